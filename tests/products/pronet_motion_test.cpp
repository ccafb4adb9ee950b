#include <cmath>
#include <gtest/gtest.h>

#include "products/pronet/pronet.hpp"
#include "rig.hpp"

// Motion of a ProNet drive in profile position and profile velocity, compared with closed-form results: ramps,
// S-curves, set-points and their handshake, option codes, units.
namespace servodrome {
namespace pronet_motion_test {
namespace {

using dictionary::AbortCode;
using drive::PowerState;
using products::Pronet;
using Axis = test::Rig<Pronet>;

constexpr double counts = 131072.0;
constexpr double tenth_rpm = counts / 600.0;  // counts/s

void must_set(Axis& axis, std::uint16_t index, std::uint8_t sub, std::int64_t value) {
  EXPECT_EQ(axis.set(index, sub, value), AbortCode::none) << std::hex << index << "h:" << int{sub};
}

void positioning(Axis& axis, std::int64_t velocity = 3000) {
  axis.run_ms(1);
  must_set(axis, 0x6060, 0, 1);
  must_set(axis, 0x6081, 0, velocity);
  ASSERT_TRUE(axis.enable());
}

void set_point(Axis& axis, std::int64_t target, std::uint16_t bits = 0) {
  must_set(axis, 0x607A, 0, target);
  axis.control(static_cast<std::uint16_t>(0x1F | bits));
}

// Seconds from now until the demand stands.
double until_standing(Axis& axis) {
  axis.run_ms(1);
  const std::int64_t ticks = axis.run_until([&] { return !axis.device.drive().in_motion(); }, 60000.0);
  EXPECT_GE(ticks, 0);
  return static_cast<double>(ticks) / 16000.0 + 0.001;
}

constexpr std::uint16_t reached = 0x0400;
constexpr std::uint16_t acknowledge = 0x1000;

// --- Units (ch. 4)

TEST(PronetMotion, SpeedsAreTenthsOfRpm) {
  Axis axis;
  axis.run_ms(1);
  must_set(axis, 0x6060, 0, 3);
  ASSERT_TRUE(axis.enable());
  must_set(axis, 0x60FF, 0, 12345);
  axis.run_ms(500);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 1234.5, 1.0);
  EXPECT_EQ(axis.get(0x606B), 12345);
  EXPECT_NEAR(static_cast<double>(axis.get(0x606C)), 12345.0, 15.0);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6069)), 12345.0, 15.0);
}

// The manual's examples of factors: speeds per minute are 10/1, accelerations per minute squared 10/60 (ch. 4.3
// and 4.4). 6069h is not scaled.
TEST(PronetMotion, FactorsScaleSpeedsAndRamps) {
  Axis axis;
  axis.run_ms(1);
  must_set(axis, 0x6094, 1, 10);
  must_set(axis, 0x6097, 1, 10);
  must_set(axis, 0x6097, 2, 60);
  must_set(axis, 0x6083, 0, 60000);  // rpm per minute: 1000 rpm in a second
  must_set(axis, 0x6060, 0, 3);
  ASSERT_TRUE(axis.enable());
  must_set(axis, 0x60FF, 0, 500);
  axis.run_ms(250);
  EXPECT_NEAR(axis.device.drive().axis().generator.velocity(), 250.0 / 60.0 * counts, 0.01 * counts);
  axis.run_ms(750);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 500.0, 1.0);
  EXPECT_NEAR(static_cast<double>(axis.get(0x606C)), 500.0, 2.0);
  EXPECT_NEAR(static_cast<double>(axis.get(0x6069)), 5000.0, 15.0);
}

TEST(PronetMotion, PositionFactorIsExact) {
  Axis axis;
  axis.run_ms(1);
  must_set(axis, 0x6093, 1, 131072);  // 10000 units per turn
  must_set(axis, 0x6093, 2, 10000);
  positioning(axis);
  set_point(axis, 25000);
  until_standing(axis);
  axis.run_ms(100);
  EXPECT_EQ(axis.get(0x6062), 25000);
  EXPECT_EQ(axis.get(0x60FC), 327680);
  EXPECT_NEAR(static_cast<double>(axis.plant.position_counts()), 327680.0, 30.0);
  EXPECT_EQ(axis.set(0x6093, 1, 7), AbortCode::device_state) << "not while the motor has power";
}

// --- Ramps

TEST(PronetMotion, TrapezoidTakesItsTime) {
  Axis axis;
  must_set(axis, 0x6083, 0, 20000);
  must_set(axis, 0x6084, 0, 10000);
  positioning(axis);
  set_point(axis, 5 * 131072);
  const double v = 3000.0;
  const double way = 5.0 * counts / tenth_rpm;  // in 0.1 rpm s
  const double ramps = v / 20000.0 + v / 10000.0;
  EXPECT_NEAR(until_standing(axis), way / v + ramps / 2.0, 0.002);
}

// 6086h = 2: the acceleration time from rest is v/a + a/j, or 2 sqrt(v/j) if a is not reached; the ramp down is the
// same (ch. 4, 7.4.3 and 7.4.4).
TEST(PronetMotion, SCurveTakesItsTime) {
  struct Curve {
    std::int64_t jerk;          // 60A4h:01
    std::int64_t velocity;      // 0.1 rpm
    std::int64_t acceleration;  // 0.1 rpm/s
  };
  for (const Curve& curve : {Curve{5, 3000, 100000}, Curve{1, 30000, 100000}, Curve{20, 30000, 100000},
                             Curve{5, 10000, 20000}, Curve{20, 10000, 5000}}) {
    SCOPED_TRACE(std::to_string(curve.jerk) + " " + std::to_string(curve.velocity));
    Axis axis;
    must_set(axis, 0x6086, 0, 2);
    must_set(axis, 0x60A4, 1, curve.jerk);
    must_set(axis, 0x6083, 0, curve.acceleration);
    must_set(axis, 0x6084, 0, 1000000);  // no effect: the S-curve is symmetric
    positioning(axis, curve.velocity);
    const double v = static_cast<double>(curve.velocity) * tenth_rpm;
    const double a = static_cast<double>(curve.acceleration) * tenth_rpm;
    const double j = static_cast<double>(curve.jerk) * 1e8;  // pulse/s^3
    const double ramp = v >= a * a / j ? v / a + a / j : 2.0 * std::sqrt(v / j);
    const auto way = static_cast<std::int64_t>(std::ceil(v * ramp * 1.5));
    set_point(axis, way);
    axis.run_ms(0.5);
    std::int64_t accelerating = 0;
    const std::int64_t start = axis.ticks();
    axis.run_until(
        [&] {
          if (axis.device.drive().axis().generator.velocity() < v * (1.0 - 1e-9)) accelerating = axis.ticks() - start;
          return axis.device.drive().axis().generator.velocity() >= v * (1.0 - 1e-9);
        },
        10000.0);
    EXPECT_NEAR(static_cast<double>(accelerating) / 16000.0, ramp, 0.002);
    until_standing(axis);
    const double total = static_cast<double>(axis.ticks() - start) / 16000.0;
    EXPECT_NEAR(total, ramp + static_cast<double>(way) / v, 0.003);
    EXPECT_EQ(axis.get(0x6062), way);
  }
}

// With S-curves only single set-points are possible: a set-point during a motion is not accepted (ch. 7.4.4).
TEST(PronetMotion, SCurveTakesNoSecondSetPoint) {
  Axis axis;
  must_set(axis, 0x6086, 0, 2);
  positioning(axis);
  set_point(axis, 300000);
  axis.run_ms(50);
  axis.control(0x0F);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & acknowledge, acknowledge) << "not ready for another";
  for (const std::uint16_t bits : {std::uint16_t{0x00}, std::uint16_t{0x20}}) {
    set_point(axis, -300000, bits);
    axis.run_ms(5);
    axis.control(0x0F);
    axis.run_ms(5);
  }
  until_standing(axis);
  axis.run_ms(50);
  EXPECT_EQ(axis.get(0x6062), 300000);
  EXPECT_EQ(axis.status() & (acknowledge | reached), reached);
  set_point(axis, 0);
  until_standing(axis);
  EXPECT_EQ(axis.get(0x6062), 0);
}

// --- Set-points (ch. 7.4.1, 7.4.2, 7.4.4 and 9.3)

TEST(PronetMotion, OneSetPointRunsAndOneWaits) {
  Axis axis;
  positioning(axis);
  set_point(axis, 131072);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & (acknowledge | reached), acknowledge);
  axis.run_ms(20);
  EXPECT_EQ(axis.status() & acknowledge, acknowledge) << "a level of bit 4 does nothing";
  axis.control(0x0F);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & acknowledge, 0) << "ready for one that waits";
  set_point(axis, 65536);
  axis.run_ms(1);
  axis.control(0x0F);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & acknowledge, acknowledge) << "while one waits there is no room";
  set_point(axis, 999999);  // not executed, although data arrive
  axis.run_ms(1);
  axis.control(0x0F);
  set_point(axis, 888888, 0x20);  // not with immediate effect either
  axis.run_ms(1);
  axis.control(0x0F);
  bool reached_between = false;
  axis.run_until(
      [&] {
        reached_between |= (axis.status() & reached) != 0;
        return axis.get(0x6062) == 131072;
      },
      5000.0);
  EXPECT_FALSE(reached_between) << "bit 10 only after the last";
  until_standing(axis);
  axis.run_ms(50);
  EXPECT_EQ(axis.get(0x6062), 65536);
  EXPECT_EQ(axis.status() & (acknowledge | reached), reached);
}

TEST(PronetMotion, ChangeAtOnceBreaksOff) {
  Axis axis;
  positioning(axis);
  set_point(axis, 10 * 131072);
  axis.run_ms(100);
  axis.control(0x0F);
  axis.run_ms(1);
  set_point(axis, -131072, 0x20);
  until_standing(axis);
  EXPECT_EQ(axis.get(0x6062), -131072);
}

TEST(PronetMotion, RelativeToTheLastTarget) {
  Axis axis;
  positioning(axis);
  set_point(axis, 100000);
  axis.run_ms(20);
  axis.control(0x0F);
  axis.run_ms(1);
  set_point(axis, 50000, 0x60);  // relative, with immediate effect, during the motion
  until_standing(axis);
  EXPECT_EQ(axis.get(0x6062), 150000);
  axis.control(0x0F);
  axis.run_ms(1);
  set_point(axis, 150000);  // absolute, to the present position: no motion (ch. 9.3)
  axis.run_ms(20);
  EXPECT_FALSE(axis.device.drive().in_motion());
  EXPECT_EQ(axis.status() & reached, reached);
}

TEST(PronetMotion, WithoutProfileVelocityNothingMoves) {
  Axis axis;
  positioning(axis, 0);
  set_point(axis, 100000);
  axis.run_ms(200);
  EXPECT_EQ(axis.get(0x6062), 0);
  EXPECT_EQ(axis.status() & 0x6F, 0x27);
  axis.control(0x0F);
  must_set(axis, 0x6081, 0, 3000);
  axis.run_ms(1);
  set_point(axis, 100000);
  until_standing(axis);
  EXPECT_EQ(axis.get(0x6062), 100000);
}

// 6082h lets a sequence pass its first target without stopping (ch. 7.4.3, 6081h; ch. 7.4.4).
TEST(PronetMotion, EndVelocityPassesTheTarget) {
  Axis axis;
  must_set(axis, 0x6082, 0, 1500);
  positioning(axis);
  set_point(axis, 131072);
  axis.run_ms(1);
  axis.control(0x0F);
  axis.run_ms(1);
  must_set(axis, 0x6082, 0, 0);
  set_point(axis, 262144);
  double slowest = 1e9;
  axis.run_until(
      [&] {
        if (axis.get(0x6062) > 120000) slowest = std::min(slowest, axis.device.drive().axis().generator.velocity());
        return axis.get(0x6062) > 150000;
      },
      5000.0);
  EXPECT_NEAR(slowest, 1500.0 * tenth_rpm, 50.0 * tenth_rpm);
  until_standing(axis);
  EXPECT_EQ(axis.get(0x6062), 262144);
}

TEST(PronetMotion, HaltStopsByItsCodeAndGoesOn) {
  struct Halt {
    int code;  // 0: the factory value, acts like 1
    double deceleration;
  };
  for (const Halt& halt : {Halt{0, 10000.0}, Halt{1, 10000.0}, Halt{2, 40000.0}}) {
    SCOPED_TRACE(halt.code);
    Axis axis;
    must_set(axis, 0x6084, 0, 10000);
    must_set(axis, 0x6085, 0, 40000);
    if (halt.code != 0) must_set(axis, 0x605D, 0, halt.code);
    positioning(axis);
    set_point(axis, 10 * 131072);
    axis.run_ms(500);
    axis.control(0x11F);
    EXPECT_NEAR(until_standing(axis), 3000.0 / halt.deceleration, 0.002);
    axis.run_ms(1);
    EXPECT_EQ(axis.status() & 0x046F, 0x0427);
    axis.control(0x1F);
    axis.run_ms(1);
    EXPECT_EQ(axis.status() & reached, 0);
    until_standing(axis);
    EXPECT_EQ(axis.get(0x6062), 10 * 131072);
  }
}

// --- Windows (ch. 5 and 7.3.3)

TEST(PronetMotion, FollowingErrorShowsInBit13AndNowhereElse) {
  Axis axis;
  positioning(axis);
  set_point(axis, 10 * 131072);
  axis.run_ms(100);
  must_set(axis, 0x6065, 0, 20000);
  axis.run_ms(20);
  EXPECT_EQ(axis.status() & 0x2000, 0);
  axis.plant.lock_rotor(true);
  ASSERT_GE(axis.run_until([&] { return (axis.status() & 0x2000) != 0; }, 200.0), 0);
  axis.run_ms(20);
  EXPECT_EQ(axis.status() & 0x206F, 0x2027) << "no alarm";
  EXPECT_EQ(axis.get(0x603F), 0);
  must_set(axis, 0x6065, 0, 0x7FFFFFFF);
  axis.run_ms(1);
  EXPECT_EQ(axis.status() & 0x2000, 0);
}

TEST(PronetMotion, VelocityWindows) {
  Axis axis;
  axis.run_ms(1);
  must_set(axis, 0x6060, 0, 3);
  must_set(axis, 0x6083, 0, 10000);
  must_set(axis, 0x6084, 0, 10000);
  must_set(axis, 0x606E, 0, 50);
  must_set(axis, 0x6070, 0, 30);
  ASSERT_TRUE(axis.enable());
  axis.run_ms(100);
  EXPECT_EQ(axis.status() & 0x1400, 0x1400) << "at standstill, as wanted";
  must_set(axis, 0x60FF, 0, 3000);
  axis.run_ms(20);
  EXPECT_EQ(axis.status() & 0x1400, 0x1000) << "faster than 606Fh, but not for long enough";
  axis.run_ms(30);
  EXPECT_EQ(axis.status() & 0x1400, 0);
  axis.run_ms(280);  // the ramp takes 300 ms, the window 50
  EXPECT_EQ(axis.status() & 0x0400, 0);
  axis.run_ms(60);
  EXPECT_EQ(axis.status() & 0x3400, 0x0400);
  axis.control(0x10F);
  axis.run_ms(100);
  EXPECT_EQ(axis.status() & 0x1400, 0) << "halt: decelerates";
  axis.run_ms(300);
  EXPECT_EQ(axis.status() & 0x1400, 0x1400) << "halt: speed 0";
}

// --- Power states

TEST(PronetMotion, OptionCodes) {
  struct Code {
    std::uint16_t index;
    int value;  // -1: the factory value
    std::uint16_t controlword;
    double seconds;         // 0: no ramp
    std::uint16_t ends_in;  // statusword & 6Fh
  };
  const double ramp = 3000.0 / 10000.0;
  const double urgent = 3000.0 / 40000.0;
  const std::vector<Code> codes{
      {0x605A, -1, 0x0B, 0.0, 0x40},   {0x605A, 0, 0x0B, 0.0, 0x40},  {0x605A, 1, 0x0B, ramp, 0x40},
      {0x605A, 2, 0x0B, urgent, 0x40}, {0x605A, 5, 0x0B, ramp, 0x07}, {0x605A, 6, 0x0B, urgent, 0x07},
      {0x605B, -1, 0x06, 0.0, 0x21},   {0x605B, 0, 0x06, 0.0, 0x21},  {0x605B, 1, 0x06, ramp, 0x21},
      {0x605C, -1, 0x07, 0.0, 0x23},   {0x605C, 0, 0x07, 0.0, 0x23},  {0x605C, 1, 0x07, ramp, 0x23},
  };
  for (const Code& code : codes) {
    SCOPED_TRACE(testing::Message() << std::hex << code.index << "h = " << std::dec << code.value);
    Axis axis;
    axis.run_ms(1);
    must_set(axis, 0x6060, 0, 3);
    must_set(axis, 0x6084, 0, 10000);
    must_set(axis, 0x6085, 0, 40000);
    if (code.value >= 0) must_set(axis, code.index, 0, code.value);
    ASSERT_TRUE(axis.enable());
    must_set(axis, 0x60FF, 0, 3000);
    axis.run_ms(300);
    axis.control(code.controlword);
    if (code.seconds == 0.0) {
      axis.run_ms(1);
      EXPECT_FALSE(axis.actuation.pwm_enabled);
      EXPECT_GT(axis.plant.velocity_rpm(), 250.0) << "coasts";
    } else {
      EXPECT_NEAR(until_standing(axis), code.seconds, 0.002);
      axis.run_ms(1);
    }
    EXPECT_EQ(axis.status() & (code.ends_in == 0x40 ? 0x4F : 0x6F), code.ends_in);
    EXPECT_EQ(axis.actuation.pwm_enabled, code.ends_in == 0x07);
    if (code.ends_in == 0x07) {
      axis.control(0x0F);  // transition 16
      axis.run_ms(1);
      EXPECT_EQ(axis.status() & 0x6F, 0x27);
    }
  }
}

// Bits 8, 9, 14 and 15 are not used; bit 4 shows the main power (ch. 6.2.2).
TEST(PronetMotion, StatuswordThroughTheStates) {
  Axis axis;
  axis.run_ms(1);
  EXPECT_EQ(axis.status(), 0x0050);
  axis.control(0x06);
  axis.run_ms(1);
  EXPECT_EQ(axis.status(), 0x0031);
  axis.control(0x07);
  axis.run_ms(1);
  EXPECT_EQ(axis.status(), 0x0033);
  EXPECT_FALSE(axis.actuation.pwm_enabled) << "the motor is free while Switched on (C22)";
  axis.control(0x0F);
  axis.run_ms(1);
  EXPECT_EQ(axis.status(), 0x0037);
  axis.control(0x00);
  axis.run_ms(1);
  EXPECT_EQ(axis.status(), 0x0050);
  axis.control(0x06);
  axis.control(0x0F);  // "switch on" with the enable bit set: 3 and then 4
  axis.run_ms(1);
  EXPECT_EQ(axis.status(), 0x0037);
  must_set(axis, 0x60FF, 0, 3000);
  must_set(axis, 0x607A, 0, 3000);
  axis.control(0x1F);
  axis.run_ms(100);
  EXPECT_EQ(axis.plant.position_counts(), 0) << "mode 0: nothing moves";
}

TEST(PronetMotion, TorqueLimitShowsInBit11) {
  Axis axis;
  axis.run_ms(1);
  must_set(axis, 0x3068, 0, 20);  // Pn401, per cent
  must_set(axis, 0x6060, 0, 3);
  ASSERT_TRUE(axis.enable());
  axis.plant.lock_rotor(true);
  must_set(axis, 0x60FF, 0, 3000);
  axis.run_ms(300);
  EXPECT_EQ(axis.status() & 0x0800, 0x0800);
  EXPECT_NEAR(static_cast<double>(axis.device.drive().loops().torque), 0.20, 0.01);
  EXPECT_NEAR(static_cast<double>(axis.get(0x320D)), 20.0, 1.0);  // Un003, per cent
}

// Un000 and Un001 in rpm.
TEST(PronetMotion, MonitorsOfTheSpeed) {
  Axis axis;
  axis.run_ms(1);
  must_set(axis, 0x6060, 0, 3);
  ASSERT_TRUE(axis.enable());
  for (const std::int64_t target : {6000, -3000}) {  // 0.1 rpm
    must_set(axis, 0x60FF, 0, target);
    axis.run_ms(1500);
    const auto rpm = [&axis](std::uint16_t index) { return static_cast<std::int16_t>(axis.get(index)); };
    EXPECT_NEAR(axis.plant.velocity_rpm(), 0.1 * static_cast<double>(target), 3.0);
    EXPECT_NEAR(rpm(0x320A), axis.plant.velocity_rpm(), 2.0);
    EXPECT_NEAR(rpm(0x320B), 0.1 * static_cast<double>(target), 1.0);
  }
}

// --- Ramps that exceed the motor: as steep as the torque limits allow, without an over-current fault.

TEST(PronetMotion, TheSteepestRampsAreNoOverCurrent) {
  for (const std::int32_t encoder : {131072, 10000}) {
    for (const std::int64_t percent : {300, 100, 30}) {
      for (const int mode : {1, 3, 6}) {
        SCOPED_TRACE(testing::Message() << encoder << " counts, mode " << mode << ", " << percent << " %");
        plant::Parameters parameters = test::default_plant();
        parameters.encoder.counts_per_revolution = encoder;
        const double comparator_a = 1.5 * static_cast<double>(test::motor_data(parameters).peak_current_a);
        parameters.supply.overcurrent_a = parameters.supply.bus_overcurrent_a = comparator_a;
        Axis axis(parameters);
        axis.run_ms(1);
        for (const std::uint16_t ramp : {std::uint16_t{0x6083}, std::uint16_t{0x6084}, std::uint16_t{0x6085}}) {
          must_set(axis, ramp, 0, 0xFFFFFFFF);
        }
        must_set(axis, 0x605A, 0, 2);
        must_set(axis, 0x609A, 0, 0x7FFFFFFF);
        must_set(axis, 0x3068, 0, percent);
        must_set(axis, 0x3069, 0, percent);
        must_set(axis, 0x6099, 1, 60000);
        must_set(axis, 0x6099, 2, 30000);
        must_set(axis, 0x6098, 0, 17);
        must_set(axis, 0x6060, 0, mode);
        must_set(axis, 0x6081, 0, 60000);
        must_set(axis, 0x6065, 0, 0x7FFFFFFF);
        ASSERT_TRUE(axis.enable());
        const auto run = [&](double ms, const char* what) {
          for (int i = 0; i < static_cast<int>(ms); ++i) {
            axis.run_ms(1);
            ASSERT_EQ(axis.get(0x603F), 0) << what << ", " << i << " ms";
            ASSERT_EQ(axis.get(0x1001), 0) << what << ", " << i << " ms";
          }
        };
        for (const int sign : {1, -1, 1}) {
          must_set(axis, 0x607A, 0, sign * 100LL * encoder);
          must_set(axis, 0x60FF, 0, sign * 60000LL);
          axis.control(0x1F);
          run(700, "run");
          axis.control(0x0F);
          run(20, "bit 4 away");
        }
        axis.control(0x10F);
        run(500, "halt");
        axis.control(0x0F);
        run(300, "on");
        axis.control(0x02);
        run(700, "quick stop");
        EXPECT_NEAR(axis.plant.velocity_rpm(), 0.0, 3.0);
        must_set(axis, 0x60FF, 0, 0);
        ASSERT_TRUE(axis.enable());
        run(300, "enabled again");
        axis.control(0x0F);
        must_set(axis, 0x60FF, 0, -60000);
        axis.control(0x1F);
        run(200, "again");
        must_set(axis, 0x6060, 0, mode == 3 ? 1 : 3);
        run(500, "another mode");
        axis.control(0x00);
        run(100, "power off");
      }
    }
  }
}

}  // namespace
}  // namespace pronet_motion_test
}  // namespace servodrome
