#include "products/ismk/gains.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "products/ismk/units.hpp"

namespace servodrome::products::ismk {

namespace {

constexpr double pi = std::numbers::pi;
constexpr double kvp_scale = 262144.0;  // 2^18
constexpr double tick_s = 62.5e-6;      // Ts of ch. 6.2.1

double counts_per_rad(const drive::MotorData& motor) { return motor.counts_per_revolution / (2.0 * pi); }

// DEC of current for 1 A of amplitude.
double dec_per_ampere(const drive::MotorData& motor) {
  return peak_current_dec / static_cast<double>(motor.peak_current_a);
}

// kvp for 1 Hz. J in kg m^2 x 1e6, Kt in Nm/Arms x 100, Imax in 0.1 Ap.
double kvp_per_hz(double inertia_kgm2, const drive::MotorData& motor) {
  const double kt = 100.0 * std::numbers::sqrt2 * static_cast<double>(motor.torque_constant_nm_per_a);
  const double imax = 10.0 * static_cast<double>(motor.peak_current_a);
  return 1.853358080e5 * (inertia_kgm2 * 1e6) * pi * pi / (imax * kt * motor.counts_per_revolution);
}

}  // namespace

const SpeedMode* find_speed_mode(std::uint8_t object_value) {
  const auto code = static_cast<std::uint8_t>(object_value & ~fast_sampling);
  const auto* const found =
      std::find_if(speed_modes.begin(), speed_modes.end(), [code](const SpeedMode& mode) { return mode.code == code; });
  return found != speed_modes.end() ? found : nullptr;
}

double output_filter_hz(std::uint16_t n) { return n > 1 ? 1.0 / (2.0 * pi * tick_s * n) : 0.0; }

double kvp_of_bandwidth(double bandwidth_hz, double inertia_kgm2, const drive::MotorData& motor) {
  return bandwidth_hz * kvp_per_hz(inertia_kgm2, motor);
}

double bandwidth_of_kvp(double kvp, double inertia_kgm2, const drive::MotorData& motor) {
  return kvp / kvp_per_hz(inertia_kgm2, motor);
}

double velocity_kp_unit(const drive::MotorData& motor) {
  return velocity_dec_per_inc_s * counts_per_rad(motor) / kvp_scale / dec_per_ampere(motor);
}

double full_acceleration_feed_forward(double inertia_kgm2, const drive::MotorData& motor) {
  const double current_dec = inertia_kgm2 / static_cast<double>(motor.torque_constant_nm_per_a) * dec_per_ampere(motor);
  return acceleration_dec_per_inc_s2 * counts_per_rad(motor) / current_dec;
}

std::int16_t acceleration_feed_forward_of(double permille, double inertia_kgm2, const drive::MotorData& motor) {
  if (permille <= 0.0) return acceleration_feed_forward_off;
  const double full = full_acceleration_feed_forward(inertia_kgm2, motor);
  return static_cast<std::int16_t>(
      std::lround(std::clamp(full * 1000.0 / permille, 1.0, acceleration_feed_forward_off - 1.0)));
}

double acceleration_permille_of(std::int16_t k_acc_ff, double inertia_kgm2, const drive::MotorData& motor) {
  if (k_acc_ff <= 0 || k_acc_ff == acceleration_feed_forward_off) return 0.0;
  const double load = easy_kload(full_acceleration_feed_forward(inertia_kgm2, motor));
  return 1000.0 * acceleration_percent_constant / k_acc_ff / load;
}

drive::Gains loop_gains(const Gains& gains, const Tuning& tuning, const drive::MotorData& motor) {
  const std::size_t set = gains.pointer & 3U;
  const double kp_unit = velocity_kp_unit(motor);
  const double kvi = gains.velocity_ki[set] + (set == 0 ? gains.velocity_ki_32 / 32.0 : 0.0);
  const auto inertia = static_cast<double>(motor.inertia_kgm2);
  drive::Gains loops;
  loops.current_bandwidth_hz = current_bandwidth_hz;
  loops.velocity_kp = static_cast<float>(gains.velocity_kp[set] * kp_unit);
  loops.velocity_ki = static_cast<float>(kvi * kp_unit * velocity_ki_rate_hz);
  loops.velocity_integral_limit_a = static_cast<float>(gains.velocity_integral_limit / dec_per_ampere(motor));
  loops.position_kp = static_cast<float>(2.0 * pi * gains.position_kp[set] / kpp_per_hz);
  loops.velocity_feed_forward = static_cast<float>(gains.velocity_feed_forward / velocity_feed_forward_full);
  loops.acceleration_feed_forward =
      static_cast<float>(acceleration_permille_of(gains.acceleration_feed_forward, inertia, motor) / 1000.0);
  if (const SpeedMode* mode = find_speed_mode(gains.feedback_mode)) {
    const auto corner_hz = static_cast<float>(feedback_filter_hz(gains.feedback_filter));
    loops.velocity_feedback = mode->feedback;
    loops.velocity_filter_hz = mode->feedback_filtered ? corner_hz : 0.0F;
    loops.velocity_command_filter_hz = mode->command_filtered ? corner_hz : 0.0F;
  }
  loops.torque_filter_hz = static_cast<float>(output_filter_hz(gains.output_filter));
  const std::size_t notches = notches_of_code[tuning.notch_control & 3U];
  for (std::size_t i = 0; i < notches; ++i) {
    const auto hz = static_cast<float>(i == 0 ? tuning.notch_frequency_hz : gains.notch_frequency_hz[i - 1]);
    if (hz <= highest_notch_hz) loops.notches[i] = {hz, notch_relative_width * hz, notch_depth};
  }
  return loops;
}

}  // namespace servodrome::products::ismk
