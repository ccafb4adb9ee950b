#pragma once

#include <chrono>

#include "links/time.hpp"

namespace servodrome::line {

using links::Time;

// Determines how a line's time follows CLOCK_MONOTONIC. If its process got no processor and the line fell behind by
// more than `most_behind`, the line drops the lost time and is late from then on. A machine that is too slow thus runs
// a slow line, instead of one that never catches up. Frames that waited in a socket during the pause get the
// line's time after the drop. If the line ran through the whole pause first, without these frames, a drive would see
// its master silent for as long as the pause.
class RealPace {
 public:
  using Moment = std::chrono::steady_clock::time_point;

  // Well below the timeout of a drive's watchdog (EtherCAT's sync managers: 100 ms), and well above the pauses that
  // occur on an idle machine.
  static constexpr Time most_behind = std::chrono::milliseconds(20);
  // Time is dropped in multiples of this step. Frames that a master sends every 1, 2 or 4 ms thus keep their phase to
  // SYNC0.
  static constexpr Time step = std::chrono::milliseconds(4);

  // Starts: at the moment `present` the line's time is `line_now`.
  void begin(Moment present, Time line_now) { start_ = present - line_now; }

  // Returns the time that the line should have at `present`. It is at least `line_now`, the time that the line has, and
  // at most `most_behind` + `nap` later; the difference to real time is dropped. `nap` is how long the line sleeps
  // intentionally, which does not count as a pause.
  Time due(Moment present, Time line_now, Time nap = {});
  // The time that the last due() dropped, 0 if none.
  Time given_up() const { return given_up_; }

  // The moment at which the line should be at `time`.
  Moment moment_of(Time time) const { return start_ + time; }

 private:
  Moment start_{};  // of the line's time 0, plus all dropped time
  Time given_up_{};
};

}  // namespace servodrome::line
