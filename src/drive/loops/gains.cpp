#include "drive/loops/gains.hpp"

#include <algorithm>
#include <cmath>

#include "drive/loops/constants.hpp"

namespace servodrome::drive {
namespace {

constexpr float degree = pi / 180.0F;

// Corners of the filters, in multiples of the crossover: far enough to cost little phase.
constexpr float velocity_filter_ratio = 12.0F;
constexpr float torque_filter_ratio = 16.0F;
// Phase margin, and limits of the integral's phase lag at the crossover.
constexpr float phase_margin = 55.0F * degree;
constexpr float least_integral_lag = 10.0F * degree;
constexpr float most_integral_lag = 14.0F * degree;
// Greatest torque for one count through velocity_kp, fraction of rated.
constexpr float torque_per_count = 0.1F;

}  // namespace

Gains default_gains(const MotorData& motor, Rates rates, const Bandwidths& bandwidths) {
  const float count_rad = 2.0F * pi / static_cast<float>(motor.counts_per_revolution);

  // The delay of the current loop as a first-order system. The delays of the difference and the hold, half a velocity
  // period each, cancel against the two filters, which are exact for held inputs and so faster than their continuous
  // prototypes.
  const float current_pole = std::exp(-2.0F * pi * bandwidths.current_hz * tick_s);
  const float delay_s = tick_s * (1.0F / (1.0F - current_pole) - 0.5F + static_cast<float>(motor.voltage_delay_ticks));
  const float filter_lag = std::atan(1.0F / velocity_filter_ratio) + std::atan(1.0F / torque_filter_ratio);
  const float lag_available = pi / 2.0F - phase_margin - filter_lag;

  const float by_delay = (lag_available - least_integral_lag) / delay_s;
  const float by_encoder =
      std::sqrt(torque_per_count * motor.rated_torque_nm / (velocity_filter_ratio * motor.inertia_kgm2 * count_rad));
  const float velocity_rate_hz = 1.0F / (static_cast<float>(rates.velocity_loop_ticks) * tick_s);
  const float by_rate = 2.0F * pi * 0.5F * velocity_rate_hz / torque_filter_ratio;
  const float crossover = std::min({2.0F * pi * bandwidths.velocity_hz, by_delay, by_encoder, by_rate});
  const float integral_ratio = std::tan(std::min(lag_available - crossover * delay_s, most_integral_lag));

  // The magnitude at the crossover is that of the integrator 1 / (J s) times PI and filters.
  const auto square = [](float x) { return x * x; };
  const float filters = std::sqrt((1.0F + square(1.0F / velocity_filter_ratio)) *
                                  (1.0F + square(1.0F / torque_filter_ratio)) / (1.0F + square(integral_ratio)));
  Gains gains;
  gains.current_bandwidth_hz = bandwidths.current_hz;
  gains.velocity_kp = crossover * motor.inertia_kgm2 / motor.torque_constant_nm_per_a * filters;
  gains.velocity_ki = gains.velocity_kp * crossover * integral_ratio;
  gains.position_kp = std::min(bandwidths.position_kp, crossover / 5.0F);
  gains.velocity_filter_hz = velocity_filter_ratio * crossover / (2.0F * pi);
  gains.torque_filter_hz = torque_filter_ratio * crossover / (2.0F * pi);
  return gains;
}

}  // namespace servodrome::drive
