#include <gtest/gtest.h>
#include <optional>
#include <random>
#include <set>
#include <span>
#include <string>

#include "drive/homing/cia402_methods.hpp"
#include "drive/homing_axis.hpp"
#include "products/ismc/homing_methods.hpp"

namespace servodrome::drive::test {
namespace {

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  Counts between(Counts low, Counts high) {  // both included
    return low + static_cast<Counts>(engine_() % static_cast<std::uint32_t>(high - low + 1));
  }

 private:
  std::mt19937 engine_;
};

// --- Where home is, by the figures of CiA 402-2: which boundary, and which way from there to the index if any.

enum class Place { negative_limit, positive_limit, home_negative_edge, home_positive_edge, start, hard_stop };

struct Figure {
  int number;
  Place place;
  int approach;  // direction of travel when home is found; 0: no motion
  bool index;
};

constexpr Figure figures[] = {
    {-4, Place::hard_stop, -1, true},
    {-3, Place::hard_stop, 1, true},
    {-2, Place::hard_stop, -1, false},
    {-1, Place::hard_stop, 1, false},
    {1, Place::negative_limit, 1, true},
    {2, Place::positive_limit, -1, true},
    {3, Place::home_negative_edge, -1, true},
    {4, Place::home_negative_edge, 1, true},
    {5, Place::home_positive_edge, 1, true},
    {6, Place::home_positive_edge, -1, true},
    {7, Place::home_negative_edge, -1, true},
    {8, Place::home_negative_edge, 1, true},
    {9, Place::home_positive_edge, -1, true},
    {10, Place::home_positive_edge, 1, true},
    {11, Place::home_positive_edge, 1, true},
    {12, Place::home_positive_edge, -1, true},
    {13, Place::home_negative_edge, 1, true},
    {14, Place::home_negative_edge, -1, true},
    {17, Place::negative_limit, 1, false},
    {18, Place::positive_limit, -1, false},
    {19, Place::home_negative_edge, -1, false},
    {20, Place::home_negative_edge, 1, false},
    {21, Place::home_positive_edge, 1, false},
    {22, Place::home_positive_edge, -1, false},
    {23, Place::home_negative_edge, -1, false},
    {24, Place::home_negative_edge, 1, false},
    {25, Place::home_positive_edge, -1, false},
    {26, Place::home_positive_edge, 1, false},
    {27, Place::home_positive_edge, 1, false},
    {28, Place::home_positive_edge, -1, false},
    {29, Place::home_negative_edge, 1, false},
    {30, Place::home_negative_edge, -1, false},
    {33, Place::start, -1, true},
    {34, Place::start, 1, true},
    {35, Place::start, 0, false},
    {37, Place::start, 0, false},
};

// The first index (its lower boundary) that lies wholly beyond `boundary`.
Counts index_beyond(Counts boundary, int direction, const World& world) {
  Counts index = world.index;
  if (direction > 0) {
    while (index >= boundary) index -= world.revolution;
    while (index < boundary) index += world.revolution;
  } else {
    while (index + world.index_width <= boundary) index += world.revolution;
    while (index + world.index_width > boundary) index -= world.revolution;
  }
  return index;
}

Counts expected_home(const Figure& figure, const World& world, Counts start, Counts retraction) {
  switch (figure.place) {
    case Place::negative_limit:
      return figure.index ? index_beyond(world.negative_limit, figure.approach, world) : world.negative_limit;
    case Place::positive_limit:
      return figure.index ? index_beyond(world.positive_limit, figure.approach, world) : world.positive_limit;
    case Place::home_negative_edge:
      return figure.index ? index_beyond(world.home_from, figure.approach, world) : world.home_from;
    case Place::home_positive_edge:
      return figure.index ? index_beyond(world.home_to, figure.approach, world) : world.home_to;
    case Place::start:
      // From inside of count `start`: its upper boundary going up, its lower one going down.
      if (figure.approach == 0) return start;
      return index_beyond(figure.approach > 0 ? start + 1 : start, figure.approach, world);
    case Place::hard_stop:
      if (figure.approach > 0) {
        return figure.index ? index_beyond(world.low_stop + 1, 1, world) : world.low_stop + retraction;
      }
      return figure.index ? index_beyond(world.high_stop, -1, world) : world.high_stop - retraction;
  }
  return 0;
}

// --- Geometry

bool uses_home(int number) { return (number >= 3 && number <= 14) || (number >= 19 && number <= 30); }
bool is_hard_stop(int number) { return number < 0; }

struct Setting {
  World world;
  HomingConfig config;
};

Setting random_setting(const Figure& figure, Random& random) {
  Setting setting;
  HomingConfig& config = setting.config;
  config.slow = static_cast<double>(random.between(500, 6000));
  config.fast = static_cast<double>(random.between(6000, 30000));
  config.acceleration = static_cast<double>(random.between(200000, 2000000));
  config.stall_torque = 1.5F;
  config.stall_cycles = static_cast<std::uint32_t>(random.between(1, 40));
  config.retraction = random.between(0, 3) == 0 ? 0 : random.between(1, 2500);
  config.timeout_cycles = 200000;

  World& world = setting.world;
  world.revolution = random.between(300, 2000);
  world.index_width = random.between(1, 20);
  config.index_width = world.index_width;
  world.index = random.between(-3000, 3000);
  // Room for an index and for the longest way to stop (2250 counts) on both sides of everything.
  const Counts room = world.revolution + 2500;
  const Counts width = random.between(1, 3000);
  world.home_from = random.between(-2000, 2000);
  world.home_to = world.home_from + width;
  world.negative_limit = world.home_from - room - random.between(0, 2000);
  world.positive_limit = world.home_to + room + random.between(0, 2000);
  world.low_stop = world.negative_limit - 6000;
  world.high_stop = world.positive_limit + 6000;
  const int number = pattern(figure.number);
  if (number == 3 || number == 4) world.home_to = world.high_stop + 1;  // stays active up to the end
  if (number == 5 || number == 6) world.home_from = world.low_stop;
  if (is_hard_stop(figure.number)) {  // no switches on the way
    world.low_stop = world.negative_limit + random.between(1, 1000);
    world.high_stop = world.positive_limit - random.between(2, 1000);
  }
  return setting;
}

enum class Start { below_home, on_home, above_home, on_negative_limit, on_positive_limit };
constexpr Start starts[] = {Start::below_home, Start::on_home, Start::above_home, Start::on_negative_limit,
                            Start::on_positive_limit};

// Nothing if the geometry has no such place, or the method begins by running further onto the limit it stands on.
std::optional<Counts> start_position(const Figure& figure, const World& world, Start start, Random& random) {
  Counts low = std::max(world.low_stop, world.negative_limit);
  Counts high = std::min(world.high_stop, world.positive_limit - 1);
  if (figure.number == 33) low += world.revolution + world.index_width;  // there is an index in front of the limit
  if (figure.number == 34) high -= world.revolution + world.index_width;
  switch (start) {
    case Start::below_home:
      if (world.home_from <= low) return std::nullopt;
      return random.between(low, world.home_from - 1);
    case Start::on_home: return random.between(std::max(low, world.home_from), std::min(high, world.home_to - 1));
    case Start::above_home:
      if (world.home_to > high) return std::nullopt;
      return random.between(world.home_to, high);
    case Start::on_negative_limit:
      if (is_hard_stop(figure.number) || figure.number == 33) return std::nullopt;
      return random.between(world.negative_limit - 3000, world.negative_limit - 1);
    case Start::on_positive_limit:
      if (is_hard_stop(figure.number) || figure.number == 34) return std::nullopt;
      return random.between(world.positive_limit, world.positive_limit + 3000);
  }
  return std::nullopt;
}

const Figure* figure_of(int number) {
  for (const Figure& figure : figures) {
    if (figure.number == number) return &figure;
  }
  return nullptr;
}

struct Table {
  const char* name;
  std::span<const Method> methods;
  std::set<int> numbers;
  std::set<int> returning;  // those that come back to home
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
};

class HomingTables : public testing::TestWithParam<const Table*> {};

std::string name_of(const testing::TestParamInfo<const Table*>& table) {
  return table.param == &tables[0] ? "cia402" : "ismc";
}
INSTANTIATE_TEST_SUITE_P(Both, HomingTables, testing::Values(&tables[0], &tables[1]), name_of);

TEST_P(HomingTables, HaveExactlyTheMethodsOfTheirBook) {
  for (int number = -128; number <= 127; ++number) {
    const bool found = find_method(GetParam()->methods, static_cast<std::int8_t>(number)) != nullptr;
    EXPECT_EQ(found, GetParam()->numbers.contains(number)) << number;
    Homing homing;
    homing.start(GetParam()->methods, static_cast<std::int8_t>(number), HomingConfig{}, HomingInputs{});
    EXPECT_EQ(homing.error(), found ? HomingError::none : HomingError::unsupported_method) << number;
    EXPECT_EQ(homing.active(), found) << number;
  }
}

TEST_P(HomingTables, FindHomeWhereTheFigureHasIt) {
  int runs = 0;
  for (const Method& method : GetParam()->methods) {
    const Figure& figure = *figure_of(method.number);
    Random random{static_cast<std::uint32_t>(1000 + method.number)};
    for (int round = 0; round < 150; ++round) {
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
        // Slow, unless the home switch is so short that the axis has not slowed down on it yet.
        const double ramp = (config.fast * config.fast - config.slow * config.slow) / (2.0 * config.acceleration);
        if (!uses_home(figure.number) ||
            static_cast<double>(world.home_to - world.home_from) > ramp + config.fast * Axis::cycle_s + 2.0) {
          ASSERT_LE(std::abs(velocity), config.slow);
        }
        if (GetParam()->returning.contains(figure.number)) {
          ASSERT_EQ(outcome.rest, outcome.latch);
        } else if (figure.index || !is_hard_stop(figure.number)) {
          // The axis stops v^2 / 2a behind the point where it learnt of home, at most a cycle after home; a falling
          // direction meets the index its width earlier.
          const double stop = velocity * velocity / (2.0 * config.acceleration);
          const Counts edge = figure.index && figure.approach < 0 ? outcome.latch + world.index_width : outcome.latch;
          const double overrun = static_cast<double>((outcome.rest - edge) * figure.approach);
          ASSERT_GE(overrun, stop - 1.0);
          ASSERT_LE(overrun, stop + std::max(std::abs(velocity), config.slow) * Axis::cycle_s + 1.0);
        } else {
          ASSERT_EQ(outcome.rest, outcome.latch);  // hard stop without index: home is where it stands
        }
      }
    }
  }
  RecordProperty("runs", runs);
  EXPECT_GT(runs, 20000);
}

// 607Eh: a reversed axis in the mirrored world does the same with signs changed. (The way back after the latch differs:
// home is the same boundary of the index in encoder counts, not in the mirror.)
TEST_P(HomingTables, ReversedPolarityIsTheMirrorImage) {
  for (const Method& method : GetParam()->methods) {
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
    const int number = method.number;
    const Outcome outcome = run(method, plain_config(), bare, 0);
    const bool found = number == 17 || number == 18 || number >= 35;
    EXPECT_EQ(outcome.finished, found) << number;
    if (found) continue;
    // 1, 2 have turned round at a limit, 7 to 14 and 23 to 30 do when they miss home; the others may meet none.
    const bool turns = (pattern(number) >= 7 && pattern(number) <= 14) || number == 1 || number == 2;
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
    if (method.leg_count == 0) {
      EXPECT_TRUE(outcome.finished);
    } else {
      EXPECT_EQ(outcome.error, HomingError::timed_out) << int{method.number};
      EXPECT_EQ(outcome.cycles, 3001u) << int{method.number};
    }
  }
}

// Whatever the wires do, the executor stays within its legs and ends by its time-out.
TEST_P(HomingTables, SurviveNonsense) {
  Random random{7};
  for (const Method& method : GetParam()->methods) {
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
}  // namespace servodrome::drive::test
