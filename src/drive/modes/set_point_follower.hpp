#pragma once

#include "drive/axis.hpp"
#include "drive/modes/line.hpp"
#include "drive/modes/line_demand.hpp"

namespace servodrome::drive {

// The interpolation time period, 60C2h or Configuration::set_point_period_s, in position-loop cycles: a real number, at
// least 1.
class InterpolationPeriod {
 public:
  double cycles(const Axis& axis) {
    const Objects& objects = axis.objects;
    if (objects.interpolation_time_period_value != value_ || objects.interpolation_time_index != index_ ||
        axis.configuration.set_point_period_s != set_s_) {
      update(axis);
    }
    return cycles_;
  }

 private:
  void update(const Axis& axis);

  std::uint8_t value_ = 0;
  std::int8_t index_ = 0;
  double set_s_ = 0.0;
  double cycles_ = 1.0;
};

// Follows targets with the period 60C2h. It interpolates on its own time base, not at the times of arrival, and the
// time base follows the targets slowly: a target may come up to one cycle early or late (jitter of bus and master, or a
// period that is no multiple of the cycle) without an effect on the velocity. With SYNC, whose time is known to a
// fraction of a cycle, the time base locks to it.
//
// One missing target is bridged: the axis runs on for one more period. If the next one is missing too, the stream has
// ended, and the axis rests at the last target.
class SetPointFollower {
 public:
  // Discards the targets; the axis comes to rest.
  void stop() { following_ = false, demand_.stop(); }
  // A limit in this direction, -1 or +1, ended the motion: see LineDemand::hold.
  void hold(int direction) { following_ = false, demand_.hold(direction); }
  // Like stop(), but for a stop that is not a command: a limit continues to hold the axis.
  void pause() { following_ = false, demand_.restart(); }
  bool on_line() const { return demand_.on_line(); }
  bool following() const { return following_; }
  // The axis is at the last target, and none is due.
  bool arrived() const { return line_.arrived() && (!streams_ || line_.rate() == 0.0); }

  // A new target in user units, to be reached one period after the previous one.
  void follow(Axis& axis, std::int64_t user);
  // The same for a target whose SYNC came `age` cycles ago, 0 to 1.
  void follow_sync(Axis& axis, std::int64_t user, double age);
  // One position-loop cycle.
  void step(Axis& axis);

  double period_cycles(const Axis& axis) { return period_.cycles(axis); }

 private:
  void keep_to_limits(Axis& axis);
  bool begin(Axis& axis, std::int64_t user, double cycles);
  void lead_to(Axis& axis, std::int64_t user);
  void await_late_target(const Axis& axis);

  Line line_{};
  LineDemand demand_{};
  InterpolationPeriod period_{};
  double due_ = 0.0;  // cycles until the line's target is due; negative: since then
  // Cycles until the next SYNC in the time base. The time base is later than the SYNCs by their greatest age, so that a
  // line ends in the cycle that adopts the next target, not before.
  double sync_due_ = 0.0;
  double slack_ = 0.0;
  double phase_ = 0.0;      // mean of due_ at the arrival of the next target
  bool following_ = false;  // a target was given
  bool regular_ = false;    // the last target came when it was due
  bool streams_ = false;    // ... and the axis runs on while the next target may still come
  bool bridging_ = false;   // ... in place of a missing target
  Counts target_ = 0;       // the last target
  double bridge_ = 0.0;     // counts per cycle: see bridging_rate
};

// The speed, counts per cycle, with which an axis runs on if the target after a line of speed `rate` is missing;
// `before` is the speed of the line before that. It is `rate` less the deceleration from `before`, so that a motion
// that was about to end goes no further. Must not be used for a jump, whose speed differs widely from that of the
// previous line.
double bridging_rate(double before, double rate);
// Ends the motion that bridges a missing target: the axis stops and returns to `target`, on `line` in `cycles` or, if
// that is too far, by catching up.
void end_bridge(Axis& axis, Line& line, LineDemand& demand, Counts target, double cycles);
// Returns true if a line that replaces a missing set-point leaves the software limits in the next cycle.
bool runs_beyond_limits(const Axis& axis, Line line);

// Returns true if 607Dh was changed in motion so that it excludes an accepted target. The axis then brakes at once,
// and the target is dropped. Raises the fault for it, if the product has one.
bool given_up_at_limits(Axis& axis, Counts target);

// Shared by the interpolating modes: targets in counts, and coming to rest before the first target.
Counts resolve_cyclic_target(Axis& axis, std::int64_t user, Counts last);
void await_target(Axis& axis);

}  // namespace servodrome::drive
