#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>

#include "ismk_rig.hpp"

// The iSMK's step stop, 2340h sub 1 and 2 (Table 5-18): a load that is too great displaces the shaft. The test measures
// the true shaft.
namespace servodrome {
namespace step_stop_test {
namespace {

using products::ismk::velocity_dec_from_rpm;

constexpr double turn = 65536.0;

struct StepStop : test::IsmkRig {
  // `filter`: command filter, 60FBh sub 5.
  explicit StepStop(std::int64_t filter = 1) {
    set(0x60FB, 5, filter);
    set(0x2340, 1, 1);
    set(0x2340, 2, 200);
    set(0x6060, 0, 1);
    set(0x6081, 0, std::llround(velocity_dec_from_rpm(300)));
    EXPECT_TRUE(enable());
    set(0x607A, 0, 65536);
    control(0x1F);
    run_ms(5);
    control(0x0F);
    run_ms(1800);
    EXPECT_NEAR(turns(), 1.0, 0.002);
  }
  // More torque than that current can hold, for some time.
  void slip() {
    plant.set_external_torque_nm(0.3);
    run_ms(140);
    plant.set_external_torque_nm(0.0);
    run_ms(800);
    EXPECT_LT(turns(), -1.0);
    EXPECT_NEAR(plant.velocity_rpm(), 0.0, 0.5);
    EXPECT_EQ(get(0x603F), 0);
  }
  double turns() const { return static_cast<double>(plant.position_counts()) / turn; }
};

TEST(StepStop, SlipIsAFollowingError) {
  StepStop rig;
  rig.set(0x6065, 0, 65536);
  rig.plant.set_external_torque_nm(0.3);
  rig.run_ms(140);
  EXPECT_EQ(rig.get(0x603F), 0x8611);
}

TEST(StepStop, ErrorActualValueShowsTheSlip) {
  StepStop rig;
  rig.slip();
  EXPECT_NEAR(static_cast<double>(rig.get(0x60F4)), static_cast<double>(65536 - rig.plant.position_counts()), 2.0);
}

TEST(StepStop, AnotherModeLeavesASlippedShaftWhereItIs) {
  StepStop rig;
  rig.slip();
  const double stood = rig.turns();
  rig.set(0x6060, 0, 7);
  for (int i = 0; i < 1500; ++i) {
    rig.run_ms(1);
    ASSERT_NEAR(rig.turns(), stood, 0.02) << i;
  }
}

// The axis moves from its present position to the target, with the profile of 300 rpm, with and without a command
// filter.
TEST(StepStop, ASetPointAfterASlipIsNoSprint) {
  for (const int filter : {1, 30, 255}) {
    for (const std::uint16_t bits : std::to_array<std::uint16_t>({0x00, 0x40})) {
      SCOPED_TRACE(::testing::Message() << filter << " ms, bits " << bits);
      StepStop rig(filter);
      rig.slip();
      const double stood = rig.turns();
      rig.control(static_cast<std::uint16_t>(0x0F | bits));
      rig.set(0x607A, 0, bits == 0 ? 131072 : 100);
      rig.control(static_cast<std::uint16_t>(0x1F | bits));
      const double ends = bits == 0 ? 2.0 : 1.0 + 100.0 / turn;
      for (int i = 0; i < 16 * 1800; ++i) {
        rig.tick();
        ASSERT_LT(rig.plant.velocity_rpm(), 330.0) << i / 16.0;
        ASSERT_GT(rig.plant.velocity_rpm(), -15.0) << i / 16.0;
        ASSERT_GT(rig.turns(), stood - 0.001) << i / 16.0;
      }
      EXPECT_NEAR(rig.turns(), ends, 0.003);
    }
  }
}

// A load that hangs on the shaft: the position loop takes it over from the direct current.
struct HangingStepStop : test::IsmkRig {
  HangingStepStop() : IsmkRig(test::hanging(test::ismk_plant(), 0.15, 0.0), test::ismk_settings()) {
    set(0x2340, 1, 1);
    set(0x2340, 2, 600);
    set(0x6060, 0, 1);
    set(0x6081, 0, std::llround(velocity_dec_from_rpm(300)));
    run_ms(5);
    control(0x0F);
    run_ms(500);
    set(0x607A, 0, 65536);
    control(0x1F);
    run_ms(5);
    control(0x0F);
    run_ms(1800);
    EXPECT_EQ(device.drive().axis().demand.loop, drive::Loop::locked);
  }
  double turns() const { return static_cast<double>(plant.position_counts()) / turn; }
};

TEST(StepStop, ItsEndDoesNotDropALoad) {
  HangingStepStop rig;
  const double stood = rig.turns();
  rig.set(0x6083, 0, 1);  // the demand hardly moves
  rig.set(0x607A, 0, 131072);
  rig.control(0x1F);
  double moves = 0.0;
  for (int i = 0; i < 16 * 100; ++i) {
    rig.tick();
    moves = std::max(moves, std::abs(rig.turns() - stood));
  }
  std::printf("moves by %.5f turns\n", moves);
  EXPECT_NE(rig.device.drive().axis().demand.loop, drive::Loop::locked);
  EXPECT_LT(moves, 0.0005);
}

TEST(StepStop, IdentificationHoldsTheLoad) {
  HangingStepStop rig;
  const double stood = rig.turns();
  ASSERT_TRUE(rig.device.drive().identify_inertia(
      {.travel_counts = turn, .speed_counts_per_s = 5.0 * turn, .torque_limit = 0.5F}));
  rig.run_ms(20);
  EXPECT_NEAR(rig.turns(), stood, 0.005);
  ASSERT_GE(rig.run_until([&] { return !rig.device.drive().identification().running(); }, 6000.0), 0);
  EXPECT_EQ(rig.device.drive().identification().outcome(), drive::InertiaIdentification::Outcome::done);
}

}  // namespace
}  // namespace step_stop_test
}  // namespace servodrome
