// Functions of the master's axis besides homing and moving, with every product on every bus it has: jog, torque, halt
// and resume, changes of velocity, limits, probes, and all kinds of failure.
#include <gmock/gmock.h>

#include "axis/axis_rig.hpp"

namespace servodrome::master::test {
namespace axis_motion_test {
namespace {

using testing::HasSubstr;

class AxisMotion : public testing::TestWithParam<RigCase> {
 protected:
  std::int32_t revolutions(double number) const { return static_cast<std::int32_t>(number * units.position); }
  MotionProfile profile(double rps) const {
    return {.velocity = static_cast<std::uint32_t>(rps * units.velocity),
            .acceleration = static_cast<std::uint32_t>(50 * units.acceleration),
            .deceleration = static_cast<std::uint32_t>(50 * units.acceleration)};
  }
  // Position of the shaft itself, in revolutions.
  double shaft() { return rig.shaft_counts() / counts_per_revolution(); }
  double counts_per_revolution() { return rig.drive().plant().parameters().encoder.counts_per_revolution; }
  double shaft_speed() {
    rig.objects().wait(200ms);  // a drive counts as "at rest" within its window
    const double before = shaft();
    rig.objects().wait(100ms);
    return (shaft() - before) / 0.1;
  }

  AxisRig rig{GetParam()};
  bool give_up = false;
  Axis402 axis{rig.objects(), [this] {
                 AxisOptions options = rig.options();
                 options.cancelled = [this] { return give_up; };
                 return options;
               }()};
  AxisUnits units = axis.units().value_or(AxisUnits{131072, 131072, 131072});
};
INSTANTIATE_TEST_SUITE_P(Every, AxisMotion, testing::ValuesIn(every_product),
                         [](const auto& row) { return row.param.name(); });

// On an axis that wraps around, the present position plus the distance may be outside the range 607Bh.
TEST(ModuloAxis, AMoveByADistanceAfterAStopGoesInItsDirection) {
  for (const int direction : {1, -1}) {
    AxisRig rig({"generic402"});
    Axis402 axis(rig.objects(), rig.options());
    const auto revolution = static_cast<std::int32_t>(axis.units().value().position);
    const auto speed = static_cast<std::uint32_t>(2 * revolution);
    const MotionProfile profile{.velocity = speed, .acceleration = 20 * speed, .deceleration = 20 * speed};
    rig.objects().write<std::int32_t>(0x607B, 1, 0);
    rig.objects().write<std::int32_t>(0x607B, 2, revolution - 1);
    axis.enable();
    axis.start_move_by(direction * 5 * revolution, profile);
    // Until half a revolution would leave the range.
    const auto leaves = [&] { return direction * (axis.position() - revolution / 2) > revolution / 8; };
    rig.objects().wait(300ms);
    while (!leaves()) rig.objects().wait(5ms);
    axis.stop();
    ASSERT_TRUE(leaves());
    const double before = rig.shaft_counts();
    axis.move_by(direction * revolution / 2, profile, 5s);
    rig.objects().wait(200ms);
    EXPECT_NEAR(rig.shaft_counts() - before, direction * revolution / 2.0, revolution / 50.0) << direction;
    // The next distance counts from that target again.
    axis.move_by(direction * revolution / 4, profile, 5s);
    rig.objects().wait(200ms);
    EXPECT_NEAR(rig.shaft_counts() - before, direction * revolution * 0.75, revolution / 50.0) << direction;
  }
}

// A target outside the range wraps into it, so to send it again would end the move elsewhere.
TEST(ModuloAxis, AMoveThatEndsOutsideTheRangeIsNotSentAgain) {
  for (const char* const product : {"generic402", "ismc"}) {
    AxisRig rig({product});
    Axis402 axis(rig.objects(), rig.options());
    constexpr std::int32_t revolution = 131072;
    constexpr std::uint32_t speed = 2 * revolution;
    const MotionProfile profile{.velocity = speed, .acceleration = 20 * speed, .deceleration = 20 * speed};
    for (const unsigned sub : {1U, 2U}) {
      rig.objects().write<std::int32_t>(0x607D, static_cast<std::uint8_t>(sub), 0);  // no software limits
    }
    rig.objects().write<std::int32_t>(0x607B, 1, 0);
    rig.objects().write<std::int32_t>(0x607B, 2, revolution - 1);
    axis.enable();
    axis.start_move_by(5 * revolution, profile);
    rig.objects().wait(300ms);
    EXPECT_THAT(problem_of([&] { axis.change_velocity(2 * revolution); }), HasSubstr("cannot be changed")) << product;
    axis.halt();
    const double halted_at = rig.shaft_counts();
    const bool drops = axis.product().dialect.halt_drops_target;
    EXPECT_EQ(!problem_of([&] { axis.resume(); }).empty(), drops) << product;
    rig.objects().wait(4s);
    const double end = drops ? halted_at : 5.0 * revolution;
    EXPECT_NEAR(rig.shaft_counts(), end, revolution / 50.0) << product;
  }
}

// 607Bh of a JMC is no range in which positions wrap around (Table 227), so the end of a move may be outside it.
TEST(ModuloAxis, AJmcIsNone) {
  AxisRig rig({"jmc_ec", RigCase::BusKind::ethercat});
  Axis402 axis(rig.objects(), rig.options());
  constexpr std::int32_t revolution = 4000;
  ASSERT_LT(rig.objects().read<std::int32_t>(0x607B, 2), revolution);
  axis.enable();
  const MotionProfile profile{.velocity = 8000, .acceleration = 80000, .deceleration = 80000};
  axis.start_move_by(5 * revolution, profile);
  rig.objects().wait(500ms);
  axis.stop();
  const std::int32_t stopped_at = axis.position();
  axis.move_by(revolution, profile, 5s);
  EXPECT_NEAR(rig.objects().read<std::int32_t>(0x607A), stopped_at + revolution, revolution / 50);
}

// A revolution must follow the encoder of the drive, not that of the maker's usual motor.
constexpr RigCase manuals_encoder{"pronet", RigCase::BusKind::can, "[axis.encoder]\ncounts_per_revolution = 10000\n"};
INSTANTIATE_TEST_SUITE_P(ManualsEncoder, AxisMotion, testing::Values(manuals_encoder),
                         [](const auto& row) { return row.param.name(); });

TEST(AxisUnits, AreThoseOfTheEncoderAndTheFactors) {
  AxisRig rig(manuals_encoder);
  Axis402 axis(rig.objects(), rig.options());
  EXPECT_DOUBLE_EQ(axis.units().value().position, 10000.0);
  EXPECT_DOUBLE_EQ(axis.units_per_count().value().position, 1.0);
  EXPECT_DOUBLE_EQ(axis.units_per_count().value().velocity, 600.0 / 10000.0);
  EXPECT_DOUBLE_EQ(axis.units(360.0).value().position, 360.0) << "what is said counts";
  rig.objects().write<std::uint32_t>(0x6093, 1, 10000);
  rig.objects().write<std::uint32_t>(0x6093, 2, 360);
  EXPECT_DOUBLE_EQ(axis.units().value().position, 360.0);
  EXPECT_DOUBLE_EQ(axis.units_per_count().value().position, 0.036);
}

TEST_P(AxisMotion, JogsAsLongAsItIsAsked) {
  axis.enable();
  const Time start = rig.objects().now();
  double fastest = 0;
  double slowest = 0;
  axis.jog(profile(1), [&](const AxisStatus&) -> std::optional<std::int32_t> {
    const Time since = rig.objects().now() - start;
    if (since > 1500ms) return std::nullopt;
    fastest = std::max(fastest, shaft());
    slowest = std::min(slowest, shaft());
    return static_cast<std::int32_t>((since < 500ms ? 1 : since < 1s ? 0 : -2) * units.velocity);
  });
  EXPECT_NEAR(fastest, 0.5, 0.15);
  EXPECT_LT(shaft(), -0.2);
  EXPECT_NEAR(shaft_speed(), 0, 0.02);
  EXPECT_EQ(axis.state(), PowerState::operation_enabled);
}

TEST_P(AxisMotion, AJogThatIsLeftStopsTheAxis) {
  axis.enable();
  struct Left {};
  EXPECT_THROW(axis.jog(profile(1),
                        [&](const AxisStatus&) -> std::optional<std::int32_t> {
                          if (shaft() > 0.5) throw Left{};
                          return static_cast<std::int32_t>(2 * units.velocity);
                        }),
               Left);
  EXPECT_NEAR(shaft_speed(), 0, 0.02);
}

TEST_P(AxisMotion, AHaltedMoveGoesOnToItsTarget) {
  axis.enable();
  bool halted = false;
  double at = 0;
  int looks = 0;
  axis.move_to(revolutions(3), profile(2), 5s, [&](const AxisStatus&) {
    if (!halted && shaft() > 1) {
      axis.halt();
      halted = true;
      at = shaft();
    } else if (axis.halted() && ++looks == 40) {
      EXPECT_NEAR(shaft(), at, 0.05) << "it stood meanwhile";
      axis.resume();
    }
  });
  EXPECT_TRUE(halted);
  EXPECT_LT(at, 2);
  rig.objects().wait(500ms);
  EXPECT_NEAR(shaft(), 3, 0.01);
}

TEST_P(AxisMotion, TheVelocityOfAMoveAndOfARunCanBeChanged) {
  axis.enable();
  axis.start_move_to(revolutions(4), profile(0.5));
  rig.objects().wait(500ms);
  EXPECT_NEAR(shaft_speed(), 0.5, 0.1);
  axis.change_velocity(static_cast<std::int32_t>(2 * units.velocity));
  rig.objects().wait(200ms);
  EXPECT_NEAR(shaft_speed(), 2, 0.3);
  axis.wait_for_target(5s);
  rig.objects().wait(500ms);
  EXPECT_NEAR(shaft(), 4, 0.01);
  EXPECT_THAT(problem_of([&] { axis.change_velocity(-1); }), HasSubstr("cannot be changed to -1"));

  axis.run_at(static_cast<std::int32_t>(units.velocity), profile(1), 3s);
  const Time since = rig.objects().now();
  axis.hold_for(500ms);
  EXPECT_GE(rig.objects().now() - since, 500ms);
  EXPECT_LT(rig.objects().now() - since, 600ms);
  axis.change_velocity(static_cast<std::int32_t>(-2 * units.velocity));
  rig.objects().wait(500ms);
  EXPECT_NEAR(shaft_speed(), -2, 0.3);
  axis.stop();
  EXPECT_NEAR(shaft_speed(), 0, 0.05);
}

TEST_P(AxisMotion, AVelocityThatIsChangedDuringAHaltActsAfterIt) {
  axis.enable();
  const auto change_halted = [&](double rps) {
    axis.halt();
    const double at = shaft();
    axis.change_velocity(static_cast<std::int32_t>(rps * units.velocity));
    rig.objects().wait(300ms);
    EXPECT_NEAR(shaft(), at, 0.05) << "the axis stays halted";
    axis.resume();
    rig.objects().wait(300ms);
    EXPECT_NEAR(shaft_speed(), rps, 0.3);
  };
  axis.start_move_to(revolutions(8), profile(0.5));
  rig.objects().wait(500ms);
  change_halted(2);
  axis.wait_for_target(5s);
  rig.objects().wait(500ms);
  EXPECT_NEAR(shaft(), 8, 0.01);
  axis.run_at(static_cast<std::int32_t>(units.velocity), profile(1), 3s);
  change_halted(-2);
  axis.stop();
  EXPECT_NEAR(shaft_speed(), 0, 0.05);
}

TEST_P(AxisMotion, GivesTorqueAndBrakesOrSaysThatItHasNone) {
  axis.enable();
  if (std::string_view(GetParam().product) == "pronet") {
    EXPECT_NE(problem_of([&] { axis.run_torque(100, {}, 2s); }), "");
    return;
  }
  if (std::string_view(GetParam().product) == "ismk-ea") {
    // Its process data contain the same target as a current, 60F6h sub 8.
    EXPECT_THAT(problem_of([&] { axis.run_torque(100, {}, 2s); }), HasSubstr("(6071h) is 0 after 100 was written"));
    return;
  }
  const auto has_slope = rig.objects().read_if_present<std::uint32_t>(0x6087);
  axis.run_torque(100, {.slope = has_slope ? std::optional(1000U) : std::nullopt}, 2s);
  rig.objects().wait(50ms);
  EXPECT_GT(shaft_speed(), 1) << "nothing holds the shaft: it accelerates";
  axis.stop();
  EXPECT_NEAR(shaft_speed(), 0, 0.05);
  EXPECT_THAT(problem_of([&] {
                axis.run_torque(10, {}, 2s);
                axis.halt();
              }),
              HasSubstr("coast"));
  axis.stop();
  axis.run_torque(-100, {}, 2s);
  rig.objects().wait(200ms);
  EXPECT_LT(shaft_speed(), -1);
  axis.stop();
  EXPECT_NEAR(shaft_speed(), 0, 0.05);
}

TEST_P(AxisMotion, LimitsAreReadAndWrittenAndPutBackWhenOneIsRefused) {
  const AxisLimits before = axis.limits();
  if (std::string_view(GetParam().product) == "pronet") {
    EXPECT_FALSE(before.lowest_position || before.profile_velocity) << "it has none";
    EXPECT_NE(problem_of([&] { axis.set_limits({.lowest_position = -5}); }), "");
    return;
  }
  ASSERT_TRUE(before.lowest_position && before.highest_position);
  axis.set_limits({.lowest_position = -1000, .highest_position = 2000});
  EXPECT_EQ(axis.limits().lowest_position, -1000);
  EXPECT_EQ(axis.limits().highest_position, 2000);
  EXPECT_EQ(axis.limits().profile_velocity, before.profile_velocity);
  EXPECT_THAT(problem_of([&] { axis.set_limits({.lowest_position = 5, .highest_position = 4}); }), HasSubstr("above"));
  // iSMK: Soft_Positive_Limit is sub 1.
  const bool swapped = std::string_view(GetParam().product).starts_with("ismk");
  EXPECT_EQ(rig.objects().read<std::int32_t>(0x607D, 1), swapped ? 2000 : -1000);
  if (swapped) {
    EXPECT_NE(problem_of([&] { axis.set_limits({.lowest_position = -7, .torque_permille = 10}); }), "") << "no 6072h";
    EXPECT_EQ(axis.limits().lowest_position, -1000) << "put back";
  }
}

// A drive whose 607Fh has 16 bits.
struct NarrowLimit final : ObjectClient {
  std::vector<std::byte> upload(ObjectAddress object) override {
    if (object.index != 0x607F) throw ObjectError("it is absent", "test", "", true);
    return std::vector<std::byte>(2);
  }
  void download(ObjectAddress, std::span<const std::byte> data) override { written.assign(data.begin(), data.end()); }
  Time now() const override { return {}; }
  void wait(Time) override {}
  std::uint16_t address() const override { return 1; }
  std::string where() const override { return "test"; }

  std::vector<std::byte> written;
};

TEST(AxisLimitsOfAnotherSize, ANumberThatDoesNotFitIsNotCut) {
  NarrowLimit drive;
  Axis402 axis(drive);
  axis.set_limits({.profile_velocity = 65535});
  EXPECT_EQ(drive.written, std::vector(2, std::byte{0xFF}));
  EXPECT_THAT(problem_of([&] { axis.set_limits({.profile_velocity = 65537}); }),
              HasSubstr("65537 does not fit into the 2 bytes"));
  EXPECT_EQ(drive.written, std::vector(2, std::byte{0})) << "put back";
}

TEST_P(AxisMotion, EveryWaitCanBeCancelledAndTheAxisStands) {
  axis.enable();
  const auto after = [&](double turns) {
    return [this, turns](const AxisStatus&) { give_up = std::abs(shaft()) > turns; };
  };
  EXPECT_THAT(problem_of([&] { axis.move_to(revolutions(100), profile(2), 60s, after(0.5)); }),
              HasSubstr("was cancelled; the axis stands at position"));
  EXPECT_NEAR(shaft_speed(), 0, 0.02);
  EXPECT_LT(shaft(), 2);
  give_up = false;
  EXPECT_THROW(axis.jog(profile(1),
                        [&](const AxisStatus&) -> std::optional<std::int32_t> {
                          give_up = shaft() < 0;
                          return static_cast<std::int32_t>(-2 * units.velocity);
                        }),
               Cancelled);
  EXPECT_NEAR(shaft_speed(), 0, 0.02);
  axis.disable();  // disable() cannot be cancelled
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
}

TEST_P(AxisMotion, WithoutAVelocityItSaysSoInsteadOfWaiting) {
  axis.enable();
  const auto velocity = rig.objects().read<std::uint32_t>(0x6081);
  if (velocity != 0) rig.objects().write<std::uint32_t>(0x6081, 0, 0);
  const Time start = rig.objects().now();
  EXPECT_THAT(problem_of([&] { axis.move_to(revolutions(1), {}, 60s); }), HasSubstr("profile velocity (6081h) is 0"));
  EXPECT_LT(rig.objects().now() - start, 1s);
}

TEST_P(AxisMotion, AFaultInTheMiddleIsExplainedInTheProductsWords) {
  axis.enable();
  std::string problem = problem_of([&] {
    axis.move_to(revolutions(100), profile(2), 60s, [&](const AxisStatus&) {
      if (shaft() > 0.5) rig.drive().inject(drive::Cause::over_voltage, true);
    });
  });
  EXPECT_THAT(problem, HasSubstr("the drive left operation enabled while moving to"));
  const auto code = rig.objects().read_if_present<std::uint16_t>(0x603F);
  if (code) {
    EXPECT_THAT(problem, HasSubstr("over-voltage"));
    EXPECT_THAT(problem, testing::ContainsRegex("over-voltage: .*\\. .*\\."));
  }
  EXPECT_THAT(problem, testing::Not(HasSubstr("--"))) << "no option of a command";
}

TEST_P(AxisMotion, ACutBusAndALostSupplyEndEveryWaitWithAMessage) {
  axis.enable();
  for (const bool power : {true, false}) {
    AxisRig another(GetParam());
    Axis402 its_axis(another.objects(), another.options());
    its_axis.enable();
    int looks = 0;
    const Time start = another.line.now();
    const std::string problem = problem_of([&] {
      its_axis.move_to(revolutions(100), profile(2), 60s, [&](const AxisStatus&) {
        if (++looks == 20) power ? another.power_off() : another.cut();
      });
    });
    EXPECT_NE(problem, "") << (power ? "power" : "cut");
    EXPECT_THAT(problem, HasSubstr("mem:"));
    EXPECT_LT(another.line.now() - start, 10s) << problem;
    EXPECT_LT(looks, 80) << "what the last frame brought is still shown for a while";
  }
}

// Products with a factory setting that assigns limit switches to inputs, and that stop at them in profile position.
class AxisAtALimit : public AxisMotion {};
INSTANTIATE_TEST_SUITE_P(Some, AxisAtALimit,
                         testing::Values(RigCase{"pronet"}, RigCase{"generic402"},
                                         RigCase{"generic402", RigCase::BusKind::modbus},
                                         RigCase{"jmc_ec", RigCase::BusKind::ethercat},
                                         RigCase{"generic402-ec", RigCase::BusKind::ethercat}),
                         [](const auto& row) { return row.param.name(); });

TEST_P(AxisAtALimit, AMoveThatALimitSwitchStopsIsNotWaitedForTillItsTimeIsUp) {
  axis.enable();
  const std::uint8_t input = line::find_product(line::all_products(), GetParam().product)->wiring.positive_limit;
  bool active = false;
  const Time start = rig.objects().now();
  const std::string problem = problem_of([&] {
    axis.move_to(revolutions(100), profile(2), 60s, [&](const AxisStatus&) {
      if (!active && shaft() > 0.5) rig.drive().force_input(input, true);
      active = active || shaft() > 0.5;
    });
  });
  EXPECT_THAT(problem, HasSubstr("where the positive limit switch is active (60FDh)"));
  EXPECT_LT(rig.objects().now() - start, 4s);
  EXPECT_NEAR(shaft_speed(), 0, 0.02);
}

TEST_P(AxisAtALimit, AJogIntoAnActiveSwitchFailsAndOneAwayFromItDoesNot) {
  axis.enable();
  const std::uint8_t input = line::find_product(line::all_products(), GetParam().product)->wiring.positive_limit;
  rig.drive().force_input(input, true);
  rig.objects().wait(100ms);
  const auto jog = [&](double rps, Time span, bool waits = false) {
    const Time end = rig.objects().now() + span;
    return problem_of([&] {
      axis.jog(
          profile(1),
          [&](const AxisStatus&) -> std::optional<std::int32_t> {
            if (rig.objects().now() >= end) return std::nullopt;
            return static_cast<std::int32_t>(rps * units.velocity);
          },
          waits);
    });
  };
  EXPECT_THAT(jog(1, 5s), HasSubstr("jogging ended at position"));
  EXPECT_THAT(jog(1, 300ms), HasSubstr("where the positive limit switch is active (60FDh)"));
  EXPECT_EQ(jog(1, 1s, true), "") << "keys may reverse it";
  EXPECT_EQ(jog(-1, 1s), "");
  EXPECT_LT(shaft(), -0.3);
}

TEST_P(AxisAtALimit, TorqueAndARunIntoAnActiveSwitchFail) {
  axis.enable();
  const std::uint8_t input = line::find_product(line::all_products(), GetParam().product)->wiring.positive_limit;
  axis.run_at(static_cast<std::int32_t>(units.velocity), profile(1), 3s);
  rig.drive().force_input(input, true);
  EXPECT_THAT(problem_of([&] { axis.hold_for(3s); }), HasSubstr("where the positive limit switch is active (60FDh)"));
  if (std::string_view(GetParam().product) == "pronet") return;  // it has no torque mode
  EXPECT_THAT(problem_of([&] { axis.run_torque(100, {.slope = 1000U}, 5s); }),
              HasSubstr("applying 10 % of rated torque ended at position"));
}

// The quick stop ramp is slower than that of the move, so the switch stops the axis behind its target.
TEST(AxisBehindItsTarget, IsAtTheLimitSwitchThatStoppedIt) {
  AxisRig rig(RigCase{"generic402", RigCase::BusKind::can,
                      "[axis.travel]\ncounts_per_unit = 131072\nlow_stop = -11\nhigh_stop = 11\npositive_limit = 2\n"});
  Axis402 axis(rig.objects(), rig.options());
  rig.objects().write<std::uint32_t>(0x6085, 0, 10 * 131072);
  axis.enable();
  const Time start = rig.objects().now();
  const MotionProfile profile{.velocity = 5U * 131072, .acceleration = 500U * 131072, .deceleration = 500U * 131072};
  const std::string problem = problem_of([&] { axis.move_to(2 * 131072 + 3000, profile, 60s); });
  EXPECT_GT(rig.shaft_counts(), 2 * 131072 + 10000);
  EXPECT_THAT(problem, HasSubstr("where the positive limit switch is active (60FDh)"));
  EXPECT_LT(rig.objects().now() - start, 4s);
}

// An ISMC reports target reached when its demand is at the target, and by default does not monitor the following error.
TEST(AxisAtAHardStop, IsNotTakenForAnAxisAtItsTarget) {
  AxisRig rig(RigCase{"ismc", RigCase::BusKind::can,
                      "[axis.travel]\ncounts_per_unit = 131072\nlow_stop = -1\nhigh_stop = 1\n"});
  Axis402 axis(rig.objects(), rig.options());
  axis.enable();
  const std::string problem = problem_of(
      [&] { axis.move_to(4 * 131072, {.velocity = 131072, .acceleration = 1310720, .deceleration = 1310720}, 60s); });
  EXPECT_THAT(problem, HasSubstr("the drive shows the target as reached, but the axis stands at 13"));
  EXPECT_THAT(problem, HasSubstr("instead of 524288"));
}

class Probes : public testing::TestWithParam<RigCase> {};
INSTANTIATE_TEST_SUITE_P(Some, Probes,
                         testing::Values(RigCase{"generic402"}, RigCase{"generic402", RigCase::BusKind::modbus},
                                         RigCase{"generic402-ec", RigCase::BusKind::ethercat}),
                         [](const auto& row) { return row.param.name(); });

// Inputs 3 and 4 of the reference drive are its probes.
TEST_P(Probes, KeepThePositionOfEachEdge) {
  AxisRig rig(GetParam());
  Axis402 axis(rig.objects(), rig.options());
  axis.enable();
  const ProbeRequest request{.probe = 2, .negative_edge = true};
  axis.arm_probe(request);
  EXPECT_FALSE(axis.probe_positions(2).positive);
  axis.start_move_to(20 * 131072, {.velocity = 131072});
  double rose = 0;
  double fell = 0;
  const ProbePositions seen = axis.wait_for_probe(request, 10s, [&](const AxisStatus&) {
    if (rose == 0 && rig.shaft_counts() > 100000) {
      rig.drive().force_input(4, true);
      rose = rig.shaft_counts();
    } else if (rose != 0 && fell == 0 && rig.shaft_counts() > 200000) {
      rig.drive().force_input(4, false);
      fell = rig.shaft_counts();
    }
  });
  ASSERT_TRUE(seen.positive && seen.negative);
  EXPECT_NEAR(*seen.positive, rose, 300);
  EXPECT_NEAR(*seen.negative, fell, 300);
  axis.disarm_probe(2);
  axis.stop();

  const ProbeRequest index{.source = ProbeRequest::Source::index};
  axis.arm_probe(index);
  axis.move_by(2 * 131072, {.velocity = 131072}, 10s);
  const ProbePositions at_index = axis.wait_for_probe(index, 1s);
  ASSERT_TRUE(at_index.positive);
  EXPECT_EQ(*at_index.positive % 131072, 0) << "the index of this motor is at 0";
}

TEST_P(Probes, ThatSeeNothingSaySo) {
  AxisRig rig(GetParam());
  Axis402 axis(rig.objects(), rig.options());
  const ProbeRequest request{.probe = 1};
  axis.arm_probe(request);
  EXPECT_THAT(problem_of([&] { axis.wait_for_probe(request, 200ms); }),
              HasSubstr("waiting for touch probe 1 took longer than 0.2 s (positive edge: not detected"));
  EXPECT_NE(problem_of([&] { axis.arm_probe({.probe = 3}); }), "");
  EXPECT_NE(problem_of([&] { axis.arm_probe({.positive_edge = false}); }), "");
}

}  // namespace
}  // namespace axis_motion_test
}  // namespace servodrome::master::test
