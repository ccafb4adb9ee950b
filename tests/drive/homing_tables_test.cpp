#include <gtest/gtest.h>
#include <set>
#include <span>
#include <string>

#include "drive/homing/cia402_methods.hpp"
#include "drive/homing_figures.hpp"
#include "products/ismc/homing_methods.hpp"
#include "products/jmc_ec/homing_methods.hpp"

namespace servodrome::drive::test {
namespace homing_tables_test {
namespace {

struct Table {
  const char* name;
  std::span<const Method> methods;
  std::set<int> numbers;
  std::set<int> returning;  // methods that move back to home at the end
  std::set<int> at_fast{};  // home is met at fast speed, or during the ramp down from it
  std::set<int> idle{};     // allowed, but without motion
  bool all_turn = false;    // methods 3 to 6 also reverse at a limit switch
};

std::set<int> numbers_without(std::set<int> absent) {
  std::set<int> numbers;
  for (int number = -4; number <= 37; ++number) {
    if (!absent.contains(number)) numbers.insert(number);
  }
  return numbers;
}

const Table tables[] = {
    {"CiA 402", cia402_methods, numbers_without({0, 15, 16, 31, 32, 36}), numbers_without({-2, -1, 35, 37})},
    {"ISMC", products::ismc::homing_methods, numbers_without({0, 15, 16, 31, 32, 36, 37}), {4, 5}},
    {"JMC EC",
     products::jmc_ec::homing_methods,
     numbers_without({-4, -3, -2, -1, 36, 37}),
     numbers_without({-4, -3, -2, -1, 0, 15, 16, 31, 32, 35, 36, 37}),
     {4, 6, 8, 9, 12, 13, 20, 22, 24, 25, 28, 29},
     {0, 15, 16, 31, 32},
     true},
};

class HomingTables : public testing::TestWithParam<const Table*> {};

std::string name_of(const testing::TestParamInfo<const Table*>& table) {
  return table.param == &tables[0] ? "cia402" : table.param == &tables[1] ? "ismc" : "jmc_ec";
}
INSTANTIATE_TEST_SUITE_P(Each, HomingTables, testing::Values(&tables[0], &tables[1], &tables[2]), name_of);

TEST_P(HomingTables, HaveExactlyTheMethodsOfTheirBook) {
  for (int number = -128; number <= 127; ++number) {
    const bool found = find_method(GetParam()->methods, static_cast<std::int8_t>(number)) != nullptr;
    EXPECT_EQ(found, GetParam()->numbers.contains(number)) << number;
    Homing homing;
    homing.start(GetParam()->methods, static_cast<std::int8_t>(number), HomingConfig{}, HomingInputs{});
    EXPECT_EQ(homing.error(), found ? HomingError::none : HomingError::unsupported_method) << number;
    EXPECT_EQ(homing.active(), found && !GetParam()->idle.contains(number)) << number;
    EXPECT_FALSE(homing.finished()) << number;
  }
}

TEST_P(HomingTables, FindHomeWhereTheFigureHasIt) {
  int runs = 0;
  for (const Method& method : GetParam()->methods) {
    if (method.idle) continue;
    const Figure& figure = *figure_of(method.number);
    Random random{static_cast<std::uint32_t>(1000 + method.number)};
    for (int round = 0; round < 90; ++round) {
      for (const Start start : starts) {
        const Setting setting = random_setting(figure, random);
        const World& world = setting.world;
        const HomingConfig& config = setting.config;
        const std::optional<Counts> from = start_position(figure, world, start, random);
        if (!from) continue;
        ++runs;
        SCOPED_TRACE(testing::Message() << GetParam()->name << " method " << figure.number << " round " << round
                                        << " start " << static_cast<int>(start) << " at " << *from << ", home "
                                        << world.home_from << ".." << world.home_to << ", limits "
                                        << world.negative_limit << ".." << world.positive_limit);
        const Outcome outcome = run(method, config, world, *from);
        ASSERT_TRUE(outcome.finished) << "error " << static_cast<int>(outcome.error);
        ASSERT_EQ(outcome.latch, expected_home(figure, world, *from, config.retraction));

        const double velocity = outcome.velocity_at_latch;
        if (figure.approach != 0 && !is_hard_stop(figure.number)) {
          ASSERT_GT(velocity * figure.approach, 0.0) << "found in the wrong direction";
        }
        // Slow, unless the home switch is so short that the axis is still slowing down on it.
        const double ramp = (config.fast * config.fast - config.slow * config.slow) / (2.0 * config.acceleration);
        if (GetParam()->at_fast.contains(figure.number)) {
          ASSERT_LE(std::abs(velocity), config.fast);
        } else if (!uses_home(figure.number) || static_cast<double>(world.home_to - world.home_from) >
                                                    ramp + config.fast * HomingAxis::cycle_s + 2.0) {
          ASSERT_LE(std::abs(velocity), config.slow);
        }
        if (GetParam()->returning.contains(figure.number)) {
          ASSERT_EQ(outcome.rest, outcome.latch);
        } else if (figure.index || !is_hard_stop(figure.number)) {
          // The axis stops v^2 / 2a behind the point at which it detected home, at most one cycle after home. In
          // negative direction it meets the index earlier by the width of the index.
          const double stop = velocity * velocity / (2.0 * config.acceleration);
          const Counts edge = figure.index && figure.approach < 0 ? outcome.latch + world.index_width : outcome.latch;
          const double overrun = static_cast<double>((outcome.rest - edge) * figure.approach);
          ASSERT_GE(overrun, stop - 1.0);
          ASSERT_LE(overrun, stop + std::max(std::abs(velocity), config.slow) * HomingAxis::cycle_s + 1.0);
        } else {
          ASSERT_EQ(outcome.rest, outcome.latch);  // hard stop without index: home is the resting position
        }
      }
    }
  }
  RecordProperty("runs", runs);
  EXPECT_GT(runs, 13000);
}

// 607Eh: a reversed axis in the mirrored geometry makes the same motion with opposite signs. (The way back after the
// latch differs: home is the same boundary of the index in encoder counts, which is not mirrored.)
TEST_P(HomingTables, ReversedPolarityIsTheMirrorImage) {
  for (const Method& method : GetParam()->methods) {
    if (method.idle) continue;
    const Figure& figure = *figure_of(method.number);
    Random random{static_cast<std::uint32_t>(2000 + method.number)};
    for (int round = 0; round < 20; ++round) {
      for (const Start start : starts) {
        const Setting setting = random_setting(figure, random);
        const std::optional<Counts> from = start_position(figure, setting.world, start, random);
        if (!from) continue;
        SCOPED_TRACE(testing::Message() << "method " << figure.number << " round " << round);
        HomingConfig reversed = setting.config;
        reversed.reversed = true;
        const Outcome one = run(method, setting.config, setting.world, *from);
        const Outcome other = run(method, reversed, setting.world.mirrored(), -1 - *from);
        ASSERT_TRUE(one.finished && other.finished);
        ASSERT_EQ(one.latch_cycle, other.latch_cycle);
        ASSERT_EQ(one.velocity_at_latch, -other.velocity_at_latch);
        const bool a_count = figure.approach == 0 || (is_hard_stop(figure.number) && !figure.index);
        ASSERT_EQ(other.latch, -one.latch - (a_count ? 1 : figure.index ? setting.world.index_width : 0));
        ASSERT_EQ(one.commands.size(), other.commands.size());
        for (std::size_t i = 0; i < one.commands.size(); ++i) {
          ASSERT_EQ(one.commands[i].kind, other.commands[i].kind);
          if (one.commands[i].kind == HomingCommand::Kind::velocity) {
            ASSERT_EQ(one.commands[i].velocity, -other.commands[i].velocity);
          }
        }
      }
    }
  }
}

// --- Errors

TEST_P(HomingTables, EndInAnErrorBetweenLimitsWithoutHomeOrIndex) {
  for (const Method& method : GetParam()->methods) {
    if (method.idle) continue;
    const int number = method.number;
    const Outcome outcome = run(method, plain_config(), bare, 0);
    const bool found = number == 17 || number == 18 || number >= 35;
    EXPECT_EQ(outcome.finished, found) << number;
    if (found) continue;
    // Methods 1 and 2 have reversed at a limit; 7 to 14 and 23 to 30 reverse when they miss home; the others must not
    // meet a limit.
    const bool turns =
        (pattern(number) >= (GetParam()->all_turn ? 3 : 7) && pattern(number) <= 14) || number == 1 || number == 2;
    EXPECT_EQ(outcome.error, turns ? HomingError::home_not_found : HomingError::wrong_limit) << number;
    EXPECT_EQ(outcome.commands.back().kind, HomingCommand::Kind::stop) << number;
  }
}

TEST_P(HomingTables, TimeOutWhenNothingHappens) {
  World endless = bare;
  endless.negative_limit = endless.low_stop = -1'000'000'000;
  endless.positive_limit = endless.high_stop = 1'000'000'000;
  HomingConfig config = plain_config();
  config.timeout_cycles = 3000;
  for (const Method& method : GetParam()->methods) {
    const Outcome outcome = run(method, config, endless, 0);
    if (method.idle) {
      EXPECT_FALSE(outcome.finished);
      EXPECT_EQ(outcome.cycles, 0u);
    } else if (method.leg_count == 0) {
      EXPECT_TRUE(outcome.finished);
    } else {
      EXPECT_EQ(outcome.error, HomingError::timed_out) << int{method.number};
      EXPECT_EQ(outcome.cycles, 3001u) << int{method.number};
    }
  }
}

// With any inputs the executor stays within its legs and ends after its timeout at the latest.
TEST_P(HomingTables, SurviveNonsense) {
  Random random{7};
  for (const Method& method : GetParam()->methods) {
    if (method.idle) continue;
    for (int round = 0; round < 200; ++round) {
      HomingConfig config = plain_config();
      config.timeout_cycles = 500;
      config.reversed = round % 2 == 1;
      Homing homing;
      HomingInputs inputs;
      homing.start(method, config, inputs);
      int cycles = 0;
      bool latched = false;
      for (; homing.active() && cycles < 2000; ++cycles) {
        SignalEdge edges[3];
        for (SignalEdge& edge : edges) {
          edge = {static_cast<Signal>(random.between(0, 6)), random.between(0, 1) == 1, random.between(-50, 50)};
        }
        inputs.edges = {edges, static_cast<std::size_t>(random.between(0, 3))};
        inputs.signals = static_cast<std::uint32_t>(random.between(0, 0x1F)) & (round % 3 == 0 ? 0x1Fu : 0x18u);
        inputs.standing = random.between(0, 2) == 0;
        inputs.torque = static_cast<float>(random.between(-2, 2));
        homing.step(inputs);
        ASSERT_FALSE(latched && !homing.latched()) << "a latch is not taken back";
        latched = homing.latched();
      }
      ASSERT_FALSE(homing.active()) << int{method.number};
      ASSERT_NE(homing.finished(), homing.error() != HomingError::none) << int{method.number};
      ASSERT_NE(homing.error(), HomingError::internal);
    }
  }
}

}  // namespace
}  // namespace homing_tables_test
}  // namespace servodrome::drive::test
