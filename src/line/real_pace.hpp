#pragma once

#include <chrono>

#include "links/time.hpp"

namespace servodrome::line {

using links::Time;

// How a line's time follows CLOCK_MONOTONIC. A line that fell behind by more than `most_behind`, because its process
// had no processor, gives up what is missing: it is late from then on, but a machine that is too slow runs a slow line
// instead of one that never comes up again. What came meanwhile (frames in a socket) is dated to the time that is left;
// if the line caught up after it instead, a drive would see its master silent for as long as the pause had been.
class RealPace {
 public:
  using Moment = std::chrono::steady_clock::time_point;

  // Well below what a drive's watchdog waits for (EtherCAT's sync managers: 100 ms), and well above the pauses that an
  // idle machine makes.
  static constexpr Time most_behind = std::chrono::milliseconds(20);
  // Time is given up in whole steps, so that what a master sends each millisecond, or each two or four, keeps its phase
  // to what the line does by itself (SYNC0).
  static constexpr Time step = std::chrono::milliseconds(4);

  // From `present` on, when the line is at `line_now`.
  void begin(Moment present, Time line_now) { start_ = present - line_now; }

  // The time that the line ought to have, never more than `most_behind` and the nap above `line_now`, which it has.
  // `nap`: how long it sleeps of its own will, which is no pause.
  Time due(Moment present, Time line_now, Time nap = {});
  // What the last due() gave up.
  Time given_up() const { return given_up_; }

  // When the line is to be at `time`.
  Moment moment_of(Time time) const { return start_ + time; }

 private:
  Moment start_{};  // of the line's time 0, moved on by what was given up
  Time given_up_{};
};

}  // namespace servodrome::line
