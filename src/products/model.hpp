#pragma once

#include <span>
#include <string_view>

#include "drive/loops/motor_data.hpp"

// The sizes a product is sold in. A product with one size has none of these.
namespace servodrome::products {

// A drive with its own motor: nameplate, and what a simulation has to know beyond it. SI units, phase values line to
// neutral (of a stepper, of one winding), currents of `motor` as peak values of the phase current.
struct Model {
  std::string_view name;           // as a line file calls it
  std::string_view title;          // one line for people
  drive::MotorData motor{};        // inertia_kgm2: of the rotor alone
  float cogging_torque_nm = 0.0F;  // amplitude
  int cogging_periods_per_revolution = 30;
  float brake_torque_nm = 0.0F;
  float supply_v = 48.0F;
  float dc_link_f = 1e-3F;
  float source_resistance_ohm = 0.05F;
  float standby_w = 0.0F;  // the electronics, where the DC link feeds them
  float winding_to_case_k_per_w = 1.0F;
  float case_to_ambient_k_per_w = 1.8F;
  float stage_rated_current_a = 0.0F;   // the drive's own, as amplitude; 0: no less than the motor's
  float stage_resistance_ohm = 0.005F;  // of the switches, per phase
};

constexpr const Model* find_model(std::span<const Model> models, std::string_view name) {
  for (const Model& model : models) {
    if (model.name == name) return &model;
  }
  return nullptr;
}

}  // namespace servodrome::products
