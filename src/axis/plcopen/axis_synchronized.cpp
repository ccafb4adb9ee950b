// Gear and cam: set-points of a slave derived from a master axis.
#include <algorithm>
#include <cmath>

#include "axis/plcopen/axis.hpp"

namespace servodrome::master::plcopen {

// The master's position or velocity in its units. The position does not contain the master's offset, nor the steps by
// which its origin changes: MC_SetPosition and MC_Home at the master do not move a slave.
double Axis::led_by(const Command& command, bool velocity) const {
  const Axis& master = *command.master;
  if (command.source == Source::ActualValue) {
    return velocity ? master.actual_velocity() : master.motion_.continuous_position() / master.scale_;
  }
  return (velocity ? master.motion_.set_point().velocity : master.motion_.continuous_set_point()) / master.scale_;
}

void Axis::follow_gear(Command& command) {
  const double period_s = motion_.generator().period_s();
  const double velocity = command.ratio * led_by(command, true) * scale_;
  if (is_too_fast(velocity)) return;
  MotionLimits limits = limits_of(command);
  limits.jerk = 0.0;
  if (!command.in_goal) {
    const double present = motion_.set_point().velocity;
    const double slope = std::abs(velocity) > std::abs(present) ? limits.acceleration : limits.deceleration;
    if (std::abs(velocity - present) > slope * period_s || motion_.is_changing_mode()) {
      limits.velocity = configuration_.max_velocity * std::abs(scale_);
      motion_.run_at(velocity, limits);
      return;
    }
    // The remaining velocity difference is below one cycle's acceleration, so the positions are coupled now.
    command.in_goal = true;
    master_origin_ = led_by(command, false);
    slave_origin_ = motion_.set_point().position / scale_;
  }
  const double way = command.ratio * (led_by(command, false) - master_origin_);
  motion_.follow({(slave_origin_ + way) * scale_, velocity, 0.0});
}

// Stops the slave with an error if its master demands more than the slave's greatest velocity. `velocity`: in counts/s.
bool Axis::is_too_fast(double velocity) {
  if (std::abs(velocity) <= configuration_.max_velocity * std::abs(scale_)) return false;
  enter_error_stop(ErrorId::above_limit);
  return true;
}

// Returns the master position (as led_by() returns it) that is the origin of the cam, before the offset: the origin of
// the master's own positions, or for a relative master its present position.
double Axis::cam_origin(const Command& command) const {
  const double place = led_by(command, false);
  if (!command.master_is_absolute) return place;
  const Axis& master = *command.master;
  const bool actual = command.source == Source::ActualValue;
  return place - (actual ? master.actual_position() : master.commanded_position());
}

// The master's position on the cam.
double Axis::on_cam(const Command& command, double master_origin) const {
  return (led_by(command, false) - master_origin) * command.master_scaling + command.master_offset;
}

CamTable::Value Axis::cam_value(const Command& command, double master_origin) const {
  CamTable::Value value = command.cam->at(on_cam(command, master_origin));
  value.slave = value.slave * command.slave_scaling + command.slave_offset;
  value.slope *= command.slave_scaling * command.master_scaling;
  return value;
}

void Axis::follow_cam(Command& command) {
  const CamTable& cam = *command.cam;
  const CamTable::Value value = cam_value(command, master_origin_);
  const double velocity = value.slope * led_by(command, true) * scale_;
  if (is_too_fast(velocity)) return;
  motion_.follow({(slave_origin_ + value.slave) * scale_, velocity, 0.0});
  // EndOfProfile is a pulse of one cycle, whenever the master passes an end of the cam.
  const double at = on_cam(command, master_origin_);
  const double turn = cam.periodic()    ? std::floor((at - cam.begin()) / (cam.end() - cam.begin()))
                      : at >= cam.end() ? 1.0
                                        : 0.0;
  command.end_of_profile = command.in_goal && turn != cam_turn_;
  cam_turn_ = turn;
  command.in_goal = true;
}

}  // namespace servodrome::master::plcopen
