#pragma once

#include <array>

#include "drive/transforms.hpp"
#include "products/model.hpp"

// The sizes of the EC series: integrated servos IHSV-EC (ch. 2.1 and 2.2) and the two stepper drives that the routines
// for TwinCAT3 and INovance name.
//
// Printed for the IHSV: flange, power, supply, rated speed 3000 rpm, 300 % torque, 1000-line encoder (4000 increments).
// Derived: rated torque. Chosen, because nothing is printed: five pole pairs (the sample of P00-05, ch. 6); a torque
// constant with which the motor turns 4500 rpm on 80 % of its supply; copper losses, electrical time constants of 1.4
// to 1.8 ms, rotor inertias of motors of that flange; thermal resistances for a winding 98 K above ambient in
// continuous duty. The steppers ("hybrid stepping servo", 'Preface') have two phases and 50 pole pairs. 6 A and 4.436
// Nm are the defaults of 6075h and 6076h (Table 219) and are used for 2HSS458-EC; 2DM542-EC has the 4.2 A of its name.
// Chosen: windings with which the DC link allows the rated torque up to the rated speed, a detent torque of 4 % of the
// holding torque, four times per tooth. Table 219 is for both and has the objects of an encoder (6064h, 608Fh, 60F4h),
// so the 2DM542 has one.
namespace servodrome::products::jmc_ec {

struct Rating {
  Model model{};
  const char* device_name;     // 1008h, SII and ESI
  std::uint32_t product_code;  // printed XXXX: chosen
};

namespace rating {

inline constexpr float root2 = 1.41421356F;
inline constexpr float root3 = 1.73205081F;
inline constexpr float standby_w = 3.0F;  // chosen: processor, EtherCAT with two ports, encoder; DC+ is the only supply

constexpr void heat(Model& model) {
  const drive::MotorData& motor = model.motor;
  const float copper_w =
      drive::phase_factor(motor.phases) * motor.resistance_ohm * motor.rated_current_a * motor.rated_current_a;
  model.winding_to_case_k_per_w = 35.0F / copper_w;
  model.case_to_ambient_k_per_w = 63.0F / copper_w;
}

struct Servo {
  float power_w;
  float supply_v;
  float inertia_kgm2;
  float copper_w;
  float brake_torque_nm;
  float dc_link_f;
};

constexpr Rating servo(std::string_view name, std::string_view title, const char* device_name, std::uint32_t code,
                       const Servo& plate) {
  constexpr float rated_rad_s = 314.159265F;    // 3000 rpm
  constexpr float no_load_rad_s = 471.238898F;  // 4500 rpm
  Rating made{.device_name = device_name, .product_code = code};
  made.model.name = name;
  made.model.title = title;
  drive::MotorData& motor = made.model.motor;
  motor.counts_per_revolution = 4000;
  motor.pole_pairs = 5;
  motor.rated_speed_rpm = 3000.0F;
  motor.max_speed_rpm = 4500.0F;
  motor.rated_torque_nm = plate.power_w / rated_rad_s;
  motor.torque_constant_nm_per_a = 1.5F * 0.8F * plate.supply_v / root3 / no_load_rad_s;
  motor.rated_current_a = motor.rated_torque_nm / motor.torque_constant_nm_per_a;
  motor.peak_current_a = 3.0F * motor.rated_current_a;
  motor.resistance_ohm = plate.copper_w / (1.5F * motor.rated_current_a * motor.rated_current_a);
  motor.inductance_d_h = motor.inductance_q_h = 1.4e-3F * motor.resistance_ohm;
  motor.inertia_kgm2 = plate.inertia_kgm2;
  made.model.supply_v = plate.supply_v;
  made.model.dc_link_f = plate.dc_link_f;
  made.model.standby_w = standby_w;
  made.model.brake_torque_nm = plate.brake_torque_nm;
  made.model.stage_rated_current_a = 1.2F * motor.rated_current_a;
  heat(made.model);
  return made;
}

// Data as on the nameplate of a hybrid stepper: current of each winding with both windings at full current, the holding
// torque then, resistance and inductance of one winding.
struct Stepper {
  float rated_current_a;
  float rated_torque_nm;
  float supply_v;
  float rated_speed_rpm;
  float max_speed_rpm;
  float resistance_ohm;
  float inductance_h;
  float inertia_kgm2;
};

constexpr Rating stepper(std::string_view name, std::string_view title, const char* device_name, std::uint32_t code,
                         const Stepper& plate) {
  Rating made{.device_name = device_name, .product_code = code};
  made.model.name = name;
  made.model.title = title;
  drive::MotorData& motor = made.model.motor;
  motor.counts_per_revolution = 4000;
  motor.phases = 2;
  motor.pole_pairs = 50;
  motor.rated_speed_rpm = plate.rated_speed_rpm;
  motor.max_speed_rpm = plate.max_speed_rpm;
  motor.rated_torque_nm = plate.rated_torque_nm;
  motor.rated_current_a = plate.rated_current_a * root2;  // amplitude of the rotating current vector of both windings
  motor.torque_constant_nm_per_a = motor.rated_torque_nm / motor.rated_current_a;
  motor.peak_current_a = 1.5F * motor.rated_current_a;
  motor.resistance_ohm = plate.resistance_ohm;
  motor.inductance_d_h = motor.inductance_q_h = plate.inductance_h;
  motor.inertia_kgm2 = plate.inertia_kgm2;
  made.model.supply_v = plate.supply_v;
  made.model.dc_link_f = 2.2e-3F;
  made.model.standby_w = standby_w;
  made.model.cogging_torque_nm = 0.04F * plate.rated_torque_nm;
  made.model.cogging_periods_per_revolution = 4 * motor.pole_pairs;  // one per full step
  made.model.stage_rated_current_a = 1.2F * motor.rated_current_a;
  heat(made.model);
  return made;
}

}  // namespace rating

inline constexpr std::string_view default_rating = "ihsv57-180";

inline constexpr std::array ratings{
    rating::servo("ihsv42-78", "IHSV42-30-07-24-EC, 78 W", "IHSV42-30-07-24-EC", 0x45430401,
                  {78.0F, 24.0F, 0.07e-4F, 10.0F, 0.3F, 2.2e-3F}),
    rating::servo("ihsv57-140", "IHSV57-30-14-36-EC, 140 W", "IHSV57-30-14-36-EC", 0x45430501,
                  {140.0F, 36.0F, 0.18e-4F, 16.0F, 0.6F, 3.3e-3F}),
    rating::servo("ihsv57-180", "IHSV57-30-18-36-EC, 180 W", "IHSV57-30-18-36-EC", 0x45430502,
                  {180.0F, 36.0F, 0.26e-4F, 20.0F, 0.6F, 3.3e-3F}),
    rating::servo("ihsv60-200", "IHSV60-30-20-48-EC, 200 W", "IHSV60-30-20-48-EC", 0x45430601,
                  {200.0F, 48.0F, 0.29e-4F, 20.0F, 1.5F, 3.3e-3F}),
    rating::servo("ihsv60-400", "IHSV60-30-40-48-EC, 400 W", "IHSV60-30-40-48-EC", 0x45430602,
                  {400.0F, 48.0F, 0.58e-4F, 35.0F, 1.5F, 4.7e-3F}),
    rating::servo("ihsv86-440", "IHSV86-30-44-72-EC, 440 W", "IHSV86-30-44-72-EC", 0x45430801,
                  {440.0F, 72.0F, 1.6e-4F, 38.0F, 3.2F, 4.7e-3F}),
    rating::servo("ihsv86-660", "IHSV86-30-66-72-EC, 660 W", "IHSV86-30-66-72-EC", 0x45430802,
                  {660.0F, 72.0F, 2.4e-4F, 55.0F, 3.2F, 6.8e-3F}),
    rating::stepper("2hss458-ec", "2HSS458-EC closed-loop stepper drive", "2HSS458-EC", 0x45431001,
                    {6.0F, 4.436F, 72.0F, 600.0F, 900.0F, 0.4F, 2.3e-3F, 1.4e-4F}),
    rating::stepper("2dm542-ec", "2DM542-EC stepper drive", "2DM542-EC", 0x45432001,
                    {2.97F, 1.8F, 48.0F, 500.0F, 750.0F, 0.8F, 3.0e-3F, 0.48e-4F}),
};

// The same, as models for the registry of a line.
inline constexpr auto models = [] {
  std::array<Model, ratings.size()> made{};
  for (std::size_t i = 0; i < made.size(); ++i) made[i] = ratings[i].model;
  return made;
}();

// The rating with that name; an unknown name gives the default.
constexpr const Rating& find_rating(std::string_view name) {
  std::size_t chosen = 0;
  for (std::size_t i = 0; i < ratings.size(); ++i) {
    if (ratings[i].model.name == default_rating) chosen = i;
  }
  for (std::size_t i = 0; i < ratings.size(); ++i) {
    if (ratings[i].model.name == name) chosen = i;
  }
  return ratings[chosen];
}
static_assert(find_rating("").model.name == default_rating);

}  // namespace servodrome::products::jmc_ec
