#pragma once

#include "drive/axis.hpp"
#include "drive/modes/line.hpp"

namespace servodrome::drive {

// The demand of a mode that follows a line of cyclic set-points.
//
// Normally the demand is the line. The demand catches up with a line that begins far away (the mode was entered with an
// old target, or a halt or a limit held the axis while the master continued) or that is faster than the axis may be:
// the demand is then the line plus a distance, which decreases to zero within Axis::catch_up_limits. If the line slows
// down by a steeper ramp meanwhile, the demand slows down with it and does not pass it. After a limit ended the motion,
// the demand does not move until the line is on the free side of the limit, even if the limit is no longer active.
class LineDemand {
 public:
  void stop() { *this = {}; }
  // A limit in the direction of `held`, -1 or +1, ended the motion.
  void hold(int held) { *this = {}, held_ = held; }
  // Restarts; a limit that holds the demand continues to hold it.
  void restart() { hold(held_); }
  // Returns true if the demand is on the line: the demand neither catches up with the line nor is held at a limit.
  bool on_line() const { return !catching_up_ && held_ == 0; }

  // Returns true if a step of the speed, counts/s, is a jump and not the beginning of a motion.
  static bool jumps(const Axis& axis, double step) {
    return step != 0.0 && std::abs(step) > jump_share * axis.max_velocity(false);
  }
  // Sets the beginning of `line`: at the axis or, if `target` is too far to be reached in `cycles`, at the target.
  void begin(const Axis& axis, Line& line, Counts target, double cycles);
  // One cycle: sets the generator and the demand of the loops. `step` advances the line by one cycle and returns
  // whether it moves.
  template <typename Step>
  void follow(Axis& axis, Line& line, Step&& step) {
    const double line_velocity = step() ? line.rate() / axis.cycle_s : 0.0;
    lead(axis, line, line_velocity);
  }

 private:
  static constexpr double jump_share = 0.1;  // of the greatest speed

  // Distance of the demand from the line, counts.
  static double distance_to(const Axis& axis, const Line& line);
  void lead(Axis& axis, const Line& line, double line_velocity);
  void slow_with_line(double distance, double line_velocity, double before, double deceleration);

  int held_ = 0;
  bool catching_up_ = false;
  double velocity_ = 0.0;       // of the demand while it catches up, counts/s
  double line_velocity_ = 0.0;  // in the previous cycle, counts/s
};

}  // namespace servodrome::drive
