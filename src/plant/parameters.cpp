#include "plant/parameters.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "drive/hardware.hpp"

namespace servodrome::plant {

namespace {

constexpr double coldest_c = -60.0;
const double below_one = std::nextafter(1.0, 0.0);

struct Check {
  std::string_view name;
  double value;
  double least;
  double most;
};

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.9g", value);
  return text.data();
}

void check(std::vector<std::string>& messages, std::string_view name, double value, double least, double most) {
  if (value >= least && value <= most) return;  // a NaN fails this comparison
  messages.push_back(std::string(name) + ": " + number(value) + " is not within " + number(least) + " .. " +
                     number(most));
}

bool is_position(std::int64_t counts) {
  return counts >= -largest_position_counts && counts <= largest_position_counts;
}

// The inertia on which a torque at the load acts within a tick: with an elastic load that of the load alone. A crank's
// slider adds to it in most places, but not in its dead centres.
double least_inertia_kgm2(const Parameters& p) {
  return p.load.inertia_kgm2 + (p.load.elastic ? 0.0 : p.motor.rotor_inertia_kgm2);
}

// A limit as a number of four digits, so that a message can state it exactly.
enum class Rounding : std::uint8_t { down, up };
double rounded(double limit, Rounding rounding) {
  if (limit == 0.0) return limit;
  const double places = 3.0 - std::floor(std::log10(limit));
  const double scale = std::pow(10.0, std::abs(places));
  const double digits = places < 0.0 ? limit / scale : limit * scale;
  const double whole = rounding == Rounding::up ? std::ceil(digits) : std::floor(digits);
  return places < 0.0 ? whole * scale : whole / scale;
}

// Returns true if an inertia oscillates against a stiffness slowly compared with the tick.
bool is_slow(double stiffness_nm_per_rad, double inertia_kgm2) {
  return stiffness_nm_per_rad == 0.0 || drive::tick_seconds * std::sqrt(stiffness_nm_per_rad / inertia_kgm2) <= 1.0;
}

void check_load(std::vector<std::string>& messages, const Parameters& p) {
  const Load& load = p.load;
  if (load.elastic) check(messages, "load.inertia_kgm2", load.inertia_kgm2, 1.0e-8, 1.0e3);
  const bool low = load.low_stop_counts != no_low_limit;
  const bool high = load.high_stop_counts != no_high_limit;
  const std::int64_t start = p.encoder.start_position_counts;
  if (low && !is_position(load.low_stop_counts)) messages.emplace_back("load.low_stop_counts: beyond 2^61");
  if (high && !is_position(load.high_stop_counts)) messages.emplace_back("load.high_stop_counts: beyond 2^61");
  if (low && high && load.high_stop_counts < load.low_stop_counts + 2) {
    messages.emplace_back("load.high_stop_counts: must be at least two counts above load.low_stop_counts");
  }
  if ((low && start < load.low_stop_counts) || (high && start > load.high_stop_counts)) {
    messages.emplace_back("encoder.start_position_counts: is beyond a hard stop");
  }
}

void check_motor(std::vector<std::string>& messages, const Parameters& p) {
  const Motor& motor = p.motor;
  check(messages, "motor.quadrature_inductance_h / motor.direct_inductance_h",
        motor.quadrature_inductance_h / motor.direct_inductance_h, 0.1, 10.0);
  // The rotor oscillates against the field of the winding with p flux sqrt(phases / 2 / (J L)): about 500 to 4000 rad/s
  // in real motors. An oscillation too fast for the tick would simulate a different motor.
  const double coldest = 1.0 + motor.magnet_temperature_coefficient * (25.0 - coldest_c);
  const double flux = flux_linkage_vs(motor) * coldest * motor.pole_pairs;
  const double saturated = motor.quadrature_saturation_a > 0.0 ? motor.saturated_inductance_share : 1.0;
  const double inductance = std::min(motor.direct_inductance_h, saturated * motor.quadrature_inductance_h);
  if (!(drive::tick_seconds * flux * std::sqrt(0.5 * motor.phases / (motor.rotor_inertia_kgm2 * inductance)) <= 1.0)) {
    messages.emplace_back(
        "motor.torque_constant_nm_per_a: too large for this rotor inertia and inductance (together they would "
        "oscillate "
        "faster than the base tick shows)");
  }
  // Cogging is evaluated at mid-tick, so its own oscillation must be slow compared with the tick.
  double stiffness = motor.cogging_torque_nm * motor.cogging_periods_per_revolution;
  for (std::size_t i = 0; i < motor.cogging_count; ++i) {
    stiffness += motor.cogging[i].torque_nm * motor.cogging[i].periods;
  }
  if (!is_slow(stiffness, motor.rotor_inertia_kgm2)) {
    messages.emplace_back("motor.cogging_torque_nm: the rotor would oscillate in it faster than the base tick shows");
  }
}

void check_cogging(std::vector<std::string>& messages, const Motor& motor) {
  if (motor.cogging_count > most_cogging_harmonics) {
    messages.emplace_back("motor.cogging_count: at most " + std::to_string(most_cogging_harmonics));
    return;
  }
  for (std::size_t i = 0; i < motor.cogging_count; ++i) {
    const std::string name = "motor.cogging[" + std::to_string(i) + "].";
    check(messages, name + "torque_nm", motor.cogging[i].torque_nm, 0.0, 1.0e3);
    check(messages, name + "periods", motor.cogging[i].periods, 1.0, 1000.0);
    check(messages, name + "phase_turns", motor.cogging[i].phase_turns, 0.0, below_one);
  }
}

// The weight of arm and crank is evaluated at mid-tick too.
void check_weight(std::vector<std::string>& messages, const Parameters& p) {
  const Load& load = p.load;
  const double stiffness = (std::abs(load.arm_torque_nm) + (1.0 + load.crank_ratio) * std::abs(load.crank_torque_nm)) /
                           load.cycle_revolutions;
  if (is_slow(stiffness, least_inertia_kgm2(p))) return;
  messages.emplace_back(load.arm_torque_nm != 0.0
                            ? "load.arm_torque_nm: the arm would swing faster than the base tick shows"
                            : "load.crank_torque_nm: the crank would swing faster than the base tick shows");
}

void check_switches(std::vector<std::string>& messages, const Parameters& p) {
  if (p.switch_count > most_switches) {
    messages.emplace_back("switch_count: at most " + std::to_string(most_switches));
    return;
  }
  std::uint32_t wires = 0;
  for (std::size_t i = 0; i < p.switch_count; ++i) {
    const Switch& fitted = p.switches[i];
    const std::string name = "switches[" + std::to_string(i) + "].";
    if (fitted.wire > 31) {
      messages.push_back(name + "wire: " + std::to_string(fitted.wire) + " is not within 0 .. 31");
    } else if (((wires >> fitted.wire) & 1u) != 0) {
      messages.push_back(name + "wire: " + std::to_string(fitted.wire) + " carries another switch already");
    } else {
      wires |= 1u << fitted.wire;
    }
    if (fitted.from_counts != no_low_limit && !is_position(fitted.from_counts)) {
      messages.push_back(name + "from_counts: beyond 2^61");
    }
    if (fitted.to_counts != no_high_limit && !is_position(fitted.to_counts)) {
      messages.push_back(name + "to_counts: beyond 2^61");
    }
    if (fitted.to_counts < fitted.from_counts) messages.push_back(name + "to_counts: is below from_counts");
    check(messages, name + "hysteresis_counts", static_cast<double>(fitted.hysteresis_counts), 0.0, 2147483648.0);
  }
}

}  // namespace

void remove_imperfections(Parameters& parameters) {
  parameters.stage.ideal = parameters.sensors.ideal = true;
  parameters.supply.mains_phases = 0;
  Motor& motor = parameters.motor;
  motor.quadrature_saturation_a = motor.magnet_temperature_coefficient = 0.0;
  motor.iron_hysteresis_nm = motor.iron_eddy_nms = motor.cogging_torque_nm = 0.0;
  motor.cogging_count = 0;
  motor.brake_rise_ms = motor.brake_half_torque_j = 0.0;
  parameters.load.stribeck_speed_rad_s = parameters.load.belt_length_revolutions = 0.0;
}

std::vector<std::string> validate(const Parameters& p) {
  std::vector<std::string> messages;
  const Motor& m = p.motor;
  const Load& l = p.load;
  const Supply& s = p.supply;
  const Encoder& e = p.encoder;
  const Thermal& t = p.thermal;
  const Stage& g = p.stage;
  const Sensors& n = p.sensors;
  const double last_count = e.counts_per_revolution - 1.0;
  const std::array checks{
      Check{"motor.rated_torque_nm", m.rated_torque_nm, 1.0e-6, 1.0e5},
      Check{"motor.rated_current_a", m.rated_current_a, 1.0e-6, 1.0e4},
      Check{"motor.rated_speed_rpm", m.rated_speed_rpm, 1.0e-3, 1.0e5},
      Check{"motor.phases", static_cast<double>(m.phases), 2.0, 3.0},
      Check{"motor.pole_pairs", static_cast<double>(m.pole_pairs), 1.0, 100.0},
      Check{"motor.resistance_ohm", m.resistance_ohm, 1.0e-3, 1.0e3},
      Check{"motor.direct_inductance_h", m.direct_inductance_h, 1.0e-6, 1.0},
      Check{"motor.quadrature_inductance_h", m.quadrature_inductance_h, 1.0e-6, 1.0},
      Check{"motor.quadrature_saturation_a", m.quadrature_saturation_a, 0.0, 1.0e5},
      Check{"motor.saturated_inductance_share", m.saturated_inductance_share, 0.1, 1.0},
      Check{"motor.torque_constant_nm_per_a", m.torque_constant_nm_per_a, 1.0e-4, 1.0e3},
      Check{"motor.magnet_temperature_coefficient", m.magnet_temperature_coefficient, 0.0, 0.005},
      Check{"motor.rotor_inertia_kgm2", m.rotor_inertia_kgm2, 1.0e-8, 10.0},
      Check{"motor.viscous_friction_nms", m.viscous_friction_nms, 0.0, 1.0e3},
      Check{"motor.coulomb_friction_nm", m.coulomb_friction_nm, 0.0, 1.0e5},
      Check{"motor.iron_hysteresis_nm", m.iron_hysteresis_nm, 0.0, 1.0e5},
      Check{"motor.iron_eddy_nms", m.iron_eddy_nms, 0.0, 1.0e3},
      Check{"motor.cogging_torque_nm", m.cogging_torque_nm, 0.0, 1.0e3},
      Check{"motor.cogging_periods_per_revolution", static_cast<double>(m.cogging_periods_per_revolution), 1.0, 1000.0},
      Check{"motor.copper_temperature_coefficient", m.copper_temperature_coefficient, 0.0, 0.01},
      Check{"motor.brake_torque_nm", m.brake_torque_nm, 0.0, 1.0e5},
      Check{"motor.brake_release_ms", m.brake_release_ms, 0.0, 1.0e4},
      Check{"motor.brake_engage_ms", m.brake_engage_ms, 0.0, 1.0e4},
      Check{"motor.brake_rise_ms", m.brake_rise_ms, 0.0, m.brake_engage_ms},
      Check{"motor.brake_half_torque_j", m.brake_half_torque_j, 0.0, 1.0e12},
      Check{"load.inertia_kgm2", l.inertia_kgm2, 0.0, 1.0e3},
      Check{"load.viscous_friction_nms", l.viscous_friction_nms, 0.0, 1.0e3},
      Check{"load.coulomb_friction_nm", l.coulomb_friction_nm, 0.0, 1.0e5},
      Check{"load.static_friction_nm", l.static_friction_nm, l.coulomb_friction_nm, 1.0e5},
      Check{"load.stribeck_speed_rad_s", l.stribeck_speed_rad_s, 0.0, 1.0e5},
      Check{"load.cycle_revolutions", l.cycle_revolutions, 1.0e-3, 1.0e6},
      Check{"load.cycle_offset_turns", l.cycle_offset_turns, 0.0, below_one},
      Check{"load.arm_torque_nm", l.arm_torque_nm, -1.0e5, 1.0e5},
      Check{"load.crank_inertia_kgm2", l.crank_inertia_kgm2, 0.0, 1.0e3},
      Check{"load.crank_torque_nm", l.crank_torque_nm, -1.0e5, 1.0e5},
      Check{"load.crank_ratio", l.crank_ratio, 0.0, 0.9},
      Check{"load.gravity_torque_nm", l.gravity_torque_nm, -1.0e5, 1.0e5},
      Check{"load.external_torque_nm", l.external_torque_nm, -1.0e5, 1.0e5},
      Check{"load.stiffness_nm_per_rad", l.stiffness_nm_per_rad, 1.0e-3, 1.0e8},
      Check{"load.damping_nms", l.damping_nms, 0.0, 1.0e4},
      Check{"load.backlash_rad", l.backlash_rad, 0.0, 6.3},
      Check{"load.belt_length_revolutions", l.belt_length_revolutions, 0.0, 1.0e6},
      Check{"load.belt_middle_revolutions", l.belt_middle_revolutions, -1.0e6, 1.0e6},
      Check{"load.stop_stiffness_nm_per_rad", l.stop_stiffness_nm_per_rad, 1.0e-3, 1.0e9},
      Check{"load.stop_damping_nms", l.stop_damping_nms, 0.0, 1.0e5},
      Check{"supply.volts", s.volts, 0.0, 2000.0},
      Check{"supply.mains_hz", s.mains_hz, 1.0, 1000.0},
      Check{"supply.source_resistance_ohm", s.source_resistance_ohm, 1.0e-4, 1.0e3},
      Check{"supply.capacitance_f", s.capacitance_f, 1.0e-6, 10.0},
      Check{"supply.precharge_time_constant_s", s.precharge_time_constant_s, 0.0, 10.0},
      Check{"supply.bleeder_resistance_ohm", s.bleeder_resistance_ohm, 1.0, 1.0e9},
      Check{"supply.standby_w", s.standby_w, 0.0, 1.0e4},
      Check{"supply.chopper_resistance_ohm", s.chopper_resistance_ohm, 0.1, 1.0e6},
      Check{"supply.overcurrent_a", s.overcurrent_a, 0.01, 1.0e5},
      Check{"supply.bus_overcurrent_a", s.bus_overcurrent_a, 0.01, 1.0e5},
      Check{"encoder.counts_per_revolution", static_cast<double>(e.counts_per_revolution), 1.0, 16777216.0},
      Check{"encoder.commutation_offset_turns", e.commutation_offset_turns, 0.0, below_one},
      Check{"encoder.index_position_counts", static_cast<double>(e.index_position_counts), 0.0, last_count},
      Check{"encoder.index_width_counts", static_cast<double>(e.index_width_counts), 0.0, last_count},
      Check{"thermal.ambient_c", t.ambient_c, -60.0, 150.0},
      Check{"thermal.winding_heat_capacity_j_per_k", t.winding_heat_capacity_j_per_k, 0.01, 1.0e7},
      Check{"thermal.winding_to_case_k_per_w", t.winding_to_case_k_per_w, 1.0e-4, 1.0e4},
      Check{"thermal.case_heat_capacity_j_per_k", t.case_heat_capacity_j_per_k, 0.01, 1.0e7},
      Check{"thermal.case_to_ambient_k_per_w", t.case_to_ambient_k_per_w, 1.0e-4, 1.0e4},
      Check{"thermal.stage_heat_capacity_j_per_k", t.stage_heat_capacity_j_per_k, 0.01, 1.0e7},
      Check{"thermal.stage_to_ambient_k_per_w", t.stage_to_ambient_k_per_w, 1.0e-4, 1.0e4},
      Check{"thermal.stage_standby_w", t.stage_standby_w, 0.0, 1.0e5},
      Check{"thermal.stage_resistance_ohm", t.stage_resistance_ohm, 0.0, 100.0},
      Check{"stage.delay_ticks", static_cast<double>(g.delay_ticks), 0.0, 3.0},
      Check{"stage.dead_time_us", g.dead_time_us, 0.0, 10.0},
      Check{"stage.dead_time_compensation", g.dead_time_compensation, 0.0, 1.0},
      Check{"stage.switch_drop_v", g.switch_drop_v, 0.0, 10.0},
      Check{"stage.modulation_limit", g.modulation_limit, 0.1, 1.0},
      Check{"sensors.current_range_a", n.current_range_a, 0.0, 1.0e5},
      Check{"sensors.current_bits", static_cast<double>(n.current_bits), 0.0, 24.0},
      Check{"sensors.current_noise", n.current_noise, 0.0, 0.1},
      Check{"sensors.current_offset", n.current_offset, 0.0, 0.1},
      Check{"sensors.current_gain_error", n.current_gain_error, 0.0, 0.2},
      Check{"sensors.encoder_noise_arcsec", n.encoder_noise_arcsec, 0.0, 36000.0},
      Check{"sensors.encoder_latency_us", n.encoder_latency_us, 0.0, 250.0},
      Check{"sensors.eccentricity_arcsec", n.eccentricity_arcsec, 0.0, 36000.0},
      Check{"sensors.encoder_lines", static_cast<double>(n.encoder_lines), 0.0, 1.0e6},
      Check{"sensors.interpolation_arcsec", n.interpolation_arcsec, 0.0, 36000.0},
      Check{"sensors.interpolation_second_arcsec", n.interpolation_second_arcsec, 0.0, 36000.0},
  };
  for (const Check& one : checks) check(messages, one.name, one.value, one.least, one.most);
  if (e.direction != 1 && e.direction != -1) messages.emplace_back("encoder.direction: must be 1 or -1");
  if (!is_position(e.start_position_counts)) messages.emplace_back("encoder.start_position_counts: beyond 2^61");
  if (s.mains_phases != 0 && s.mains_phases != 1 && s.mains_phases != 3) {
    messages.emplace_back("supply.mains_phases: must be 0, 1 or 3");
  }
  check_cogging(messages, m);
  if (messages.empty()) {  // checks of several parameters together
    check_motor(messages, p);
    check_weight(messages, p);
  }
  check_load(messages, p);
  check_switches(messages, p);
  return messages;
}

std::vector<std::string> validate(const CouplingParameters& coupling, const Parameters& first,
                                  const Parameters& second) {
  std::vector<std::string> messages;
  check(messages, "ratio", std::abs(coupling.ratio), 1.0e-3, 1.0e3);
  if (!messages.empty()) return messages;
  // The torque of a tick is constant, so the vibration of the two inertias must be slow compared with the tick: at most
  // 1 rad of it in a tick, and a damper that takes at most all of the relative speed.
  const double per_inertia =
      1.0 / least_inertia_kgm2(first) + coupling.ratio * coupling.ratio / least_inertia_kgm2(second);
  const double stiffest = rounded(1.0 / (per_inertia * drive::tick_seconds * drive::tick_seconds), Rounding::down);
  const double most_damped = rounded(1.0 / (per_inertia * drive::tick_seconds), Rounding::down);
  check(messages, "stiffness_nm_per_rad", coupling.stiffness_nm_per_rad, 1.0e-3, std::min(stiffest, 1.0e8));
  if (!messages.empty()) return messages;  // the limits of the damping depend on the stiffness
  const double angle = drive::tick_seconds * std::sqrt(coupling.stiffness_nm_per_rad * per_inertia);
  // A flank that closes or opens within a tick changes the energy of the rebound by up to an eighth of the angle's
  // square. This damper takes at least as much.
  const double least_damped =
      coupling.backlash_rad > 0.0 ? coupling.stiffness_nm_per_rad * drive::tick_seconds * angle / 16.0 : 0.0;
  check(messages, "damping_nms", coupling.damping_nms, rounded(least_damped, Rounding::up),
        std::min(most_damped, 1.0e4));
  check(messages, "backlash_rad", coupling.backlash_rad, 0.0, 6.3);
  return messages;
}

}  // namespace servodrome::plant
