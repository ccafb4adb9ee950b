#pragma once

#include <numbers>

#include "plant/parameters.hpp"
#include "products/model.hpp"

namespace servodrome::line {

// Gives the plant the motor, encoder, supply and heat data of a model, and a load with the inertia of its rotor.
inline void fit_model(const products::Model& model, plant::Parameters& parameters) {
  const drive::MotorData& data = model.motor;
  plant::Motor& motor = parameters.motor;
  motor.rated_torque_nm = static_cast<double>(data.rated_torque_nm);
  const double peak_current_a = static_cast<double>(data.peak_current_a);
  motor.rated_current_a = static_cast<double>(data.rated_current_a) / std::numbers::sqrt2;
  motor.rated_speed_rpm = static_cast<double>(data.rated_speed_rpm);
  motor.phases = data.phases;
  motor.pole_pairs = data.pole_pairs;
  motor.resistance_ohm = static_cast<double>(data.resistance_ohm);
  motor.direct_inductance_h = static_cast<double>(data.inductance_d_h);
  motor.quadrature_inductance_h = static_cast<double>(data.inductance_q_h);
  motor.torque_constant_nm_per_a = static_cast<double>(data.torque_constant_nm_per_a) * std::numbers::sqrt2;
  motor.rotor_inertia_kgm2 = static_cast<double>(data.inertia_kgm2);
  motor.cogging_torque_nm = static_cast<double>(model.cogging_torque_nm);
  motor.cogging_periods_per_revolution = model.cogging_periods_per_revolution;
  parameters.load.inertia_kgm2 = static_cast<double>(data.inertia_kgm2);
  parameters.encoder.counts_per_revolution = static_cast<std::int32_t>(data.counts_per_revolution);
  parameters.supply.volts = static_cast<double>(model.supply_v);
  parameters.supply.source_resistance_ohm = static_cast<double>(model.source_resistance_ohm);
  parameters.supply.capacitance_f = static_cast<double>(model.dc_link_f);
  parameters.supply.standby_w = static_cast<double>(model.standby_w);
  parameters.supply.overcurrent_a = 1.5 * peak_current_a;
  parameters.supply.bus_overcurrent_a = 1.5 * peak_current_a;
  parameters.thermal.winding_to_case_k_per_w = static_cast<double>(model.winding_to_case_k_per_w);
  parameters.thermal.case_to_ambient_k_per_w = static_cast<double>(model.case_to_ambient_k_per_w);
  parameters.thermal.stage_resistance_ohm = static_cast<double>(model.stage_resistance_ohm);
  // All models have a supply of at most 72 V, for which power stages are built of MOSFETs.
  parameters.stage.switch_drop_v = 0.0;
  parameters.stage.dead_time_us = 0.5;
}

}  // namespace servodrome::line
