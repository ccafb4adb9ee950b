#include "line/config.hpp"

#include <cmath>
#include <fmt/format.h>
#include <numbers>

#include "links/number_text.hpp"

namespace servodrome::line {

drive::MotorData motor_data_of(const plant::Parameters& parameters) {
  constexpr double peak_per_rms = std::numbers::sqrt2;
  constexpr double peak_per_rated_current = 3.0;  // customary for servo motors of this class
  constexpr double top_speed_per_rated_speed = 2.0;
  const plant::Motor& motor = parameters.motor;
  drive::MotorData data;
  data.counts_per_revolution = static_cast<std::uint32_t>(parameters.encoder.counts_per_revolution);
  data.phases = static_cast<std::uint8_t>(motor.phases);
  data.pole_pairs = static_cast<std::uint16_t>(motor.pole_pairs);
  data.rated_current_a = static_cast<float>(motor.rated_current_a * peak_per_rms);
  data.peak_current_a = static_cast<float>(motor.rated_current_a * peak_per_rms * peak_per_rated_current);
  data.rated_torque_nm = static_cast<float>(motor.rated_torque_nm);
  data.rated_speed_rpm = static_cast<float>(motor.rated_speed_rpm);
  data.max_speed_rpm = static_cast<float>(motor.rated_speed_rpm * top_speed_per_rated_speed);
  data.torque_constant_nm_per_a = static_cast<float>(motor.torque_constant_nm_per_a / peak_per_rms);
  data.resistance_ohm = static_cast<float>(motor.resistance_ohm);
  data.inductance_d_h = static_cast<float>(motor.direct_inductance_h);
  data.inductance_q_h = static_cast<float>(motor.quadrature_inductance_h);
  data.inertia_kgm2 = static_cast<float>(motor.rotor_inertia_kgm2 + parameters.load.inertia_kgm2);
  data.commutation_offset_turns = static_cast<float>(parameters.encoder.commutation_offset_turns);
  if (motor.brake_torque_nm > 0.0) {
    data.brake_release_ms = static_cast<std::uint16_t>(std::ceil(motor.brake_release_ms));
    data.brake_engage_ms = static_cast<std::uint16_t>(std::ceil(motor.brake_engage_ms));
  }
  if (!parameters.stage.ideal) data.voltage_delay_ticks = static_cast<std::uint8_t>(parameters.stage.delay_ticks);
  return data;
}

std::string parse_api_address(std::string_view text, ApiSettings& api) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos || colon == 0) return fmt::format("\"{}\" is not an ADDRESS:PORT", text);
  std::string_view host = text.substr(0, colon);
  if (host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  const std::string_view digits = text.substr(colon + 1);
  const auto port = links::number_of_text<std::uint16_t>(digits);
  if (!port) return fmt::format("\"{}\" is not a port", digits);
  api.address = host;
  api.port = *port;
  return {};
}

}  // namespace servodrome::line
