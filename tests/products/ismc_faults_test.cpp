#include <set>

#include "csv.hpp"
#include "fault_cases.hpp"
#include "products/ismc/ismc.hpp"

// Every fault of the ISMC manual (tests/data/ismc_alarms.csv), caused in the drive or its surroundings.
namespace servodrome {
namespace ismc_faults_test {
namespace {

using drive::Cause;
using plant::Injection;
using products::Ismc;
using test::Cut;
using test::Gone;
using test::Reset;
using Axis = test::Rig<Ismc>;
using Case = test::FaultCase<Ismc>;
using Action = Case::Action;

constexpr std::int64_t speed = 500000;  // counts/s: 95 ms of quick stop

void must_set(Axis& axis, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  EXPECT_EQ(axis.set(index, sub, value), dictionary::AbortCode::none) << std::hex << index << "h:" << int{sub};
}

// --- The state of the axis when the fault occurs

void turning(Axis& axis) {
  must_set(axis, 0x6060, 0, 3);
  axis.enable();
  must_set(axis, 0x60FF, 0, speed);
  axis.run_ms(600);
  EXPECT_NEAR(static_cast<double>(axis.get(0x606C)), speed, 0.02 * speed);
}

void turning_under_load(Axis& axis) {
  turning(axis);
  axis.plant.set_external_torque_nm(0.5);
  axis.run_ms(200);
}

void positioning(Axis& axis) {
  must_set(axis, 0x6060, 0, 1);
  must_set(axis, 0x6081, 0, speed);
  axis.enable();
  must_set(axis, 0x607A, 0, 100000000);
  axis.control(0x1F);
  axis.run_ms(600);
  axis.control(0x0F);
  axis.run_ms(1);
}

void positioning_jerk_limited(Axis& axis) {
  must_set(axis, 0x6086, 0, 3);
  must_set(axis, 0x60A4, 1, 13107200);
  positioning(axis);
}

Action standing(std::int8_t mode) {
  return [mode](Axis& axis) {
    must_set(axis, 0x6060, 0, mode);
    axis.enable();
  };
}

void ready_to_home(Axis& axis) {
  must_set(axis, 0x6099, 1, 100000);
  must_set(axis, 0x6099, 2, 1000);
  must_set(axis, 0x609A, 0, 1310720);
  must_set(axis, 0x6098, 0, 34);
  standing(6)(axis);
}

// --- The cause of the fault

void command_point(Axis& axis) {
  must_set(axis, 0x607A, 0, 2000);
  axis.control(0x3F);
}

Action point_with(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  return [=](Axis& axis) {
    must_set(axis, index, sub, value);
    command_point(axis);
  };
}

Action point_with_limits(std::uint16_t index, std::int64_t low, std::int64_t high) {
  return [=](Axis& axis) {
    must_set(axis, index, 1, low);
    must_set(axis, index, 2, high);
    command_point(axis);
  };
}

Action velocity_with(std::uint16_t index, std::int64_t value) {
  return [=](Axis& axis) {
    must_set(axis, index, 0, value);
    must_set(axis, 0x60FF, 0, speed / 2);
  };
}

Action homing_with(std::int8_t method) {
  return [method](Axis& axis) {
    must_set(axis, 0x6098, 0, method);
    axis.control(0x1F);
  };
}

// A load that accelerates the shaft until the drive detects it.
void pull_until_fault(Axis& axis) {
  axis.plant.set_external_torque_nm(-12.0);
  axis.run_until([&axis] { return axis.get(0x603F) != 0; }, 100.0);
  axis.plant.set_external_torque_nm(0.0);
}

Action inject(Injection injection) {
  return [injection](Axis& axis) { axis.plant.inject(injection, true); };
}
Action take_back(Injection injection) {
  return [injection](Axis& axis) { axis.plant.inject(injection, false); };
}
Action input(int wire, bool level) {
  return [=](Axis& axis) { axis.plant.force_input(wire, level); };
}
Action input_function(int wire, std::uint8_t function) {
  return [=](Axis& axis) {
    must_set(axis, 0x2F12, static_cast<std::uint8_t>(wire + 1), function);
    turning(axis);
  };
}

Case injected(std::uint16_t code, Injection injection, Cut cut, Reset reset = Reset::by_controlword) {
  return {code, turning, inject(injection), take_back(injection), Gone::when_removed, cut, reset};
}

// The shorted phase carries the sum of the other two currents: its comparator responds first, if it does so before the
// current loop reaches its limits.
Case shorted(std::uint16_t code, Injection injection) {
  return {.code = code,
          .prepare = turning,
          .raise = inject(injection),
          .remove = take_back(injection),
          .cut = Cut::at_once,
          .comparator_a = 5.0};
}

// Causes that exist neither in the plant nor in the objects: the drive's own commissioning, and codes that the manual's
// drive without an end velocity object cannot raise (G19).
Case hardware_only(std::uint16_t code, Cause cause, Cut cut) {
  return {code,
          turning,
          [cause](Axis& axis) { axis.device.drive().inject(cause, true); },
          [cause](Axis& axis) { axis.device.drive().inject(cause, false); },
          Gone::when_removed,
          cut};
}

// An index pulse of the encoder at a wrong position.
void index_pulse_at(Axis& axis, std::int64_t position) {
  axis.feedback.edges[0] = {drive::Edge::index_source, true, position};
  axis.feedback.edge_count = 1;
  axis.tick();
}

std::vector<Case> cases() {
  const auto at_once = Cut::at_once;
  const auto option = Cut::by_option_code;
  return {
      injected(0x2230, Injection::bus_overcurrent, at_once),
      shorted(0x2310, Injection::short_phase_u),
      shorted(0x2311, Injection::short_phase_v),
      injected(0x2320, Injection::short_circuit, at_once),
      shorted(0x2320, Injection::short_phase_w),
      {0x3130, turning_under_load, inject(Injection::open_phase_u), take_back(Injection::open_phase_u),
       Gone::with_reaction, at_once, Reset::by_controlword, 2000.0, "phase U"},
      {0x3130, turning_under_load, inject(Injection::open_phase_w), take_back(Injection::open_phase_w),
       Gone::with_reaction, at_once, Reset::by_controlword, 2000.0, "phase W"},
      {0x3210, turning,
       [](Axis& axis) {
         axis.plant.inject(Injection::chopper_broken, true);
         axis.plant.set_supply_v(450.0);
       },
       [](Axis& axis) {
         axis.plant.set_supply_v(310.0);
         axis.plant.discharge_dc_link();
       },
       Gone::when_removed, option},
      {0x3220, turning,
       [](Axis& axis) {
         axis.plant.inject(Injection::supply_loss, true);
         axis.plant.discharge_dc_link();
       },
       take_back(Injection::supply_loss), Gone::with_reaction, at_once},
      injected(0x3221, Injection::gate_supply_low, at_once),
      {0x4110, turning, [](Axis& axis) { axis.plant.set_ambient_c(70.0); },
       [](Axis& axis) { axis.plant.set_ambient_c(25.0); }, Gone::when_removed, option},
      {0x4120, turning, [](Axis& axis) { axis.plant.set_ambient_c(-30.0); },
       [](Axis& axis) { axis.plant.set_ambient_c(25.0); }, Gone::when_removed, option},
      injected(0x4310, Injection::stage_overheat, option),
      hardware_only(0x6180, Cause::profile_duration, option),
      hardware_only(0x6181, Cause::profile_end_velocity_above_start, option),
      {0x6182, positioning,
       [](Axis& axis) {  // another point that is passed without a deceleration
         must_set(axis, 0x6084, 0, 0);
         must_set(axis, 0x607A, 0, 2000);
         axis.control(0x23F);
       }},
      hardware_only(0x6184, Cause::homing_state, option),
      {.code = 0x6280,
       .prepare = standing(6),
       .raise = homing_with(33),
       .variant = "speeds and acceleration of homing as from the factory"},
      {.code = 0x6280,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x6086, 0, 3);
             must_set(axis, 0x60A4, 1, 0);
             must_set(axis, 0x6081, 0, speed);
             standing(1)(axis);
           },
       .raise = command_point,
       .variant = "jerk"},
      hardware_only(0x6281, Cause::end_velocity_above_profile, option),
      hardware_only(0x6282, Cause::end_velocity_unreachable, option),
      {.code = 0x6283, .prepare = positioning, .raise = point_with_limits(0x607D, 10, -10), .variant = "min > max"},
      {.code = 0x6283, .prepare = positioning, .raise = point_with_limits(0x607D, 10, 10), .variant = "min = max"},
      {.code = 0x6283,
       .prepare = positioning,
       .raise =
           [](Axis& axis) {
             must_set(axis, 0x607B, 1, -1000000000);
             must_set(axis, 0x607B, 2, 1000000000);
             must_set(axis, 0x607D, 1, -1000000001);
             must_set(axis, 0x607D, 2, 1000000000);
             command_point(axis);
           },
       .variant = "outside of 607Bh"},
      {.code = 0x6284, .prepare = positioning, .raise = point_with_limits(0x607B, 10, -10)},
      {.code = 0x6285, .prepare = turning, .raise = velocity_with(0x2117, 1)},
      {.code = 0x6286, .prepare = positioning, .raise = point_with(0x6086, 0, 1), .variant = "position, 1"},
      {.code = 0x6286, .prepare = positioning, .raise = point_with(0x6086, 0, 2), .variant = "position, 2"},
      {.code = 0x6286, .prepare = turning, .raise = velocity_with(0x6086, -1), .variant = "velocity, -1"},
      {.code = 0x6287,
       .prepare = standing(4),
       .raise = [](Axis& axis) { must_set(axis, 0x6088, 0, 1); },
       .variant = "1"},
      {.code = 0x6287,
       .prepare = standing(4),
       .raise = [](Axis& axis) { must_set(axis, 0x6088, 0, -1); },
       .variant = "-1"},
      {.code = 0x6288,
       .prepare = ready_to_home,
       .raise =
           [](Axis& axis) {
             axis.control(0x1F);
             axis.run_ms(100);
             axis.plant.force_input(1, true);
           },
       .remove = input(1, false)},
      {.code = 0x6289, .prepare = ready_to_home, .raise = homing_with(15), .variant = "15"},
      {.code = 0x6289, .prepare = ready_to_home, .raise = homing_with(0), .variant = "0"},
      {.code = 0x6289, .prepare = ready_to_home, .raise = homing_with(37), .variant = "37"},
      {.code = 0x628B,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x2F11, 0, 100);
             ready_to_home(axis);
           },
       .raise = [](Axis& axis) { axis.control(0x1F); }},
      {.code = 0x628C, .prepare = positioning_jerk_limited, .raise = command_point, .variant = "position"},
      {.code = 0x628C, .prepare = turning, .raise = velocity_with(0x6086, 3), .variant = "velocity"},
      {.code = 0x6542, .prepare = positioning, .raise = point_with(0x6084, 0, 0), .variant = "6084h"},
      {.code = 0x6542, .prepare = positioning, .raise = point_with(0x6085, 0, 0), .variant = "6085h"},
      {.code = 0x6551, .prepare = positioning, .raise = point_with(0x6081, 0, 0), .variant = "moving"},
      {.code = 0x6551, .prepare = standing(1), .raise = command_point, .variant = "6081h as from the factory"},
      {.code = 0x6552, .prepare = positioning, .raise = point_with(0x6083, 0, 0), .variant = "position"},
      {.code = 0x6552, .prepare = turning, .raise = velocity_with(0x6083, 0), .variant = "velocity"},
      {.code = 0x6553, .prepare = standing(8), .raise = [](Axis& axis) { must_set(axis, 0x60C2, 1, 0); }},
      {.code = 0x6572, .prepare = turning, .raise = velocity_with(0x6084, 0), .variant = "6084h"},
      {.code = 0x6572, .prepare = turning, .raise = velocity_with(0x6085, 0), .variant = "6085h"},
      {0x7124, input_function(3, 5), input(3, true), input(3, false), Gone::when_removed},
      {.code = 0x7320,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x2F18, 0, 1);
             must_set(axis, 0x2001, 0, 100);
             must_set(axis, 0x60B8, 0, 0x17);  // continuous, index, rising edge
             turning(axis);
           },
       .raise =
           [](Axis& axis) {
             const std::int64_t here = axis.plant.position_counts();
             index_pulse_at(axis, here);
             index_pulse_at(axis, here + 131072 + 101);
           }},
      injected(0x7380, Injection::encoder_loss, at_once),
      injected(0x7383, Injection::encoder_multi_turn, at_once, Reset::by_power_cycle),
      injected(0x7384, Injection::encoder_overheat, option),
      injected(0x7385, Injection::encoder_count, at_once, Reset::by_power_cycle),
      injected(0x7389, Injection::encoder_overflow, at_once, Reset::by_power_cycle),
      injected(0x738A, Injection::encoder_crc, at_once),
      injected(0x738B, Injection::encoder_delimiter, at_once, Reset::by_power_cycle),
      injected(0x738C, Injection::hall_wiring, at_once),
      {.code = 0x8482,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x6083, 0, 13107200);
             must_set(axis, 0x6084, 0, 13107200);
             must_set(axis, 0x6080, 0, 1000);
             standing(3)(axis);
             must_set(axis, 0x60FF, 0, 2180000);  // 998 rpm
             axis.run_ms(800);
           },
       .raise = [](Axis& axis) { pull_until_fault(axis); },
       .remove = [](Axis& axis) { axis.plant.set_coulomb_friction_nm(5.0); }},  // so that it coasts
      {.code = 0x8483,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x2200, 1, 10000);
             must_set(axis, 0x2200, 2, 50);
             standing(3)(axis);
           },
       .raise =
           [](Axis& axis) {
             axis.plant.lock_rotor(true);
             must_set(axis, 0x60FF, 0, speed);
           },
       .remove = [](Axis& axis) { axis.plant.lock_rotor(false); }},
      {.code = 0x8611,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x6065, 0, 5000);
             must_set(axis, 0x6066, 0, 20);
             positioning(axis);
           },
       .raise = [](Axis& axis) { axis.plant.lock_rotor(true); },
       .remove = [](Axis& axis) { axis.plant.lock_rotor(false); }},
      {.code = 0x8612, .prepare = positioning, .raise = point_with_limits(0x607D, -1999, 1999), .variant = "target"},
      {.code = 0x8612,
       .prepare = positioning,
       .raise =
           [](Axis& axis) {
             must_set(axis, 0x607D, 1, -1000);
             must_set(axis, 0x607D, 2, axis.get(0x6064) + 10000);
           },
       .variant = "actual position"},
      hardware_only(0x8620, Cause::calibration, at_once),
      {.code = 0x8700,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x1006, 0, 1000);
             must_set(axis, 0x60C2, 1, 1);
             standing(8)(axis);
             for (std::int32_t i = 1; i <= 400; ++i) {
               must_set(axis, 0x607A, 0, std::min(i, 300) * std::min(i, 300) / 2);
               axis.send(0x80, {});
               axis.run_ms(1);
             }
           },
       .raise = [](Axis&) {},
       .reset = Reset::by_power_cycle},
      {.code = 0x8900,
       .prepare =
           [](Axis& axis) {
             must_set(axis, 0x2017, 0, 2);
             standing(4)(axis);
           },
       .raise =
           [](Axis& axis) {
             axis.plant.lock_rotor(true);
             must_set(axis, 0x6071, 0, 3000);
           },
       .within_ms = 4000.0},
      hardware_only(0x8901, Cause::not_calibrated, at_once),
      {0x9100, input_function(4, 4), input(4, true), input(4, false), Gone::when_removed},
      hardware_only(0xB010, Cause::angle_jitter, at_once),
      hardware_only(0xB020, Cause::angle_no_motion, at_once),
      hardware_only(0xB030, Cause::angle_excess, at_once),
      hardware_only(0xB040, Cause::angle_timeout, at_once),
      hardware_only(0xB102, Cause::phase_sequence, at_once),
      injected(0xB104, Injection::hall_state, at_once),
  };
}

TEST(IsmcFaults, EveryRowOfTheManualByItsCause) {
  std::set<std::uint16_t> in_manual;
  const std::vector<Case> all = cases();
  for (const test::CsvRow& row : test::read_csv("ismc_alarms.csv")) {
    const auto code = static_cast<std::uint16_t>(std::stoul(row.at("code"), nullptr, 16));
    const auto error_register = static_cast<std::uint8_t>(std::stoul(row.at("error_register"), nullptr, 16));
    const bool restart = row.at("reset").find("estart") != std::string::npos;
    in_manual.insert(code);
    SCOPED_TRACE(row.at("code") + " " + row.at("name"));
    int found = 0;
    for (const Case& fault : all) {
      if (fault.code != code) continue;
      ++found;
      EXPECT_EQ(fault.reset == Reset::by_power_cycle, restart);
      for (std::int16_t option_code = 0; option_code <= 3; ++option_code) {
        test::check_fault(fault, error_register, option_code);
      }
    }
    EXPECT_GT(found, 0) << "no test";
  }
  EXPECT_EQ(in_manual.size(), 57U);
  for (const Case& fault : all) EXPECT_TRUE(in_manual.contains(fault.code)) << std::hex << fault.code;
  for (const drive::FaultRow& row : Ismc::policy.faults.rows) {
    if (row.cause == Cause::communication_lost || row.cause == Cause::memory) continue;  // G4, G32: not in its table
    EXPECT_TRUE(in_manual.contains(row.code)) << std::hex << row.code;
  }
}

TEST(IsmcFaults, HomingErrorShowsInBit13UntilItIsReset) {
  Axis axis;
  ready_to_home(axis);
  homing_with(15)(axis);
  axis.run_ms(2);
  EXPECT_EQ(axis.status() & 0x204F, 0x2008);
  axis.control(0x80);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & 0x204F, 0x0040);
}

TEST(IsmcFaults, LoadThatRunsAwayWithTheMotorIsOverSpeed) {
  Axis axis;
  standing(3)(axis);
  must_set(axis, 0x60E0, 0, 0);
  must_set(axis, 0x60E1, 0, 0);
  axis.plant.set_external_torque_nm(-1.0);
  ASSERT_GE(axis.run_until([&] { return (axis.status() & 0x4F) == 0x08; }, 1000.0), 0);
  EXPECT_EQ(axis.get(0x603F), 0x8482);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 1.2 * 6000.0, 150.0);  // 170 rpm in a millisecond
  EXPECT_FALSE(axis.actuation.pwm_enabled);
  axis.control(0x80);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & 0x4F, 0x08) << "it still turns too fast";
}

TEST(IsmcFaults, OverloadIsWatchedOnlyIfSwitchedOn) {
  Axis axis;
  standing(4)(axis);
  axis.plant.lock_rotor(true);
  must_set(axis, 0x6071, 0, 3000);
  axis.run_ms(6000);
  EXPECT_EQ(axis.device.drive().state(), drive::PowerState::operation_enabled);
}

TEST(IsmcFaults, ASecondFaultWhileTheFirstIsReactedToIsReportedToo) {
  Axis axis;
  must_set(axis, 0x605E, 0, 2);
  turning(axis);
  axis.sent.clear();
  axis.plant.set_ambient_c(70.0);
  axis.run_ms(20);
  EXPECT_TRUE(axis.actuation.pwm_enabled);
  axis.plant.inject(Injection::encoder_loss, true);  // no ramp without an encoder
  axis.run_ms(1);
  EXPECT_FALSE(axis.actuation.pwm_enabled);
  EXPECT_EQ(test::emergencies(axis, 1),
            (std::vector<std::string>{test::emergency_text(0x4110, 0x09), test::emergency_text(0x7380, 0x29)}));
  EXPECT_EQ(axis.get(0x603F), 0x7380);
  EXPECT_EQ(axis.get(0x1003, 0), 2);
  EXPECT_EQ(axis.get(0x1003, 1) & 0xFFFF, 0x7380);
  EXPECT_EQ(axis.get(0x1003, 2) & 0xFFFF, 0x4110);
  axis.plant.inject(Injection::encoder_loss, false);
  axis.run_ms(10);
  axis.control(0x80);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & 0x4F, 0x08) << "one of two causes is still there";
  axis.plant.set_ambient_c(25.0);
  axis.control(0x00);
  axis.run_ms(1);
  axis.control(0x80);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & 0x4F, 0x40);
}

}  // namespace
}  // namespace ismc_faults_test
}  // namespace servodrome
