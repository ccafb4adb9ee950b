// plant_trace reads a scenario from standard input, steps a plant through it, and writes a trace to standard output.
//
// A scenario consists of lines of words. First parameters, by the names of parameters.hpp; others have their defaults:
//   load.inertia_kgm2 = 1e-4
//   locked = 1          the bench holds the rotor
//   every = 16          writes each 16th tick only
// then, after a line "ticks", inputs that are constant for a number of ticks (for each tick, if the number is 1):
//   TICKS U_V V_V W_V PWM SHORT_CIRCUIT BRAKE_RELEASED EXTERNAL_NM CHOPPER DC_LINK_CONNECTED
//
// The trace is a line with the names of the columns, and then rows of binary doubles: the state before the first tick
// and at the end of ticks. Text with 17 digits per value would take longer than the plant.
#include <array>
#include <charconv>
#include <cstdio>
#include <exception>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "plant/plant.hpp"

namespace {

using servodrome::drive::Actuation;
using servodrome::drive::Feedback;
using servodrome::plant::Energy;
using servodrome::plant::Parameters;
using servodrome::plant::Plant;

using Member = std::variant<double*, int*, std::int64_t*, bool*>;

// Settings of the run, not of the machine.
struct Run {
  bool locked = false;
  int every = 1;
};

std::map<std::string, Member, std::less<>> members_of(Parameters& p, Run& run) {
  return {{"motor.phases", &p.motor.phases},
          {"motor.pole_pairs", &p.motor.pole_pairs},
          {"motor.resistance_ohm", &p.motor.resistance_ohm},
          {"motor.direct_inductance_h", &p.motor.direct_inductance_h},
          {"motor.quadrature_inductance_h", &p.motor.quadrature_inductance_h},
          {"motor.quadrature_saturation_a", &p.motor.quadrature_saturation_a},
          {"motor.saturated_inductance_share", &p.motor.saturated_inductance_share},
          {"motor.magnet_temperature_coefficient", &p.motor.magnet_temperature_coefficient},
          {"motor.iron_hysteresis_nm", &p.motor.iron_hysteresis_nm},
          {"motor.iron_eddy_nms", &p.motor.iron_eddy_nms},
          {"motor.torque_constant_nm_per_a", &p.motor.torque_constant_nm_per_a},
          {"motor.rotor_inertia_kgm2", &p.motor.rotor_inertia_kgm2},
          {"motor.viscous_friction_nms", &p.motor.viscous_friction_nms},
          {"motor.coulomb_friction_nm", &p.motor.coulomb_friction_nm},
          {"motor.copper_temperature_coefficient", &p.motor.copper_temperature_coefficient},
          {"motor.brake_torque_nm", &p.motor.brake_torque_nm},
          {"motor.brake_release_ms", &p.motor.brake_release_ms},
          {"motor.brake_engage_ms", &p.motor.brake_engage_ms},
          {"load.inertia_kgm2", &p.load.inertia_kgm2},
          {"load.viscous_friction_nms", &p.load.viscous_friction_nms},
          {"load.coulomb_friction_nm", &p.load.coulomb_friction_nm},
          {"load.static_friction_nm", &p.load.static_friction_nm},
          {"load.stribeck_speed_rad_s", &p.load.stribeck_speed_rad_s},
          {"load.cycle_revolutions", &p.load.cycle_revolutions},
          {"load.cycle_offset_turns", &p.load.cycle_offset_turns},
          {"load.arm_torque_nm", &p.load.arm_torque_nm},
          {"load.crank_inertia_kgm2", &p.load.crank_inertia_kgm2},
          {"load.crank_torque_nm", &p.load.crank_torque_nm},
          {"load.crank_ratio", &p.load.crank_ratio},
          {"load.belt_length_revolutions", &p.load.belt_length_revolutions},
          {"load.belt_middle_revolutions", &p.load.belt_middle_revolutions},
          {"load.gravity_torque_nm", &p.load.gravity_torque_nm},
          {"load.elastic", &p.load.elastic},
          {"load.stiffness_nm_per_rad", &p.load.stiffness_nm_per_rad},
          {"load.damping_nms", &p.load.damping_nms},
          {"load.backlash_rad", &p.load.backlash_rad},
          {"load.low_stop_counts", &p.load.low_stop_counts},
          {"load.high_stop_counts", &p.load.high_stop_counts},
          {"load.stop_stiffness_nm_per_rad", &p.load.stop_stiffness_nm_per_rad},
          {"load.stop_damping_nms", &p.load.stop_damping_nms},
          {"supply.volts", &p.supply.volts},
          {"supply.mains_phases", &p.supply.mains_phases},
          {"supply.mains_hz", &p.supply.mains_hz},
          {"supply.source_resistance_ohm", &p.supply.source_resistance_ohm},
          {"supply.capacitance_f", &p.supply.capacitance_f},
          {"supply.precharge_time_constant_s", &p.supply.precharge_time_constant_s},
          {"supply.bleeder_resistance_ohm", &p.supply.bleeder_resistance_ohm},
          {"supply.standby_w", &p.supply.standby_w},
          {"supply.chopper_resistance_ohm", &p.supply.chopper_resistance_ohm},
          {"supply.charged_at_start", &p.supply.charged_at_start},
          {"encoder.counts_per_revolution", &p.encoder.counts_per_revolution},
          {"encoder.start_position_counts", &p.encoder.start_position_counts},
          {"encoder.direction", &p.encoder.direction},
          {"thermal.ambient_c", &p.thermal.ambient_c},
          {"thermal.winding_heat_capacity_j_per_k", &p.thermal.winding_heat_capacity_j_per_k},
          {"thermal.winding_to_case_k_per_w", &p.thermal.winding_to_case_k_per_w},
          {"thermal.case_heat_capacity_j_per_k", &p.thermal.case_heat_capacity_j_per_k},
          {"thermal.case_to_ambient_k_per_w", &p.thermal.case_to_ambient_k_per_w},
          {"thermal.stage_heat_capacity_j_per_k", &p.thermal.stage_heat_capacity_j_per_k},
          {"thermal.stage_to_ambient_k_per_w", &p.thermal.stage_to_ambient_k_per_w},
          {"thermal.stage_standby_w", &p.thermal.stage_standby_w},
          {"thermal.stage_resistance_ohm", &p.thermal.stage_resistance_ohm},
          {"locked", &run.locked},
          {"every", &run.every}};
}

template <typename Number>
void read_number(std::string_view text, Number& number) {
  const char* last = text.data() + text.size();
  const auto [end, error] = std::from_chars(text.data(), last, number);
  if (error != std::errc{} || end != last) throw std::runtime_error("not a number: " + std::string(text));
}
void read_number(std::string_view text, bool& flag) {
  int number = 0;
  read_number(text, number);
  flag = number != 0;
}

void read_parameters(std::istream& in, Parameters& parameters, Run& run) {
  const auto members = members_of(parameters, run);
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string name;
    std::string equals;
    std::string value;
    words >> name >> equals >> value;
    if (name.empty()) continue;
    if (name == "ticks") return;
    const auto found = members.find(name);
    if (found == members.end() || equals != "=") throw std::runtime_error("not a parameter: " + line);
    std::visit([&value](auto* member) { read_number(value, *member); }, found->second);
  }
  throw std::runtime_error("no line \"ticks\"");
}

constexpr std::string_view columns =
    "position_counts velocity_rpm load_position_counts load_velocity_rpm direct_a quadrature_a torque_nm dc_link_v "
    "supplied_j chopped_j standby_j stage_j to_motor_j copper_j shaft_j link_stored_j magnetic_j kinetic_j elastic_j "
    "winding_c case_c stage_c";

std::array<double, 22> row_of(const Plant& plant) {
  const Energy energy = plant.energy();
  return {static_cast<double>(plant.position_counts()) + plant.position_fraction(),
          plant.velocity_rpm(),
          plant.load_position_counts(),
          plant.load_velocity_rpm(),
          plant.direct_current_a(),
          plant.current_a(),
          plant.torque_nm(),
          plant.dc_link_v(),
          energy.supplied_j,
          energy.chopped_j,
          energy.standby_j,
          energy.stage_j,
          energy.to_motor_j,
          energy.copper_j,
          energy.shaft_j,
          energy.link_stored_j,
          energy.magnetic_j,
          energy.kinetic_j,
          energy.elastic_j,
          plant.winding_temperature_c(),
          plant.case_temperature_c(),
          plant.power_stage_temperature_c()};
}

struct Hold {
  std::int64_t ticks = 0;
  Actuation actuation;
  double external_nm = 0.0;
};

bool read_hold(std::istream& in, Hold& hold) {
  if (!(in >> hold.ticks)) {
    if (!in.eof()) throw std::runtime_error("not a number of ticks");
    return false;
  }
  Actuation& a = hold.actuation;
  in >> a.phase_voltage_v[0] >> a.phase_voltage_v[1] >> a.phase_voltage_v[2] >> a.pwm_enabled >> a.short_circuit >>
      a.brake_released >> hold.external_nm >> a.chopper_on >> a.dc_link_connected;
  if (!in) throw std::runtime_error("a line of ticks has ten numbers");
  return true;
}

void trace(std::istream& in) {
  Parameters parameters;
  Run run;
  read_parameters(in, parameters, run);
  if (run.every < 1) throw std::runtime_error("every: at least 1");
  Plant plant(parameters);
  if (run.locked) plant.lock_rotor(true);

  std::printf("%.*s\n", static_cast<int>(columns.size()), columns.data());
  std::vector<double> rows;
  const auto write = [&] {
    const auto row = row_of(plant);
    rows.insert(rows.end(), row.begin(), row.end());
  };
  write();
  Feedback feedback;
  int until_written = run.every;
  double external_nm = 0.0;
  for (Hold hold; read_hold(in, hold);) {
    if (hold.external_nm != external_nm) plant.set_external_torque_nm(external_nm = hold.external_nm);
    for (std::int64_t tick = 0; tick < hold.ticks; ++tick) {
      plant.step(hold.actuation, feedback);
      if (--until_written > 0) continue;
      write();
      until_written = run.every;
    }
  }
  if (std::fwrite(rows.data(), sizeof(double), rows.size(), stdout) != rows.size())
    throw std::runtime_error("not written");
}

}  // namespace

int main() {
  try {
    trace(std::cin);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "plant_trace: %s\n", error.what());
    return 2;
  }
}
