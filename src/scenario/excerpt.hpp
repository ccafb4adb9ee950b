#pragma once

#include <deque>
#include <string>
#include <vector>

#include "links/time.hpp"

namespace servodrome::scenario {

// A line of decoded traffic: a frame, an act of a rule, or the reason why this part of the traffic is shown.
struct TrafficLine {
  enum class Kind : std::uint8_t { frame, error, act, moment, gap };
  links::Time at{};
  std::string from;  // sender of the frame
  std::string raw;   // its bytes
  std::string text;
  Kind kind = Kind::frame;
};

std::string_view word_of(TrafficLine::Kind kind);

// A point in time around which the traffic is worth reading.
struct Moment {
  links::Time at{};
  std::string text;
};

// The traffic of one bus around the moments of a trial.
struct BusExcerpt {
  std::string bus;
  std::vector<TrafficLine> lines;
};

// Picks the lines around moments from a long sequence. Keeps only the lines that it may still need.
class Excerpt {
 public:
  static constexpr std::size_t lines_before = 40;
  static constexpr std::size_t lines_behind = 20;

  // `moments` in the order of time.
  explicit Excerpt(std::vector<Moment> moments) : moments_(std::move(moments)) {}

  // The caller must add lines in the order of time.
  void add(TrafficLine line);
  // Call this after the last line. Moments after the last line get the lines before them.
  std::vector<TrafficLine> finish();

 private:
  void pass_moment();

  std::vector<Moment> moments_;
  std::size_t next_ = 0;    // of the moments
  std::size_t behind_ = 0;  // number of lines that are still picked
  std::size_t left_out_ = 0;
  std::deque<TrafficLine> before_;
  std::vector<TrafficLine> picked_;
};

}  // namespace servodrome::scenario
