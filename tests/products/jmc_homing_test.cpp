#include <gtest/gtest.h>

#include "drive/homing_figures.hpp"
#include "jmc_rig.hpp"

// Homing of the JMC EC drives (HM): every method from every side on a plant with random geometry, and related
// functions.
namespace servodrome {
namespace jmc_homing_test {
namespace {

using dictionary::AbortCode;
using drive::Counts;
using drive::test::Figure;
using drive::test::Random;
using drive::test::Start;
using drive::test::World;
using test::JmcRig;

constexpr Counts revolution = 4000;
constexpr double rest = 8.0;  // counts: friction holds the shaft a little away
constexpr std::uint16_t reached = 0x0400;
constexpr std::uint16_t attained = 0x1000;
constexpr std::uint16_t error = 0x2000;
constexpr std::uint16_t flags = reached | attained | error;

// The home switch is a cam for every method; for 3 to 6 also in the standard's form (`to_the_end`).
World random_world(int number, Random& random, bool to_the_end) {
  World world;
  world.revolution = revolution;
  world.index = random.between(0, revolution - 1);
  world.index_width = random.between(1, 12);
  world.home_from = random.between(-5000, 5000);
  world.home_to = world.home_from + random.between(200, 8000);
  world.negative_limit = world.home_from - revolution - random.between(3000, 8000);
  world.positive_limit = world.home_to + revolution + random.between(3000, 8000);
  world.low_stop = world.negative_limit - 8000;
  world.high_stop = world.positive_limit + 8000;
  const int pattern = drive::test::pattern(number);
  if (to_the_end && (pattern == 3 || pattern == 4)) world.home_to = world.high_stop + 1;
  if (to_the_end && (pattern == 5 || pattern == 6)) world.home_from = world.low_stop;
  return world;
}

plant::Parameters plant_of(const World& world, Counts start, std::string_view rating) {
  plant::Parameters parameters = test::jmc_plant(rating);
  parameters.encoder.index_position_counts = static_cast<std::int32_t>(world.index);
  parameters.encoder.index_width_counts = static_cast<std::int32_t>(world.index_width);
  parameters.encoder.start_position_counts = start;
  parameters.load.low_stop_counts = world.low_stop;
  parameters.load.high_stop_counts = world.high_stop;
  // CW-, HW+, CCW+ (ch. 3.1.2); CW is positive.
  parameters.switches[0].wire = 0;
  parameters.switches[0].from_counts = world.positive_limit;
  parameters.switches[1].wire = 1;
  parameters.switches[1].from_counts = world.home_from;
  parameters.switches[1].to_counts = world.home_to - 1;
  parameters.switches[2].wire = 2;
  parameters.switches[2].to_counts = world.negative_limit - 1;
  parameters.switch_count = 3;
  return parameters;
}

struct Homing : JmcRig {
  Homing(const World& world, Counts start, std::string_view rating = products::jmc_ec::default_rating)
      : JmcRig(plant_of(world, start, rating), test::jmc_settings(rating)) {
    run_ms(5);
    set(0x6060, 0, 6);
    set(0x6099, 1, 8000);
    set(0x6099, 2, 1000);
    set(0x609A, 0, 200000);
    EXPECT_TRUE(enable());
  }
  void start(int method) {
    EXPECT_EQ(set(0x6098, 0, method), AbortCode::none);
    control(0x1F);
    run_ms(2);
  }
  bool finish(double limit_ms = 60000.0) {
    return run_until([this] { return (status() & (attained | error)) != 0 && (status() & reached) != 0; }, limit_ms) >=
           0;
  }
  // The home position of the drive in true counts, before the offset.
  Counts home(std::int64_t offset) { return -device.drive().position_offset() - offset; }
};

// Tolerances in counts: the shaft's distance from home at the end, and its motion since the drive's last cycle.
struct Tolerance {
  double off = rest;
  double creeps = 0.0;
};

int every_method(std::string_view rating, int rounds, Tolerance tolerance) {
  int runs = 0;
  for (const drive::Method& method : products::JmcEc::policy.homing.methods) {
    if (method.idle) continue;
    const Figure& figure = *drive::test::figure_of(method.number);
    Random random{static_cast<std::uint32_t>(9000 + method.number)};
    for (int round = 0; round < rounds; ++round) {
      for (const Start start : drive::test::starts) {
        const World world = random_world(method.number, random, round == 1);
        const std::optional<Counts> from = start_position(figure, world, start, random);
        if (!from) continue;
        SCOPED_TRACE(testing::Message() << "method " << figure.number << " at " << *from << ", home " << world.home_from
                                        << ".." << world.home_to << ", limits " << world.negative_limit << ".."
                                        << world.positive_limit << ", index " << world.index);
        ++runs;
        std::int64_t offset = random.between(-3000, 3000);
        // Not into a limit switch, which ends the motion there.
        if (!world.lies_between_limits(expected_home(figure, world, *from, 0) + offset)) offset = -offset;
        Homing rig(world, *from, rating);
        rig.set(0x607C, 0, offset);
        rig.set(0x6099, 1, random.between(16000, 48000));
        rig.set(0x6099, 2, random.between(2000, 8000));
        rig.set(0x609A, 0, random.between(400000, 1600000));
        const Counts begins = rig.plant.position_counts();  // a detent may have moved it from `from` without power
        rig.start(method.number);
        if (figure.number != 35) {
          EXPECT_EQ(rig.status() & flags, 0) << "in progress";
        }
        if (!rig.finish()) return ADD_FAILURE() << "does not finish", 0;
        EXPECT_EQ(rig.status() & flags, reached | attained) << std::hex << rig.status();
        // 35 uses the present position, so there is no motion (HM 2.35).
        const std::int64_t travelled = figure.number == 35 ? 0 : offset;
        const Counts expected = expected_home(figure, world, figure.number == 35 ? begins : *from, 0);
        EXPECT_NEAR(static_cast<double>(rig.home(travelled)), static_cast<double>(expected),
                    figure.number == 35 ? tolerance.creeps : 0.0);
        rig.run_ms(100);
        const Counts true_position = rig.plant.position_counts() - rig.home(travelled) - travelled;
        EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), static_cast<double>(true_position), tolerance.creeps)
            << "counted from the zero point, 607Ch from home";
        EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), 0.0, tolerance.off) << "D-25";
        if (testing::Test::HasFailure()) return 0;
      }
    }
  }
  return runs;
}

TEST(JmcHoming, EveryMethodFromEveryStart) { EXPECT_GT(every_method(products::jmc_ec::default_rating, 2, {}), 280); }

// Two phases, 50 pole pairs. The detent torque moves a shaft that friction would hold, by less than a full step.
TEST(JmcHoming, EveryMethodOfTheSteppers) {
  for (const std::string_view rating : {"2hss458-ec", "2dm542-ec"})
    EXPECT_GT(every_method(rating, 1, {.off = 20.0, .creeps = 1.0}), 130) << rating;
}

World simple_world() {
  World world;
  world.revolution = revolution;
  world.index_width = 1;
  world.index = 1000;
  world.home_from = 10000;
  world.home_to = 30000;
  world.negative_limit = -20000;
  world.positive_limit = 60000;
  world.low_stop = -30000;
  world.high_stop = 80000;
  return world;
}

// 0, 15, 16, 31, 32: allowed, without motion (HM 2.15 and 2.31, object 6098h). Others are refused (D-23).
TEST(JmcHoming, ReservedMethods) {
  for (const int number : {0, 15, 16, 31, 32}) {
    Homing rig(simple_world(), 0);
    rig.start(number);
    rig.run_ms(100);
    EXPECT_EQ(rig.status() & flags, reached) << number << ": not started, standing";
    EXPECT_EQ(rig.get(0x6064), 0);
    EXPECT_FALSE(rig.device.drive().homed());
    rig.control(0x0F);
    rig.start(17);
    ASSERT_TRUE(rig.finish());
    EXPECT_EQ(rig.status() & flags, reached | attained);
  }
  Homing rig(simple_world(), 0);
  for (const int number : {-128, -1, 36, 37, 127}) EXPECT_EQ(rig.set(0x6098, 0, number), AbortCode::value_invalid);
}

// The offset is a separate move with the slow speed, after home is found (Charts 42 and 44): bit 12 is set before bit
// 10.
TEST(JmcHoming, OffsetIsTravelledAtTheSlowSpeed) {
  for (const std::int64_t offset : {3000, -3000}) {
    Homing rig(simple_world(), 20000);
    rig.set(0x607C, 0, offset);
    rig.start(21);  // leaves the switch in positive direction
    ASSERT_GE(rig.run_until([&] { return (rig.status() & attained) != 0; }, 60000), 0);
    EXPECT_EQ(rig.status() & flags, attained);
    EXPECT_NEAR(static_cast<double>(rig.get(0x6064)), -static_cast<double>(offset), 20.0);
    double fastest = 0.0;
    const std::int64_t ticks = rig.run_until(
        [&] {
          fastest = std::max(fastest, std::abs(rig.plant.velocity_rpm()) / 60.0 * revolution);
          return (rig.status() & reached) != 0;
        },
        10000);
    ASSERT_GE(ticks, 0);
    EXPECT_NEAR(static_cast<double>(ticks) / 16000.0, 3.0, 0.05) << "3000 units at 1000 units/s";
    EXPECT_LT(fastest, 1500.0);
    EXPECT_EQ(rig.home(offset), 30000);
  }
}

// Bit 4 from 1 to 0 ends it: ramp 609Ah, no home, no error (Chart 38).
TEST(JmcHoming, StartBitTakenAwayAborts) {
  Homing rig(simple_world(), 0);
  rig.start(3);
  rig.run_ms(200);
  EXPECT_NEAR(rig.plant.velocity_rpm(), 120.0, 5.0);
  rig.control(0x0F);
  EXPECT_GE(rig.run_until([&] { return !rig.device.drive().in_motion(); }, 100), 0);
  EXPECT_EQ(rig.status() & flags, reached);
  EXPECT_FALSE(rig.device.drive().homed());
}

// Halt by 605Dh with 609Ah; bit 10 then means standstill, and homing continues afterwards (Chart 273).
TEST(JmcHoming, HaltAndResume) {
  Homing rig(simple_world(), 0);
  rig.set(0x609A, 0, 40000);
  rig.start(3);
  rig.run_ms(300);
  rig.control(0x11F);
  const std::int64_t ticks = rig.run_until([&] { return (rig.status() & reached) != 0; }, 1000);
  EXPECT_NEAR(static_cast<double>(ticks) / 16000.0, 8000.0 / 40000.0, 0.01);
  rig.run_ms(100);
  EXPECT_EQ(rig.status() & flags, reached);
  rig.control(0x1F);
  rig.run_ms(5);
  EXPECT_EQ(rig.status() & flags, 0);
  ASSERT_TRUE(rig.finish());
  EXPECT_EQ(rig.status() & flags, reached | attained);
}

// The factory value of 6099h sub 1 is 0: bit 13 immediately. If 609Ah is 0, 60C5h applies (D-24).
TEST(JmcHoming, SpeedAndRampOfZero) {
  Homing rig(simple_world(), 0);
  rig.set(0x6099, 1, 0);
  rig.start(3);
  EXPECT_EQ(rig.status() & flags, reached | error);
  EXPECT_EQ(rig.status() & 0x6F, 0x27) << "no fault";
  rig.control(0x0F);
  rig.set(0x6099, 1, 8000);
  rig.set(0x609A, 0, 0);
  rig.set(0x60C5, 0, 80000);
  rig.start(3);
  const std::int64_t ticks = rig.run_until([&] { return rig.plant.velocity_rpm() > 119.0; }, 1000);
  EXPECT_NEAR(static_cast<double>(ticks) / 16000.0, 0.1, 0.01);
  ASSERT_TRUE(rig.finish());
  EXPECT_EQ(rig.status() & flags, reached | attained);
}

// P03-68: AL.551, a fault with bit 13 (ch. 9.1 and 9.2). 0 means no limit.
TEST(JmcHoming, TimesOut) {
  Homing rig(simple_world(), 0);
  rig.set_panel(3, 68, 1);
  rig.set(0x6099, 1, 100);
  rig.start(3);
  const std::int64_t ticks = rig.run_until([&] { return (rig.status() & error) != 0; }, 5000);
  EXPECT_NEAR(static_cast<double>(ticks) / 16000.0, 1.0, 0.01);
  rig.run_ms(200);
  EXPECT_EQ(rig.status() & 0x4F, 0x08);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.551");
  EXPECT_NE(rig.status() & error, 0);

  Homing patient(simple_world(), 0);
  patient.set_panel(3, 68, 0);
  patient.set(0x6099, 1, 1500);
  patient.start(3);
  EXPECT_TRUE(patient.finish());
}

// Both limits without a home switch: an error, but no fault.
TEST(JmcHoming, HomeNotFound) {
  World world = simple_world();
  world.home_from = 200000;
  world.home_to = 200001;
  Homing rig(world, 0);
  rig.set(0x6099, 1, 40000);
  rig.start(7);
  ASSERT_TRUE(rig.finish());
  EXPECT_EQ(rig.status() & flags, reached | error);
  EXPECT_EQ(rig.status() & 0x6F, 0x27);
}

// Out of tolerance while homing: the fault shows bit 13 (Chart 273).
TEST(JmcHoming, FollowingErrorIsAHomingError) {
  Homing rig(simple_world(), 0);
  rig.set(0x6065, 0, 200);
  rig.start(3);
  rig.run_ms(100);
  rig.plant.lock_rotor(true);
  ASSERT_GE(rig.run_until([&] { return (rig.status() & 0x4F) == 0x08; }, 1000), 0);
  EXPECT_EQ(rig.status() & error, error);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.501");
}

// 607Eh bit 7 reverses the methods together with the switches.
TEST(JmcHoming, Polarity) {
  Homing rig(simple_world(), 0);
  rig.control(0x00);
  rig.run_ms(150);
  EXPECT_EQ(rig.set(0x607E, 0, 0xC0), AbortCode::none);
  EXPECT_TRUE(rig.enable());
  rig.start(17);  // the user's negative end has the large counts
  ASSERT_TRUE(rig.finish());
  EXPECT_EQ(rig.status() & flags, reached | attained);
  EXPECT_NEAR(static_cast<double>(rig.plant.position_counts()), 60000.0, rest);
}

}  // namespace
}  // namespace jmc_homing_test
}  // namespace servodrome
