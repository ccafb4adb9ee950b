#include <gtest/gtest.h>

#include "drive/homing_figures.hpp"
#include "ismk_rig.hpp"

// Homing of the iSMK (ch. 5.5): every method on a plant with random geometry, and related functions. The drive has two
// inputs: one for the home switch, one for the limit switch at which the method reverses.
namespace servodrome {
namespace ismk_homing_test {
namespace {

using dictionary::AbortCode;
using drive::Counts;
using drive::test::Figure;
using drive::test::Random;
using drive::test::Start;
using drive::test::World;
using products::ismk::velocity_dec_from_rpm;
using test::IsmkRig;

constexpr Counts revolution = 65536;
constexpr double rest = 65.0;  // counts: friction holds the shaft up to a third of a degree away
constexpr std::uint16_t home_found = 0x8000;
constexpr std::uint16_t homing_error = 0x1000;
constexpr std::uint16_t target_reached = 0x0400;

constexpr std::uint16_t positive_limit_function = 0x0010;
constexpr std::uint16_t negative_limit_function = 0x0020;
constexpr std::uint16_t home_function = 0x0040;

World random_world(int number, Random& random) {
  World world;
  world.revolution = revolution;
  world.index = random.between(0, revolution - 1);
  world.index_width = random.between(1, 200);
  world.home_from = random.between(-80000, 80000);
  world.home_to = world.home_from + random.between(2000, 120000);
  world.negative_limit = world.home_from - revolution - random.between(40000, 120000);
  world.positive_limit = world.home_to + revolution + random.between(40000, 120000);
  world.low_stop = world.negative_limit - 100000;
  world.high_stop = world.positive_limit + 100000;
  const int pattern = number >= 17 && number <= 30 ? number - 16 : number;
  if (pattern == 3 || pattern == 4) world.home_to = world.high_stop + 1;
  if (pattern == 5 || pattern == 6) world.home_from = world.low_stop;
  return world;
}

std::uint16_t limit_function(const drive::Method& method) {
  for (std::size_t i = 0; i < method.leg_count; ++i) {
    const drive::Leg& leg = method.legs[i];
    if (leg.until != drive::Until::limit_reached && leg.on_limit == drive::no_leg) continue;
    return leg.direction == drive::Direction::negative ? negative_limit_function : positive_limit_function;
  }
  return 0;
}

plant::Parameters plant_of(const World& world, Counts start, std::uint16_t limit) {
  plant::Parameters parameters = test::ismk_plant();
  parameters.encoder.index_position_counts = static_cast<std::int32_t>(world.index);
  parameters.encoder.index_width_counts = static_cast<std::int32_t>(world.index_width);
  parameters.encoder.start_position_counts = start;
  parameters.load.low_stop_counts = world.low_stop;
  parameters.load.high_stop_counts = world.high_stop;
  plant::Switch& home = parameters.switches[0];
  home.wire = 0;
  home.from_counts = world.home_from;
  home.to_counts = world.home_to - 1;
  plant::Switch& end = parameters.switches[1];
  end.wire = 1;
  end.normally_closed = true;  // ch. 5.6.1
  if (limit == negative_limit_function) end.to_counts = world.negative_limit - 1;
  if (limit == positive_limit_function) end.from_counts = world.positive_limit;
  parameters.switch_count = limit != 0 ? 2 : 1;
  return parameters;
}

struct Homing : IsmkRig {
  Homing(const World& world, Counts start, std::uint16_t limit)
      : IsmkRig(plant_of(world, start, limit), test::ismk_settings()) {
    run_ms(5);
    EXPECT_EQ(set(0x2010, 3, home_function), AbortCode::none);
    EXPECT_EQ(set(0x2010, 4, limit), AbortCode::none);
    set(0x6060, 0, 6);
  }
  void start(int method, std::uint16_t enabling = 0x0F) {
    EXPECT_EQ(set(0x6098, 0, method), AbortCode::none);
    control(enabling);
    run_ms(5);
    control(0x1F);
    run_ms(2);
  }
  bool finish(double limit_ms = 60000.0) {
    return run_until([this] { return (status() & (home_found | homing_error)) != 0; }, limit_ms) >= 0;
  }
  // The home position of the drive, in true counts.
  Counts home() { return -device.drive().position_offset() - get(0x607C); }
};

TEST(IsmkHoming, EveryMethodFromEveryStart) {
  int runs = 0;
  for (const drive::Method& method : products::Ismk::policy.homing.methods) {
    const Figure& figure = *drive::test::figure_of(method.number);
    Random random{static_cast<std::uint32_t>(7000 + method.number)};
    const std::uint16_t limit = limit_function(method);
    int starts = 0;
    for (int round = 0; round < 2; ++round) {
      for (const Start start : drive::test::starts) {
        const World world = random_world(method.number, random);
        const std::optional<Counts> from = start_position(figure, world, start, random);
        if (!from) continue;
        // Beyond an end whose switch has no input the axis would not detect the end.
        if (start == Start::on_negative_limit && limit != negative_limit_function) continue;
        if (start == Start::on_positive_limit && limit != positive_limit_function) continue;
        SCOPED_TRACE(testing::Message() << "method " << figure.number << " at " << *from << ", home " << world.home_from
                                        << ".." << world.home_to << ", limits " << world.negative_limit << ".."
                                        << world.positive_limit << ", index " << world.index);
        ++runs;
        ++starts;
        std::int64_t offset = random.between(-30000, 30000);
        // Not into a limit switch, which ends the motion there.
        if (!world.lies_between_limits(expected_home(figure, world, *from, 0) + offset)) offset = -offset;
        const bool travels = runs % 2 == 0;
        Homing rig(world, *from, limit);
        rig.set(0x607C, 0, offset);
        rig.set(0x6099, 1, std::llround(velocity_dec_from_rpm(static_cast<double>(random.between(60, 300)))));
        rig.set(0x6099, 2, std::llround(velocity_dec_from_rpm(static_cast<double>(random.between(20, 60)))));
        rig.set(0x6099, 5, travels ? 0 : 1);
        rig.start(method.number);
        ASSERT_TRUE(rig.finish());
        ASSERT_EQ(rig.status() & ~0x0A00, 0xC037) << std::hex << rig.status();  // bit 10 stays 0 (ch. 8.3.2)
        ASSERT_EQ(rig.home(), expected_home(figure, world, *from, 0));
        rig.run_ms(100);
        const Counts true_position = rig.plant.position_counts() - rig.home() - offset;
        ASSERT_NEAR(static_cast<double>(rig.get(0x6063)), static_cast<double>(true_position), 2.0);
        // Table 5-14; ch. 7.6, 6099.05: 0 moves to the offset point and shows 0 there, 1 stays at home and shows
        // -offset.
        ASSERT_NEAR(static_cast<double>(rig.get(0x6063)), travels ? 0.0 : -static_cast<double>(offset), rest);
      }
    }
    EXPECT_GE(starts, 4) << "method " << int{method.number};
  }
  std::printf("%d homings\n", runs);
  EXPECT_GT(runs, 200);
}

World simple_world(Counts index_from_edge) {
  World world;
  world.revolution = revolution;
  world.index_width = 1;
  world.home_from = 100000;
  world.home_to = 400000;
  world.index = (world.home_from + index_from_edge) % revolution;
  world.negative_limit = -300000;
  world.positive_limit = 700000;
  world.low_stop = -400000;
  world.high_stop = 800000;
  return world;
}

// A reset of bit 4 interrupts homing (Table 5-4): no home, no error.
TEST(IsmkHoming, IsInterruptedByBit4) {
  Homing rig(simple_world(20000), 0, positive_limit_function);
  rig.start(3);
  rig.run_ms(50);
  rig.control(0x0F);
  rig.run_ms(500);
  EXPECT_EQ(rig.status() & (home_found | homing_error | target_reached), 0);
  EXPECT_FALSE(rig.device.drive().in_motion());
}

// A new homing clears bit 15 until it is done (Table 5-5).
TEST(IsmkHoming, AnotherRunForgetsHome) {
  Homing rig(simple_world(20000), 0, positive_limit_function);
  rig.start(35);
  ASSERT_TRUE(rig.finish());
  rig.control(0x0F);
  rig.start(3);
  EXPECT_EQ(rig.status() & home_found, 0);
  ASSERT_TRUE(rig.finish());
  EXPECT_NE(rig.status() & home_found, 0);
}

// Bit 12 is the error (Table 5-5): immediately for a switch without an input, or when a limit switch is met.
TEST(IsmkHoming, Errors) {
  for (const int method : {1, 2, 17, 18}) {
    Homing rig(simple_world(20000), 0, 0);
    rig.start(method);
    EXPECT_EQ(rig.status() & (home_found | homing_error), homing_error) << method;
    EXPECT_EQ(rig.status() & 0xFF, 0x37);
    EXPECT_FALSE(rig.device.drive().in_motion());
    rig.control(0x0F);
    rig.start(35);
    ASSERT_TRUE(rig.finish());
    EXPECT_EQ(rig.status() & (home_found | homing_error), home_found);
  }
  const World world = simple_world(20000);
  Homing below(world, 0, negative_limit_function);
  below.start(21);
  ASSERT_TRUE(below.finish());
  EXPECT_EQ(below.status() & (home_found | homing_error), homing_error) << "the limit came before the home switch";
}

// 6099h sub 6 (ch. 5.5): an index next to the edge of the switch is skipped; with 1 the drive decides by itself whether
// this is necessary.
TEST(IsmkHoming, BlindWindow) {
  struct {
    double index_turns;  // from the edge, in the direction of search
    int window;
    double home_turns;
    int window_after;
  } const cases[]{
      {0.1, 0, 0.1, 0}, {0.1, 2, 1.1, 2}, {0.1, 1, 1.1, 2},   {0.45, 2, 1.45, 2},
      {0.6, 2, 0.6, 2}, {0.5, 1, 0.5, 0}, {0.95, 1, 0.95, 2}, {0.02, 1, 1.02, 2},
  };
  for (const auto& [index_turns, window, home_turns, window_after] : cases) {
    SCOPED_TRACE(testing::Message() << "index " << index_turns << " window " << window);
    const World world = simple_world(static_cast<Counts>(index_turns * revolution));
    Homing rig(world, 0, positive_limit_function);
    rig.set(0x6099, 6, window);
    rig.start(4);  // the index is inside the switch, on the positive side of the negative edge
    ASSERT_TRUE(rig.finish());
    EXPECT_NEAR(static_cast<double>(rig.home() - world.home_from), home_turns * revolution, 2.0);
    rig.run_ms(5);
    EXPECT_EQ(rig.get(0x6099, 6), window_after);
    // The same home position again.
    const Counts first = rig.home();
    rig.control(0x0F);
    rig.start(4);
    ASSERT_TRUE(rig.finish());
    EXPECT_EQ(rig.home(), first);
  }
}

// 6099h sub 3 (Table 5-14, ch. 5.5): once, at the first enable after each power-on, in any mode.
TEST(IsmkHoming, AtPowerOn) {
  Homing rig(simple_world(20000), 0, positive_limit_function);
  rig.set(0x6098, 0, 3);
  rig.set(0x6099, 3, 1);
  rig.set(0x2FF0, 1, 1);
  rig.set(0x2FFF, 0, 0xAA55);
  rig.run_ms(25);
  rig.set(0x6060, 0, 3);
  EXPECT_EQ(rig.status() & home_found, 0);
  rig.control(0x0F);
  rig.run_ms(20);
  EXPECT_EQ(rig.get(0x6061), 6);
  ASSERT_TRUE(rig.finish());
  rig.run_ms(5);
  EXPECT_NE(rig.status() & home_found, 0);
  EXPECT_EQ(rig.get(0x6061), 3);
  EXPECT_EQ(rig.get(0x6040), 0x0F);
  rig.control(0x06);
  rig.run_ms(5);
  rig.control(0x0F);
  rig.run_ms(20);
  EXPECT_EQ(rig.get(0x6061), 3) << "once only";
}

// 6099h sub 4: the current of homing (Table 5-14).
TEST(IsmkHoming, CurrentLimit) {
  for (const auto& [method, direction] : {std::pair{3, 1.0}, std::pair{5, -1.0}}) {
    Homing rig(simple_world(20000), 0, positive_limit_function);
    rig.set(0x6099, 4, 200);
    rig.start(static_cast<std::int8_t>(method));
    rig.run_ms(50);
    EXPECT_GT(direction * rig.plant.velocity_rpm(), 0.0);
    rig.plant.lock_rotor(true);
    rig.run_ms(50);
    EXPECT_NEAR(direction * static_cast<double>(static_cast<std::int16_t>(rig.get(0x6078))), 200.0, 8.0);
  }
  Homing rig(simple_world(20000), 0, positive_limit_function);
  rig.set(0x6099, 4, 200);
  rig.start(3);
  rig.run_ms(50);
  rig.plant.lock_rotor(true);
  rig.run_ms(50);
  // In another mode the limit is that of 6073h.
  rig.control(0x06);
  rig.set(0x6060, 0, -3);
  rig.set(0x60FF, 0, 17895697);
  rig.control(0x0F);
  rig.run_ms(50);
  EXPECT_GT(rig.get(0x6078), 1500);
}

// 607Dh: after homing only, and only if negative < positive (ch. 5.6.1).
TEST(IsmkHoming, SoftLimitsActAfterHomingOnly) {
  const auto reaches = [](bool homed, std::int64_t positive, std::int64_t negative) {
    Homing rig(simple_world(20000), 0, 0);
    rig.set(0x607D, 1, positive);
    rig.set(0x607D, 2, negative);
    if (homed) {
      rig.start(35);
      EXPECT_TRUE(rig.finish());
    }
    rig.set(0x6060, 0, 1);
    rig.set(0x6081, 0, std::llround(velocity_dec_from_rpm(600)));
    rig.set(0x607A, 0, 50000);
    rig.control(0x2F);
    rig.run_ms(5);
    rig.control(0x3F);
    rig.run_ms(800);
    EXPECT_EQ((rig.status() & 0x0800) != 0, homed && negative < positive);
    return static_cast<double>(rig.get(0x6063));
  };
  EXPECT_NEAR(reaches(false, 20000, -20000), 50000.0, rest);
  EXPECT_NEAR(reaches(true, 20000, -20000), 20000.0, rest);
  EXPECT_NEAR(reaches(true, -20000, 20000), 50000.0, rest);
  EXPECT_NEAR(reaches(true, 0, 0), 50000.0, rest);
}

// Speed modes stop at the soft limit with bit 11, until a command in the opposite direction (Table 5-5).
TEST(IsmkHoming, SoftLimitsHoldSpeedModes) {
  Homing rig(simple_world(20000), 0, 0);
  rig.set(0x607D, 1, 10000);
  rig.set(0x607D, 2, -10000);
  rig.start(35);
  EXPECT_TRUE(rig.finish());
  rig.set(0x6060, 0, 3);
  rig.control(0x0F);
  for (const double rpm : {-300.0, 300.0}) {
    rig.set(0x60FF, 0, std::llround(velocity_dec_from_rpm(rpm)));
    rig.run_ms(30);
    EXPECT_EQ(rig.status() & 0x0800, 0) << "on the way";
    rig.run_ms(500);
    EXPECT_NE(rig.status() & 0x0800, 0);
    EXPECT_EQ(rig.status() & 0x0400, 0) << "the speed is not reached";
    EXPECT_NEAR(static_cast<double>(rig.get(0x6063)), rpm > 0 ? 10000.0 : -10000.0, 700.0);
  }
}

}  // namespace
}  // namespace ismk_homing_test
}  // namespace servodrome
