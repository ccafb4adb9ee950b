#include <cmath>
#include <gtest/gtest.h>
#include <random>

#include "ismk_rig.hpp"
#include "jmc_bus.hpp"
#include "products/generic402/generic402_ec.hpp"
#include "products/ismc/ismc.hpp"
#include "products/pronet/pronet.hpp"
#include "reference_axis.hpp"

// Events before and after a stop: jumps of the target, ramps of zero, limits, loads that lag. The test measures the
// true shaft, not the drive's values.
namespace servodrome {
namespace stop_sequences_test {
namespace {

using drive::PowerState;
using drive::Signal;
using products::Generic402;
using products::Generic402Ec;
using products::Ismc;
using products::Pronet;
using test::IsmkRig;
using test::JmcBus;
using test::one_move;
using test::Reference;
using test::Rig;

// --- Ramps of zero

// Without a profile a set-point causes no motion, regardless of earlier motions.
template <typename RigType>
void zero_value_after_a_move(RigType& rig, std::uint16_t zero, std::int64_t stroke) {
  SCOPED_TRACE(zero);
  rig.set(0x6060, 0, 1);
  ASSERT_TRUE(rig.enable());
  one_move(rig, stroke);
  rig.run_ms(1500);
  const std::int64_t stood = rig.plant.position_counts();
  ASSERT_GT(std::abs(stood), 1000);
  ASSERT_EQ(rig.set(zero, 0, 0), dictionary::AbortCode::none);
  one_move(rig, stroke);
  for (int i = 0; i < 1000; ++i) {
    rig.run_ms(0.5);
    ASSERT_NEAR(static_cast<double>(rig.plant.position_counts()), static_cast<double>(stood), 10.0) << i;
  }
}
template <typename Product>
void zero_values(std::int64_t velocity, std::int64_t ramp) {
  for (const std::uint16_t zero : std::to_array<std::uint16_t>({0x6081, 0x6083, 0x6084})) {
    Rig<Product> rig;
    rig.set(0x6081, 0, velocity);
    rig.set(0x6083, 0, ramp);
    rig.set(0x6084, 0, ramp);
    zero_value_after_a_move(rig, zero, 131072);
  }
}
TEST(ZeroProfile, Generic402) { zero_values<Generic402>(500000, 5000000); }
TEST(ZeroProfile, Pronet) { zero_values<Pronet>(3000, 30000); }
TEST(ZeroProfile, Ismc) { zero_values<Ismc>(500000, 5000000); }
TEST(ZeroProfile, Ismk) {
  for (const std::uint16_t zero : std::to_array<std::uint16_t>({0x6081, 0x6083, 0x6084})) {
    IsmkRig rig;
    rig.set(0x6081, 0, 2000000);
    zero_value_after_a_move(rig, zero, 65536);
  }
}

// --- Cyclic synchronous position: targets that jump, and stops after them

// The greatest distance from `from` within the time, in both directions.
template <typename Bus>
std::pair<double, double> reach(Bus& bus, std::int64_t from, int milliseconds) {
  std::pair<double, double> extremes{0.0, 0.0};
  for (int i = 0; i < milliseconds; ++i) {
    bus.run_cycles(1, 1.0);
    const auto off = static_cast<double>(bus.plant.position_counts() - from);
    extremes = {std::min(extremes.first, off), std::max(extremes.second, off)};
  }
  return extremes;
}
struct JmcInPosition : JmcBus {
  JmcInPosition() {
    open_limits();
    connect();
  }
  // Rests at `units`, disabled.
  void stand_at(std::int32_t units) {
    enable_in(8);
    for (int i = 0; i <= 1000; ++i) {
      put<std::int32_t>(Out::position, units * i / 1000);
      cycles(1);
    }
    settle();
    ASSERT_NEAR(position(), units, 2);
    word(0x06, 200);
  }
};

TEST(CyclicPositionJumps, JmcCatchesUpWithAnOldTarget) {
  JmcInPosition rig;
  rig.stand_at(12345);
  const std::int64_t from = rig.plant.position_counts();
  rig.put<std::int32_t>(JmcBus::Out::position, 0);
  rig.word(0x07, 110);
  rig.word(0x0F, 150);
  double fastest = 0.0;
  for (int i = 0; i < 3000; ++i) {
    rig.cycles(1);
    ASSERT_EQ(rig.state(), 0x27U) << i;
    fastest = std::max(fastest, std::abs(rig.device.drive().axis().generator.velocity()));
  }
  const auto way = static_cast<double>(rig.plant.position_counts() - from);
  EXPECT_NEAR(way, -12345, 100.0);
  EXPECT_LE(fastest, rig.device.drive().axis().max_velocity(false) * 1.001);
  EXPECT_TRUE(rig.bit(12));
}

TEST(CyclicPositionJumps, JmcTargetBeyondItsSoftwareLimit) {
  JmcInPosition rig;
  rig.stand_at(4900);
  rig.set(0x607D, 1, -5000);
  rig.set(0x607D, 2, 5000);
  rig.enable_in(8);
  const std::int64_t from = rig.plant.position_counts();
  rig.put<std::int32_t>(JmcBus::Out::position, 5001);
  rig.cycles(1);
  rig.put<std::int32_t>(JmcBus::Out::position, 4900);
  const auto [below, above] = reach(rig, from, 1000);
  EXPECT_EQ(rig.state() & 0x08U, 0x08U);
  EXPECT_LT(above, 100);
  EXPECT_GT(below, -100);
}

// A jump of the target, and 1 ms later a stop with `deceleration` counts/s^2. The axis must not become faster than it
// was just after the stop command, and must rest within the stopping distance of this speed.
template <typename Bus>
void jump_and_stop(Bus& bus, std::size_t target_at, std::int32_t target, std::uint16_t stop, double deceleration) {
  SCOPED_TRACE(::testing::Message() << "target " << target << " stop " << std::hex << stop);
  const double counts_per_turn = bus.device.drive().axis().units.counts_per_revolution;
  const auto speed = [&] { return std::abs(bus.plant.velocity_rpm()) / 60.0 * counts_per_turn; };
  const std::int64_t from = bus.plant.position_counts();
  bus.template put<std::int32_t>(target_at, target);
  bus.run_cycles(1, 1.0);
  bus.template put<std::uint16_t>(0, stop);
  double fastest = speed();
  for (int i = 0; i < 3; ++i) {
    bus.run_cycles(1, 1.0);
    fastest = std::max(fastest, speed());
  }
  const double way = fastest * fastest / (2.0 * deceleration);
  const int milliseconds = static_cast<int>(1000.0 * fastest / deceleration) + 300;
  double later = 0.0;
  std::pair<double, double> extremes{0.0, 0.0};
  for (int i = 0; i < milliseconds; ++i) {
    bus.run_cycles(1, 1.0);
    later = std::max(later, speed());
    const auto off = static_cast<double>(bus.plant.position_counts() - from);
    extremes = {std::min(extremes.first, off), std::max(extremes.second, off)};
  }
  // The demand has moved a little; the shaft follows with the lag of the loop.
  EXPECT_LT(later, 1.05 * fastest + 0.05 * counts_per_turn);
  EXPECT_LT(extremes.second, 1.1 * way + 0.02 * fastest + 0.005 * counts_per_turn);
  EXPECT_GT(extremes.first, -0.01 * fastest - 0.005 * counts_per_turn);
  const std::int64_t rests = bus.plant.position_counts();
  bus.run_cycles(100, 1.0);
  EXPECT_NEAR(static_cast<double>(bus.plant.position_counts() - rests), 0.0, 0.001 * counts_per_turn);
}
TEST(CyclicPositionJumps, JmcStopsAfterThem) {
  for (const std::uint16_t stop : std::to_array<std::uint16_t>({0x0B, 0x10F, 0x07, 0x06})) {
    for (const std::int32_t jump : {500, 3000}) {
      JmcInPosition rig;
      for (const std::uint16_t option : std::to_array<std::uint16_t>({0x605A, 0x605B, 0x605C, 0x605D})) {
        rig.set(option, 0, 1);
      }
      rig.enable_in(8);
      jump_and_stop(rig, JmcBus::Out::position, rig.position() + jump, stop, stop == 0x0B ? 800000 : 400000);
    }
  }
}
TEST(CyclicPositionJumps, JmcDisabledWithoutARampAfterThem) {
  JmcInPosition rig;
  rig.set(0x605C, 0, 0);
  rig.enable_in(8);
  jump_and_stop(rig, JmcBus::Out::position, rig.position() + 3000, 0x07, 400000);
}

struct ReferenceBus : test::EthercatRig<Generic402Ec> {
  struct Out {
    static constexpr std::size_t controlword = 0, position = 2, velocity = 6, mode = 12;
  };
  void enable_in(std::int8_t mode) {
    to_pre_operational();
    set_process_data();
    ASSERT_EQ(request(4), good(4));
    run_cycles(20, 1);
    write(ethercat::reg::al_control, test::little_endian(std::uint16_t{8}));
    run_cycles(20, 1);
    put<std::int8_t>(Out::mode, mode);
    for (const std::uint16_t word : std::to_array<std::uint16_t>({0x06, 0x07, 0x0F})) {
      put<std::uint16_t>(Out::controlword, word);
      run_cycles(word == 0x07 ? 200 : 5, 1);
    }
    ASSERT_EQ(input<std::uint16_t>(0) & 0x6FU, 0x27U);
  }
};
TEST(CyclicPositionJumps, ReferenceDriveStopsAfterThem) {
  for (const std::uint16_t stop : std::to_array<std::uint16_t>({0x0B, 0x10F, 0x07, 0x06})) {
    ReferenceBus rig;
    for (const std::uint16_t option : std::to_array<std::uint16_t>({0x605B, 0x605C, 0x605D})) rig.set(option, 0, 1);
    rig.enable_in(8);
    rig.run_cycles(10, 1);
    const std::uint16_t ramp = stop == 0x0B ? 0x6085 : 0x6084;
    jump_and_stop(rig, ReferenceBus::Out::position, 40000, stop, static_cast<double>(rig.get(ramp)));
  }
}

// A jump of the target speed is not a speed of the shaft.
TEST(CyclicVelocityJumps, AreNoSpeedToStopFrom) {
  ReferenceBus rig;
  rig.enable_in(9);
  jump_and_stop(rig, ReferenceBus::Out::velocity, 6'000'000, 0x0B, static_cast<double>(rig.get(0x6085)));
}

// --- Cyclic synchronous position: targets from the master while the axis must not follow

TEST(CyclicPositionHeld, JmcByItsLimitSwitch) {
  for (const std::int32_t step : {2, 10}) {
    SCOPED_TRACE(step);
    JmcInPosition rig;
    rig.enable_in(8);
    const std::int32_t start = rig.position();
    std::int32_t target = start;
    const auto stream = [&](int cycles, std::int32_t by) {
      rig.cycles(cycles, [&](int) { rig.put<std::int32_t>(JmcBus::Out::position, target += by); });
    };
    stream(200, step);
    rig.plant.force_input(0, true);
    stream(100, step);
    const std::int64_t held = rig.plant.position_counts();
    stream(1000, step);
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts() - held), 0.0, 100.0) << "as long as it is active";
    EXPECT_FALSE(rig.bit(12)) << "the target is not followed";
    // A switch that opens again does not count as a command.
    rig.plant.force_input(0, false);
    stream(500, 0);
    EXPECT_NEAR(static_cast<double>(rig.plant.position_counts() - held), 0.0, 100.0);
    rig.plant.force_input(0, true);
    // Targets on this side of the switch: the axis follows as soon as they are there.
    target = rig.position();
    stream(500, -step);
    EXPECT_LT(static_cast<double>(rig.plant.position_counts()), static_cast<double>(held) - 400 * step);
    EXPECT_EQ(rig.state(), 0x27U);
    rig.settle();
    EXPECT_NEAR(rig.position(), target, 3);
    EXPECT_TRUE(rig.bit(12));
  }
}

// The target continued while the axis was halted: the axis must not jump to it.
TEST(CyclicPositionHeld, JmcByAHalt) {
  JmcInPosition rig;
  rig.enable_in(8);
  std::int32_t target = rig.position();
  const auto stream = [&](int cycles) {
    rig.cycles(cycles, [&](int) { rig.put<std::int32_t>(JmcBus::Out::position, target += 20); });
  };
  stream(500);
  const std::int32_t lag = target - rig.position();
  rig.put<std::uint16_t>(0, 0x10F);
  stream(500);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 0.5);
  rig.put<std::uint16_t>(0, 0x0F);
  const double steepest = rig.device.drive().axis().catch_up_limits().acceleration * 0.0005;
  double before = rig.device.drive().axis().generator.velocity();
  for (int i = 0; i < 3000; ++i) {
    stream(1);
    const double now = rig.device.drive().axis().generator.velocity();
    ASSERT_LE(std::abs(now - before), 2.2 * steepest + 2000.0) << i;
    before = now;
    ASSERT_EQ(rig.state(), 0x27U) << i;
  }
  EXPECT_NEAR(target - rig.position(), lag, 2) << "as far behind as before";
}

// --- Power off after a stop

// A stop ends when the shaft stands, not when the demand does.
TEST(StopBeforePowerOff, IsmkWithALoadThatLags) {
  plant::Parameters parameters = test::ismk_plant();
  parameters.load.inertia_kgm2 = 3e-4;
  for (const std::uint16_t stop : std::to_array<std::uint16_t>({0x06, 0x07, 0x0B})) {
    SCOPED_TRACE(stop);
    IsmkRig rig(parameters, test::ismk_settings());
    for (const std::uint16_t option : std::to_array<std::uint16_t>({0x605A, 0x605B, 0x605C})) rig.set(option, 0, 1);
    rig.set(0x6084, 0, 10'000'000);
    rig.set(0x6060, 0, 3);
    ASSERT_TRUE(rig.enable());
    rig.set(0x60FF, 0, 16'000'000);
    rig.run_ms(2500);
    ASSERT_GT(std::abs(rig.plant.velocity_rpm()), 500.0);
    rig.control(stop);
    ASSERT_GE(rig.run_until([&] { return !rig.actuation.pwm_enabled; }, 5000), 0);
    EXPECT_LT(std::abs(rig.plant.velocity_rpm()), 10.0);
  }
}

// An external torque keeps the shaft turning: the power is still switched off, 2 s after the ramp.
TEST(StopBeforePowerOff, ReferenceDriveWaitsNoLongerThanTwoSeconds) {
  Rig<Generic402> rig;
  rig.set(0x6060, 0, 3);
  rig.set(0x605B, 0, 1);
  ASSERT_TRUE(rig.enable());
  rig.set(0x60FF, 0, 200000);
  rig.run_ms(1000);
  rig.set(0x6072, 0, 100);
  rig.plant.set_external_torque_nm(0.15);
  rig.control(0x06);
  const std::int64_t ticks = rig.run_until([&] { return !rig.actuation.pwm_enabled; }, 10000);
  EXPECT_GT(ticks, 16 * 2000);
  EXPECT_LT(ticks, 16 * 2500);
}

// A torque that accelerates the axis in torque mode must not continue in the velocity loop of a stop.
TEST(StopAfterTorque, ReferenceDriveAndIsmk) {
  const auto halted = [](auto& rig, std::int64_t torque) {
    rig.set(0x6060, 0, 4);
    rig.set(0x6087, 0, 0);
    ASSERT_TRUE(rig.enable());
    rig.set(0x6071, 0, torque);
    rig.run_ms(2);
    const double speed = std::abs(rig.plant.velocity_rpm());
    rig.set(0x60FF, 0, 0);
    rig.set(0x6060, 0, 3);
    double fastest = 0.0;
    for (int i = 0; i < 2000; ++i) {
      rig.run_ms(1);
      fastest = std::max(fastest, std::abs(rig.plant.velocity_rpm()));
    }
    ASSERT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
    EXPECT_LT(fastest, 1.5 * speed + 30.0);
    EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
  };
  Rig<Generic402> reference;
  halted(reference, 2000);
  test::FactoryIsmkRig ismk;
  halted(ismk, -3000);
}

// A ramp that the motor cannot follow: the axis moves past the demand, and must not be pulled back over that distance.
TEST(StopBeyondTheMotor, DoesNotComeBack) {
  plant::Parameters parameters = test::default_plant();
  parameters.load.inertia_kgm2 = 20e-4;
  Rig<Generic402> rig(parameters);
  rig.set(0x6060, 0, 3);
  ASSERT_TRUE(rig.enable());
  rig.set(0x60FF, 0, 131072 * 20);
  rig.run_ms(1500);
  rig.set(0x6060, 0, 8);
  rig.set(0x605D, 0, 2);
  rig.set(0x6065, 0, 0xFFFFFFFF);
  rig.set(0x6085, 0, 4'000'000'000);
  rig.set(0x6072, 0, 500);
  rig.control(0x10F);
  std::int64_t furthest = 0;
  for (int i = 0; i < 3000; ++i) {
    rig.run_ms(1);
    furthest = std::max(furthest, rig.plant.position_counts());
  }
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 1.0);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), static_cast<double>(furthest), 0.01 * 131072);
}

// The demand was ahead of the shaft at the stop command.
TEST(StopBeyondTheMotor, ProfileVelocityBrakesFromTheSpeedThatThereIs) {
  Rig<Generic402> rig;
  rig.set(0x6060, 0, 3);
  rig.set(0x6083, 0, 4'000'000'000);
  rig.set(0x6084, 0, 1'000'000);
  ASSERT_TRUE(rig.enable());
  rig.set(0x60FF, 0, 4'700'000);
  rig.run_ms(1);
  const double speed = std::abs(rig.plant.velocity_rpm()) / 60.0 * 131072.0;
  const std::int64_t from = rig.plant.position_counts();
  rig.set(0x60FF, 0, 0);
  rig.run_ms(3000);
  const double more = speed + 1'000'000.0;  // speed that the present current still adds
  EXPECT_LT(static_cast<double>(rig.plant.position_counts() - from), more * more / 2e6 + 0.1 * 131072);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 0.0, 0.5);
}

// --- Limits

// Table 5-5: "input the reverse shift instruction can make the motor exit the position limit state".
TEST(AfterALimit, IsmkMovesByARelativeSetPointFromWhereItStands) {
  IsmkRig rig;
  rig.set(0x6060, 0, 1);
  rig.set(0x6081, 0, 4'000'000);
  rig.set(0x2010, 3, 0x0010);  // DIN1: positive limit, normally closed
  rig.plant.force_input(0, true);
  ASSERT_TRUE(rig.enable());
  const std::int64_t start = rig.plant.position_counts();
  one_move(rig, 10 * 65536);
  rig.run_ms(300);
  rig.plant.force_input(0, false);
  rig.run_ms(500);
  const std::int64_t stood = rig.plant.position_counts();
  ASSERT_GT(stood - start, 65536);
  ASSERT_LT(stood - start, 9 * 65536);
  one_move(rig, -65536);
  rig.run_ms(1000);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts() - stood), -65536.0, 30.0);
}

template <typename RigType>
void relative_after_a_change_of_mode(RigType&& rig, double turn) {
  const drive::Units& units = rig.device.drive().axis().units;
  const auto ramp = static_cast<std::int64_t>(20.0 * turn / units.acceleration);
  for (const std::uint16_t object : std::to_array<std::uint16_t>({0x6083, 0x6084})) rig.set(object, 0, ramp);
  rig.set(0x6081, 0, static_cast<std::int64_t>(units.velocity_to_user(5.0 * turn)));
  rig.set(0x6060, 0, 3);
  ASSERT_TRUE(rig.enable());
  rig.set(0x60FF, 0, static_cast<std::int64_t>(units.velocity_to_user(-10.0 * turn)));
  rig.run_ms(700);
  ASSERT_LT(rig.plant.velocity_rpm(), -500.0);
  rig.set(0x6060, 0, 1);
  rig.run_ms(1500);
  ASSERT_NEAR(rig.plant.velocity_rpm(), 0.0, 3.0);
  const std::int64_t stood = rig.plant.position_counts();
  one_move(rig, -units.to_user(static_cast<drive::Counts>(turn)));
  rig.run_ms(1500);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts() - stood), -turn, 0.01 * turn);
}

// A relative set-point in a mode that was entered in motion starts from the position at which the axis came to rest.
TEST(AfterAChangeOfMode, ARelativeSetPointCountsFromTheRest) {
  relative_after_a_change_of_mode(Rig<Generic402>{}, 131072.0);
  relative_after_a_change_of_mode(Rig<Pronet>{}, 131072.0);
  relative_after_a_change_of_mode(IsmkRig{}, 65536.0);
}

TEST(SoftwareLimitSetInMotion, EndsAPositioning) {
  Reference axis(1);
  one_move(axis, 131072 * 5);
  axis.run_ms(700);
  axis.limit_turns(-1.0, 3.0);
  axis.run_ms(4000);
  EXPECT_NEAR(axis.turns(), 3.0, 0.001);
  EXPECT_TRUE(axis.bit(11));
}
// An axis outside of the limits that moves towards them continues to its target.
TEST(SoftwareLimitSetInMotion, LetsAnAxisComeIn) {
  Reference axis(1);
  one_move(axis, 131072 * 5);
  axis.run_ms(700);
  const double there = axis.turns();
  axis.limit_turns(there + 1.0, 20.0);
  axis.run_ms(4000);
  EXPECT_NEAR(axis.turns(), 5.0, 0.001);
  EXPECT_TRUE(axis.bit(10));
}
// The axis approaches a far cyclic target. New limits exclude that target: the axis comes to rest. The ramps leave no
// reserve of distance, so the speed that the axis gains in the cycle of the change counts.
TEST(SoftwareLimits, AreNotPassedByEndVelocitiesOrChangesOnSetPoint) {
  std::mt19937 random(1);
  const auto draw = [&random](double least, double greatest) {
    return std::uniform_real_distribution<>(least, greatest)(random);
  };
  const auto ramp = [&draw] { return 131072.0 * std::exp(draw(std::log(5.0), std::log(2000.0))); };
  for (int n = 0; n < 60; ++n) {
    SCOPED_TRACE(n);
    Reference axis(1);
    const double braking = ramp();
    const double speed = draw(2.0, 45.0);
    const double limit = draw(3.0, 12.0);
    axis.set(0x6083, 0, std::lround(ramp()));
    axis.set(0x6084, 0, std::lround(braking));
    axis.set(0x6085, 0, std::lround(braking));
    axis.set(0x6081, 0, std::lround(131072.0 * speed));
    axis.limit_turns(-20.0, limit);
    const bool on_set_point = n % 2 != 0;
    if (!on_set_point) axis.set(0x6082, 0, std::lround(131072.0 * draw(0.0, speed)));
    test::absolute_move(axis, std::lround(131072.0 * (limit - draw(0.0, 1.0))), 0x1F);
    if (on_set_point) test::absolute_move(axis, std::lround(131072.0 * (limit - draw(-1.0, 0.5))), 0x21F);
    double furthest = 0.0;
    for (int i = 0; i < 4000; ++i) {
      axis.run_ms(1);
      furthest = std::max(furthest, axis.turns());
    }
    EXPECT_LT(furthest, limit + 0.02);
  }
}
TEST(SoftwareLimitSetInMotion, HoldsACyclicTargetThatLiesOutsideNow) {
  Reference axis(8);
  axis.set(0x6083, 0, 131072 * 10);
  axis.set(0x6084, 0, 131072 * 10);
  axis.set(0x607A, 0, 131072 * 10);
  axis.run_ms(500);
  const double there = axis.turns();
  EXPECT_GT(there, 0.5);
  axis.limit_turns(-1.0, there + 4.0);
  axis.run_ms(4000);
  EXPECT_LT(axis.turns(), there + 4.0);
  EXPECT_TRUE(axis.bit(11));
}
// The new limits are behind the axis: it stops as soon as possible and does not return by itself.
TEST(SoftwareLimitSetInMotion, BehindTheAxisStopsIt) {
  Reference axis(1);
  one_move(axis, 131072 * 5);
  axis.run_ms(1500);
  const double there = axis.turns();
  axis.limit_turns(-1.0, 1.0);
  axis.run_ms(3000);
  EXPECT_GT(axis.turns(), there);
  EXPECT_LT(axis.turns(), there + 2.0 * 2.0 / 2.0 / 10.0 + 0.05);
  EXPECT_TRUE(axis.bit(11));
  EXPECT_FALSE(axis.bit(10));
}

// The ramp of a halt may be too low for the distance to a limit: then the quick stop's ramp applies.
TEST(HaltBeforeALimit, BrakesByTheQuickStopsRamp) {
  for (const std::int64_t mode : {1, 3, 8}) {
    for (const bool by_switch : {false, true}) {
      SCOPED_TRACE(mode);
      SCOPED_TRACE(by_switch);
      Reference axis(mode);
      axis.set(0x6085, 0, 131072 * 40);
      axis.set(0x60FF, 0, 131072 * 4);
      axis.set(0x6081, 0, 131072 * 4);
      if (mode == 1) one_move(axis, 131072 * 30);
      if (mode == 8) axis.set(0x607A, 0, 131072 * 30);
      axis.run_ms(1000);
      ASSERT_GT(axis.turns_per_s(), 3.0);
      const double there = axis.turns();
      axis.set(0x6084, 0, 131072);  // 8 turns and more
      if (!by_switch) axis.limit_turns(-1.0, there + 3.0);
      axis.run_ms(2);
      axis.control(0x10F);
      axis.run_ms(300);
      EXPECT_GT(axis.turns_per_s(), 2.0) << "the halt has a ramp of its own";
      const double here = axis.turns();
      const double speed = axis.turns_per_s();
      if (by_switch) axis.plant.force_input(0, true);
      axis.run_ms(3000);
      EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
      if (by_switch) {
        EXPECT_LT(axis.turns(), here + speed * speed / 80.0 + 0.1);
      } else {
        EXPECT_NEAR(axis.turns(), there + 3.0, 0.06);
      }
      EXPECT_TRUE(axis.bit(11));
    }
  }
}

// The same applies to the ramp of a mode that is entered in motion and stops.
TEST(RestBeforeALimit, BrakesByTheQuickStopsRamp) {
  for (const std::int64_t mode : {1, 7, 8}) {
    SCOPED_TRACE(mode);
    Reference axis(3);
    axis.set(0x6085, 0, 131072 * 40);
    axis.set(0x60FF, 0, 131072 * 4);
    axis.run_ms(1000);
    ASSERT_GT(axis.turns_per_s(), 3.0);
    const double there = axis.turns();
    axis.set(0x6084, 0, 131072);
    axis.limit_turns(-1.0, there + 3.0);
    axis.set(0x6060, 0, mode);
    axis.run_ms(100);
    EXPECT_GT(axis.turns_per_s(), 3.0) << "far from the limit it brakes by 6084h";
    axis.run_ms(3000);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
    EXPECT_NEAR(axis.turns(), there + 3.0, 0.06);
    EXPECT_TRUE(axis.bit(11));
  }
}

// A halt that ends before the axis rests, in a mode without a target.
TEST(HaltReleasedInMotion, ComesToRestWithoutATarget) {
  for (const std::int64_t mode : {1, 6, 7, 8}) {
    for (const std::int64_t code : {1, 2, 3}) {
      SCOPED_TRACE(mode);
      SCOPED_TRACE(code);
      Reference axis(3);
      axis.set(0x605D, 0, code);
      axis.set(0x609A, 0, 131072 * 10);
      axis.plant.set_load_inertia_kgm2(axis.plant.parameters().load.inertia_kgm2 * 10.0);
      axis.set(0x60FF, 0, 131072 * 4);
      axis.run_ms(1000);
      ASSERT_GT(axis.turns_per_s(), 3.0);
      axis.control(0x10F);
      axis.run_ms(1);
      axis.set(0x6060, 0, mode);
      axis.run_ms(1);
      axis.control(0x0F);
      axis.run_ms(2);
      axis.control(0x10F);
      axis.run_ms(1);
      axis.control(0x0F);
      const double there = axis.turns();
      const double speed = axis.turns_per_s();
      axis.run_ms(2000);
      EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
      EXPECT_LT(axis.turns(), there + speed * speed / 2.0 / 10.0 + 0.3);
    }
  }
}

// Homing is cancelled while the shaft does not follow its demand: it rests at its position and does not move to the
// demand.
TEST(HomingGivenUp, RestsWhereTheShaftIs) {
  Reference axis(6);
  axis.set(0x6098, 0, -1);
  axis.set(0x6099, 1, 131072 * 20);
  axis.set(0x6099, 2, 131072);
  axis.set(0x609A, 0, 131072 * 1000);
  axis.set(0x6072, 0, 30);
  axis.control(0x1F);
  axis.run_ms(45);  // shorter than the detection of a hard stop
  const drive::Axis& own = axis.device.drive().axis();
  ASSERT_GT(std::abs(static_cast<double>(own.generator.velocity())), 2.0 * std::abs(axis.turns_per_s()) * 131072.0);
  const double there = axis.turns();
  const double speed = std::abs(axis.turns_per_s());
  axis.control(0x0F);
  axis.set(0x6072, 0, 3000);
  double fastest = 0.0;
  for (int i = 0; i < 1000; ++i) {
    axis.run_ms(1);
    fastest = std::max(fastest, std::abs(axis.turns_per_s()));
  }
  EXPECT_LT(fastest, speed * 1.2 + 0.1);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
  EXPECT_NEAR(axis.turns(), there, speed * 0.1 + 0.05);
}

TEST(ZeroRamps, LetProfileVelocityBrake) {
  {  // an acceleration of zero does not block braking
    Reference axis(3);
    axis.set(0x60FF, 0, 131072 * 2);
    axis.run_ms(1000);
    axis.set(0x6083, 0, 0);
    axis.set(0x60FF, 0, 131072);
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns_per_s(), 1.0, 0.02);
    EXPECT_TRUE(axis.bit(10));
    axis.set(0x60FF, 0, 131072 * 3);
    axis.run_ms(500);
    EXPECT_NEAR(axis.turns_per_s(), 1.0, 0.02) << "no faster";
    EXPECT_FALSE(axis.bit(10)) << "606Ch is not 60FFh";
    axis.set(0x6083, 0, 131072 * 10);
    axis.run_ms(500);
    EXPECT_NEAR(axis.turns_per_s(), 1.0, 0.02) << "an old target is not revived by a ramp";
    axis.set(0x60FF, 0, 131072 * 3 + 1);
    axis.run_ms(500);
    EXPECT_NEAR(axis.turns_per_s(), 3.0, 0.02);
  }
  for (const std::uint16_t zero : std::to_array<std::uint16_t>({0x6083, 0x6084})) {
    Reference axis(3);
    axis.set(0x60FF, 0, 131072 * 2);
    axis.run_ms(1000);
    axis.set(zero, 0, 0);
    axis.set(0x60FF, 0, 0);
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.001) << zero;
    EXPECT_TRUE(axis.bit(10));
  }
  {  // a cancelled target observes a limit that is lowered, and a limit that is raised does not activate it again
    Reference axis(3);
    axis.set(0x60FF, 0, 131072 * 2);
    axis.run_ms(1000);
    axis.set(0x6083, 0, 0);
    axis.set(0x60FF, 0, 131072 * 3);
    axis.run_ms(100);
    axis.set(0x607F, 0, 131072);
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns_per_s(), 1.0, 0.02);
    axis.set(0x607F, 0, 131072 * 4);
    axis.set(0x6083, 0, 131072 * 10);
    axis.run_ms(500);
    EXPECT_NEAR(axis.turns_per_s(), 1.0, 0.02);
  }
  {  // three ramps of zero do not block braking either
    Reference axis(3);
    axis.set(0x60FF, 0, 131072 * 2);
    axis.run_ms(1000);
    for (const std::uint16_t zero : std::to_array<std::uint16_t>({0x6083, 0x6084, 0x6085})) axis.set(zero, 0, 0);
    axis.set(0x60FF, 0, 0);
    axis.run_ms(1000);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.001);
  }
}

TEST(AfterALimit, ProfileVelocityStandsUntilItIsGivenAnotherTarget) {
  for (const std::int64_t mode : {3, 2}) {
    SCOPED_TRACE(mode);
    Reference axis(mode);
    axis.control(0x7F);
    axis.set(0x60FF, 0, 131072 * 2);
    axis.set(0x6042, 0, 120);
    axis.run_ms(1000);
    ASSERT_GT(axis.turns_per_s(), 1.5);
    axis.plant.force_input(0, true);
    axis.run_ms(500);
    EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.001);
    for (int bounce = 0; bounce < 3; ++bounce) {
      axis.plant.force_input(0, false);
      axis.set(0x6083, 0, 131072 * (11 + bounce));  // does not count as a motion command either
      axis.set(0x6048, 1, 1000 + bounce);
      axis.run_ms(200);
      EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.001);
      axis.plant.force_input(0, true);
      axis.run_ms(20);
    }
    axis.set(0x60FF, 0, -131072);
    axis.set(0x6042, 0, -60);
    axis.run_ms(500);
    EXPECT_NEAR(axis.turns_per_s(), -1.0, 0.02);
  }
}

// --- Controlword bit 7

// The standard's table of commands has bit 7 at 0: with bit 7 set, the word contains no command, and the bits of the
// modes have no effect. Halt, which is not in that table, still acts.
TEST(FaultResetBit, CommandsNothing) {
  Reference axis(1);
  axis.set(0x607A, 0, 131072);
  axis.control(0x8F);
  axis.run_ms(2);
  axis.control(0x9F);
  axis.run_ms(500);
  EXPECT_NEAR(axis.turns(), 0.0, 0.001) << "no set-point";
  EXPECT_FALSE(axis.bit(12)) << "no set-point is acknowledged";
  axis.control(0x1F);
  axis.run_ms(1500);
  EXPECT_NEAR(axis.turns(), 1.0, 0.001);
  one_move(axis, 131072 * 2);
  axis.run_ms(200);
  axis.control(0x18F);
  axis.run_ms(3000);
  EXPECT_LT(axis.turns(), 2.0);
  axis.control(0x0F);
  axis.run_ms(3000);
  EXPECT_NEAR(axis.turns(), 3.0, 0.001);
}
// The iSMK's 86h resets and ends in Ready (Table 5-2); without a fault it is not a command.
TEST(FaultResetBit, OfTheIsmkIsNoCommandWithoutAFault) {
  IsmkRig rig;
  rig.set(0x6060, 0, 3);
  ASSERT_TRUE(rig.enable());
  rig.control(0x86);
  rig.run_ms(5);
  EXPECT_EQ(rig.device.drive().state(), PowerState::operation_enabled);
}

}  // namespace
}  // namespace stop_sequences_test
}  // namespace servodrome
