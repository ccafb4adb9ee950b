#include <gtest/gtest.h>
#include <initializer_list>
#include <optional>
#include <span>

#include "drive/homing/cia402_methods.hpp"
#include "drive/homing_axis.hpp"
#include "products/ismc/homing_methods.hpp"

namespace servodrome::drive::test {
namespace homing_test {
namespace {

TEST(Homing, WrongLimitStopsAtOnceWhereTheMethodDoesNotTurnRound) {
  World world = bare;
  world.home_from = 7000;  // behind the positive limit
  world.home_to = 9001;
  const Outcome outcome = run(*find_method(cia402_methods, 19), plain_config(), world, 0);
  EXPECT_EQ(outcome.error, HomingError::wrong_limit);
  EXPECT_GE(outcome.rest, world.positive_limit);
  // A start on that limit switch causes no motion.
  const Outcome standing = run(*find_method(cia402_methods, 34), plain_config(), bare, bare.positive_limit);
  EXPECT_EQ(standing.error, HomingError::wrong_limit);
  EXPECT_EQ(standing.cycles, 1u);
  EXPECT_EQ(standing.rest, bare.positive_limit);
}

// The ISMC reverses at the limit only if it starts below it; the manual (ch. 4.7.6, method 9) shows no other branch.
TEST(Homing, IsmcMethodNineHasNoBranchFromAnActiveHomeSwitch) {
  World world = bare;
  world.home_from = 3000;
  world.home_to = 7000;
  const Outcome outcome = run(*find_method(products::ismc::homing_methods, 9), plain_config(), world, 4000);
  EXPECT_EQ(outcome.error, HomingError::wrong_limit);
}

TEST(Homing, BothIndexDirectionsAgree) {
  World world = bare;
  world.index = 123;
  world.index_width = 17;
  world.revolution = 100000;
  HomingConfig config = plain_config();
  config.index_width = world.index_width;
  EXPECT_EQ(run(*find_method(cia402_methods, 33), config, world, 800).latch, 123);
  EXPECT_EQ(run(*find_method(cia402_methods, 34), config, world, -800).latch, 123);
}

TEST(Homing, HardStopNeedsTheTorqueForTheWholeTime) {
  HomingConfig config = plain_config();
  config.stall_cycles = 10;
  config.stall_window = 3;
  HomingInputs inputs{.ahead = 1};
  Homing homing;
  homing.start(*find_method(cia402_methods, -2), config, inputs);
  EXPECT_EQ(homing.step(inputs).velocity, 20000.0);
  inputs.standing = false;
  EXPECT_EQ(homing.pressing(), 1);
  const auto press = [&](float torque, int cycles) {
    inputs.torque = torque;
    HomingCommand command;
    for (int i = 0; i < cycles; ++i) command = homing.step(inputs);
    return command.kind;
  };
  EXPECT_EQ(press(1.6F, 9), HomingCommand::Kind::keep);
  EXPECT_EQ(press(0.0F, 1), HomingCommand::Kind::keep);    // a torque peak of the ramp does not count as a hard stop
  EXPECT_EQ(press(-3.0F, 50), HomingCommand::Kind::keep);  // a torque in the opposite direction does not count either
  inputs.ahead = 0;
  EXPECT_EQ(press(1.6F, 50), HomingCommand::Kind::keep);  // nor does one that is needed to follow the demand
  inputs.ahead = -1;
  EXPECT_EQ(press(1.6F, 50), HomingCommand::Kind::keep);
  inputs.ahead = 1;
  for (int i = 0; i < 50; ++i) {  // nor does one that still moves the shaft
    inputs.position += 1;
    EXPECT_EQ(press(1.6F, 1), HomingCommand::Kind::keep);
  }
  inputs.position = 4321;
  EXPECT_EQ(press(1.5F, 10), HomingCommand::Kind::hold);
  EXPECT_EQ(homing.pressing(), 0);
  EXPECT_FALSE(homing.latched());
  inputs.standing = true;
  homing.step(inputs);  // no retraction: this position is home
  EXPECT_TRUE(homing.latched());
  EXPECT_EQ(homing.latch(), 4321);
  homing.step(inputs);
  EXPECT_TRUE(homing.finished());
}

// A halt on the way to a hard stop (605Dh): the torque that brakes the axis does not count as that of the hard stop.
TEST(Homing, TheTorqueOfAHaltIsNoHardStop) {
  HomingConfig config = plain_config();
  Homing homing;
  HomingInputs inputs;
  homing.start(*find_method(cia402_methods, -2), config, inputs);
  homing.step(inputs);
  inputs.standing = false;
  inputs.torque = 3.0F;
  inputs.ahead = 1;
  for (int i = 0; i < 50; ++i) EXPECT_EQ(homing.step_halted(inputs).kind, HomingCommand::Kind::keep);
  EXPECT_EQ(homing.pressing(), 1);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::hold);
}

TEST(Homing, PresentPositionNeedsNoMotion) {
  for (const std::int8_t number : {std::int8_t{35}, std::int8_t{37}}) {
    Homing homing;
    HomingInputs inputs{.position = -77};
    homing.start(cia402_methods, number, plain_config(), inputs);
    EXPECT_FALSE(homing.latched());
    homing.step(inputs);
    EXPECT_TRUE(homing.latched());
    EXPECT_EQ(homing.latch(), -77);
    EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
    EXPECT_TRUE(homing.finished());
    EXPECT_FALSE(homing.active());
  }
}

TEST(Homing, AttainedComesWithTheEdgeAndTargetReachedWithStandstill) {
  World world = bare;
  world.index_width = 1;
  HomingAxis axis{world, 10, 1.0e6};
  Homing homing;
  homing.start(products::ismc::homing_methods, 34, plain_config(), axis.inputs());
  while (!homing.latched()) axis.step(homing.step(axis.inputs()));
  EXPECT_FALSE(homing.finished());
  EXPECT_GT(axis.velocity(), 0.0);  // ch. 4.7.2: bit 12 is set while the motor still turns
  while (!homing.finished()) axis.step(homing.step(axis.inputs()));
  EXPECT_EQ(axis.velocity(), 0.0);
  EXPECT_EQ(homing.latch(), 1000);
}

// If the axis moves at the start, it first comes to rest. Edges that it meets until then do not belong to the first
// leg.
TEST(Homing, StartsFromRestOnly) {
  Homing homing;
  HomingInputs inputs{.standing = false};
  homing.start(cia402_methods, 34, plain_config(), inputs);
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::stop);
  const SignalEdge index[]{{Signal::index, true, 5}};
  inputs.edges = index;
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  EXPECT_FALSE(homing.latched());
  inputs.edges = {};
  inputs.standing = true;
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::velocity);
}

// The actual position lags the demand: after the reversal the axis still moves on, here past the far edge of a short
// cam.
TEST(Homing, EdgesBeyondTheTurningPointAreNotOfTheLegBack) {
  const auto latch = [](std::int8_t number, Counts sign) {
    Homing homing;
    HomingInputs inputs;
    const auto step = [&](std::initializer_list<SignalEdge> edges, Counts position, bool standing) {
      inputs.edges = {edges.begin(), edges.size()};
      inputs.position = sign * position;
      inputs.standing = standing;
      return homing.step(inputs);
    };
    homing.start(cia402_methods, number, plain_config(), inputs);
    step({}, 0, true);
    EXPECT_EQ(step({{Signal::home, true, sign * 100}}, 150, false).kind, HomingCommand::Kind::stop);
    EXPECT_EQ(step({}, 150, true).velocity, static_cast<double>(sign * -2000));
    step({{Signal::home, false, sign * 160}, {Signal::home, true, sign * 159}}, 158, false);
    EXPECT_FALSE(homing.latched());
    step({{Signal::home, false, sign * 99}}, 90, false);
    EXPECT_TRUE(homing.latched());
    return homing.latch();
  };
  EXPECT_EQ(latch(23, 1), 100);
  EXPECT_EQ(latch(27, -1), -99);
}

// The capture unit may lose edges because its buffer is short, and a level may change and return within a cycle. Either
// signal is sufficient.
TEST(Homing, LimitSwitchIsSeenByEdgeAndByLevel) {
  const Method& method = *find_method(cia402_methods, 34);
  const SignalEdge pulse[]{{Signal::positive_limit, true, 50}, {Signal::positive_limit, false, 60}};
  for (const bool by_edge : {true, false}) {
    Homing homing;
    HomingInputs inputs;
    homing.start(method, plain_config(), inputs);
    homing.step(inputs);
    inputs.standing = false;
    if (by_edge) {
      inputs.edges = pulse;
    } else {
      inputs.signals = bit(Signal::positive_limit);
    }
    EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::stop);
    EXPECT_EQ(homing.error(), HomingError::wrong_limit);
  }
}

// The axis is home; the time until it rests does not count for the timeout.
TEST(Homing, NoTimeOutAfterTheLatch) {
  HomingConfig config = plain_config();
  config.timeout_cycles = 10;
  Homing homing;
  HomingInputs inputs;
  homing.start(cia402_methods, 34, config, inputs);
  homing.step(inputs);
  inputs.standing = false;
  const SignalEdge index[]{{Signal::index, true, 5}};
  inputs.edges = index;
  homing.step(inputs);
  inputs.edges = {};
  for (int i = 0; i < 100; ++i) homing.step(inputs);
  EXPECT_EQ(homing.error(), HomingError::none);
  EXPECT_TRUE(homing.active());
}

// A method that no product has: from one hard stop to the other.
TEST(Homing, EveryHardStopIsTimedAnew) {
  const Method method = make_method(1, {leg(Direction::negative, HomingSpeed::fast, Until::stalled, Then::hold),
                                        leg(Direction::positive, HomingSpeed::fast, Until::stalled, Then::hold),
                                        leg(Direction::negative, HomingSpeed::slow, Until::index, Then::latch)});
  const World world{.index = 100, .low_stop = -3000, .high_stop = 3000};
  HomingConfig config = plain_config();
  config.stall_cycles = 20;
  const Outcome outcome = run(method, config, world, 0);
  EXPECT_EQ(outcome.latch, 2100);
  Homing homing;
  HomingInputs inputs;
  homing.start(method, config, inputs);
  homing.step(inputs);
  inputs.torque = -2.0F;
  inputs.ahead = -1;
  for (int i = 0; i < 19; ++i) EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::hold);
  EXPECT_EQ(homing.step(inputs).velocity, 20000.0);
  inputs.torque = 2.0F;
  inputs.ahead = 1;
  for (int i = 0; i < 19; ++i) EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::hold);
}

// A load drives the axis back beyond the beginning of the leg, or faster than a rebound from the stop is.
TEST(Homing, ALoadThatDrivesTheAxisBackEndsIt) {
  HomingConfig config = plain_config();
  config.slack = 50;
  for (const bool far : {true, false}) {
    Homing homing;
    HomingInputs inputs{.position = 1000, .ahead = -1};
    homing.start(*find_method(cia402_methods, -1), config, inputs);  // negative
    homing.step(inputs);
    inputs.standing = false;
    inputs.position = far ? 1050 : -9000;
    inputs.velocity = far ? 10.0 : 1.5 * config.fast;
    EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
    if (far) inputs.position += 1;
    if (!far) inputs.velocity += 1.0;
    EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::stop);
    EXPECT_EQ(homing.error(), HomingError::driven_back);
    EXPECT_FALSE(homing.active());
  }
}

// The axis rebounds from a hard stop, with full torque, before it rests there.
TEST(Homing, AHardStopIsFoundWhenTheShaftStands) {
  const Method method = make_method(1, {leg(Direction::negative, HomingSpeed::fast, Until::stalled, Then::hold),
                                        leg(Direction::positive, HomingSpeed::slow, Until::index, Then::latch)});
  HomingConfig config = plain_config();
  config.stall_cycles = 20;
  Homing homing;
  HomingInputs inputs;
  homing.start(method, config, inputs);
  homing.step(inputs);
  inputs.torque = -2.0F;
  inputs.ahead = -1;
  for (int i = 0; i < 15; ++i) EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  inputs.moves = true;
  for (int i = 0; i < 30; ++i) EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  inputs.moves = false;
  for (int i = 0; i < 19; ++i) EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::hold);
}

// Switch edge and index within the same cycle: their order decides.
TEST(Homing, IndexCountsOnlyAfterTheQualifyingEdge) {
  const auto latched_at = [](std::span<const SignalEdge> edges) -> std::optional<Counts> {
    Homing homing;
    HomingInputs inputs{.signals = bit(Signal::home)};
    homing.start(cia402_methods, 5, plain_config(), inputs);  // on the switch: positive, home falls, index
    homing.step(inputs);
    inputs.edges = edges;
    inputs.position = 100;
    homing.step(inputs);
    return homing.latched() ? std::optional{homing.latch()} : std::nullopt;
  };
  const SignalEdge before[]{{Signal::index, true, 40}, {Signal::home, false, 50}};
  const SignalEdge after[]{{Signal::home, false, 50}, {Signal::index, true, 60}};
  EXPECT_EQ(latched_at(before), std::nullopt);
  EXPECT_EQ(latched_at(after), 60);
}

TEST(Homing, AbortForgetsAndANewStartBeginsAfresh) {
  World world = bare;
  world.home_from = -300;
  world.home_to = 400;
  world.index_width = 1;
  world.index = 77;
  const Method& method = *find_method(cia402_methods, 10);
  const Counts home = run(method, plain_config(), world, 2000).latch;
  EXPECT_EQ(home, 1077);
  const std::uint32_t cycles = run(method, plain_config(), world, 2000).cycles;
  for (std::uint32_t when = 0; when < cycles; when += 7) {
    HomingAxis axis{world, 2000, 1.0e6};
    Homing homing;
    homing.start(method, plain_config(), axis.inputs());
    for (std::uint32_t i = 0; i < when; ++i) axis.step(homing.step(axis.inputs()));
    homing.abort();
    ASSERT_FALSE(homing.active() || homing.latched() || homing.finished());
    ASSERT_EQ(homing.error(), HomingError::none);
    ASSERT_EQ(homing.step(axis.inputs()).kind, HomingCommand::Kind::keep);
    // The caller stops the axis; here the new start must stop it.
    homing.start(method, plain_config(), axis.inputs());
    while (homing.active()) axis.step(homing.step(axis.inputs()));
    ASSERT_TRUE(homing.finished()) << "aborted after " << when;
    ASSERT_EQ(homing.latch(), home);
  }
}

TEST(HomingMethods, WellFormednessIsChecked) {
  constexpr Leg forward = leg(Direction::positive, HomingSpeed::slow, Until::home_rising, Then::stop);
  constexpr Leg last = leg(Direction::positive, HomingSpeed::slow, Until::index, Then::latch);
  EXPECT_TRUE(is_well_formed(make_method(1, {forward, last})));
  EXPECT_FALSE(is_well_formed(make_method(1, {forward})));           // has no end
  EXPECT_FALSE(is_well_formed(make_method(1, {forward, last}, 2)));  // has no start
  Method circle = make_method(1, {forward, forward, last});
  circle.legs[1].next = 0;
  EXPECT_FALSE(is_well_formed(circle));
  circle.legs[1].next = 1;
  EXPECT_FALSE(is_well_formed(circle));
  Method back = make_method(1, {forward, last});
  back.legs[1].on_limit = 0;
  EXPECT_FALSE(is_well_formed(back));
  EXPECT_FALSE(is_well_formed(
      make_method(1, {leg(Direction::negative, HomingSpeed::fast, Until::home_rising, Then::keep), last})));
  EXPECT_FALSE(
      is_well_formed(make_method(1, {leg(Direction::negative, HomingSpeed::fast, Until::limit_reached, Then::latch)})));
  Homing homing;
  homing.start(circle, plain_config(), HomingInputs{});
  EXPECT_EQ(homing.error(), HomingError::internal);
  EXPECT_FALSE(homing.active());
}

}  // namespace
}  // namespace homing_test
}  // namespace servodrome::drive::test
