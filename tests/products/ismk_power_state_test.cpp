#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"

// Table 5-2 of the iSMK manual with its low bytes of the statusword, the stop modes 605Ah to 605Eh and the brake.
namespace servodrome {
namespace ismk_power_state_test {
namespace {

using drive::PowerState;
using test::IsmkRig;

int low_byte(IsmkRig& rig) { return rig.status() & 0xFF; }

void command(IsmkRig& rig, std::uint16_t word, double ms = 2.0) {
  rig.control(word);
  rig.run_ms(ms);
}

struct Step {
  std::uint16_t controlword;
  int low_byte;
};

// Table 5-2, with its numbers of the transitions.
TEST(IsmkPowerState, TheTableOfTransitions) {
  const std::vector<std::vector<Step>> walks{
      {{0x06, 0x31}, {0x07, 0x33}, {0x0F, 0x37}},                // 2, 3, 4
      {{0x0F, 0x37}, {0x07, 0x33}, {0x06, 0x31}, {0x00, 0x70}},  // 5, 6, 7
      {{0x0F, 0x37}, {0x06, 0x31}},                              // 8
      {{0x0F, 0x37}, {0x00, 0x70}, {0x06, 0x31}},                // 9, 2
      {{0x07, 0x33}, {0x00, 0x70}},                              // 10
      {{0x0F, 0x37}, {0x02, 0x70}},                              // 11, and immediately 12: 605Ah is 0
      {{0x0F, 0x37}, {0x0B, 0x70}, {0x06, 0x31}, {0x0F, 0x37}},  // the word of Table 5-18, 605Ah
      {{0x00, 0x70}, {0x0F, 0x70}, {0x07, 0x70}},                // only 6 leaves Disable
      {{0x2F, 0x37}},                                            // directly from Ready
      {{0x86, 0x31}, {0x0F, 0x37}},
  };
  for (const auto& walk : walks) {
    IsmkRig rig;
    rig.run_ms(5);
    ASSERT_EQ(low_byte(rig), 0x31) << "6040h is 6 from the start (Table 5-3, C1)";
    for (const Step& step : walk) {
      command(rig, step.controlword);
      EXPECT_EQ(low_byte(rig), step.low_byte) << std::hex << step.controlword;
    }
  }
}

TEST(IsmkPowerState, PowerOnIsHealthy) {
  IsmkRig rig;
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x6040), 6);
  EXPECT_EQ(rig.get(0x6060), -4);
  EXPECT_EQ(rig.get(0x2601), 0);
  EXPECT_EQ(rig.get(0x2602), 0);
  EXPECT_EQ(rig.status() & ~0x0200, 0x4031);  // commutation found, no home
  EXPECT_EQ(rig.get(0x6061), -4);
}

// Table 5-2: fault, and its reset, which ends in Ready because the word contains 6.
TEST(IsmkPowerState, AFaultIsResetToReady) {
  IsmkRig rig;
  rig.run_ms(5);
  command(rig, 0x0F);
  rig.device.drive().inject(drive::Cause::power_stage_hot, true);
  rig.run_ms(2);
  EXPECT_EQ(low_byte(rig), 0x38);
  EXPECT_EQ(rig.get(0x603F), 0x4210);
  command(rig, 0x86);
  EXPECT_EQ(low_byte(rig), 0x38) << "the cause is still there (Table 5-2)";
  rig.device.drive().inject(drive::Cause::power_stage_hot, false);
  rig.run_ms(2);
  command(rig, 0x86);
  EXPECT_EQ(low_byte(rig), 0x38) << "only an edge resets (Table 5-4)";
  command(rig, 0x06);
  command(rig, 0x86);
  EXPECT_EQ(low_byte(rig), 0x31);
  EXPECT_EQ(rig.get(0x603F), 0);
}

// --- Stops

// Turns at 1000 rpm in immediate speed mode.
struct Turning : IsmkRig {
  explicit Turning(const plant::Parameters& parameters = test::ismk_plant())
      : IsmkRig(parameters, test::ismk_settings()) {
    run_ms(5);
    set(0x6060, 0, -3);
    set(0x60FF, 0, 17895697);
    control(0x0F);
    run_ms(200);
    EXPECT_NEAR(rpm(), 1000.0, 20.0);
  }
  double rpm() { return device.drive().axis().velocity() * 60.0 / 65536.0; }
  // Milliseconds until the shaft turns at less than 10 rpm.
  double stop_ms(double limit_ms = 60000.0) {
    const std::int64_t ticks = run_until([this] { return std::abs(rpm()) < 10.0; }, limit_ms);
    return ticks < 0 ? limit_ms : static_cast<double>(ticks) / 16.0;
  }
};

struct Stopping {
  const char* name;
  std::uint16_t option;  // index of the option code
  std::uint16_t word;    // controlword that triggers it
  int after;             // low byte of the statusword afterwards
};

// 100 rps/s from 1000 rpm (16.67 rps) are 166.7 ms, 610 rps/s 27.3 ms.
constexpr double ramp_ms = 166.7;
constexpr double quick_ramp_ms = 27.3;

TEST(IsmkStops, EveryOptionCodeOfEveryTrigger) {
  const std::vector<Stopping> triggers{
      {"quick stop", 0x605A, 0x02, 0x70},
      {"shutdown", 0x605B, 0x06, 0x31},
      {"disable", 0x605C, 0x07, 0x33},
  };
  for (const Stopping& trigger : triggers) {
    for (const int code : {0, 1, 2, 5, 6, 18}) {
      const bool stays = trigger.option == 0x605A && code >= 5;
      SCOPED_TRACE(testing::Message() << trigger.name << " " << code);
      Turning rig;
      rig.set(0x607F, 0, 89478485);
      if (trigger.option != 0x605A && (code == 5 || code == 6)) {
        EXPECT_EQ(rig.set(trigger.option, 0, code), dictionary::AbortCode::value_invalid);
        continue;
      }
      ASSERT_EQ(rig.set(trigger.option, 0, code), dictionary::AbortCode::none);
      rig.control(trigger.word);
      rig.run_ms(1.5);
      if (trigger.option == 0x605A && code != 0) {
        EXPECT_EQ(low_byte(rig), 0x50);
      }
      EXPECT_EQ(rig.actuation.short_circuit, code == 18);
      const double took = rig.stop_ms(2000.0) + 1.5;
      rig.run_ms(20);
      switch (code) {
        case 0: EXPECT_GT(took, 500.0) << "coasts"; break;
        case 1:
        case 5: EXPECT_NEAR(took, ramp_ms, 6.0); break;
        case 2:
        case 6: EXPECT_NEAR(took, quick_ramp_ms, 6.0); break;
        // The windings stop a light rotor quickly; the heavy load is tested below.
        default: EXPECT_GT(took, 2.0); EXPECT_LT(took, quick_ramp_ms);
      }
      if (code != 0) {
        EXPECT_EQ(low_byte(rig), stays ? 0x50 : trigger.after);
      }
      EXPECT_EQ(rig.device.drive().energised(), stays);
    }
  }
}

// Ch. 5.6.3, Table 5-2, C4: leaves the held quick stop with 06 and then 0F; directly with 0F only for 5 and 6.
TEST(IsmkStops, LeavingAHeldQuickStop) {
  for (const int code : {5, 6, 18}) {
    SCOPED_TRACE(code);
    Turning rig;
    rig.set(0x605A, 0, code);
    command(rig, 0x02, 500.0);
    ASSERT_EQ(low_byte(rig), 0x50);
    command(rig, 0x0F);
    EXPECT_EQ(low_byte(rig), code == 18 ? 0x50 : 0x37);
    command(rig, 0x02, 500.0);
    command(rig, 0x06);
    EXPECT_EQ(low_byte(rig), 0x31);
    EXPECT_FALSE(rig.device.drive().energised());
    command(rig, 0x0F);
    EXPECT_EQ(low_byte(rig), 0x37);
    command(rig, 0x02, 500.0);
    command(rig, 0x00);
    EXPECT_EQ(low_byte(rig), 0x70);
  }
  // On its way to Disable neither word cancels it.
  Turning rig;
  rig.set(0x605A, 0, 1);
  command(rig, 0x02, 20.0);
  command(rig, 0x06, 20.0);
  command(rig, 0x0F, 20.0);
  EXPECT_EQ(low_byte(rig), 0x50);
  rig.run_ms(200.0);
  EXPECT_EQ(low_byte(rig), 0x70);
}

// The short circuit brakes faster than friction and, with a heavy load, more slowly than the quick stop ramp: the
// motor's resistance limits the braking torque.
TEST(IsmkStops, ShortCircuitBrakingLiesBetweenCoastingAndTheRamp) {
  plant::Parameters heavy = test::ismk_plant();
  heavy.load.inertia_kgm2 = 20.0 * heavy.motor.rotor_inertia_kgm2;
  const auto stop_with = [&heavy](int code) {
    Turning rig(heavy);
    rig.set(0x605B, 0, code);
    rig.control(0x06);
    rig.run_ms(1.5);
    if (code != 2) return rig.stop_ms(20000.0) + 1.5;
    // The ramp of the demand; how well a load follows depends on the gains.
    const std::int64_t ticks = rig.run_until([&rig] { return !rig.device.drive().in_motion(); }, 1000.0);
    return static_cast<double>(ticks) / 16.0 + 1.5;
  };
  const double coasting = stop_with(0);
  const double ramp = stop_with(2);
  const double windings = stop_with(18);
  std::printf("stop from 1000 rpm, 20 times the rotor: coasting %.0f ms, windings %.0f ms, 6085h %.0f ms\n", coasting,
              windings, ramp);
  EXPECT_NEAR(ramp, quick_ramp_ms, 6.0);
  EXPECT_GT(windings, 1.5 * ramp);
  EXPECT_LT(windings, 0.1 * coasting);
}

// 605Dh, and bit 8, which torque mode ignores (Table 5-4).
TEST(IsmkStops, Halt) {
  for (const int code : {1, 2}) {
    Turning rig;
    rig.set(0x605D, 0, code);
    rig.control(0x10F);
    EXPECT_NEAR(rig.stop_ms(), code == 1 ? ramp_ms : quick_ramp_ms, 6.0);
    EXPECT_EQ(low_byte(rig), 0x37);
    rig.run_ms(20);
    EXPECT_NE(rig.status() & 0x0400, 0) << "zero speed reached";
    command(rig, 0x0F, 100.0);
    EXPECT_NEAR(rig.rpm(), 1000.0, 20.0);
  }
  plant::Parameters heavy = test::ismk_plant();
  heavy.load.inertia_kgm2 = 20.0 * heavy.motor.rotor_inertia_kgm2;
  IsmkRig rig(heavy, test::ismk_settings());
  rig.run_ms(5);
  rig.set(0x6060, 0, 4);
  rig.set(0x6071, 0, 100);
  command(rig, 0x0F, 100.0);
  command(rig, 0x10F, 200.0);
  EXPECT_NEAR(static_cast<double>(rig.device.drive().axis().torque()), 0.1, 0.02);
}

// 605Eh (Table 5-18): 603Fh and Fault as soon as the stop is over.
TEST(IsmkStops, FaultReaction) {
  for (const int code : {0, 1, 2, 18}) {
    SCOPED_TRACE(code);
    Turning rig;
    rig.set(0x605E, 0, code);
    rig.device.drive().inject(drive::Cause::power_stage_hot, true);
    rig.run_ms(1.5);
    EXPECT_EQ(low_byte(rig), 0x38);
    EXPECT_EQ(rig.device.drive().energised(), code != 0);
    const double took = rig.stop_ms(1000.0);
    if (code == 1) {
      EXPECT_NEAR(took, ramp_ms, 6.0);
    }
    if (code == 2) {
      EXPECT_NEAR(took, quick_ramp_ms, 6.0);
    }
    if (code == 0) {
      EXPECT_GT(took, 500.0);
    }
    rig.run_ms(20);
    EXPECT_EQ(rig.device.drive().state() == PowerState::fault, true);
    EXPECT_FALSE(rig.device.drive().energised());
  }
}

// --- The brake (ch. 5.6.2)

struct Braked : IsmkRig {
  static plant::Parameters plant() {
    plant::Parameters parameters = test::ismk_plant();
    parameters.motor.brake_torque_nm = 1.5;
    parameters.motor.brake_engage_ms = 100.0;
    parameters.motor.brake_release_ms = 50.0;
    parameters.load.gravity_torque_nm = 0.5;
    return parameters;
  }
  Braked() : IsmkRig(plant(), test::ismk_settings()) {
    run_ms(5);
    set(0x6410, 0x17, 1);
    set(0x6060, 0, 3);
  }
};

TEST(IsmkBrake, MotionWaitsForTheBrakeToOpen) {
  Braked rig;
  rig.set(0x60FF, 0, 1789570);
  rig.control(0x0F);
  rig.run_ms(2);
  EXPECT_EQ(low_byte(rig), 0x37);
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  EXPECT_TRUE(rig.actuation.brake_released);
  rig.run_ms(145);
  EXPECT_FALSE(rig.device.drive().in_motion());
  rig.run_ms(10);
  EXPECT_TRUE(rig.device.drive().in_motion());
}

TEST(IsmkBrake, WithoutARampTheAxisIsHeldUntilTheBrakeCloses) {
  Braked rig;
  command(rig, 0x0F, 400.0);
  const drive::Counts held = rig.device.drive().axis().position();
  rig.control(0x06);
  rig.run_ms(2);
  EXPECT_FALSE(rig.actuation.brake_released) << "cut at once";
  EXPECT_TRUE(rig.actuation.pwm_enabled) << "still held at zero speed";
  rig.run_ms(145);
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  EXPECT_EQ(low_byte(rig), 0x37);
  rig.run_ms(8);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_EQ(low_byte(rig), 0x31);
  rig.run_ms(500);
  EXPECT_NEAR(static_cast<double>(rig.device.drive().axis().position() - held), 0.0, 65536.0 / 100.0)
      << "the load did not drop";
  // Without a brake the motor is released immediately.
  IsmkRig plain;
  plain.run_ms(5);
  command(plain, 0x0F);
  command(plain, 0x06);
  EXPECT_EQ(low_byte(plain), 0x31);
}

TEST(IsmkBrake, AfterARampTheBrakeClosesAtZeroSpeed) {
  Braked rig;
  rig.set(0x605B, 0, 2);
  rig.set(0x60FF, 0, 17895697);
  command(rig, 0x0F, 600.0);
  rig.control(0x06);
  rig.run_ms(20);
  EXPECT_TRUE(rig.actuation.brake_released) << "still ramping";
  ASSERT_GE(rig.run_until([&] { return !rig.actuation.brake_released; }, 40), 0);
  EXPECT_LT(std::abs(static_cast<IsmkRig&>(rig).plant.velocity_rpm()), 10.0) << "the shaft, not the demand alone";
  EXPECT_TRUE(rig.actuation.pwm_enabled);
  rig.run_ms(160);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_EQ(low_byte(rig), 0x31);
}

}  // namespace
}  // namespace ismk_power_state_test
}  // namespace servodrome
