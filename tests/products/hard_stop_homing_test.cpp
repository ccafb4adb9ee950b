#include <cmath>
#include <gtest/gtest.h>

#include "products/ismc/ismc.hpp"
#include "reference_axis.hpp"

// Homing on hard stops with loads that need nearly as much torque as the detection of the stop.
namespace servodrome {
namespace hard_stop_homing_test {
namespace {

using drive::PowerState;
using test::Reference;
using test::Rig;

constexpr std::int64_t turn = 131072;
constexpr double stop_turns = 20.0;
constexpr int to_negative_stop = -1;
constexpr int to_positive_stop = -2;

// A load hangs on the shaft and pulls towards the negative stop.
struct Hanging : Reference {
  explicit Hanging(double share, double inertia_kgm2 = test::default_plant().load.inertia_kgm2)
      : Reference(6, machine(share, inertia_kgm2)) {
    set(0x2020, 1, 40);  // the brake
    set(0x2020, 2, 25);
    run_ms(300);
  }
  static plant::Parameters machine(double share, double inertia_kgm2) {
    const double rated_nm = test::default_plant().motor.rated_torque_nm;
    plant::Parameters parameters = test::hanging(test::default_plant(), share * rated_nm, share > 0.0 ? 4.0 : 0.0);
    parameters.load.inertia_kgm2 = inertia_kgm2;
    parameters.load.stop_damping_nms = 50.0;  // a heavy load does not rebound for long
    parameters.load.low_stop_counts = std::llround(-stop_turns * turn);
    parameters.load.high_stop_counts = std::llround(stop_turns * turn);
    return parameters;
  }
  void begin(int method, double speed_turns_per_s = 2.0, double ramp_turns_per_s2 = 2.0) {
    set(0x6098, 0, method);
    set(0x6099, 1, std::llround(speed_turns_per_s * turn));
    set(0x6099, 2, turn / 4);
    set(0x609A, 0, std::llround(ramp_turns_per_s2 * turn));
    control(0x1F);
  }
  // Until home is found or homing fails.
  void finish() {
    for (int i = 0; i < 20000 && !bit(12) && !bit(13); ++i) {
      run_ms(1);
      greatest_turns_per_s = std::max(greatest_turns_per_s, std::abs(turns_per_s()));
    }
  }
  double greatest_turns_per_s = 0.0;
};

// The stall torque is half of the rated one. The torque towards the stop is limited, the torque against it is not.
TEST(HardStopHoming, ALoadThatPullsTowardsTheStopIsHeld) {
  for (const double share : {0.4, 0.6, 0.9}) {
    SCOPED_TRACE(share);
    Hanging axis(share);
    axis.begin(to_negative_stop);
    axis.finish();
    EXPECT_TRUE(axis.bit(12));
    EXPECT_FALSE(axis.bit(13));
    EXPECT_NEAR(axis.turns(), -stop_turns, 0.01);
    EXPECT_LT(axis.greatest_turns_per_s, 2.3);
    EXPECT_EQ(axis.device.drive().state(), PowerState::operation_enabled);
  }
}

// The torque that presses cannot lift the load: homing fails, and the axis holds the load with its full torque.
TEST(HardStopHoming, ALoadThatIsTooHeavyToLiftEndsIt) {
  Hanging axis(0.6);
  axis.begin(to_positive_stop);
  axis.finish();
  EXPECT_FALSE(axis.bit(12));
  EXPECT_TRUE(axis.bit(13));
  axis.run_ms(3000);
  EXPECT_FALSE(axis.bit(12));
  EXPECT_NEAR(axis.turns(), 0.0, 0.5);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
  EXPECT_EQ(axis.device.drive().state(), PowerState::operation_enabled);
}

// A load that becomes too heavy on the way: it falls back at most at the speed of a rebound.
TEST(HardStopHoming, ALoadThatBecomesTooHeavyOnTheWayEndsIt) {
  Hanging axis(0.3);
  axis.begin(to_positive_stop);
  axis.run_ms(4000);
  ASSERT_GT(axis.turns(), 4.0);
  axis.plant.set_external_torque_nm(0.4 * test::default_plant().motor.rated_torque_nm);
  axis.finish();
  EXPECT_TRUE(axis.bit(13));
  EXPECT_LT(axis.greatest_turns_per_s, 5.0);
  axis.run_ms(4000);
  EXPECT_NEAR(axis.turns_per_s(), 0.0, 0.01);
  EXPECT_GT(axis.turns(), -5.0) << "far from the other stop";
}

// A halt on the way holds the load with the full torque as well.
TEST(HardStopHoming, AHaltHoldsTheLoad) {
  Hanging axis(0.4);
  axis.begin(to_positive_stop);
  axis.run_ms(2000);
  axis.control(0x11F);
  axis.run_ms(2000);
  const double there = axis.turns();
  axis.plant.set_external_torque_nm(0.3 * test::default_plant().motor.rated_torque_nm);
  axis.run_ms(2000);
  EXPECT_NEAR(axis.turns(), there, 0.01);
}

// The load alone needs the torque of the detection, but the shaft follows its demand.
TEST(HardStopHoming, ATorqueWithoutAStopIsNoStop) {
  Hanging axis(0.52);
  axis.begin(to_positive_stop);
  axis.finish();
  EXPECT_TRUE(axis.bit(12));
  EXPECT_NEAR(axis.turns(), stop_turns, 0.01);
}

// The acceleration alone needs the torque of the detection, or more than the limit allows.
TEST(HardStopHoming, AnAccelerationIsNoStop) {
  const double rated_nm = test::default_plant().motor.rated_torque_nm;
  for (const double share : {0.40, 0.44, 0.48, 0.6, 2.0}) {
    SCOPED_TRACE(share);
    Hanging axis(0.0, share * rated_nm / (20.0 * 2.0 * 3.14159265358979));
    axis.begin(to_negative_stop, 20.0, 20.0);
    axis.finish();
    EXPECT_TRUE(axis.bit(12));
    EXPECT_NEAR(axis.turns(), -stop_turns, 0.01);
  }
}

// A stall torque of 0 would make every slow moment a stop, and leave no torque to move.
TEST(HardStopHoming, TheStallTorqueOfTheIsmcIsNotZero) {
  Rig<products::Ismc> rig;
  EXPECT_EQ(rig.set(0x2138, 0, 0), dictionary::AbortCode::value_too_low);
  EXPECT_EQ(rig.set(0x2138, 0, 10), dictionary::AbortCode::none);
}

}  // namespace
}  // namespace hard_stop_homing_test
}  // namespace servodrome
