#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drive/hardware.hpp"
#include "plant/parameters.hpp"

// Switches and index along the travel, and the capture of their transitions.
//
// An edge carries the first position, in the direction of motion, at which the new level holds: a switch from 100 to
// 200 rises at 100 going up and at 200 coming down, and falls (without hysteresis) at 201 and at 99. `quiet` caches the
// interval around the position in which no transition can occur, so that a tick within it costs one comparison.
namespace servodrome::plant {

class Travel {
 public:
  Travel(const Encoder& encoder, const std::array<Switch, most_switches>& switches, std::size_t count);

  // True if nothing changes on the way to `position`: no transition and no hard stop (see set_stops).
  bool quiet(std::int64_t position) const {
    return static_cast<std::uint64_t>(position) - static_cast<std::uint64_t>(quiet_from_) <= quiet_span_;
  }

  bool beyond_stop(std::int64_t position) const {
    return (high_stop_ != no_high_limit && position >= high_stop_) ||
           (low_stop_ != no_low_limit && position < low_stop_);
  }

  // Sets levels and `quiet` interval for an axis placed at `position`, without edges.
  void place(std::int64_t position);

  // Moves from `from` to `to`; appends the edges on the way, in order, while `feedback` has room for them.
  void move(std::int64_t from, std::int64_t to, drive::Feedback& feedback);

  // The load may touch a stop outside [low, high]: `quiet` is false there.
  void set_stops(std::int64_t low, std::int64_t high);

  // Forces a wire, or releases it; returns true if its level changed.
  bool force(int wire, bool level);
  bool release(int wire);
  bool level(int wire) const { return ((inputs() >> wire) & 1u) != 0; }

  std::uint32_t inputs() const { return (levels_ & ~forced_) | (forced_levels_ & forced_); }
  bool index() const { return index_; }

 private:
  struct Fitted {
    std::int64_t from;
    std::int64_t to;
    std::int64_t release_from;  // from - hysteresis
    std::int64_t release_to;
    std::uint8_t wire;
    bool normally_closed;
    bool actuated;
  };
  struct Event {
    std::int64_t position;
    std::size_t source;  // number of the switch, or index_source
  };
  static constexpr std::size_t index_source = most_switches;

  // Finds the first event at or after `cursor` in a direction, up to `limit`; returns false if there is none.
  bool next(int direction, std::int64_t cursor, std::int64_t limit, Event& event) const;
  void apply(const Event& event, drive::Feedback& feedback);
  void update_level(const Fitted& fitted);
  void update_quiet(std::int64_t position);

  std::int64_t quiet_from_ = 0;
  std::uint64_t quiet_span_ = 0;
  std::uint32_t levels_ = 0;
  std::uint32_t forced_ = 0;
  std::uint32_t forced_levels_ = 0;
  bool index_ = false;

  std::int64_t low_stop_ = no_low_limit;
  std::int64_t high_stop_ = no_high_limit;
  std::int64_t counts_per_revolution_;
  std::int64_t index_position_;
  std::int64_t index_width_;
  std::array<Fitted, most_switches> fitted_{};
  std::size_t count_;
};

}  // namespace servodrome::plant
