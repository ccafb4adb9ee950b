#pragma once

#include <span>
#include <string_view>

#include "drive/loops/motor_data.hpp"

// The sizes of a product. A product with a single size has no models.
namespace servodrome::products {

// A drive with its own motor: nameplate, and the further data that a simulation needs. SI units; phase values line to
// neutral (for a stepper, of one winding); currents of `motor` as peak values of the phase current.
struct Model {
  std::string_view name;           // its name in a line file
  std::string_view title;          // one line of text for users
  drive::MotorData motor{};        // inertia_kgm2: of the rotor alone
  float cogging_torque_nm = 0.0F;  // amplitude
  int cogging_periods_per_revolution = 30;
  float brake_torque_nm = 0.0F;
  float supply_v = 48.0F;
  float dc_link_f = 1e-3F;
  float source_resistance_ohm = 0.05F;
  float standby_w = 0.0F;  // consumption of the electronics, if the DC link feeds them
  float winding_to_case_k_per_w = 1.0F;
  float case_to_ambient_k_per_w = 1.8F;
  float stage_rated_current_a = 0.0F;   // of the drive, as amplitude; 0: at least that of the motor
  float stage_resistance_ohm = 0.005F;  // of the switches, per phase
};

constexpr const Model* find_model(std::span<const Model> models, std::string_view name) {
  for (const Model& model : models) {
    if (model.name == name) return &model;
  }
  return nullptr;
}

}  // namespace servodrome::products
