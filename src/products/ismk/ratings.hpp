#pragma once

#include <algorithm>
#include <array>

#include "products/model.hpp"

// The four ratings of the iSMK (ch. 1.3.1) with their motors.
//
// Printed: peak and continuous current of the drive, rated and greatest torque, rated speed, rotor inertia, supply 24
// to 60 V, encoder 65536 inc/rev. Derived: the torque constant is the greatest torque divided by the peak current. So
// the rated current, rated torque divided by torque constant, is a third of the peak current. For 40-010 and 80-075
// this is the printed continuous current within 6 %; the other two have a reserve. Chosen, because nothing is printed:
// five pole pairs; resistances for copper losses of 15, 22, 35 and 55 W at rated torque; inductances for electrical
// time constants of 1.4 to 3 ms, with which every motor still reaches peak torque at rated speed on 48 V; thermal
// resistances for a winding 98 K above ambient in continuous duty at rated torque and 48 K at 70 % of it. This agrees
// with the printed duty (S1 only at 70 % of rated torque, ch. 1.3.1, with an alarm at 100 degC, ch. 3.7).
namespace servodrome::products::ismk {

namespace rating {

struct Nameplate {
  float peak_current_a;        // Ap
  float continuous_current_a;  // Arms
  float rated_torque_nm;
  float peak_torque_nm;
  float rotor_inertia_kgm2;
  float resistance_ohm;  // of a phase at 25 degC
  float inductance_h;
  float brake_torque_nm;
  float dc_link_f;
};

constexpr Model model(std::string_view name, std::string_view title, const Nameplate& plate) {
  Model made;
  made.name = name;
  made.title = title;
  drive::MotorData& motor = made.motor;
  motor.counts_per_revolution = 65536;  // Table 8-2
  motor.pole_pairs = 5;
  motor.torque_constant_nm_per_a = plate.peak_torque_nm / plate.peak_current_a;
  motor.rated_current_a = plate.rated_torque_nm / motor.torque_constant_nm_per_a;
  motor.peak_current_a = plate.peak_current_a;
  motor.rated_torque_nm = plate.rated_torque_nm;
  motor.rated_speed_rpm = 3000.0F;  // ch. 1.3.1
  motor.max_speed_rpm = 6000.0F;    // above 6080h, 5000 rpm
  motor.resistance_ohm = plate.resistance_ohm;
  motor.inductance_d_h = plate.inductance_h;
  motor.inductance_q_h = plate.inductance_h;
  motor.inertia_kgm2 = plate.rotor_inertia_kgm2;
  made.stage_rated_current_a = plate.continuous_current_a * 1.41421356F;
  made.brake_torque_nm = plate.brake_torque_nm;
  made.dc_link_f = plate.dc_link_f;
  const float copper_w = 1.5F * plate.resistance_ohm * motor.rated_current_a * motor.rated_current_a;
  made.winding_to_case_k_per_w = 35.0F / copper_w;
  made.case_to_ambient_k_per_w = 63.0F / copper_w;
  return made;
}

}  // namespace rating

inline constexpr std::string_view default_rating = "60-040";  // the printed defaults are those of this one (ch. 7.3)

inline constexpr std::array ratings{
    rating::model("40-010", "iSMK40-010, 100 W",
                  {18.0F, 4.0F, 0.32F, 0.96F, 0.044e-4F, 0.28F, 0.40e-3F, 0.32F, 2.2e-3F}),
    rating::model("60-020", "iSMK60-020, 200 W", {24.0F, 7.0F, 0.64F, 1.92F, 0.17e-4F, 0.23F, 0.40e-3F, 1.5F, 3.3e-3F}),
    rating::model("60-040", "iSMK60-040, 400 W",
                  {48.0F, 12.0F, 1.27F, 3.81F, 0.31e-4F, 0.09F, 0.20e-3F, 1.5F, 4.7e-3F}),
    rating::model("80-075", "iSMK80-075, 750 W",
                  {100.0F, 23.0F, 2.39F, 7.17F, 0.85e-4F, 0.033F, 0.10e-3F, 3.2F, 10.0e-3F}),
};
// find_model is not used here: with sanitizers gcc 12 does not accept the address it returns as a constant.
static_assert(std::any_of(ratings.begin(), ratings.end(),
                          [](const Model& model) { return model.name == default_rating; }));

}  // namespace servodrome::products::ismk
