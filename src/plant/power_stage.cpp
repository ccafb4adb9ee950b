#include "plant/power_stage.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::plant {

namespace {

constexpr double tick_us = drive::tick_seconds * 1.0e6;
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

drive::Actuation PowerStage::apply(const drive::Actuation& commanded, const std::array<float, 3>& current_a,
                                   double link_v) {
  drive::Actuation acting = commanded;
  loss_w_ = 0.0;
  if (!commanded.pwm_enabled || commanded.short_circuit) {  // both act at once; the PWM then restarts from zero
    waiting_ = {};
    return acting;
  }
  newest_ = (newest_ + 1) % waiting_.size();
  waiting_[newest_] = commanded.phase_voltage_v;
  const std::array<float, 3>& due = waiting_[(newest_ + waiting_.size() - delay_) % waiting_.size()];

  std::array<double, 3> volts{};
  for (std::size_t phase = 0; phase < 3; ++phase) {
    const auto wanted = static_cast<double>(due[phase]);
    volts[phase] = std::isfinite(wanted) ? wanted : 0.0;
  }
  const double most = modulation_limit_ * link_v;
  // A winding in quadrature lies between two half bridges; a winding of a star is on one.
  const double bridges = two_phases_ ? 2.0 : 1.0;
  double scale = 1.0;
  if (!two_phases_) {
    const auto [low, high] = std::minmax({volts[0], volts[1], volts[2]});
    if (high - low > most) scale = most / (high - low);
  }
  const double lost_v = bridges * (dead_share_ * link_v + drop_v_);
  for (std::size_t phase = 0; phase < (two_phases_ ? 2U : 3U); ++phase) {
    const auto current = static_cast<double>(current_a[phase]);
    const double way = std::clamp(current * per_soft_current_, -1.0, 1.0);
    volts[phase] = two_phases_ ? std::clamp(volts[phase], -most, most) : scale * volts[phase];
    acting.phase_voltage_v[phase] = static_cast<float>(volts[phase] - way * lost_v);
    loss_w_ += bridges * drop_v_ * current * way;
  }
  return acting;
}

}  // namespace servodrome::plant
