#include "drive/open_phase.hpp"

#include <gtest/gtest.h>

// Which signals count as a cut wire and which just do not, sample by sample.
namespace servodrome::drive {
namespace open_phase_test {
namespace {

struct Looks : testing::Test {
  Looks() { watch.configure(motor); }
  void look(int count = 1) {
    for (int i = 0; i < count; ++i) watch.look(sample);
  }
  // Turns in steps of a sixteenth of an electrical turn; returns the step at which the phase counts as open, 0: none.
  int opens_after(int sixteenths) {
    for (int i = 1; i <= sixteenths; ++i) {
      sample.angle += Phase{1} << 28;
      look();
      if (watch.open()) return i;
    }
    return 0;
  }
  // Returns the number of checks after which a standing axis has an open phase.
  int stands_until_open(int most = 100) {
    for (int i = 1; i <= most; ++i) {
      look();
      if (watch.open()) return i;
    }
    return 0;
  }

  MotorData motor{.counts_per_revolution = 20000,
                  .pole_pairs = 5,
                  .rated_current_a = 4.0F,
                  .torque_constant_nm_per_a = 0.3F,
                  .resistance_ohm = 0.5F,
                  .inductance_d_h = 2.0e-3F,
                  .inductance_q_h = 2.5e-3F};
  OpenPhase watch;
  OpenPhase::Sample sample;
};

TEST_F(Looks, SixSixteenthsOfATurnWithoutAPhase) {
  sample.current_a = {1.0F, -1.0F, 0.0F};
  EXPECT_EQ(opens_after(16), 6);
  watch.reset();
  EXPECT_FALSE(watch.open());
  look(100);
  EXPECT_FALSE(watch.open()) << "it does not turn";
}

TEST_F(Looks, EachPhaseIsWatched) {
  for (std::size_t open = 0; open < 3; ++open) {
    watch.reset();
    sample.current_a = {1.0F, 1.0F, 1.0F};
    sample.current_a[open] = 0.0F;
    EXPECT_EQ(opens_after(16), 6) << open;
  }
  // A motor with two windings has no third phase.
  motor.phases = 2;
  watch.configure(motor);
  watch.reset();
  sample.current_a = {1.0F, 1.0F, 0.0F};
  EXPECT_EQ(opens_after(32), 0);
  sample.current_a = {1.0F, 0.0F, 0.0F};
  EXPECT_EQ(opens_after(32), 6);
}

TEST_F(Looks, ATenthOfTheOthersIsNothing) {
  for (const float sign : {1.0F, -1.0F}) {
    sample.current_a = {1.0F, -1.0F, sign * 0.11F};
    watch.reset();
    EXPECT_EQ(opens_after(32), 0) << sign;
    sample.current_a[2] = sign * 0.099F;
    EXPECT_EQ(opens_after(32), 6) << sign;
  }
}

TEST_F(Looks, OneLookWithCurrentBeginsAnew) {
  sample.current_a = {1.0F, -1.0F, 0.0F};
  EXPECT_EQ(opens_after(5), 0);
  sample.current_a[2] = 1.0F;
  EXPECT_EQ(opens_after(1), 0);
  sample.current_a[2] = 0.0F;
  EXPECT_EQ(opens_after(16), 6);
}

// 0.5 % of the rated current: less current gives no information.
TEST_F(Looks, LittleCurrentTellsNothing) {
  sample.current_a = {0.0199F, -0.0199F, 0.0F};
  EXPECT_EQ(opens_after(64), 0);
  watch.reset();
  sample.current_a = {0.0201F, -0.0201F, 0.0F};
  EXPECT_EQ(opens_after(64), 6);
}

// Two thirds of the passed angle must be without current.
TEST_F(Looks, WhereNoCurrentWasMeantCountsAsPassed) {
  for (const auto& [passed, needed] : {std::pair{3, 6}, {4, 8}}) {
    watch.reset();
    sample.current_a = {1.0F, -1.0F, 0.0F};
    sample.field_turns = false;
    EXPECT_EQ(opens_after(passed), 0);
    sample.field_turns = true;
    EXPECT_EQ(opens_after(12), needed) << passed;
  }
}

// 25 checks; 4 (R + L / 50 ms) times the minimum current, a quarter of a turn's flux in 50 ms, 1 % of the DC link.
TEST_F(Looks, AVoltageThatDrivesNoCurrent) {
  const float least = 4.0F * (0.5F + 2.5e-3F / 0.05F) * 0.02F + 0.3F / (1.5F * 5.0F) * 1.5707963F / 0.05F + 3.0F;
  sample.dc_link_v = 300.0F;
  for (const float sign : {1.0F, -1.0F}) {
    for (std::size_t phase = 0; phase < 3; ++phase) {
      sample.voltage_v = {};
      sample.voltage_v[phase] = sign * (least - 0.002F);
      watch.reset();
      EXPECT_EQ(stands_until_open(), 0) << phase;
      sample.voltage_v[phase] = sign * (least + 0.002F);
      watch.reset();
      EXPECT_EQ(stands_until_open(), 25) << phase;
    }
  }
  watch.reset();
  sample.current_a = {0.0201F, 0.0201F, -0.0201F};
  EXPECT_EQ(stands_until_open(), 0) << "it drives one";
  watch.reset();
  sample.current_a = {0.0199F, 0.0199F, -0.0199F};
  EXPECT_EQ(stands_until_open(), 25);
}

TEST_F(Looks, TheGreatestCurrentOfTheWindowCounts) {
  sample.voltage_v = {0.0F, 0.0F, 10.0F};
  for (int i = 1; i <= 25; ++i) {
    sample.current_a[2] = i == 13 ? -0.1F : 0.0F;
    look();
  }
  EXPECT_FALSE(watch.open());
  EXPECT_EQ(stands_until_open(), 25) << "the next window has none";
}

// Oscillation within a quarter of an electrical turn counts as standing; a larger motion begins another window.
TEST_F(Looks, MotionBeginsAnotherWindow) {
  sample.voltage_v = {0.0F, 0.0F, 10.0F};
  for (const int sign : {1, -1}) {
    watch.reset();
    sample.position = 0;
    look(20);
    sample.position = sign * 1000;
    EXPECT_EQ(stands_until_open(), 5);
    watch.reset();
    sample.position = 0;
    look(20);
    sample.position = sign * 1001;
    look();
    EXPECT_EQ(stands_until_open(), 25);
  }
}

TEST_F(Looks, ComeWithoutARhythm) {
  std::uint32_t sum = 0;
  for (int i = 0; i < 8; ++i) sum += watch.next_look();
  EXPECT_EQ(sum, 256U) << "2 ms on average";
}

}  // namespace
}  // namespace open_phase_test
}  // namespace servodrome::drive
