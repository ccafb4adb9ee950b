#include <cmath>
#include <gtest/gtest.h>

#include "plant/parameters.hpp"

// The ranges that parameters.hpp documents, at both ends: the last valid value and the next invalid one.
namespace servodrome::plant {
namespace parameter_ranges_test {
namespace {

constexpr double endless = std::numeric_limits<double>::infinity();

// Returns true if the parameter is out of its range. Other error messages do not count, because a wide range allows
// combinations that do not fit together.
bool refused(const Parameters& parameters, const std::string& name) {
  for (const std::string& message : validate(parameters)) {
    const bool of_range = message.find("is not within") != std::string::npos || name == "encoder.direction";
    if (of_range && message.starts_with(name + ":")) return true;
  }
  return false;
}

TEST(ParameterRanges, EndWhereTheySay) {
  struct Row {
    const char* name;
    double& (*of)(Parameters&);
    double least, most;
  };
  for (const auto& [name, of, least, most] : std::to_array<Row>({
           {"motor.rated_torque_nm", [](Parameters& p) -> double& { return p.motor.rated_torque_nm; }, 1.0e-6, 1.0e5},
           {"motor.rated_current_a", [](Parameters& p) -> double& { return p.motor.rated_current_a; }, 1.0e-6, 1.0e4},
           {"motor.rated_speed_rpm", [](Parameters& p) -> double& { return p.motor.rated_speed_rpm; }, 1.0e-3, 1.0e5},
           {"motor.resistance_ohm", [](Parameters& p) -> double& { return p.motor.resistance_ohm; }, 1.0e-3, 1.0e3},
           {"motor.direct_inductance_h", [](Parameters& p) -> double& { return p.motor.direct_inductance_h; }, 1.0e-6,
            1.0},
           {"motor.quadrature_inductance_h", [](Parameters& p) -> double& { return p.motor.quadrature_inductance_h; },
            1.0e-6, 1.0},
           {"motor.torque_constant_nm_per_a", [](Parameters& p) -> double& { return p.motor.torque_constant_nm_per_a; },
            1.0e-4, 1.0e3},
           {"motor.rotor_inertia_kgm2", [](Parameters& p) -> double& { return p.motor.rotor_inertia_kgm2; }, 1.0e-8,
            10.0},
           {"motor.viscous_friction_nms", [](Parameters& p) -> double& { return p.motor.viscous_friction_nms; }, 0.0,
            1.0e3},
           {"motor.coulomb_friction_nm", [](Parameters& p) -> double& { return p.motor.coulomb_friction_nm; }, 0.0,
            1.0e5},
           {"motor.cogging_torque_nm", [](Parameters& p) -> double& { return p.motor.cogging_torque_nm; }, 0.0, 1.0e3},
           {"motor.copper_temperature_coefficient",
            [](Parameters& p) -> double& { return p.motor.copper_temperature_coefficient; }, 0.0, 0.01},
           {"motor.brake_torque_nm", [](Parameters& p) -> double& { return p.motor.brake_torque_nm; }, 0.0, 1.0e5},
           {"motor.brake_release_ms", [](Parameters& p) -> double& { return p.motor.brake_release_ms; }, 0.0, 1.0e4},
           {"motor.brake_engage_ms", [](Parameters& p) -> double& { return p.motor.brake_engage_ms; }, 0.0, 1.0e4},
           {"load.inertia_kgm2", [](Parameters& p) -> double& { return p.load.inertia_kgm2; }, 0.0, 1.0e3},
           {"load.viscous_friction_nms", [](Parameters& p) -> double& { return p.load.viscous_friction_nms; }, 0.0,
            1.0e3},
           {"load.coulomb_friction_nm", [](Parameters& p) -> double& { return p.load.coulomb_friction_nm; }, 0.0,
            1.0e5},
           {"load.gravity_torque_nm", [](Parameters& p) -> double& { return p.load.gravity_torque_nm; }, -1.0e5, 1.0e5},
           {"load.external_torque_nm", [](Parameters& p) -> double& { return p.load.external_torque_nm; }, -1.0e5,
            1.0e5},
           {"load.stiffness_nm_per_rad", [](Parameters& p) -> double& { return p.load.stiffness_nm_per_rad; }, 1.0e-3,
            1.0e8},
           {"load.damping_nms", [](Parameters& p) -> double& { return p.load.damping_nms; }, 0.0, 1.0e4},
           {"load.backlash_rad", [](Parameters& p) -> double& { return p.load.backlash_rad; }, 0.0, 6.3},
           {"load.stop_stiffness_nm_per_rad", [](Parameters& p) -> double& { return p.load.stop_stiffness_nm_per_rad; },
            1.0e-3, 1.0e9},
           {"load.stop_damping_nms", [](Parameters& p) -> double& { return p.load.stop_damping_nms; }, 0.0, 1.0e5},
           {"supply.volts", [](Parameters& p) -> double& { return p.supply.volts; }, 0.0, 2000.0},
           {"supply.source_resistance_ohm", [](Parameters& p) -> double& { return p.supply.source_resistance_ohm; },
            1.0e-4, 1.0e3},
           {"supply.capacitance_f", [](Parameters& p) -> double& { return p.supply.capacitance_f; }, 1.0e-6, 10.0},
           {"supply.precharge_time_constant_s",
            [](Parameters& p) -> double& { return p.supply.precharge_time_constant_s; }, 0.0, 10.0},
           {"supply.bleeder_resistance_ohm", [](Parameters& p) -> double& { return p.supply.bleeder_resistance_ohm; },
            1.0, 1.0e9},
           {"supply.standby_w", [](Parameters& p) -> double& { return p.supply.standby_w; }, 0.0, 1.0e4},
           {"supply.chopper_resistance_ohm", [](Parameters& p) -> double& { return p.supply.chopper_resistance_ohm; },
            0.1, 1.0e6},
           {"supply.overcurrent_a", [](Parameters& p) -> double& { return p.supply.overcurrent_a; }, 0.01, 1.0e5},
           {"supply.bus_overcurrent_a", [](Parameters& p) -> double& { return p.supply.bus_overcurrent_a; }, 0.01,
            1.0e5},
           {"motor.quadrature_saturation_a", [](Parameters& p) -> double& { return p.motor.quadrature_saturation_a; },
            0.0, 1.0e5},
           {"motor.saturated_inductance_share",
            [](Parameters& p) -> double& { return p.motor.saturated_inductance_share; }, 0.1, 1.0},
           {"motor.magnet_temperature_coefficient",
            [](Parameters& p) -> double& { return p.motor.magnet_temperature_coefficient; }, 0.0, 0.005},
           {"motor.iron_hysteresis_nm", [](Parameters& p) -> double& { return p.motor.iron_hysteresis_nm; }, 0.0,
            1.0e5},
           {"motor.iron_eddy_nms", [](Parameters& p) -> double& { return p.motor.iron_eddy_nms; }, 0.0, 1.0e3},
           {"motor.brake_rise_ms", [](Parameters& p) -> double& { return p.motor.brake_rise_ms; }, 0.0, 20.0},
           {"motor.brake_half_torque_j", [](Parameters& p) -> double& { return p.motor.brake_half_torque_j; }, 0.0,
            1.0e12},
           {"load.stribeck_speed_rad_s", [](Parameters& p) -> double& { return p.load.stribeck_speed_rad_s; }, 0.0,
            1.0e5},
           {"load.cycle_revolutions", [](Parameters& p) -> double& { return p.load.cycle_revolutions; }, 1.0e-3, 1.0e6},
           {"load.arm_torque_nm", [](Parameters& p) -> double& { return p.load.arm_torque_nm; }, -1.0e5, 1.0e5},
           {"load.crank_inertia_kgm2", [](Parameters& p) -> double& { return p.load.crank_inertia_kgm2; }, 0.0, 1.0e3},
           {"load.crank_torque_nm", [](Parameters& p) -> double& { return p.load.crank_torque_nm; }, -1.0e5, 1.0e5},
           {"load.crank_ratio", [](Parameters& p) -> double& { return p.load.crank_ratio; }, 0.0, 0.9},
           {"load.belt_length_revolutions", [](Parameters& p) -> double& { return p.load.belt_length_revolutions; },
            0.0, 1.0e6},
           {"load.belt_middle_revolutions", [](Parameters& p) -> double& { return p.load.belt_middle_revolutions; },
            -1.0e6, 1.0e6},
           {"supply.mains_hz", [](Parameters& p) -> double& { return p.supply.mains_hz; }, 1.0, 1000.0},
           {"thermal.ambient_c", [](Parameters& p) -> double& { return p.thermal.ambient_c; }, -60.0, 150.0},
           {"thermal.winding_heat_capacity_j_per_k",
            [](Parameters& p) -> double& { return p.thermal.winding_heat_capacity_j_per_k; }, 0.01, 1.0e7},
           {"thermal.winding_to_case_k_per_w",
            [](Parameters& p) -> double& { return p.thermal.winding_to_case_k_per_w; }, 1.0e-4, 1.0e4},
           {"thermal.case_heat_capacity_j_per_k",
            [](Parameters& p) -> double& { return p.thermal.case_heat_capacity_j_per_k; }, 0.01, 1.0e7},
           {"thermal.case_to_ambient_k_per_w",
            [](Parameters& p) -> double& { return p.thermal.case_to_ambient_k_per_w; }, 1.0e-4, 1.0e4},
           {"thermal.stage_heat_capacity_j_per_k",
            [](Parameters& p) -> double& { return p.thermal.stage_heat_capacity_j_per_k; }, 0.01, 1.0e7},
           {"thermal.stage_to_ambient_k_per_w",
            [](Parameters& p) -> double& { return p.thermal.stage_to_ambient_k_per_w; }, 1.0e-4, 1.0e4},
           {"thermal.stage_standby_w", [](Parameters& p) -> double& { return p.thermal.stage_standby_w; }, 0.0, 1.0e5},
           {"thermal.stage_resistance_ohm", [](Parameters& p) -> double& { return p.thermal.stage_resistance_ohm; },
            0.0, 100.0},
       })) {
    const auto takes = [place = of, key = name](double value) {
      Parameters parameters;
      place(parameters) = value;
      return !refused(parameters, key);
    };
    EXPECT_TRUE(takes(least)) << name;
    EXPECT_FALSE(takes(std::nextafter(least, -endless))) << name;
    EXPECT_TRUE(takes(most)) << name;
    EXPECT_FALSE(takes(std::nextafter(most, endless))) << name;
    EXPECT_FALSE(takes(std::nan(""))) << name;
  }
}

TEST(ParameterRanges, OfWholeNumbers) {
  const auto takes = [](const char* name, auto change) {
    Parameters parameters;
    change(parameters);
    return !refused(parameters, name);
  };
  for (const int phases : {1, 2, 3, 4}) {
    EXPECT_EQ(takes("motor.phases", [&](Parameters& p) { p.motor.phases = phases; }), phases == 2 || phases == 3);
  }
  for (const int pairs : {0, 1, 100, 101}) {
    EXPECT_EQ(takes("motor.pole_pairs", [&](Parameters& p) { p.motor.pole_pairs = pairs; }),
              pairs == 1 || pairs == 100);
  }
  for (const int periods : {0, 1, 1000, 1001}) {
    EXPECT_EQ(takes("motor.cogging_periods_per_revolution",
                    [&](Parameters& p) { p.motor.cogging_periods_per_revolution = periods; }),
              periods == 1 || periods == 1000);
  }
  for (const std::int32_t counts : {0, 1, 1 << 24, (1 << 24) + 1}) {
    EXPECT_EQ(takes("encoder.counts_per_revolution", [&](Parameters& p) { p.encoder.counts_per_revolution = counts; }),
              counts == 1 || counts == 1 << 24);
  }
  for (const std::int32_t counts : {-1, 0, 131071, 131072}) {
    const bool within = counts == 0 || counts == 131071;
    EXPECT_EQ(takes("encoder.index_position_counts", [&](Parameters& p) { p.encoder.index_position_counts = counts; }),
              within);
    EXPECT_EQ(takes("encoder.index_width_counts", [&](Parameters& p) { p.encoder.index_width_counts = counts; }),
              within);
  }
  for (const double turns : {-1.0e-9, 0.0, 1.0 - 1.0e-9, 1.0}) {
    EXPECT_EQ(
        takes("encoder.commutation_offset_turns", [&](Parameters& p) { p.encoder.commutation_offset_turns = turns; }),
        turns >= 0.0 && turns < 1.0);
  }
  for (const int phases : {-1, 0, 1, 2, 3, 4}) {
    Parameters parameters;
    parameters.supply.mains_phases = phases;
    EXPECT_EQ(validate(parameters).empty(), phases == 0 || phases == 1 || phases == 3);
  }
  for (const double turns : {-1.0e-9, 0.0, 1.0 - 1.0e-9, 1.0}) {
    EXPECT_EQ(takes("load.cycle_offset_turns", [&](Parameters& p) { p.load.cycle_offset_turns = turns; }),
              turns >= 0.0 && turns < 1.0);
  }
  for (const int direction : {-2, -1, 0, 1, 2}) {
    EXPECT_EQ(takes("encoder.direction", [&](Parameters& p) { p.encoder.direction = direction; }),
              direction == 1 || direction == -1);
  }
  for (const double friction : {0.0099, 0.01, 1.0e5, 1.00001e5}) {
    EXPECT_EQ(takes("load.static_friction_nm", [&](Parameters& p) { p.load.static_friction_nm = friction; }),
              friction >= 0.01 && friction <= 1.0e5);
  }
}

TEST(ParameterRanges, OfPositions) {
  constexpr std::int64_t most = largest_position_counts;
  const auto complaints = [](auto change) {
    Parameters parameters;
    change(parameters);
    return validate(parameters).size();
  };
  for (const int sign : {1, -1}) {
    EXPECT_EQ(complaints([&](Parameters& p) { p.encoder.start_position_counts = sign * most; }), 0U);
    EXPECT_EQ(complaints([&](Parameters& p) { p.encoder.start_position_counts = sign * (most + 1); }), 1U);
  }
  EXPECT_EQ(complaints([&](Parameters& p) { p.load.high_stop_counts = most; }), 0U);
  EXPECT_EQ(complaints([&](Parameters& p) { p.load.high_stop_counts = most + 1; }), 1U);
  EXPECT_EQ(complaints([&](Parameters& p) { p.load.low_stop_counts = -most; }), 0U);
  EXPECT_EQ(complaints([&](Parameters& p) { p.load.low_stop_counts = -most - 1; }), 1U);
  // The axis begins between its stops, at most on one of them, and the stops are two counts apart.
  const auto between = [&](std::int64_t low, std::int64_t start, std::int64_t high) {
    return complaints([&](Parameters& p) {
      p.load.low_stop_counts = low;
      p.encoder.start_position_counts = start;
      p.load.high_stop_counts = high;
    });
  };
  EXPECT_EQ(between(10, 10, 20), 0U);
  EXPECT_EQ(between(10, 9, 20), 1U);
  EXPECT_EQ(between(10, 20, 20), 0U);
  EXPECT_EQ(between(10, 21, 20), 1U);
  EXPECT_EQ(between(10, 10, 12), 0U);
  EXPECT_EQ(between(10, 10, 11), 1U);
  EXPECT_EQ(between(no_low_limit, -1000, 20), 0U);
  EXPECT_EQ(between(10, 1000, no_high_limit), 0U);
}

TEST(ParameterRanges, OfSwitches) {
  const auto complaints = [](std::initializer_list<Switch> switches) {
    Parameters parameters;
    for (const Switch& one : switches) parameters.switches[parameters.switch_count++] = one;
    return validate(parameters);
  };
  EXPECT_TRUE(complaints({{.wire = 31}, {.wire = 0}}).empty());
  EXPECT_EQ(complaints({{.wire = 32}}), std::vector<std::string>{"switches[0].wire: 32 is not within 0 .. 31"});
  EXPECT_EQ(complaints({{.wire = 3}, {.wire = 4}, {.wire = 3}}),
            std::vector<std::string>{"switches[2].wire: 3 carries another switch already"});
  constexpr std::int64_t most = largest_position_counts;
  EXPECT_TRUE(complaints({{.from_counts = -most, .to_counts = most}}).empty());
  EXPECT_EQ(complaints({{.from_counts = -most - 1}}), std::vector<std::string>{"switches[0].from_counts: beyond 2^61"});
  EXPECT_EQ(complaints({{.to_counts = most + 1}}), std::vector<std::string>{"switches[0].to_counts: beyond 2^61"});
  EXPECT_TRUE(complaints({{.from_counts = 5, .to_counts = 5}}).empty());
  EXPECT_EQ(complaints({{.from_counts = 5, .to_counts = 4}}),
            std::vector<std::string>{"switches[0].to_counts: is below from_counts"});
  EXPECT_TRUE(complaints({{.hysteresis_counts = std::int64_t{1} << 31}}).empty());
  EXPECT_EQ(complaints({{.hysteresis_counts = (std::int64_t{1} << 31) + 1}}).size(), 1U);
  EXPECT_EQ(complaints({{.hysteresis_counts = -1}}).size(), 1U);
  Parameters parameters;
  for (std::size_t i = 0; i < most_switches; ++i) parameters.switches[i].wire = static_cast<std::uint8_t>(i);
  parameters.switch_count = most_switches;
  EXPECT_TRUE(validate(parameters).empty());
  parameters.switch_count = most_switches + 1;
  EXPECT_EQ(validate(parameters), std::vector<std::string>{"switch_count: at most 8"});
}

// Conditions on several parameters together.
TEST(ParameterRanges, OfWhatHasToFitTogether) {
  const auto complaint = [](auto change) {
    Parameters parameters;
    change(parameters);
    const auto messages = validate(parameters);
    return messages.empty() ? std::string() : messages.front().substr(0, messages.front().find(':'));
  };
  constexpr const char* ratio = "motor.quadrature_inductance_h / motor.direct_inductance_h";
  const auto inductance = [](double quadrature) {
    return [quadrature](Parameters& p) {
      p.motor.direct_inductance_h = 1.0e-2;
      p.motor.quadrature_inductance_h = quadrature;
    };
  };
  EXPECT_EQ(complaint(inductance(1.001e-3)), "");
  EXPECT_EQ(complaint(inductance(0.999e-3)), ratio);
  EXPECT_EQ(complaint(inductance(0.0999)), "");
  EXPECT_EQ(complaint(inductance(0.1001)), ratio);
  // h p flux sqrt(phases / 2 / (J L)) = 1, with p flux = kt / (phases / 2 sqrt(2)).
  const double inertia = 1.0e-4, henry = 1.0e-2;
  for (const int phases : {2, 3}) {
    const double greatest = 0.5 * phases * std::sqrt(2.0) * std::sqrt(inertia * henry / (0.5 * phases)) / 62.5e-6;
    const auto torque_constant = [&](double share) {
      return [=](Parameters& p) {
        p.motor.phases = phases;
        p.motor.rotor_inertia_kgm2 = inertia;
        p.motor.direct_inductance_h = henry;
        p.motor.quadrature_inductance_h = 2.0 * henry;
        p.motor.torque_constant_nm_per_a = share * greatest;
      };
    };
    EXPECT_EQ(complaint(torque_constant(0.999)), "") << phases;
    EXPECT_EQ(complaint(torque_constant(1.001)), "motor.torque_constant_nm_per_a") << phases;
  }
  // h sqrt(cogging periods / J) = 1.
  const auto cogging = [&](double share) {
    return [=](Parameters& p) {
      p.motor.rotor_inertia_kgm2 = inertia;
      p.motor.cogging_periods_per_revolution = 100;
      p.motor.cogging_torque_nm = share * inertia / 100.0 / (62.5e-6 * 62.5e-6);
    };
  };
  EXPECT_EQ(complaint(cogging(0.999)), "");
  EXPECT_EQ(complaint(cogging(1.001)), "motor.cogging_torque_nm");
  // The same with harmonics: the products of amplitude and periods add up.
  const auto harmonics = [&](double share) {
    return [=](Parameters& p) {
      p.motor.rotor_inertia_kgm2 = inertia;
      p.motor.cogging[0] = {.torque_nm = 0.5 * share * inertia / 100.0 / (62.5e-6 * 62.5e-6), .periods = 100};
      p.motor.cogging[1] = {.torque_nm = share * inertia / 100.0 / (62.5e-6 * 62.5e-6), .periods = 50};
      p.motor.cogging_count = 2;
    };
  };
  EXPECT_EQ(complaint(harmonics(0.999)), "");
  EXPECT_EQ(complaint(harmonics(1.001)), "motor.cogging_torque_nm");
  EXPECT_EQ(complaint([](Parameters& p) { p.motor.cogging_count = 7; }), "motor.cogging_count");
  EXPECT_EQ(complaint([](Parameters& p) {
              p.motor.cogging_count = 2;
              p.motor.cogging[1].phase_turns = 1.0;
            }),
            "motor.cogging[1].phase_turns");
  // h sqrt(weight / revolutions of the cycle / J) = 1, with J of rotor and load, or of an elastic load alone.
  for (const bool elastic : {false, true}) {
    const auto weight = [&](double arm_share, double crank_share) {
      return [=](Parameters& p) {
        p.load.elastic = elastic;
        p.load.inertia_kgm2 = 2.0e-4;
        p.load.cycle_revolutions = 3.0;
        const double greatest = (elastic ? 2.0e-4 : 2.28e-4) * 3.0 / (62.5e-6 * 62.5e-6);
        p.load.arm_torque_nm = -arm_share * greatest;
        p.load.crank_ratio = 0.25;
        p.load.crank_torque_nm = crank_share * greatest / 1.25;
      };
    };
    EXPECT_EQ(complaint(weight(0.5, 0.499)), "");
    EXPECT_EQ(complaint(weight(0.5, 0.501)), "load.arm_torque_nm");
    EXPECT_EQ(complaint(weight(0.0, 1.001)), "load.crank_torque_nm");
  }
  // Saturated windings and cold magnets make the rotor oscillate faster.
  const auto saturated = [&](double share) {
    return [=](Parameters& p) {
      const double greatest = 1.5 * std::sqrt(2.0) * std::sqrt(inertia * 0.25 * henry / 1.5) / 62.5e-6;
      p.motor.rotor_inertia_kgm2 = inertia;
      p.motor.direct_inductance_h = p.motor.quadrature_inductance_h = henry;
      p.motor.quadrature_saturation_a = 5.0;
      p.motor.saturated_inductance_share = 0.25;
      p.motor.magnet_temperature_coefficient = 1.0e-3;
      p.motor.torque_constant_nm_per_a = share * greatest / 1.085;  // at -60 degC
    };
  };
  EXPECT_EQ(complaint(saturated(0.999)), "");
  EXPECT_EQ(complaint(saturated(1.001)), "motor.torque_constant_nm_per_a");
  // An elastic load has an inertia.
  EXPECT_EQ(complaint([](Parameters& p) { p.load.inertia_kgm2 = 0.0; }), "");
  for (const double load : {0.9e-8, 1.0e-8}) {
    EXPECT_EQ(complaint([&](Parameters& p) {
                p.load.elastic = true;
                p.load.inertia_kgm2 = load;
              }),
              load < 1.0e-8 ? "load.inertia_kgm2" : "");
  }
}

}  // namespace
}  // namespace parameter_ranges_test
}  // namespace servodrome::plant
