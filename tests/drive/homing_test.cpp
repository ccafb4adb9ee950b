#include "drive/homing/homing.hpp"

#include <gtest/gtest.h>
#include <initializer_list>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

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
int pattern(int number) { return number >= 17 && number <= 30 ? number - 16 : number; }  // 17 is 1 without index ...
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
    for (int round = 0; round < 250; ++round) {
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

HomingConfig plain_config() {
  return {.fast = 20000.0, .slow = 2000.0, .acceleration = 1.0e6, .stall_torque = 1.5F, .stall_cycles = 5};
}

constexpr World bare{
    .negative_limit = -5000, .positive_limit = 5000, .index_width = 0, .low_stop = -9000, .high_stop = 9000};

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

TEST(Homing, WrongLimitStopsAtOnceWhereTheMethodDoesNotTurnRound) {
  World world = bare;
  world.home_from = 7000;  // behind the positive limit
  world.home_to = 9001;
  const Outcome outcome = run(*find_method(cia402_methods, 19), plain_config(), world, 0);
  EXPECT_EQ(outcome.error, HomingError::wrong_limit);
  EXPECT_GE(outcome.rest, world.positive_limit);
  // Starting on that limit it does not move at all.
  const Outcome standing = run(*find_method(cia402_methods, 34), plain_config(), bare, bare.positive_limit);
  EXPECT_EQ(standing.error, HomingError::wrong_limit);
  EXPECT_EQ(standing.cycles, 1u);
  EXPECT_EQ(standing.rest, bare.positive_limit);
}

// The ISMC turns round at the limit from the low start only; L2264-2278 print no branch for the high one.
TEST(Homing, IsmcMethodNineHasNoBranchFromAnActiveHomeSwitch) {
  World world = bare;
  world.home_from = 3000;
  world.home_to = 7000;
  const Outcome outcome = run(*find_method(products::ismc::homing_methods, 9), plain_config(), world, 4000);
  EXPECT_EQ(outcome.error, HomingError::wrong_limit);
}

// --- The path itself, in letters: P, N fast and p, n slow in positive, negative direction; s a ramp to zero, h a hold,
// r the way back. A method of a product is its path, so the whole table is spelled out once more.

std::string path(const Method& method, const World& world, Counts start) {
  std::string letters;
  for (const HomingCommand& command : run(method, plain_config(), world, start).commands) {
    char letter = 0;
    switch (command.kind) {
      case HomingCommand::Kind::keep: break;
      case HomingCommand::Kind::velocity:
        letter = command.velocity == 20000.0    ? 'P'
                 : command.velocity == 2000.0   ? 'p'
                 : command.velocity == -20000.0 ? 'N'
                 : command.velocity == -2000.0  ? 'n'
                                                : '?';
        break;
      case HomingCommand::Kind::position: letter = 'r'; break;
      case HomingCommand::Kind::stop: letter = 's'; break;
      case HomingCommand::Kind::hold: letter = 'h'; break;
    }
    if (letters.empty() || letters.back() != letter) letters.push_back(letter);
  }
  return letters;
}

struct Paths {
  int number;
  std::string home_inactive;  // home is met, or there is none
  std::string home_active;
  std::string over_limit;  // home switch inactive, the limit switch is met first
};

void expect_paths(std::span<const Method> methods, std::span<const Paths> rows) {
  for (const Paths& row : rows) {
    const Method* method = find_method(methods, static_cast<std::int8_t>(row.number));
    ASSERT_NE(method, nullptr) << row.number;
    const int number = pattern(row.number);
    World world{.negative_limit = -5000,
                .positive_limit = 5000,
                .home_from = -500,
                .home_to = 500,
                .low_stop = -9000,
                .high_stop = 9000};
    if (number == 3 || number == 4) world.home_to = 9001;
    if (number == 5 || number == 6) world.home_from = -9000;
    if (number < 0) world.low_stop = -3000, world.high_stop = 3000;
    const bool starts_positive = number == 3 || number == 4 || (number >= 7 && number <= 10);
    const Counts before = starts_positive ? -1500 : 1500;
    EXPECT_EQ(path(*method, world, before), row.home_inactive) << row.number;
    if (!row.home_active.empty()) {
      EXPECT_EQ(path(*method, world, 0), row.home_active) << row.number;
    }
    if (!row.over_limit.empty()) {
      EXPECT_EQ(path(*method, world, -before), row.over_limit) << row.number;
    }
  }
}

TEST(HomingPaths, Ismc) {
  const Paths rows[] = {
      {-4, "Phns", "", ""},          // L2585-2588
      {-3, "Nhps", "", ""},          // L2579-2582
      {-2, "Phs", "", ""},           // L2570-2575, no retraction
      {-1, "Nhs", "", ""},           // L2563-2568
      {1, "Nsps", "", ""},           // L2171-2179
      {2, "Psns", "", ""},           // L2181-2188
      {3, "Psns", "ns", ""},         // L2192-2200
      {4, "psr", "Nspsr", ""},       // L2202-2210
      {5, "Nspsr", "psr", ""},       // L2212-2220
      {6, "ns", "Psns", ""},         // L2222-2230
      {7, "Psns", "ns", "PsNns"},    // L2232-2245
      {8, "ps", "Nsps", "psNsps"},   // L2247-2262
      {9, "Psns", "Psns", "Psns"},   // L2264-2278
      {10, "Pps", "ps", "PsNsps"},   // L2280-2295
      {11, "Nsps", "ps", "NsPps"},   // L2297-2310
      {12, "ns", "Psns", "nsPsns"},  // L2312-2325
      {13, "Nsps", "Nsps", "Nsps"},  // L2327-2339
      {14, "Nns", "ns", "NsPsns"},   // L2341-2354
      {17, "Nsps", "", ""},          // L2359-2366
      {18, "Psns", "", ""},          // L2368-2375
      {19, "Psns", "ns", ""},        // L2377-2385
      {20, "ps", "Nsps", ""},        // L2387-2395
      {21, "Nsps", "ps", ""},        // L2397-2405
      {22, "ns", "Psns", ""},        // L2407-2415
      {23, "Psns", "ns", "PsNns"},   // L2417-2431
      {24, "ps", "Nsps", "psNsps"},  // L2433-2451
      {25, "Psns", "Psns", "Psns"},  // L2453-2463
      {26, "Pps", "ps", "PsNsps"},   // L2465-2478
      {27, "Nsps", "ps", "NsPps"},   // L2480-2496
      {28, "ns", "Psns", "nsPsns"},  // L2498-2511
      {29, "Nsps", "Nsps", "Nsps"},  // L2513-2523
      {30, "Nns", "ns", "NsPsns"},   // L2525-2542
      {33, "ns", "", ""},            // L2544-2551
      {34, "ps", "", ""},            // L2553-2557
  };
  expect_paths(products::ismc::homing_methods, rows);
}

TEST(HomingPaths, Cia402) {
  const Paths rows[] = {
      {-4, "Phnsr", "", ""},
      {-3, "Nhpsr", "", ""},
      {-2, "Phs", "", ""},
      {-1, "Nhs", "", ""},
      {1, "Nspsr", "", ""},
      {2, "Psnsr", "", ""},
      {3, "Psnsr", "nsr", ""},
      {4, "PsNspsr", "Nspsr", ""},
      {5, "Nspsr", "psr", ""},
      {6, "NsPsnsr", "Psnsr", ""},
      {7, "Psnsr", "nsr", "PsNnsr"},
      {8, "PsNspsr", "Nspsr", "PsNspsr"},
      {9, "Psnsr", "Psnsr", "PsNsPsnsr"},
      {10, "Ppsr", "psr", "PsNspsr"},
      {11, "Nspsr", "psr", "NsPpsr"},
      {12, "NsPsnsr", "Psnsr", "NsPsnsr"},
      {13, "Nspsr", "Nspsr", "NsPsNspsr"},
      {14, "Nnsr", "nsr", "NsPsnsr"},
      {33, "nsr", "", ""},
      {34, "psr", "", ""},
  };
  expect_paths(cia402_methods, rows);
  std::vector<Paths> without_index;
  for (const Paths& row : rows) {
    if (row.number < 1 || row.number > 14) continue;
    without_index.push_back(row);
    without_index.back().number += 16;
  }
  expect_paths(cia402_methods, without_index);
}

// --- The rest

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
  HomingInputs inputs;
  Homing homing;
  homing.start(*find_method(cia402_methods, -2), config, inputs);
  EXPECT_EQ(homing.step(inputs).velocity, 20000.0);
  inputs.standing = false;
  EXPECT_TRUE(homing.pressing());
  const auto press = [&](float torque, int cycles) {
    inputs.torque = torque;
    HomingCommand command;
    for (int i = 0; i < cycles; ++i) command = homing.step(inputs);
    return command.kind;
  };
  EXPECT_EQ(press(1.6F, 9), HomingCommand::Kind::keep);
  EXPECT_EQ(press(0.0F, 1), HomingCommand::Kind::keep);    // a peak of the ramp is no stop
  EXPECT_EQ(press(-3.0F, 50), HomingCommand::Kind::keep);  // nor is torque the other way
  inputs.position = 4321;
  EXPECT_EQ(press(1.5F, 10), HomingCommand::Kind::hold);
  EXPECT_FALSE(homing.pressing());
  EXPECT_FALSE(homing.latched());
  inputs.standing = true;
  homing.step(inputs);  // no retraction: home is here
  EXPECT_TRUE(homing.latched());
  EXPECT_EQ(homing.latch(), 4321);
  homing.step(inputs);
  EXPECT_TRUE(homing.finished());
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
  Axis axis{world, 10, 1.0e6};
  Homing homing;
  homing.start(products::ismc::homing_methods, 34, plain_config(), axis.inputs());
  while (!homing.latched()) axis.step(homing.step(axis.inputs()));
  EXPECT_FALSE(homing.finished());
  EXPECT_GT(axis.velocity(), 0.0);  // L2033: bit 12 while the motor still turns
  while (!homing.finished()) axis.step(homing.step(axis.inputs()));
  EXPECT_EQ(axis.velocity(), 0.0);
  EXPECT_EQ(homing.latch(), 1000);
}

// Without standstill at the start the axis is brought to rest first: what it meets until then is not of the first leg.
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

// The actual position lags the demand: after the turn it runs on for a while, here past the far edge of a short cam.
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

// The capture unit may lose edges (its buffer is short) and a level may come and go within a cycle: either tells.
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

// The axis is home; how long it takes to come to rest is no concern of the time-out.
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

// A method of nobody's: from one hard stop to the other.
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
  for (int i = 0; i < 19; ++i) EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::hold);
  EXPECT_EQ(homing.step(inputs).velocity, 20000.0);
  inputs.torque = 2.0F;
  for (int i = 0; i < 19; ++i) EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::keep);
  EXPECT_EQ(homing.step(inputs).kind, HomingCommand::Kind::hold);
}

// Switch edge and index within one cycle: their order decides.
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
    Axis axis{world, 2000, 1.0e6};
    Homing homing;
    homing.start(method, plain_config(), axis.inputs());
    for (std::uint32_t i = 0; i < when; ++i) axis.step(homing.step(axis.inputs()));
    homing.abort();
    ASSERT_FALSE(homing.active() || homing.latched() || homing.finished());
    ASSERT_EQ(homing.error(), HomingError::none);
    ASSERT_EQ(homing.step(axis.inputs()).kind, HomingCommand::Kind::keep);
    // The caller stops the axis; here the new start has to.
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
  EXPECT_FALSE(is_well_formed(make_method(1, {forward})));           // leads nowhere
  EXPECT_FALSE(is_well_formed(make_method(1, {forward, last}, 2)));  // starts nowhere
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
}  // namespace servodrome::drive::test
