#include <algorithm>
#include <array>
#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/ismc/ismc.hpp"
#include "products/pronet/pronet.hpp"
#include "reference_axis.hpp"

// Events during a stop: a load that keeps pulling, a limit switch, another command, another fault. The test measures
// the true shaft.
namespace servodrome {
namespace stops_under_way_test {
namespace {

using drive::PowerState;
using products::Generic402;
using test::hanging;
using test::IsmkRig;
using test::JmcRig;
using test::Reference;
using test::Rig;

constexpr std::int64_t turn = 131072;

// --- A stop without a ramp against a load that keeps pulling

// The axis reaches `end`, its power goes, and a brake holds the load.
template <typename RigType>
void ends(RigType& rig, PowerState end, bool brake) {
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().state() == end; }, 8000.0), 0);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_FALSE(rig.actuation.short_circuit);
  if (!brake) return;
  rig.run_ms(200);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 0.1) << "the brake holds the load";
}

TEST(StopWithoutARamp, IsmkEndsUnderALoad) {
  struct Case {
    std::uint16_t object;
    std::uint16_t word;  // 0: a fault
    PowerState end;
  };
  for (const bool brake : {true, false}) {
    for (const Case& row : {Case{0x605A, 0x06, PowerState::ready_to_switch_on},  // 06h leaves the held quick stop
                            Case{0x605B, 0x06, PowerState::ready_to_switch_on},
                            Case{0x605C, 0x07, PowerState::switched_on}, Case{0x605E, 0, PowerState::fault}}) {
      SCOPED_TRACE(testing::Message() << std::hex << row.object << (brake ? ", brake" : ""));
      IsmkRig rig(hanging(test::ismk_plant(), 0.5, brake ? 1.5 : 0.0), test::ismk_settings());
      rig.run_ms(5);
      if (brake) rig.set(0x6410, 0x17, 1);
      rig.set(0x6060, 0, 3);
      rig.set(row.object, 0, 18);
      rig.control(0x0F);
      rig.run_ms(400);
      if (row.object == 0x605A) {
        rig.control(0x02);
        rig.run_ms(20);
        ASSERT_EQ(rig.device.drive().state(), PowerState::quick_stop_active);
      }
      if (row.word != 0) {
        rig.control(row.word);
      } else {
        rig.device.drive().inject(drive::Cause::power_stage_hot, true);
      }
      rig.run_ms(100);
      ASSERT_TRUE(rig.actuation.short_circuit);
      ends(rig, row.end, brake);
    }
  }
}

TEST(StopWithoutARamp, ReferenceDriveEndsUnderALoad) {
  for (const bool brake : {true, false}) {
    for (const std::int64_t code : {3, 4}) {  // the current limit, shorted windings
      for (const bool fault : {true, false}) {
        SCOPED_TRACE(testing::Message() << code << (brake ? ", brake" : "") << (fault ? ", fault" : ""));
        const plant::Parameters parameters = hanging(test::default_plant(), 0.0, brake ? 3.0 : 0.0);
        Reference axis(3, parameters);
        if (brake) axis.set(0x2020, 1, 40);
        if (brake) axis.set(0x2020, 2, 25);
        axis.set(fault ? 0x605E : 0x605A, 0, code);
        axis.run_ms(300);
        // The current limit is a little too low for the load.
        const double rated_nm = parameters.motor.rated_torque_nm;
        if (code == 3) axis.set(0x6072, 0, 100);
        axis.plant.set_external_torque_nm(code == 3 ? 0.12 * rated_nm : 0.5 * rated_nm);
        axis.run_ms(code == 3 ? 200 : 50);
        if (fault) {
          axis.device.drive().inject(drive::Cause::external, true);
        } else {
          axis.control(0x02);
        }
        axis.run_ms(100);
        ASSERT_GT(std::abs(axis.plant.velocity_rpm()), 10.0);
        ends(axis, fault ? PowerState::fault : PowerState::switch_on_disabled, brake);
      }
    }
  }
}

// A heavy load that the windings brake slowly, but brake, is no such load.
TEST(StopWithoutARamp, WaitsForAHeavyLoadThatSlowsDown) {
  plant::Parameters heavy = test::ismk_plant();
  heavy.load.inertia_kgm2 = 3000.0 * heavy.motor.rotor_inertia_kgm2;
  IsmkRig rig(heavy, test::ismk_settings());
  rig.run_ms(5);
  rig.set(0x605B, 0, 18);
  rig.set(0x6060, 0, 4);
  rig.set(0x6071, 0, 1000);
  rig.control(0x0F);
  ASSERT_GE(rig.run_until([&] { return rig.plant.velocity_rpm() > 600.0; }, 20000.0), 0);
  rig.control(0x06);
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().state() == PowerState::ready_to_switch_on; }, 60000.0), 0);
  EXPECT_LT(std::abs(rig.plant.velocity_rpm()), 6.0);
}

// --- Limits

// Turns at 20 turns/s in a mode of velocity; 6084h stops it within 20 turns, 6085h within 0.2.
struct Turning : Reference {
  explicit Turning(std::int64_t mode = 3) : Reference(mode) {
    set(0x6083, 0, 200 * turn);
    set(0x6085, 0, 1000 * turn);
    set(0x60FF, 0, 20 * turn);
    run_ms(200);
    EXPECT_NEAR(turns_per_s(), 20.0, 0.5);
    set(0x6084, 0, 10 * turn);
  }
};

TEST(HomingInMotion, ObeysALimitSwitchUntilItBegins) {
  for (const std::int64_t method : {33, 18}) {
    SCOPED_TRACE(method);
    Turning axis;
    axis.set(0x6098, 0, method);
    axis.set(0x6099, 1, turn);
    axis.set(0x6099, 2, turn / 4);
    axis.set(0x609A, 0, 10 * turn);  // 20 turns to come to rest
    axis.set(0x6060, 0, 6);
    axis.control(0x1F);
    axis.run_ms(50);
    axis.plant.force_input(0, true);
    const double met = axis.turns();
    double furthest = met;
    for (int i = 0; i < 6000; ++i) axis.run_ms(1), furthest = std::max(furthest, axis.turns());
    EXPECT_LT(furthest - met, 20.0 * 20.0 / 2000.0 + 0.1) << "6085h ends it";
  }
}

TEST(HomingInMotion, ObeysSoftwareLimitsUntilItBegins) {
  Turning axis;
  const double limit = axis.turns() + 5.0;
  axis.limit_turns(-10.0, limit);
  axis.set(0x6098, 0, 33);
  axis.set(0x6099, 1, turn);
  axis.set(0x6099, 2, turn / 4);
  axis.set(0x609A, 0, 10 * turn);
  axis.set(0x6060, 0, 6);
  axis.control(0x1F);
  double furthest = 0.0;
  for (int i = 0; i < 4000; ++i) axis.run_ms(1), furthest = std::max(furthest, axis.turns());
  EXPECT_LT(furthest, limit + 0.02);
  EXPECT_TRUE(axis.bit(12)) << "and then it homes";
}

// The switch opens again before the axis rests. The end of the halt is not a command to continue past it.
TEST(SwitchMetInAHalt, EndsTheMotion) {
  for (const std::int64_t mode : {1, 2, 3, 8, 9}) {
    for (const std::int64_t code : {1, 2, 3}) {
      SCOPED_TRACE(testing::Message() << "mode " << mode << ", 605Dh = " << code);
      Reference axis(mode);
      axis.set(0x605D, 0, code);
      axis.set(0x6081, 0, 10 * turn);
      axis.set(0x6083, 0, 100 * turn);
      axis.set(0x6085, 0, 200 * turn);
      axis.set(0x6042, 0, 600);
      axis.set(0x6048, 1, 6000);
      axis.set(0x6049, 1, 600);
      axis.set(0x60FF, 0, 10 * turn);
      if (mode == 1) test::absolute_move(axis, 100 * turn, 0x1F);
      const std::uint16_t run = mode == 2 ? 0x7F : 0x0F;
      axis.control(run);
      std::int64_t target = 0;
      const auto go = [&](int milliseconds) {
        for (int i = 0; i < milliseconds; ++i) {
          if (mode == 8) axis.set(0x607A, 0, target += turn / 100);
          axis.run_ms(1);
        }
      };
      go(500);
      ASSERT_GT(axis.turns_per_s(), 9.0);
      axis.control(run | 0x100);
      go(code == 3 ? 1 : 5);
      ASSERT_GT(axis.turns_per_s(), 0.5);
      axis.plant.force_input(0, true);
      go(4);
      axis.plant.force_input(0, false);
      go(1500);
      const double there = axis.turns();
      EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.02);
      if (mode < 8) {
        EXPECT_TRUE(axis.bit(10)) << "the halt has ended";
      }
      axis.control(run);
      go(500);
      EXPECT_NEAR(axis.turns(), there, 0.02);
      if (mode != 3) continue;
      axis.set(0x60FF, 0, 4 * turn);
      go(1000);
      EXPECT_NEAR(axis.turns_per_s(), 4.0, 0.1) << "another target moves it";
    }
  }
}

// 605Ch = 0 leads to Switched on, where JMC slows the axis down by 6084h.
TEST(SwitchMetInSwitchedOn, StopsJmc) {
  JmcRig rig;
  rig.open_limits();
  rig.set(0x605C, 0, 0);
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, 20000);
  rig.set(0x6084, 0, 10000);  // 2 s to rest
  ASSERT_TRUE(rig.enable());
  rig.run_ms(400);
  rig.control(0x07);
  rig.run_ms(20);
  ASSERT_EQ(rig.device.drive().state(), PowerState::switched_on);
  ASSERT_NEAR(rig.plant.velocity_rpm(), 300.0, 15.0);
  ASSERT_TRUE(rig.force(drive::Signal::positive_limit, true));
  rig.run_ms(60);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 3.0);
  EXPECT_EQ(rig.device.drive().state(), PowerState::switched_on);
  rig.run_ms(500);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
}

// --- Other commands

// 06h does not cut a quick stop's ramp short.
TEST(HeldQuickStop, IsmkIsReleasedAtRest) {
  for (const std::int64_t code : {5, 6}) {
    SCOPED_TRACE(code);
    IsmkRig rig;
    rig.run_ms(5);
    rig.set(0x6060, 0, -3);
    rig.set(0x60FF, 0, 17895697);  // 1000 rpm
    rig.set(0x605A, 0, code);
    rig.control(0x0F);
    rig.run_ms(200);
    rig.control(0x02);
    rig.run_ms(5);
    rig.control(0x06);
    rig.run_ms(2);
    EXPECT_TRUE(rig.actuation.pwm_enabled);
    EXPECT_EQ(rig.status() & 0xFF, 0x50);
    rig.control(0x0F);
    rig.run_ms(2);
    EXPECT_EQ(rig.status() & 0xFF, 0x50) << "it is on its way to Ready";
    ASSERT_GE(rig.run_until([&] { return rig.device.drive().state() == PowerState::ready_to_switch_on; }, 400.0), 0);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 10.0);
    EXPECT_FALSE(rig.actuation.pwm_enabled);
    rig.control(0x06);
    rig.control(0x0F);
    rig.run_ms(2);
    EXPECT_EQ(rig.status() & 0xFF, 0x37);
  }
}

TEST(HomingGivenUp, ComesToRestWithoutARamp) {
  Reference axis(6);
  axis.set(0x6098, 0, 17);
  axis.set(0x6099, 1, 4 * turn);
  axis.set(0x6099, 2, turn);
  axis.set(0x609A, 0, 40 * turn);
  axis.control(0x0F);
  axis.run_ms(2);
  axis.control(0x1F);
  axis.run_ms(500);
  ASSERT_GT(std::abs(axis.turns_per_s()), 3.5);
  axis.set(0x609A, 0, 0);
  axis.set(0x6084, 0, 0);
  axis.set(0x6072, 0, 1);  // the shaft lags behind its demand
  axis.plant.set_external_torque_nm(0.3);
  axis.run_ms(20);
  axis.plant.set_external_torque_nm(0.0);
  axis.set(0x6072, 0, 3000);
  axis.control(0x0F);
  axis.run_ms(1000);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.02);
  // The same for an attempt that begins without a ramp.
  Turning turning;
  turning.set(0x6084, 0, 0);
  turning.set(0x6060, 0, 6);
  turning.set(0x609A, 0, 0);
  turning.control(0x1F);
  turning.run_ms(20);
  turning.control(0x0F);
  turning.run_ms(3000);
  EXPECT_NEAR(turning.turns_per_s(), 0.0, 0.02);
}

// A quick stop, a shutdown and a fault end homing, also while it presses against a hard stop.
TEST(HomingStopped, HasEnded) {
  for (const auto word : std::to_array<std::uint16_t>({0x0B, 0x06, 0x07, 0x00})) {  // 00h: a fault
    SCOPED_TRACE(word);
    plant::Parameters parameters = test::default_plant();
    parameters.load.low_stop_counts = -2 * turn;
    parameters.load.high_stop_counts = 2 * turn;
    Reference axis(6, parameters);
    axis.set(0x605A, 0, 6);
    axis.set(0x605B, 0, 1);
    axis.set(0x605C, 0, 1);
    axis.set(0x605E, 0, 2);
    axis.set(0x6084, 0, 2 * turn);
    axis.set(0x6085, 0, 2 * turn);
    axis.set(0x6098, 0, -1);
    axis.set(0x6099, 1, 2 * turn);
    axis.set(0x6099, 2, turn * 3 / 10);
    axis.set(0x609A, 0, 20 * turn);
    axis.control(0x1F);
    ASSERT_GE(
        axis.run_until([&] { return axis.device.drive().homing_running() && std::abs(axis.turns()) > 1.9998; }, 4000),
        0);
    axis.run_ms(15);
    const auto torque = [&] { return std::abs(static_cast<double>(axis.device.drive().loops().torque)); };
    const double pressed = torque();
    ASSERT_GT(pressed, 0.3) << "of rated torque";
    if (word != 0) {
      axis.control(word);
    } else {
      axis.device.drive().inject(drive::Cause::external, true);
    }
    EXPECT_FALSE(axis.device.drive().homes() && word != 0);
    axis.run_ms(100);
    EXPECT_FALSE(axis.device.drive().homes());
    for (int i = 0; i < 500; ++i) {
      axis.run_ms(1);
      ASSERT_LT(torque(), 0.5 * pressed) << i;
      ASSERT_NEAR(axis.plant.velocity_rpm(), 0.0, 5.0);
    }
    EXPECT_FALSE(axis.bit(12));
  }
}

// The index that passes under the ramp of a quick stop is not home.
TEST(HomingStopped, TakesNoHomeFromTheRamp) {
  Reference axis(6);
  axis.set(0x605A, 0, 6);
  axis.set(0x6085, 0, 2 * turn);
  axis.set(0x6098, 0, 34);
  axis.set(0x6099, 1, 2 * turn);
  axis.set(0x6099, 2, 2 * turn);
  axis.set(0x609A, 0, 40 * turn);
  axis.control(0x1F);
  axis.run_ms(200);
  axis.control(0x0B);
  const std::int64_t before = axis.device.drive().position_offset();
  axis.run_ms(2000);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.02);
  EXPECT_FALSE(axis.device.drive().homed());
  EXPECT_EQ(axis.device.drive().position_offset(), before);
  axis.control(0x0F);
  axis.run_ms(1000);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.02) << "homing does not go on";
}

TEST(Identification, DoesNotResumeAnOldSetPointAfterAHalt) {
  plant::Parameters parameters = test::default_plant();
  Reference axis(1, parameters);
  test::absolute_move(axis, 5 * turn, 0x1F);
  axis.run_ms(100);
  axis.control(0x10F);  // a set-point that was not reached
  axis.run_ms(500);
  axis.set(0x6060, 0, 3);
  axis.run_ms(2);
  axis.set(0x6060, 0, 1);
  axis.control(0x0F);
  axis.run_ms(100);
  test::absolute_move(axis, turn, 0x1F);
  axis.run_ms(3000);
  ASSERT_TRUE(axis.device.drive().identify_inertia(
      {.travel_counts = 65536.0, .speed_counts_per_s = 800.0 / 60.0 * 65536.0, .torque_limit = 1.0F}));
  axis.run_ms(350);
  ASSERT_TRUE(axis.device.drive().identification().running());
  axis.control(0x10F);
  axis.run_ms(1000);
  const double there = axis.turns();
  ASSERT_GT(std::abs(there - 1.0), 0.002) << "the halt ends elsewhere";
  axis.control(0x0F);
  axis.run_ms(1000);
  EXPECT_NEAR(axis.turns(), there, 0.001);
}

TEST(ResonanceSearch, EndsInAHalt) {
  {
    IsmkRig rig;
    rig.run_ms(5);
    rig.control(0x0F);
    rig.run_ms(100);
    ASSERT_EQ(rig.set(0x60F9, 4, 0x80), dictionary::AbortCode::none);
    rig.run_ms(200);
    rig.control(0x10F);
    rig.run_ms(5);
    EXPECT_EQ(rig.get(0x60F9, 4) & 0x80, 0);
    EXPECT_EQ(rig.get(0x60F9, 3), 0) << "no notch is set";
  }
  JmcRig rig;
  rig.open_limits();
  rig.set(0x6060, 0, 3);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(200);
  ASSERT_EQ(rig.set(0x200E, 2, 1), dictionary::AbortCode::none);
  rig.run_ms(200);
  ASSERT_EQ(rig.get(0x200E, 2), 1);
  rig.control(0x10F);
  rig.run_ms(5);
  EXPECT_EQ(rig.get(0x200E, 2), 3) << "failed";
}

// 8Fh resets nothing and commands nothing, so the halt stays. Reset communication is not a command either.
template <typename Product>
void keeps_the_halt(std::int64_t speed) {
  Rig<Product> rig;
  rig.set(0x6060, 0, 3);
  rig.set(0x6007, 0, 0);
  ASSERT_TRUE(rig.enable());
  rig.send(0, {1, 0});
  rig.set(0x60FF, 0, speed);
  rig.run_ms(1000);
  ASSERT_GT(rig.plant.velocity_rpm(), 30.0);
  rig.control(0x10F);
  rig.run_ms(1000);
  rig.control(0x8F);
  rig.run_ms(200);
  ASSERT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
  rig.send(0, {0x82, 0});
  rig.run_ms(1000);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
  rig.control(0x0F);
  rig.run_ms(1000);
  EXPECT_GT(rig.plant.velocity_rpm(), 30.0) << "a command ends it";
}
TEST(ResetCommunication, KeepsAHalt) {
  {
    SCOPED_TRACE("generic402");
    keeps_the_halt<Generic402>(500000);
  }
  {
    SCOPED_TRACE("ismc");
    keeps_the_halt<products::Ismc>(500000);
  }
  SCOPED_TRACE("pronet");
  keeps_the_halt<products::Pronet>(500000);
}

// --- Another fault

// The rotor angle is lost during a ramp. The new 605Eh needs no angle, so it begins now.
TEST(FaultReaction, IsmkChangesToShortedWindingsWithoutAnAngle) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x6060, 0, -3);
  rig.set(0x60FF, 0, 17895697);
  rig.set(0x605E, 0, 1);
  rig.control(0x0F);
  rig.run_ms(200);
  rig.device.drive().inject(drive::Cause::power_stage_hot, true);
  rig.run_ms(5);
  ASSERT_EQ(rig.device.drive().state(), PowerState::fault_reaction_active);
  ASSERT_TRUE(rig.actuation.pwm_enabled);
  rig.set(0x605E, 0, 18);
  rig.device.drive().inject(drive::Cause::encoder_connection, true);
  rig.run_ms(2);
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_TRUE(rig.actuation.short_circuit);
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().state() == PowerState::fault; }, 2000.0), 0);
}

}  // namespace
}  // namespace stops_under_way_test
}  // namespace servodrome
