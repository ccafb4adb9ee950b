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

// Follows targets that are due one period 60C2h apart. It interpolates between them on a time base of its own, not on
// the moments they arrive, and lets that time base be pulled along by them: a target may come up to a cycle early or
// late (jitter of bus and master, or a period that is no multiple of the cycle) without a trace in the velocity. Where
// the moment is known to a part of a cycle, as that of a SYNC is, the time base locks to it.
//
// One target that does not come is bridged: the axis runs on for one period more. If the next one does not come either,
// the stream has ended, and the axis rests at the last target.
class SetPointFollower {
 public:
  // Forgets the targets; the axis comes to rest from whatever it does.
  void stop() { following_ = false, demand_.stop(); }
  // A limit in this direction, -1 or +1, ended the motion: see LineDemand::hold.
  void hold(int direction) { following_ = false, demand_.hold(direction); }
  // As stop(), for a stop that is no command: a limit goes on to hold the axis.
  void pause() { following_ = false, demand_.restart(); }
  bool on_line() const { return demand_.on_line(); }
  bool following() const { return following_; }
  // At the last target, with none expected this instant.
  bool arrived() const { return line_.arrived() && (!streams_ || line_.rate() == 0.0); }

  // A new target in user units, to be reached one period after the one before.
  void follow(Axis& axis, std::int64_t user);
  // The same, with the SYNC that brought it `age` cycles ago, 0 to 1.
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
  double due_ = 0.0;  // cycles until the line's target is due; below 0: since
  // Cycles until the time base has the next SYNC. It lies behind the SYNCs by their greatest age, so that the line that
  // a SYNC ends is over in the cycle that takes the next target over, not before.
  double sync_due_ = 0.0;
  double slack_ = 0.0;
  double phase_ = 0.0;      // mean of due_ when the next target comes
  bool following_ = false;  // a target was given
  bool regular_ = false;    // the last target came when it was due
  bool streams_ = false;    // ... and the axis runs on while the next one may come
  bool bridging_ = false;   // ... in place of one that did not
  Counts target_ = 0;       // the last one
  double bridge_ = 0.0;     // counts per cycle: see bridging_rate
};

// How fast an axis runs on, counts per cycle, in place of the target after a line of the speed `rate`, which follows
// one of the speed `before`: as fast, less what it was slowing down, so that a motion that came to its end goes no
// further. Not for a line that is a jump: its speed has nothing to do with that of the one before.
double bridging_rate(double before, double rate);
// Ends such a bridge: the axis stands, and goes back to `target` on `line` in `cycles`, or as it catches up.
void end_bridge(Axis& axis, Line& line, LineDemand& demand, Counts target, double cycles);
// Whether a line that stands for a missing set-point leaves the software limits in the next cycle.
bool runs_beyond_limits(const Axis& axis, Line line);

// Whether 607Dh was set under way so that a target that was taken before lies outside now: the axis brakes, whatever is
// left of the way to it, and the target is followed no further. Of a product that has a fault for it, the fault is
// raised.
bool given_up_at_limits(Axis& axis, Counts target);

// What the modes of interpolation share: targets in counts, and coming to rest before the first target.
Counts resolve_cyclic_target(Axis& axis, std::int64_t user, Counts last);
void await_target(Axis& axis);

}  // namespace servodrome::drive
