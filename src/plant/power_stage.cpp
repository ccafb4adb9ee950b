#include "plant/power_stage.hpp"

#include <algorithm>
#include <cmath>

#include "plant/step.hpp"

namespace servodrome::plant {

namespace {

// Below this share of the range, the current is too small to recharge the output of a half bridge within the dead time.
constexpr double soft_share = 0.01;

}  // namespace

PowerStage::PowerStage(const Stage& stage, int phases, double range_a)
    : ideal_(stage.ideal),
      two_phases_(phases == 2),
      delay_(static_cast<std::size_t>(stage.delay_ticks)),
      dead_share_(stage.dead_time_us / tick_us * (1.0 - stage.dead_time_compensation)),
      drop_v_(stage.switch_drop_v),
      modulation_limit_(stage.modulation_limit),
      per_soft_current_(1.0 / (soft_share * range_a)) {}

drive::Actuation PowerStage::apply(const drive::Actuation& commanded, const std::array<double, 3>& current_a,
                                   double link_v) {
  if (!modulates(commanded)) {
    pause();
    return commanded;
  }
  // Member by member: the phase voltages were written one by one just now. A load of several of them at once would get
  // no store forwarding and would have to wait until they are in the cache.
  drive::Actuation acting{.pwm_enabled = commanded.pwm_enabled,
                          .short_circuit = commanded.short_circuit,
                          .brake_released = commanded.brake_released,
                          .dc_link_connected = commanded.dc_link_connected,
                          .chopper_on = commanded.chopper_on,
                          .outputs = commanded.outputs};
  newest_ = (newest_ + 1) % waiting_.size();
  waiting_[newest_] = commanded.phase_voltage_v;
  std::array<double, 3> volts;
  const std::array<float, 3>& due = waiting_[(newest_ + waiting_.size() - delay_) % waiting_.size()];
  for (std::size_t phase = 0; phase < 3; ++phase) {
    volts[phase] = std::isfinite(due[phase]) ? static_cast<double>(due[phase]) : 0.0;
  }

  const double most = modulation_limit_ * link_v;
  // A winding in quadrature lies between two half bridges; a winding of a star is on one.
  const double bridges = two_phases_ ? 2.0 : 1.0;
  const std::size_t phases = two_phases_ ? 2 : 3;
  if (two_phases_) {
    for (double& voltage : volts) voltage = std::clamp(voltage, -most, most);
  } else {
    const double high = std::max(volts[0], std::max(volts[1], volts[2]));
    const double low = std::min(volts[0], std::min(volts[1], volts[2]));
    if (high - low > most) {
      for (double& voltage : volts) voltage *= most / (high - low);
    }
  }
  const double lost_v = bridges * (dead_share_ * link_v + drop_v_);
  double loss_a = 0.0;
  for (std::size_t phase = 0; phase < phases; ++phase) {
    const double current = current_a[phase];
    const double way = std::max(-1.0, std::min(current * per_soft_current_, 1.0));
    acting.phase_voltage_v[phase] = static_cast<float>(volts[phase] - way * lost_v);
    loss_a += current * way;
  }
  loss_w_ = bridges * drop_v_ * loss_a;
  return acting;
}

}  // namespace servodrome::plant
