#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <gtest/gtest.h>
#include <vector>

#include "ismk_rig.hpp"
#include "jmc_rig.hpp"
#include "reference_axis.hpp"

// From a motion to a torque, from a torque to rest, and from a motion to a rest without a target, with heavy loads. The
// test measures the true shaft.
namespace servodrome {
namespace torque_and_rest_test {
namespace {

using drive::Signal;
using test::IsmkRig;
using test::JmcRig;
using test::Reference;

constexpr std::int64_t turn = 131072;

// With an inertia of so many rotors on the shaft.
plant::Parameters heavy(plant::Parameters parameters, double rotors) {
  parameters.load.inertia_kgm2 = rotors * parameters.motor.rotor_inertia_kgm2;
  return parameters;
}
plant::Parameters heavy(double rotors) { return heavy(test::default_plant(), rotors); }

// The extremes of the shaft's speed, turns/s, within this time.
struct Speeds {
  double least;
  double greatest;
};
Speeds speeds(Reference& axis, int milliseconds) {
  Speeds seen{axis.turns_per_s(), axis.turns_per_s()};
  for (int i = 0; i < milliseconds; ++i) {
    axis.run_ms(1);
    seen.least = std::min(seen.least, axis.turns_per_s());
    seen.greatest = std::max(seen.greatest, axis.turns_per_s());
  }
  return seen;
}

// --- A shaft that is enabled while it coasts

// A drive with a brake whose shaft coasts at 20 turns/s, and that is then enabled: the brake opens for 100 ms.
struct EnabledWhileItCoasts : Reference {
  EnabledWhileItCoasts() : Reference(0, heavy(20.0)) {
    control(0x00);
    set(0x2020, 1, 100);
    set(0x2020, 2, 20);
    set(0x605E, 0, 2);
    set(0x6085, 0, 50 * turn);
    plant.set_external_torque_nm(-0.5 * plant.parameters().motor.rated_torque_nm);
    for (int ms = 0; ms < 5000 && turns_per_s() < 20.0; ++ms) run_ms(1);
    plant.set_external_torque_nm(0.0);
    for (const auto word : std::to_array<std::uint16_t>({0x06, 0x07, 0x0F})) control(word);
  }
};

TEST(EnabledInMotion, ComesToRestAndDoesNotTurnBack) {
  EnabledWhileItCoasts axis;
  ASSERT_GE(axis.turns_per_s(), 15.0);
  const Speeds seen = speeds(axis, 3000);
  EXPECT_GE(seen.least, -0.2);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
  EXPECT_TRUE(axis.actuation.pwm_enabled);
}

// The power goes only when the shaft stands.
TEST(EnabledInMotion, IsBrakedByAFaultWhileTheBrakeOpens) {
  EnabledWhileItCoasts axis;
  axis.run_ms(5);
  axis.device.drive().inject(drive::Cause::external, true);
  ASSERT_GE(axis.run_until([&] { return !axis.actuation.pwm_enabled; }, 5000.0), 0);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.2);
  EXPECT_FALSE(axis.actuation.brake_released);
}

// --- The torque with which profile torque begins

// 6087h lets the first torque fade in 20 s; the torque that braked the axis must not be that torque.
TEST(TorqueBegins, WithoutTheTorqueThatBrakes) {
  for (const std::int64_t mode : {1, 3}) {
    SCOPED_TRACE(mode);
    Reference axis(mode, heavy(50.0));
    axis.set(0x6065, 0, 0xFFFFFFFF);
    axis.set(0x6081, 0, 20 * turn);
    axis.set(0x6083, 0, 100 * turn);
    axis.set(0x6084, 0, 300 * turn);
    axis.set(0x6087, 0, 100);
    axis.set(0x60FF, 0, 20 * turn);
    if (mode == 1) test::absolute_move(axis, 1000 * turn, 0x1F);
    axis.run_ms(1000);
    ASSERT_NEAR(axis.turns_per_s(), 20.0, 1.0);
    axis.set(0x60FF, 0, 0);
    if (mode == 1) axis.control(0x10F);
    axis.run_ms(20);
    ASSERT_LT(axis.device.drive().loops().torque, -1.0F);
    ASSERT_GT(axis.turns_per_s(), 5.0);
    if (mode == 1) axis.control(0x0F);
    axis.set(0x6060, 0, 4);
    EXPECT_GT(speeds(axis, 3000).least, -0.5);
  }
}

// A stop that is taken back: the torque comes back by its slope, in its own direction.
TEST(TorqueBegins, AgainAfterAStopInItsOwnDirection) {
  struct Case {
    std::uint16_t word;
    std::int64_t halt;
  };
  for (const Case& row : {Case{0x10F, 1}, Case{0x10F, 2}, Case{0x10F, 3}, Case{0x0B, 2}, Case{0x07, 2}}) {
    SCOPED_TRACE(testing::Message() << std::hex << row.word << ", 605Dh = " << row.halt);
    Reference axis(4, heavy(50.0));
    axis.set(0x6087, 0, 1000);
    axis.set(0x6080, 0, 1200);
    axis.set(0x605D, 0, row.halt);
    axis.set(0x605A, 0, 6);
    axis.set(0x605C, 0, 1);
    axis.set(0x6084, 0, 300 * turn);
    axis.set(0x6085, 0, 300 * turn);
    axis.set(0x6071, 0, 500);
    axis.run_ms(2000);
    ASSERT_NEAR(axis.turns_per_s(), 20.0, 1.0);
    axis.control(row.word);
    axis.run_ms(15);
    ASSERT_GT(axis.turns_per_s(), 5.0);
    axis.control(0x0F);
    EXPECT_GT(speeds(axis, 3000).least, 1.0);
    EXPECT_NEAR(axis.turns_per_s(), 20.0, 1.0);
  }
}

// A load that the loops hold at rest is held on, and changes over to the target by 6087h.
TEST(TorqueBegins, WithTheLoadAtRest) {
  for (const std::int64_t mode : {1, 3, 8}) {
    for (const bool halted : {false, true}) {
      SCOPED_TRACE(testing::Message() << "mode " << mode << (halted ? ", after a halt" : ""));
      Reference axis(halted ? 4 : mode, heavy(50.0));
      if (halted) axis.control(0x10F);
      axis.run_ms(50);
      axis.plant.set_external_torque_nm(0.5);
      axis.run_ms(1000);
      const double held = axis.plant.torque_nm() / test::default_plant().motor.rated_torque_nm * 1000.0;
      ASSERT_GT(std::abs(held), 350.0);
      axis.set(0x6087, 0, 100);
      axis.set(0x6060, 0, 4);
      axis.control(0x0F);
      const auto demanded = [&] { return static_cast<double>(axis.get(0x6074)); };
      axis.run_ms(5);
      EXPECT_NEAR(demanded(), held, 15.0);
      axis.run_ms(1000);
      EXPECT_NEAR(demanded(), held - std::copysign(100.0, held), 15.0);
    }
  }
}

// The reference drive with a load that hangs on the shaft. The drive waits 80 ms for the brake, which opens after 30
// ms.
struct Hanging : test::Rig<products::Generic402> {
  explicit Hanging(std::int64_t mode) : Rig(test::hanging(test::default_plant(), 0.6, 3.0)) {
    set(0x2020, 1, 80);
    set(0x2020, 2, 40);
    set(0x6060, 0, mode);
    set(0x605D, 0, 1);
    set(0x6084, 0, 100 * turn);
    set(0x6085, 0, 100 * turn);
    set(0x6087, 0, 10);  // the load stays held for a long time
    run_ms(1);
    control(0x06);
    control(0x07);
    run_ms(200);
  }
  double turns() { return static_cast<double>(plant.position_counts()) / turn; }
  // The way from the present position to the farthest one within this time.
  double strays(int milliseconds) {
    const double here = turns();
    double most = 0.0;
    for (int ms = 0; ms < milliseconds; ++ms) {
      run_ms(1);
      most = std::max(most, std::abs(turns() - here));
    }
    return most;
  }
};

// While the brake opens the loops hold the load. The torque begins with it, whatever happens meanwhile.
TEST(TorqueBegins, WithTheLoadThatTheBrakeHeld) {
  struct Event {
    const char* name;
    std::int64_t mode;  // at the beginning
    std::function<void(Hanging&)> action;
  };
  const std::vector<Event> events{
      {"enabled in the mode", 4, [](Hanging&) {}},
      {"the mode is chosen meanwhile", 1, [](Hanging& axis) { axis.set(0x6060, 0, 4); }},
      {"the mode is left and chosen again", 4,
       [](Hanging& axis) {
         axis.set(0x6060, 0, 3);
         axis.run_ms(3);
         axis.set(0x6060, 0, 4);
       }},
      {"enabled twice", 4, [](Hanging& axis) { axis.control(0x0F); }},
      {"a halt that ends meanwhile", 4,
       [](Hanging& axis) {
         axis.control(0x10F);
         axis.run_ms(3);
         axis.control(0x0F);
       }},
      {"a halt that ends afterwards", 4,
       [](Hanging& axis) {
         axis.control(0x10F);
         axis.run_ms(100);
         axis.control(0x0F);
       }},
      {"disabled and enabled", 4,
       [](Hanging& axis) {
         axis.control(0x07);
         axis.run_ms(3);
         axis.control(0x0F);
       }},
      {"power off and on", 4,
       [](Hanging& axis) {
         axis.control(0x00);
         axis.run_ms(100);
         for (const auto word : std::to_array<std::uint16_t>({0x06, 0x07, 0x0F})) axis.control(word);
       }},
      {"quick stop and back", 4,
       [](Hanging& axis) {
         axis.set(0x605A, 0, 6);
         axis.control(0x02);
         axis.run_ms(100);
         axis.control(0x0F);
       }},
  };
  for (const Event& event : events) {
    for (const int after_ms : {2, 20, 50}) {
      SCOPED_TRACE(testing::Message() << event.name << ", after " << after_ms << " ms");
      Hanging axis(event.mode);
      axis.control(0x0F);
      axis.run_ms(after_ms);
      event.action(axis);
      EXPECT_LT(axis.strays(500), 0.02);
      EXPECT_EQ(axis.status() & 0x6F, 0x27);
      EXPECT_EQ(axis.get(0x6061), 4);
      EXPECT_NEAR(axis.plant.torque_nm(), 0.6, 0.05);
    }
  }
}

// --- A torque beyond its limit

// 6071h = 3000 for 3 s, of which 6072h allows 500: without a target the torque falls from 500 in 0.5 s.
TEST(TorqueRamp, TurnsBackAtTheLimit) {
  for (const std::int64_t shape : {0, 1}) {
    for (const auto limit : std::to_array<std::uint16_t>({0x6072, 0x60E0})) {
      SCOPED_TRACE(testing::Message() << "6088h = " << shape << std::hex << ", " << limit);
      Reference axis(4, heavy(2000.0));
      axis.set(limit, 0, 500);
      axis.set(0x6088, 0, shape);
      axis.set(0x6087, 0, 1000);
      axis.set(0x6071, 0, 3000);
      axis.run_ms(3000);
      EXPECT_EQ(axis.get(0x6074), 500);
      EXPECT_TRUE(axis.bit(11));
      EXPECT_FALSE(axis.bit(10)) << "the target is not reached";
      axis.set(0x6071, 0, 0);
      axis.run_ms(shape == 0 ? 510 : 800);
      EXPECT_EQ(axis.get(0x6074), 0);
      EXPECT_FALSE(axis.bit(11));
      EXPECT_TRUE(axis.bit(10));
      axis.set(0x6071, 0, 3000);
      axis.run_ms(3000);
      axis.set(limit, 0, 200);
      axis.run_ms(20);
      EXPECT_EQ(axis.get(0x6074), 200) << "a lowered limit holds at once";
      axis.set(limit, 0, 3000);
      axis.run_ms(10);
      EXPECT_LT(axis.get(0x6074), 250) << "a raised limit is reached by the slope";
    }
  }
}

TEST(TorqueRamp, BeginsAfterAnotherTypeOrAStep) {
  for (const bool step : {false, true}) {
    SCOPED_TRACE(step);
    Reference axis(4, heavy(200.0));
    axis.set(0x6080, 0, 60);
    axis.set(0x6087, 0, 1000);
    axis.set(0x6088, 0, 1);
    axis.set(0x6071, 0, 500);
    axis.run_ms(2000);
    axis.set(step ? 0x6087 : 0x6088, 0, 0);
    axis.set(0x6071, 0, 0);
    axis.run_ms(2000);
    ASSERT_EQ(axis.get(0x6074), 0);
    axis.set(0x6087, 0, 1000);
    axis.set(0x6088, 0, 1);
    axis.set(0x6071, 0, 500);
    axis.run_ms(2);
    EXPECT_LT(axis.get(0x6074), 10);
  }
}

// --- A rest without a target

// The shaft runs out with the torque that the motor has, and never comes back for the ramp that is too steep for it.
struct RunOut {
  double back_turns;
  double speed;  // at the end, turns/s
};
RunOut run_out(Reference& axis, int milliseconds) {
  double furthest = axis.turns();
  double back = 0.0;
  for (int i = 0; i < milliseconds; ++i) {
    axis.run_ms(1);
    furthest = std::max(furthest, axis.turns());
    back = std::max(back, furthest - axis.turns());
  }
  return {back, axis.turns_per_s()};
}

constexpr double most_back = 0.2;  // the swing of a heavy shaft about its place of rest

constexpr std::array<std::int64_t, 3> too_steep{1000 * turn, 0xFFFFFFFF, 0};

TEST(RestWithoutATarget, IsWhereTheShaftCanStop) {
  for (const std::int64_t ramp : too_steep) {
    for (const std::int64_t mode : {0, 1, 6, 7, 8}) {
      SCOPED_TRACE(testing::Message() << "6084h = " << ramp << ", mode " << mode);
      Reference axis(3, heavy(60.0));
      axis.set(0x6065, 0, 0xFFFFFFFF);
      axis.set(0x6083, 0, 20 * turn);
      axis.set(0x60FF, 0, 20 * turn);
      axis.run_ms(1500);
      ASSERT_NEAR(axis.turns_per_s(), 20.0, 0.5);
      axis.set(0x6084, 0, ramp);
      axis.set(0x6085, 0, ramp);
      axis.set(0x6060, 0, mode);
      const RunOut end = run_out(axis, 4000);
      EXPECT_LT(end.back_turns, most_back);
      EXPECT_NEAR(end.speed, 0.0, 0.05);
    }
  }
}

TEST(RestWithoutATarget, OfAnInterpolationOrAHomingThatIsGivenUp) {
  for (const std::int64_t mode : {6, 7}) {
    SCOPED_TRACE(mode);
    Reference axis(mode, heavy(60.0));
    axis.set(0x6065, 0, 0xFFFFFFFF);
    axis.set(0x60C2, 1, 2);
    axis.set(0x6098, 0, 18);
    axis.set(0x6099, 1, 20 * turn);
    axis.set(0x609A, 0, 20 * turn);
    axis.control(0x1F);
    double target = 0.0;
    double speed = 0.0;
    for (int i = 0; i < 1000; ++i) {
      speed = std::min(20.0, speed + 0.04);
      axis.set(0x60C1, 1, static_cast<std::int64_t>(target += speed * turn / 500.0));
      axis.run_ms(2);
    }
    ASSERT_NEAR(axis.turns_per_s(), 20.0, 1.0);
    axis.set(0x6084, 0, 0xFFFFFFFF);
    if (mode == 6) axis.set(0x609A, 0, 0);
    axis.control(0x0F);
    const RunOut end = run_out(axis, 4000);
    EXPECT_LT(end.back_turns, most_back);
    EXPECT_NEAR(end.speed, 0.0, 0.05);
  }
}

// At rest the position loop holds the axis there: a load that pushes it the way it came does not shift its demand.
TEST(RestWithoutATarget, IsHeldAgainstALoad) {
  Reference axis(3, heavy(60.0));
  axis.set(0x6065, 0, 0xFFFFFFFF);
  axis.set(0x6083, 0, 20 * turn);
  axis.set(0x60FF, 0, 20 * turn);
  axis.run_ms(1500);
  axis.set(0x6084, 0, 1000 * turn);
  axis.set(0x6060, 0, 1);
  axis.run_ms(4000);
  const double there = axis.turns();
  for (const double load_nm : {2.0, -2.0}) {
    axis.plant.set_external_torque_nm(load_nm);
    axis.run_ms(500);
    axis.plant.set_external_torque_nm(0.0);
    axis.run_ms(1500);
    EXPECT_NEAR(axis.turns(), there, 0.002);
  }
}

TEST(LimitSwitch, WithAnEndlessRampStopsWhereTheShaftCan) {
  for (const std::int64_t mode : {1, 7, 8}) {
    SCOPED_TRACE(mode);
    Reference axis(mode, heavy(60.0));
    axis.set(0x6065, 0, 0xFFFFFFFF);
    axis.set(0x6085, 0, 0xFFFFFFFF);
    axis.set(0x6083, 0, 20 * turn);
    axis.set(0x6081, 0, 20 * turn);
    axis.set(0x60C2, 1, 2);
    axis.control(0x1F);
    if (mode == 1) test::absolute_move(axis, 1000 * turn, 0x1F);
    double target = 0.0;
    double speed = 0.0;
    const auto go = [&] {
      speed = std::min(20.0, speed + 0.04);
      target += speed * turn / 500.0;
      if (mode != 1) axis.set(mode == 7 ? 0x60C1 : 0x607A, mode == 7 ? 1 : 0, static_cast<std::int64_t>(target));
      axis.run_ms(2);
    };
    for (int i = 0; i < 750; ++i) go();
    ASSERT_NEAR(axis.turns_per_s(), 20.0, 1.5);
    axis.plant.force_input(0, true);
    double furthest = axis.turns();
    for (int i = 0; i < 1500; ++i) {
      go();
      furthest = std::max(furthest, axis.turns());
      ASSERT_GT(axis.turns(), furthest - most_back);
    }
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.05);
  }
}

// --- A stop out of torque control without a fast integral

// The motor data have the rotor only: what accelerates the load looks like a load to hold.
TEST(StopOutOfTorque, StopsWithoutAnIntegral) {
  for (const std::int64_t mode : {4, 3}) {
    SCOPED_TRACE(mode);
    IsmkRig rig(heavy(test::ismk_plant(), 8.0), test::ismk_settings());
    rig.run_ms(5);
    rig.set(0x60F9, 2, 0);
    rig.set(0x60F9, 7, 0);
    rig.set(0x605A, 0, 6);
    rig.set(0x607F, 0, 17895697LL * 3);
    for (const auto ramp : std::to_array<std::uint16_t>({0x6083, 0x6084, 0x6085})) rig.set(ramp, 0, 100000);
    rig.set(0x6060, 0, 4);
    rig.set(0x6071, 0, 1000);
    rig.control(0x0F);
    ASSERT_GE(rig.run_until([&] { return rig.plant.velocity_rpm() > 500.0; }, 3000.0), 0);
    if (mode == 4) {
      rig.control(0x02);
    } else {
      rig.set(0x60FF, 0, 0);
      rig.set(0x6060, 0, 3);
    }
    rig.run_ms(1500);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 2.0);
  }
}

TEST(StopOutOfTorque, StopsWithASlowIntegral) {
  {
    Reference axis(4, heavy(8.0));
    axis.set(0x2010, 3, 1);
    axis.set(0x6071, 0, 500);
    axis.set(0x6084, 0, 100 * turn);
    ASSERT_GE(axis.run_until([&] { return axis.turns_per_s() > 10.0; }, 5000.0), 0);
    axis.control(0x10F);
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.05);
  }
  JmcRig rig(heavy(test::jmc_plant(), 8.0), test::jmc_settings());
  rig.open_limits();
  rig.set_panel(1, 4, 0);
  rig.set_panel(2, 30, 1);
  rig.set_panel(2, 14, 10000);  // 1000 ms
  rig.set(0x6060, 0, 10);
  ASSERT_TRUE(rig.enable());
  rig.set(0x6071, 0, 500);
  ASSERT_GE(rig.run_until([&] { return rig.plant.velocity_rpm() > 500.0; }, 5000.0), 0);
  rig.control(0x10F);
  rig.run_ms(500);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 5.0);
}

// What the torque holds at rest is a load, and no stop drops it.
TEST(StopOutOfTorque, HoldsALoadWithoutAnIntegral) {
  IsmkRig rig(test::hanging(test::ismk_plant(), 0.3, 0.0), test::ismk_settings());
  rig.run_ms(5);
  rig.set(0x6060, 0, 1);
  rig.control(0x0F);
  rig.run_ms(1000);
  const double share = static_cast<double>(rig.device.drive().loops().torque);
  rig.set(0x6071, 0, std::lround(1000.0 * share));
  rig.set(0x6060, 0, 4);
  rig.set(0x60F9, 2, 0);
  rig.set(0x60F9, 7, 0);
  rig.run_ms(20);
  rig.set(0x605A, 0, 6);
  rig.control(0x02);
  const std::int64_t there = rig.plant.position_counts();
  rig.run_ms(500);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts() - there), 0.0, 65536.0 / 20.0);
}

// --- A limit that the shaft meets behind its demand

TEST(LimitSwitch, StopsAShaftThatCatchesUpInASoftLoop) {
  for (const std::int64_t kp : {1000, 300, 100}) {
    SCOPED_TRACE(kp);
    Reference axis(1);
    axis.set(0x2010, 1, kp);
    axis.set(0x2010, 4, 0);
    axis.set(0x6065, 0, 0xFFFFFFFF);
    axis.set(0x6081, 0, 5 * turn);
    for (const auto ramp : std::to_array<std::uint16_t>({0x6083, 0x6084, 0x6085})) axis.set(ramp, 0, 100 * turn);
    test::absolute_move(axis, 20 * turn, 0x1F);
    ASSERT_GE(axis.run_until([&] { return !axis.device.drive().in_motion(); }, 20000.0), 0);
    const double there = axis.turns();
    const double speed = axis.turns_per_s();
    ASSERT_GT(speed, 1.0);
    axis.plant.force_input(0, true);
    axis.run_ms(20000);
    EXPECT_LT(axis.turns() - there, speed * speed / 200.0 + 0.02);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
    EXPECT_TRUE(axis.bit(11));
  }
}

// --- A smoothed demand that reverses

template <typename RigType>
double turns(RigType& rig) {
  return static_cast<double>(rig.plant.position_counts()) /
         static_cast<double>(rig.device.drive().configuration().motor.counts_per_revolution);
}
template <typename RigType>
double furthest(RigType& rig, int milliseconds) {
  double most = turns(rig);
  for (int i = 0; i < milliseconds; ++i) rig.run_ms(1), most = std::max(most, turns(rig));
  return most;
}
constexpr std::int64_t rpm_2000 = 17895697LL * 2;  // iSMK, 6081h and 60FFh

// Turns at 2000 rpm in this mode, with its longest smoothing and with ramps that need much less time than that.
struct Smoothed : IsmkRig {
  explicit Smoothed(std::int64_t mode) {
    set(0x2010, 3, 0x0010);
    run_ms(5);
    EXPECT_TRUE(force(Signal::positive_limit, false));
    run_ms(5);
    set(0x60FB, 5, 255);
    set(0x6060, 0, mode);
    for (const auto ramp : std::to_array<std::uint16_t>({0x6083, 0x6084, 0x6085})) set(ramp, 0, 100000000);
    set(0x607F, 0, 2 * rpm_2000);
    set(0x6081, 0, rpm_2000);
    set(0x60FF, 0, mode == 3 ? rpm_2000 : 0);
    control(0x0F);
    run_ms(100);
    if (mode == 1) {
      set(0x607A, 0, 65536 * 100);
      control(0x1F);
    }
    run_ms(700);
    EXPECT_NEAR(plant.velocity_rpm(), 2000.0, 20.0);
  }
  void reverse() {
    control(0x0F);
    set(0x60FF, 0, -rpm_2000);
    set(0x607A, 0, -65536 * 100);
    control(0x3F);
    EXPECT_GE(run_until([&] { return device.drive().axis().generator.velocity() < 0.0; }, 300.0), 0);
  }
};

TEST(SmoothedReversal, ObeysALimitSwitch) {
  for (const std::int64_t mode : {1, 3}) {
    SCOPED_TRACE(mode);
    Smoothed rig(mode);
    rig.reverse();
    const double there = turns(rig);
    ASSERT_GT(rig.plant.velocity_rpm(), 1500.0);
    ASSERT_TRUE(rig.force(Signal::positive_limit, true));
    EXPECT_LT(furthest(rig, 600) - there, 0.5);
  }
  JmcRig rig;
  rig.open_limits();
  rig.set_panel(3, 16, 10000);  // 1 s
  rig.set(0x6060, 0, 1);
  rig.set(0x6081, 0, 300000);
  ASSERT_TRUE(rig.enable());
  rig.run_ms(300);
  const auto go_to = [&](double place, std::uint16_t word) {
    const double counts = place * static_cast<double>(rig.device.drive().configuration().motor.counts_per_revolution);
    rig.control(0x0F);
    rig.set(0x607A, 0, rig.device.drive().axis().units.to_user(static_cast<drive::Counts>(counts)));
    rig.control(word);
  };
  go_to(100.0, 0x1F);
  rig.run_ms(4000);
  go_to(-100.0, 0x3F);
  ASSERT_GE(rig.run_until([&] { return rig.device.drive().axis().generator.velocity() < 0.0; }, 3000.0), 0);
  const double there = turns(rig);
  ASSERT_GT(rig.plant.velocity_rpm(), 50.0);
  ASSERT_TRUE(rig.force(Signal::positive_limit, true));
  EXPECT_LT(furthest(rig, 3000) - there, 0.5);
}

TEST(SmoothedReversal, ObeysASoftwareLimit) {
  Smoothed rig(3);
  rig.set(0x60FF, 0, 0);
  rig.run_ms(2000);
  rig.set(0x6098, 0, 35);
  rig.set(0x6060, 0, 6);
  rig.control(0x1F);
  rig.run_ms(200);
  rig.control(0x0F);
  ASSERT_TRUE(rig.device.drive().homed());
  rig.set(0x6060, 0, 3);
  rig.set(0x60FF, 0, rpm_2000);
  rig.run_ms(1500);
  ASSERT_NEAR(rig.plant.velocity_rpm(), 2000.0, 20.0);
  const double limit = turns(rig) + 1.0;
  rig.set(0x607D, 1, rig.get(0x6064) + 65536);  // ch. 7.5: sub 1 is the positive limit
  rig.set(0x607D, 2, -65536 * 100);
  rig.set(0x60FF, 0, -rpm_2000);
  EXPECT_LT(furthest(rig, 2000), limit + 0.1);
}

}  // namespace
}  // namespace torque_and_rest_test
}  // namespace servodrome
