#pragma once

#include "drive/rounding.hpp"
#include "drive/units.hpp"

namespace servodrome::drive {

// A straight line between two cyclic set-points, one step per position-loop cycle. Its end is an integer and its
// duration a real number of cycles, so that set-points whose period is no multiple of the cycle lie where they belong
// in time: of such a line the axis sees the points that its cycles fall on.
class Line {
 public:
  void stand(Counts position, double fraction = 0.0) {
    *this = {};
    from_ = to_ = position;
    place_ = start_ = fraction;
  }
  // Leads from the present place to `to`, to be there `cycles` >= 1 cycles from now.
  void go(Counts to, double cycles) {
    const Counts whole = floor_to_integer(place_);
    from_ += whole;
    start_ = place_ -= static_cast<double>(whole);
    begin(to, cycles, 0.0);
  }
  // Leads from the end of this line, at the time of that end, to `to`.
  void chain(Counts to, double cycles) {
    place_ -= static_cast<double>(to_ - from_);
    from_ = to_;
    start_ = 0.0;
    begin(to, cycles, elapsed_ - duration_);
  }
  // From the present place on at another speed, without an end: steps `run_on`.
  void run_at(double counts_per_cycle) {
    go(now(), 1.0);
    rate_ = counts_per_cycle;
    duration_ = 0.0;
  }
  // One cycle on. At its end the line waits, or, if it is to `run_on`, goes on straight ahead.
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
  double place_ = 0.0;  // likewise
  double rate_ = 0.0;
  double elapsed_ = 0.0;  // cycles
  double duration_ = 0.0;
};

}  // namespace servodrome::drive
