#pragma once

#include <cstdint>

namespace servodrome::drive {

// The drive's data of its motor: nameplate and identified electrical data. Phase values are line to neutral, with two
// phases those of one winding; currents are peak values of the phase current.
struct MotorData {
  std::uint32_t counts_per_revolution = 131072;
  std::uint8_t phases = 3;  // 3 in star on three half bridges; 2 windings in quadrature, each on its own full bridge
  std::uint16_t pole_pairs = 5;
  float rated_current_a = 3.82F;
  float peak_current_a = 11.46F;
  float rated_torque_nm = 1.27F;
  float rated_speed_rpm = 3000.0F;
  float max_speed_rpm = 6000.0F;
  float torque_constant_nm_per_a = 0.332F;
  float resistance_ohm = 0.775F;
  float inductance_d_h = 3.355e-3F;
  float inductance_q_h = 3.355e-3F;
  float inertia_kgm2 = 0.56e-4F;          // configured inertia of rotor and load together
  float commutation_offset_turns = 0.0F;  // electrical angle at encoder single-turn position 0, within +-2^31
  std::uint32_t index_width_counts = 1;   // of the encoder's index pulse
  bool phase_order_reversed = false;      // the encoder counts down while the phases turn U, V, W
  std::uint16_t brake_release_ms = 0;     // of the motor's holding brake; both 0: it has none
  std::uint16_t brake_engage_ms = 0;
  // Delay of the power stage from the sampling of the currents to the beginning of the voltage, base ticks.
  std::uint8_t voltage_delay_ticks = 0;
};

}  // namespace servodrome::drive
