#pragma once

#include "drive/rounding.hpp"
#include "drive/units.hpp"

namespace servodrome::drive {

// A straight line between two cyclic set-points, one step per position-loop cycle. Its end is an integer and its
// duration a real number of cycles, so that the timing is exact even if the set-point period is no multiple of the
// cycle. The axis gets the points of the line at its cycles.
class Line {
 public:
  void stand(Counts position, double fraction = 0.0) {
    *this = {};
    from_ = to_ = position;
    place_ = start_ = fraction;
  }
  // From the present position to `to`, in `cycles` >= 1 cycles from now.
  void go(Counts to, double cycles) {
    const Counts whole = floor_to_integer(place_);
    from_ += whole;
    start_ = place_ -= static_cast<double>(whole);
    begin(to, cycles, 0.0);
  }
  // From the end of this line, at the time of that end, to `to`.
  void chain(Counts to, double cycles) {
    place_ -= static_cast<double>(to_ - from_);
    from_ = to_;
    start_ = 0.0;
    begin(to, cycles, elapsed_ - duration_);
  }
  // From the present position at another speed, without an end: call step() with `run_on`.
  void run_at(double counts_per_cycle) {
    go(now(), 1.0);
    rate_ = counts_per_cycle;
    duration_ = 0.0;
  }
  // Advances one cycle. At its end the line waits or, with `run_on`, continues straight ahead.
  void step(bool run_on = false) {
    elapsed_ += 1.0;
    if (elapsed_ >= duration_ && !run_on) elapsed_ = duration_;
    place_ = elapsed_ == duration_ ? static_cast<double>(to_ - from_) : start_ + rate_ * elapsed_;
  }

  bool arrived() const { return elapsed_ >= duration_; }
  bool ends_in_next_cycle() const { return elapsed_ + 1.0 > duration_; }
  double remaining() const { return duration_ - elapsed_; }  // cycles
  Counts target() const { return to_; }
  Counts now() const { return from_ + floor_to_integer(place_); }
  double fraction() const { return fraction_of(place_); }
  double rate() const { return rate_; }  // counts per cycle

 private:
  void begin(Counts to, double cycles, double elapsed) {
    to_ = to;
    duration_ = cycles;
    elapsed_ = elapsed;
    rate_ = (static_cast<double>(to_ - from_) - start_) / duration_;
  }

  Counts from_ = 0;
  Counts to_ = 0;
  double start_ = 0.0;  // relative to from_
  double place_ = 0.0;  // relative to from_
  double rate_ = 0.0;
  double elapsed_ = 0.0;  // cycles
  double duration_ = 0.0;
};

}  // namespace servodrome::drive
