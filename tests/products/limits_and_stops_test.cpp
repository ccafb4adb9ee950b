#include <algorithm>
#include <array>
#include <cmath>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "products/ismc/ismc.hpp"
#include "reference_axis.hpp"

// Limits that an axis meets while its demand stands or is smoothed, stops while the brake opens, and homing that is
// given up against a hard stop. The test measures the true shaft.
namespace servodrome {
namespace limits_and_stops_test {
namespace {

using drive::PowerState;
using drive::Signal;
using products::Generic402;
using test::IsmkRig;
using test::JmcRig;
using test::Reference;
using test::Rig;

constexpr std::int64_t turn = 131072;
constexpr std::int64_t rpm_2000 = 17895697 * 2;  // iSMK, 6081h and 60FFh

template <typename RigType>
double counts_per_turn(RigType& rig) {
  return static_cast<double>(rig.device.drive().configuration().motor.counts_per_revolution);
}
template <typename RigType>
double turns(RigType& rig) {
  return static_cast<double>(rig.plant.position_counts()) / counts_per_turn(rig);
}
// The greatest position within this time.
template <typename RigType>
double furthest(RigType& rig, int milliseconds) {
  double most = turns(rig);
  for (int i = 0; i < milliseconds; ++i) rig.run_ms(1), most = std::max(most, turns(rig));
  return most;
}

// --- A stop while the brake opens

constexpr double brake_nm = 1.5;

enum class By : std::uint8_t { shutdown, disable, quick_stop, fault };

template <typename RigType>
void stop(RigType& rig, By by, drive::Cause fault) {
  switch (by) {
    case By::shutdown: return rig.control(0x06);
    case By::disable: return rig.control(0x07);
    case By::quick_stop: return rig.control(0x02);
    case By::fault: return rig.device.drive().inject(fault, true);
  }
}

// The load stays where it is.
template <typename RigType>
void holds_load(RigType& rig, By by, drive::Cause fault) {
  const double before = turns(rig);
  stop(rig, by, fault);
  rig.run_ms(500);
  EXPECT_NEAR(turns(rig), before, 0.01);
  if (rig.device.drive().state() == PowerState::switched_on && rig.actuation.pwm_enabled) return;  // JMC holds it
  EXPECT_FALSE(rig.actuation.pwm_enabled);
  EXPECT_FALSE(rig.actuation.brake_released);
}

TEST(StopWhileTheBrakeOpens, HoldsTheLoad) {
  for (const By by : {By::shutdown, By::disable, By::quick_stop, By::fault}) {
    SCOPED_TRACE(static_cast<int>(by));
    {
      SCOPED_TRACE("ismk");
      IsmkRig rig(test::hanging(test::ismk_plant(), 0.5, brake_nm), test::ismk_settings());
      rig.run_ms(5);
      rig.set(0x6410, 0x17, 1);
      for (const auto object : std::to_array<std::uint16_t>({0x605A, 0x605B, 0x605C, 0x605E})) rig.set(object, 0, 2);
      rig.set(0x6060, 0, 1);
      rig.control(0x0F);
      rig.run_ms(static_cast<double>(rig.device.drive().configuration().brake_release_ms) - 4.0);
      holds_load(rig, by, drive::Cause::power_stage_hot);
    }
    {
      SCOPED_TRACE("jmc");
      JmcRig rig(test::hanging(test::jmc_plant(), 0.3, brake_nm), test::jmc_settings());
      rig.open_limits();
      for (const auto object : std::to_array<std::uint16_t>({0x605A, 0x605B, 0x605C, 0x605E})) rig.set(object, 0, 1);
      rig.set(0x6060, 0, 1);
      ASSERT_TRUE(rig.enable());
      rig.control(0x00);
      rig.run_ms(400);
      rig.control(0x06);
      rig.run_ms(2);
      rig.control(0x0F);
      rig.run_ms(static_cast<double>(rig.device.drive().configuration().brake_release_ms) - 4.0);
      holds_load(rig, by, drive::Cause::motor_hot);
    }
    {
      SCOPED_TRACE("generic402");
      Rig<Generic402> rig(test::hanging(test::default_plant(), 0.5, brake_nm));
      rig.set(0x2020, 1, 40);
      rig.set(0x2020, 2, 25);
      for (const auto object : std::to_array<std::uint16_t>({0x605A, 0x605B, 0x605C, 0x605E})) rig.set(object, 0, 1);
      rig.set(0x6084, 0, 10 * turn);
      rig.set(0x6060, 0, 1);
      ASSERT_TRUE(rig.enable());
      rig.run_ms(36);
      holds_load(rig, by, drive::Cause::external);
    }
  }
}

TEST(StopWhileTheBrakeOpens, IsmkReleasesAHeldQuickStopUnderPower) {
  IsmkRig rig(test::hanging(test::ismk_plant(), 0.5, brake_nm), test::ismk_settings());
  rig.run_ms(5);
  rig.set(0x6410, 0x17, 1);
  rig.set(0x6060, 0, 3);
  rig.set(0x605B, 0, 1);
  rig.set(0x605A, 0, 6);
  rig.control(0x0F);
  rig.run_ms(400);
  rig.control(0x06);
  rig.run_ms(40);
  rig.control(0x02);
  rig.run_ms(120);
  holds_load(rig, By::shutdown, {});
}

// --- A limit switch while the demand stands

TEST(LimitSwitch, StopsAShaftThatFollowsASmoothedDemand) {
  for (const int mode : {1, 8}) {
    SCOPED_TRACE(mode);
    JmcRig rig;
    rig.open_limits();
    rig.set_panel(3, 16, 10000);  // 1 s
    rig.set(0x6060, 0, mode);
    rig.set(0x6081, 0, 300000);
    ASSERT_TRUE(rig.enable());
    rig.run_ms(300);
    const drive::Units& units = rig.device.drive().axis().units;
    const auto user = [&](double place) {
      return units.to_user(static_cast<drive::Counts>(place * counts_per_turn(rig)));
    };
    if (mode == 1) {
      rig.set(0x607A, 0, user(20.0));
      rig.control(0x1F);
      rig.run_ms(5);
    } else {
      for (int i = 1; i <= 500; ++i) rig.set(0x607A, 0, user(i / 50.0)), rig.run_ms(1);
    }
    ASSERT_GE(rig.run_until([&] { return !rig.device.drive().in_motion(); }, 20000.0), 0);
    const double there = turns(rig);
    ASSERT_GT(rig.plant.velocity_rpm(), 100.0);
    ASSERT_TRUE(rig.force(Signal::positive_limit, true));
    EXPECT_LT(furthest(rig, 5000) - there, 2.0);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
  }
  for (const int mode : {1, 3}) {
    SCOPED_TRACE(mode);
    IsmkRig rig;
    rig.set(0x2010, 3, 0x0010);
    rig.run_ms(5);
    ASSERT_TRUE(rig.force(Signal::positive_limit, false));
    rig.run_ms(5);
    rig.set(0x60FB, 5, 255);
    rig.set(0x6060, 0, mode);
    for (const auto ramp : std::to_array<std::uint16_t>({0x6083, 0x6084, 0x6085})) rig.set(ramp, 0, 100000000);
    rig.set(0x607F, 0, 2 * rpm_2000);
    rig.set(0x6081, 0, rpm_2000);
    rig.set(0x60FF, 0, mode == 3 ? rpm_2000 : 0);
    rig.control(0x0F);
    rig.run_ms(100);
    if (mode == 1) {
      rig.set(0x607A, 0, 65536 * 20);
      rig.control(0x1F);
      rig.run_ms(5);
    } else {
      rig.run_ms(700);
      rig.set(0x60FF, 0, 0);
      rig.run_ms(3);
    }
    ASSERT_GE(rig.run_until([&] { return !rig.device.drive().in_motion(); }, 20000.0), 0);
    const double there = turns(rig);
    ASSERT_GT(rig.plant.velocity_rpm(), 1000.0);
    ASSERT_TRUE(rig.force(Signal::positive_limit, true));
    EXPECT_LT(furthest(rig, 2000) - there, 0.5);
  }
}

TEST(LimitSwitch, StopsAShaftThatLagsBehindItsDemand) {
  for (const int mode : {1, 8}) {
    SCOPED_TRACE(mode);
    plant::Parameters parameters = test::default_plant();
    parameters.load.inertia_kgm2 = 100.0 * parameters.motor.rotor_inertia_kgm2;
    Reference axis(mode, parameters);
    axis.set(0x6065, 0, 0xFFFFFFFF);
    axis.set(0x6072, 0, 200);
    axis.set(0x6081, 0, 40 * turn);
    for (const auto ramp : std::to_array<std::uint16_t>({0x6083, 0x6084, 0x6085})) axis.set(ramp, 0, 1000 * turn);
    if (mode == 1) {
      test::absolute_move(axis, 20 * turn, 0x1F);
    } else {
      for (int i = 1; i <= 500; ++i) axis.set(0x607A, 0, i * turn / 25), axis.run_ms(1);
    }
    ASSERT_GE(axis.run_until([&] { return !axis.device.drive().in_motion(); }, 5000.0), 0);
    const double there = axis.turns();
    const double speed = axis.turns_per_s();
    ASSERT_GT(speed, 1.0);
    axis.plant.force_input(0, true);
    // The torque accelerated the axis from rest to this speed within `there` turns.
    EXPECT_LT(furthest(axis, 6000), 2.2 * there);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.05);
  }
}

TEST(SoftwareLimit, HoldsASmoothedVelocity) {
  IsmkRig rig;
  rig.run_ms(5);
  rig.set(0x60FB, 5, 255);
  rig.run_ms(5);
  rig.set(0x6098, 0, 35);
  rig.set(0x6060, 0, 6);
  rig.control(0x0F);
  rig.run_ms(50);
  rig.control(0x1F);
  rig.run_ms(200);
  rig.control(0x0F);
  ASSERT_TRUE(rig.device.drive().homed());
  rig.set(0x6060, 0, 3);
  for (const auto ramp : std::to_array<std::uint16_t>({0x6083, 0x6084, 0x6085})) rig.set(ramp, 0, 100000000);
  rig.set(0x607F, 0, 2 * rpm_2000);
  rig.set(0x60FF, 0, rpm_2000);
  rig.run_ms(700);
  const double limit = turns(rig) + 1.5;
  rig.set(0x607D, 1, rig.get(0x6064) + 65536 * 3 / 2);  // ch. 7.5: sub 1 is the positive limit
  rig.set(0x607D, 2, -65536 * 100);
  rig.set(0x60FF, 0, 0);
  EXPECT_LT(furthest(rig, 2000), limit + 0.1);
}

// 605Ah = 1 and 5 stop by 6084h. If that is too slow for a limit, 6085h applies, as in a halt.
TEST(QuickStop, ByTheSlowDownRampKeepsToLimits) {
  for (const std::int64_t code : {1, 5}) {
    for (const bool at_switch : {true, false}) {
      SCOPED_TRACE(testing::Message() << code << (at_switch ? ", switch" : ", 607Dh"));
      Reference axis(3);
      axis.set(0x6083, 0, 200 * turn);
      axis.set(0x6085, 0, 1000 * turn);
      axis.set(0x60FF, 0, 20 * turn);
      axis.run_ms(200);
      axis.set(0x6084, 0, 10 * turn);
      axis.set(0x605A, 0, code);
      const double limit = axis.turns() + 3.0;
      if (!at_switch) axis.limit_turns(-100.0, limit);
      axis.control(0x0B);
      axis.run_ms(20);
      const double there = axis.turns();
      if (at_switch) axis.plant.force_input(0, true);
      EXPECT_LT(furthest(axis, 4000), at_switch ? there + 0.5 : limit + 0.02);
    }
  }
}

// The target turns back while the axis still runs towards a limit that stops it.
TEST(TargetAwayFromALimit, IsFollowedAfterTheStop) {
  for (const std::int64_t mode : {2, 3}) {
    for (const bool at_switch : {true, false}) {
      SCOPED_TRACE(testing::Message() << "mode " << mode << (at_switch ? ", switch" : ", 607Dh"));
      Reference axis(mode);
      axis.set(0x6083, 0, 200 * turn);
      axis.set(0x6084, 0, 10 * turn);
      axis.set(0x6085, 0, 1000 * turn);
      axis.set(0x6048, 1, 12000);
      axis.set(0x6049, 1, 600);
      axis.set(0x604A, 1, 60000);
      axis.set(0x60FF, 0, 20 * turn);
      axis.set(0x6042, 0, 1200);
      axis.control(mode == 2 ? 0x7F : 0x0F);
      axis.run_ms(300);
      ASSERT_NEAR(axis.turns_per_s(), 20.0, 0.5);
      axis.set(0x60FF, 0, -5 * turn);
      axis.set(0x6042, 0, -300);
      axis.run_ms(20);
      ASSERT_GT(axis.turns_per_s(), 15.0);
      const double limit = axis.turns() + 1.0;
      at_switch ? axis.plant.force_input(0, true) : axis.limit_turns(-100.0, limit);
      EXPECT_LT(furthest(axis, 3000), limit + 0.02);
      EXPECT_NEAR(axis.turns_per_s(), -5.0, 0.1);
    }
  }
}

// The mode was entered in the halt, so it has not had a target yet.
TEST(SwitchMetInAHalt, EndsTheMotionOfANewMode) {
  for (const std::int64_t mode : {2, 3, 9}) {
    SCOPED_TRACE(mode);
    Reference axis(1);
    axis.set(0x6081, 0, 10 * turn);
    axis.set(0x6083, 0, 100 * turn);
    axis.set(0x6085, 0, 200 * turn);
    axis.set(0x60FF, 0, 3 * turn);
    axis.set(0x6042, 0, 180);
    axis.set(0x6048, 1, 6000);
    axis.set(0x6049, 1, 600);
    axis.set(0x604A, 1, 6000);
    test::absolute_move(axis, 100 * turn, 0x1F);
    axis.run_ms(500);
    axis.set(0x6060, 0, mode);
    const std::uint16_t run = mode == 2 ? 0x7F : 0x0F;
    axis.control(run | 0x100);
    axis.run_ms(5);
    axis.plant.force_input(0, true);
    axis.run_ms(4);
    axis.plant.force_input(0, false);
    axis.run_ms(1500);
    const double there = axis.turns();
    axis.control(run);
    axis.run_ms(500);
    EXPECT_NEAR(axis.turns(), there, 0.02);
    axis.set(0x60FF, 0, 2 * turn);
    axis.set(0x6042, 0, 120);
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns_per_s(), 2.0, 0.1) << "another target moves it";
  }
}

// --- Homing against a hard stop

struct Pressing : Reference {
  static plant::Parameters between_stops() {
    plant::Parameters parameters = test::default_plant();
    parameters.load.low_stop_counts = -2 * turn;
    parameters.load.high_stop_counts = 2 * turn;
    return parameters;
  }
  Pressing() : Reference(6, between_stops()) {
    set(0x2030, 2, static_cast<std::int64_t>(Signal::negative_limit));
    set(0x6084, 0, 2 * turn);
    set(0x6085, 0, 2 * turn);
    set(0x6098, 0, -1);
    set(0x6099, 1, 2 * turn);
    set(0x6099, 2, turn * 3 / 10);
    set(0x609A, 0, 20 * turn);
    control(0x1F);
    EXPECT_GE(run_until([&] { return device.drive().homing_running() && std::abs(turns()) > 1.9998; }, 4000.0), 0);
    run_ms(15);
    EXPECT_GT(torque(), 0.3);
  }
  double torque() { return std::abs(static_cast<double>(device.drive().loops().torque)); }
};

TEST(HomingGivenUp, PressesNoMoreWhateverEndsIt) {
  const std::array<void (*)(Pressing&), 4> ends{
      [](Pressing& axis) { axis.control(0x10F); },  // bit 4 falls and the halt begins
      [](Pressing& axis) {
        axis.control(0x0F);
        axis.set(0x6060, 0, 1);
      },
      [](Pressing& axis) {  // a homing error
        axis.plant.force_input(0, true);
        axis.plant.force_input(1, true);
      },
      [](Pressing& axis) { axis.control(0x11F); },
  };
  for (std::size_t i = 0; i < ends.size(); ++i) {
    SCOPED_TRACE(i);
    Pressing axis;
    ends[i](axis);
    axis.run_ms(100);
    for (int ms = 0; ms < 1000; ++ms) {
      axis.run_ms(1);
      ASSERT_LT(axis.torque(), 0.3) << ms;
    }
    EXPECT_NE(axis.device.drive().state(), PowerState::fault);
  }
}

// --- Commands and bits

// Transition 9 leads to Switch on disabled, where 0Fh has no effect. It is not withdrawn while the brake closes.
TEST(DisableVoltage, IsNotWithdrawnWhileTheBrakeCloses) {
  IsmkRig rig(test::hanging(test::ismk_plant(), 0.0, brake_nm), test::ismk_settings());
  rig.run_ms(5);
  rig.set(0x6410, 0x17, 1);
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, 17895697);
  rig.control(0x0F);
  rig.run_ms(600);
  ASSERT_GT(rig.plant.velocity_rpm(), 900.0);
  rig.control(0x00);
  rig.run_ms(100);
  rig.control(0x0F);
  rig.run_ms(500);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
  EXPECT_EQ(rig.device.drive().state(), PowerState::switch_on_disabled);
}

TEST(ResonanceSearch, DoesNotBeginInAStopsRamp) {
  IsmkRig rig(test::hanging(test::ismk_plant(), 0.0, brake_nm), test::ismk_settings());
  rig.run_ms(5);
  rig.set(0x605B, 0, 1);
  rig.set(0x6060, 0, 3);
  rig.set(0x6084, 0, 1000000);
  rig.set(0x60FF, 0, 17895697);
  rig.control(0x0F);
  rig.run_ms(1500);
  rig.control(0x06);
  rig.run_ms(5);
  ASSERT_GT(rig.plant.velocity_rpm(), 500.0);
  EXPECT_EQ(rig.set(0x60F9, 4, 0x80), dictionary::AbortCode::device_state);
}

TEST(InternalLimit, EndsWithItsCause) {
  {
    Reference axis(1);
    axis.set(0x6081, 0, 10 * turn);
    axis.set(0x6083, 0, 100 * turn);
    axis.set(0x6084, 0, 60 * turn);
    axis.set(0x6085, 0, 200 * turn);
    axis.limit_turns(-10.0, 10.0);
    test::absolute_move(axis, turn * 99 / 10, 0x1F);
    ASSERT_GE(axis.run_until([&] { return axis.turns() > 8.5; }, 5000.0), 0);
    axis.set(0x6084, 0, 5 * turn);
    axis.control(0x10F);
    axis.run_ms(1000);
    axis.control(0x0F);
    axis.run_ms(6000);
    EXPECT_NEAR(axis.turns(), 9.9, 0.01);
    EXPECT_TRUE(axis.bit(10));
    EXPECT_FALSE(axis.bit(11));
  }
  Reference axis(3);
  axis.set(0x6083, 0, 200 * turn);
  axis.set(0x6085, 0, 1000 * turn);
  axis.set(0x60FF, 0, 20 * turn);
  axis.run_ms(200);
  axis.limit_turns(-20.0, axis.turns() + 5.0);
  axis.set(0x6098, 0, 33);
  axis.set(0x6099, 1, turn);
  axis.set(0x6099, 2, turn / 4);
  axis.set(0x609A, 0, 10 * turn);
  axis.set(0x6060, 0, 6);
  axis.control(0x1F);
  axis.run_ms(6000);
  EXPECT_TRUE(axis.bit(12));
  EXPECT_FALSE(axis.bit(11));
}

}  // namespace
}  // namespace limits_and_stops_test
}  // namespace servodrome
