#include <cmath>
#include <gtest/gtest.h>

#include "products/generic402/generic402.hpp"
#include "rig.hpp"

// Cyclic synchronous and interpolated position between their set-points: the demand for the loops in every cycle.
namespace servodrome {
namespace cyclic_position_test {
namespace {

using products::Generic402;
using test::Rig;

constexpr int ticks_per_cycle = 8;
constexpr std::int64_t stroke = 1000;  // counts from target to target

class CyclicTargets : public ::testing::Test {
 protected:
  void enable(std::int64_t mode, std::int64_t period_value, std::int64_t period_index) {
    rig.set(0x60C2, 1, period_value);
    rig.set(0x60C2, 2, period_index);
    rig.set(0x6060, 0, mode);
    ASSERT_TRUE(rig.enable());
  }
  void run_cycle() {
    for (int i = 0; i < ticks_per_cycle; ++i) rig.tick();
  }
  void target(std::int64_t position) { rig.set(0x607A, 0, position); }
  double place() {
    const drive::Generator& generator = rig.device.drive().axis().generator;
    return static_cast<double>(generator.position()) + generator.fraction();
  }
  // Counts per cycle.
  double rate() { return rig.device.drive().axis().generator.velocity() * 0.0005; }

  Rig<Generic402> rig;
};

TEST_F(CyclicTargets, OneTargetIsReachedAfterOnePeriodAndNoFurther) {
  enable(8, 2, -3);
  target(stroke);
  double before = 0.0;
  for (int cycle = 1; cycle <= 20; ++cycle) {
    run_cycle();
    EXPECT_NEAR(place(), std::min(cycle, 4) * 250.0, 1e-9) << "cycle " << cycle;
    EXPECT_GE(place(), before);
    before = place();
    if (cycle >= 4) {
      EXPECT_EQ(rate(), 0.0);
    }
  }
}

// A period of 2.5 cycles: the targets come after 3, 2, 3, 2 cycles and so on.
TEST_F(CyclicTargets, PeriodThatIsNoMultipleOfTheCycleLeavesNoRipple) {
  enable(8, 125, -5);
  for (int cycle = 0; cycle < 500; ++cycle) {
    const int number = cycle * 2 / 5;  // of the target that is due; they come in the cycles 0, 3, 5, 8, 10 ...
    if (cycle == 0 || number != (cycle - 1) * 2 / 5) target((number + 1) * stroke);
    run_cycle();
    if (cycle < 5) continue;
    EXPECT_NEAR(rate(), stroke / 2.5, 1e-6) << "cycle " << cycle;
    EXPECT_NEAR(place(), (cycle + 1) * stroke / 2.5, 1e-6) << "cycle " << cycle;
  }
}

TEST_F(CyclicTargets, ATargetMayComeACycleEarlyOrLate) {
  enable(8, 2, -3);
  int next = 0;
  unsigned random = 1;
  std::int64_t number = 0;
  for (int cycle = 0; cycle < 4000; ++cycle) {
    if (cycle == next) {
      target(++number * stroke);
      random = random * 1664525u + 1013904223u;
      const int off = number < 4 ? 0 : static_cast<int>(random >> 16) % 3 - 1;
      next = static_cast<int>(number) * 4 + off;
    }
    run_cycle();
    if (cycle < 12) continue;
    ASSERT_NEAR(rate(), 250.0, 1e-6) << "cycle " << cycle;
  }
}

TEST_F(CyclicTargets, AMasterWhoseClockIsFastOrSlowIsFollowed) {
  for (const int cycles_per_thousand : {3990, 4010}) {
    Rig<Generic402> other;
    other.set(0x60C2, 1, 2);
    other.set(0x6060, 0, 8);
    ASSERT_TRUE(other.enable());
    std::int64_t number = 0;
    for (int cycle = 0; cycle < 40000; ++cycle) {
      if (cycle * 1000 >= number * cycles_per_thousand) other.set(0x607A, 0, ++number * stroke);
      for (int i = 0; i < ticks_per_cycle; ++i) other.tick();
      if (cycle < 20) continue;
      const double rate = other.device.drive().axis().generator.velocity() * 0.0005;
      ASSERT_NEAR(rate, 250.0, 4.0) << "cycle " << cycle;
    }
    EXPECT_NEAR(static_cast<double>(other.get(0x6062)), static_cast<double>(number * stroke), 2.0 * stroke);
  }
}

TEST_F(CyclicTargets, WhenTheMasterFallsSilentTheAxisStandsAtItsLastTarget) {
  enable(8, 2, -3);
  for (int cycle = 0; cycle < 40; ++cycle) {
    if (cycle % 4 == 0) target((cycle / 4 + 1) * stroke);
    run_cycle();
  }
  const double last = 10.0 * stroke;
  EXPECT_NEAR(place(), last, 1e-6);
  for (int cycle = 0; cycle < 10; ++cycle) {  // one period without a target, and one to catch up
    run_cycle();
    EXPECT_LE(place(), last + stroke + 250.0);
  }
  EXPECT_EQ(place(), last);
  EXPECT_EQ(rate(), 0.0);
}

TEST_F(CyclicTargets, TargetsPassTheEndOfTheir32Bits) {
  rig.device.drive().set_position_offset(2147483000);
  enable(8, 2, -3);
  std::int64_t position = 2147483000;
  for (int n = 0; n < 50; ++n) {
    position += stroke;
    target(static_cast<std::int32_t>(static_cast<std::uint32_t>(position)));
    for (int i = 0; i < 4; ++i) run_cycle();
    ASSERT_NEAR(place(), static_cast<double>(position), 1e-3);
  }
  EXPECT_EQ(rig.get(0x6062), position - (std::int64_t{1} << 32));
  EXPECT_EQ(rig.device.drive().state(), drive::PowerState::operation_enabled);
}

TEST_F(CyclicTargets, InterpolatedRecordsLieOnTheirOwnTimes) {
  rig.set(0x60C4, 2, 64);
  enable(7, 125, -5);
  for (int n = 1; n <= 40; ++n) rig.set(0x60C1, 1, n * n * 10);
  rig.control(0x1F);
  run_cycle();
  for (int cycle = 1; cycle < 100; ++cycle) {
    const double n = std::floor(cycle / 2.5);
    const double expected = n * n * 10.0 + (cycle / 2.5 - n) * (2.0 * n + 1.0) * 10.0;
    EXPECT_NEAR(place(), expected, 1e-6) << "cycle " << cycle;
    run_cycle();
  }
  run_cycle();
  EXPECT_EQ(place(), 16000.0);
  EXPECT_EQ(rate(), 0.0);
}

}  // namespace
}  // namespace cyclic_position_test
}  // namespace servodrome
