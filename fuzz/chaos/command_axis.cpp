#include "masters.hpp"

namespace servodrome::chaos {

master::MotionLimits limits_of(const Subject& subject, double velocity_rps, double acceleration_rps2) {
  const double acceleration = subject.variant->position(acceleration_rps2);
  return {subject.variant->position(velocity_rps), acceleration, acceleration, 0.0};
}

bool command_axis(Subject& subject, master::MotionAxis& axis, Random& random) {
  constexpr int switches_off_percent = 4;
  // A fault from before is not known yet. An axis with a fault that is switched on ends the session, and so would the
  // next session.
  if (!axis.has_read_inputs()) return false;
  if (axis.fault() != master::AxisFault::none) {
    axis.reset_fault();
    return false;
  }
  if (!axis.is_switched_on()) axis.switch_on(true);
  if (!axis.is_enabled() || !axis.generator().done()) return false;
  if (random.chance(switches_off_percent)) {
    axis.switch_on(false);
    return false;
  }
  const double speed_rps = 1.0 + random.unit() * 0.4 * subject.variant->max_speed_rpm / 60.0;
  const double target = axis.set_point().position + subject.variant->position(8.0 * random.unit() - 4.0);
  if (!axis.move_to(target, 0.0, limits_of(subject, speed_rps, 20.0 + 180.0 * random.unit()))) return false;
  ++subject.record.moves;
  return true;
}

}  // namespace servodrome::chaos
