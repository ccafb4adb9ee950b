// The parts of Plant's tick that only some machines have: cogging, loads that depend on place or speed, iron loss,
// brake.
#include <algorithm>
#include <cmath>

#include "plant/plant.hpp"
#include "plant/step.hpp"

namespace servodrome::plant {

namespace {

std::int32_t ticks_of(double ms) { return static_cast<std::int32_t>(std::lround(ms * 1.0e-3 / h)); }
}  // namespace

// Gives the shaft the load of this tick, and returns the cogging torque. Both are those of mid-tick, as far as the
// present speed predicts it.
double Plant::adapt() {
  if (shaft_.varies()) {
    shaft_.adapt(load_revolutions() + 0.5 * h * shaft_.load_speed_rad_s() / two_pi);
  }
  return cogging_torque_nm();
}

double Plant::cogging_torque_nm() const {
  const Motor& motor = parameters_.motor;
  const double counts = single_turn_ + fraction() + 0.5 * counts_per_speed_ * shaft_.speed_rad_s();
  const double turns = counts / counts_per_revolution_ * motor.cogging_periods_per_revolution;
  double torque_nm = -motor.cogging_torque_nm * static_cast<double>(drive::sin_cos(drive::phase_of(turns)).sine);
  for (std::size_t i = 0; i < motor.cogging_count; ++i) {
    const CoggingHarmonic& one = motor.cogging[i];
    const double periods = counts / counts_per_revolution_ * one.periods + one.phase_turns;
    torque_nm -= one.torque_nm * static_cast<double>(drive::sin_cos(drive::phase_of(periods)).sine);
  }
  return torque_nm;
}

double Plant::cogging_j() const {
  const Motor& motor = parameters_.motor;
  const double turns = (single_turn_ + fraction()) / counts_per_revolution_;
  const auto stored = [turns](double torque_nm, int periods, double phase) {
    return -torque_nm / periods * std::cos(two_pi * (periods * turns + phase));
  };
  double energy_j = stored(motor.cogging_torque_nm, motor.cogging_periods_per_revolution, 0.0);
  for (std::size_t i = 0; i < motor.cogging_count; ++i) {
    const CoggingHarmonic& one = motor.cogging[i];
    energy_j += stored(one.torque_nm, one.periods, one.phase_turns);
  }
  return energy_j;
}

// After the motion of a tick: the inertia at its end, and the work of iron and brake.
void Plant::book(const ShaftTick& shaft) {
  const Motor& motor = parameters_.motor;
  if (shaft_.varies()) shaft_.arrive(load_revolutions());
  const double way_rad = h * std::abs(shaft.mean);
  iron_since_j_ += (motor.iron_hysteresis_nm + motor.iron_eddy_nms * std::abs(shaft.mean)) * way_rad;
  const double work_j = brake_torque_nm() * way_rad;
  if (work_j == 0.0) return;
  brake_j_ += work_j;
  if (motor.brake_half_torque_j > 0.0) update_brake();
}

void Plant::operate_brake(bool released) {
  rests_ = false;
  const Motor& motor = parameters_.motor;
  if (released != brake_command_released_) {
    brake_command_released_ = released;
    brake_countdown_ = 1 + ticks_of(released ? motor.brake_release_ms : motor.brake_engage_ms);
  }
  if (--brake_countdown_ > 0) {
    const std::int32_t rise = ticks_of(motor.brake_rise_ms);
    if (released || brake_countdown_ > rise) return;
    brake_share_ = std::max(brake_share_, 1.0 - static_cast<double>(brake_countdown_) / (rise + 1));
  } else {
    brake_engaged_ = !released || (brake_engaged_ && injected(Injection::brake_stuck));
    brake_share_ = brake_engaged_ ? 1.0 : 0.0;
  }
  update_brake();
}

double Plant::brake_torque_nm() const {
  const Motor& motor = parameters_.motor;
  const double worn = motor.brake_half_torque_j > 0.0 ? std::exp2(-brake_j_ / motor.brake_half_torque_j) : 1.0;
  return brake_share_ * motor.brake_torque_nm * worn;
}

void Plant::update_brake() { shaft_.set_brake(brake_torque_nm()); }

}  // namespace servodrome::plant
