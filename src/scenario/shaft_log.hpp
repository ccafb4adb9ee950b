#pragma once

#include <vector>

#include "line/line.hpp"

namespace servodrome::scenario {

// Records the shafts and the states of all axes of a line once a millisecond, for pictures. Recording ends after
// `most`.
class ShaftLog final : public line::Follower {
 public:
  struct Sample {
    double revolutions = 0;
    double velocity_rpm = 0;
    int state = -1;  // drive::PowerState; -1: no power
  };
  static constexpr links::Time period = std::chrono::milliseconds(1);

  ShaftLog(line::Line& line, links::Time most);
  ~ShaftLog() { line_.remove_follower(*this); }
  ShaftLog(const ShaftLog&) = delete;
  ShaftLog& operator=(const ShaftLog&) = delete;

  links::Time next_deadline() const override { return next_; }
  void reached(links::Time now) override;

  // A row each millisecond with a sample for each axis.
  const std::vector<links::Time>& times() const { return times_; }
  const Sample& sample(std::size_t row, std::size_t axis) const { return samples_[row * line_.axes().size() + axis]; }

 private:
  line::Line& line_;
  links::Time end_;
  links::Time next_;
  std::vector<links::Time> times_;
  std::vector<Sample> samples_;
};

}  // namespace servodrome::scenario
