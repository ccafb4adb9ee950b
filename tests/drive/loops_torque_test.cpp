#include <gtest/gtest.h>

#include "loops_support.hpp"

namespace servodrome::drive::test {
namespace loops_torque_test {
namespace {

Axis torque_axis(float torque, double limit_rpm, const plant::Parameters& parameters) {
  Axis axis(parameters);
  axis.demand.loop = Loop::torque;
  axis.demand.torque = torque;
  axis.demand.velocity_limit_positive = axis.demand.velocity_limit_negative =
      static_cast<float>(axis.counts_per_s(limit_rpm));
  return axis;
}

TEST(TorqueLoop, AcceleratesWithTheDemandedTorque) {
  for (const float torque : {-1.2F, -0.1F, 0.3F, 1.0F}) {
    Axis axis = torque_axis(torque, 1.0e6, frictionless(131072));
    axis.run_seconds(0.005);
    const double before_rpm = axis.plant.velocity_rpm();
    axis.run_seconds(0.01);
    const double expected_rpm =
        static_cast<double>(torque * axis.motor.rated_torque_nm / axis.motor.inertia_kgm2) * 0.01 * 30.0 / pi;
    // The compensation of the back-EMF is half a tick late: the current lags a little while the speed increases.
    EXPECT_NEAR(axis.plant.velocity_rpm() - before_rpm, expected_rpm, 3.0e-3 * std::fabs(expected_rpm));
    EXPECT_FALSE(axis.cascade.state().velocity_limited);
    EXPECT_FALSE(axis.cascade.state().torque_limited);
  }
}

// The torque limits clip the demand, and the peak current clips the torque limits.
TEST(TorqueLoop, Limits) {
  Axis axis = torque_axis(2.0F, 1.0e6, frictionless(131072));
  axis.plant.lock_rotor(true);
  axis.demand.torque_limit_positive = 0.8F;
  axis.run_seconds(0.02);
  EXPECT_TRUE(axis.cascade.state().torque_limited);
  EXPECT_NEAR(axis.plant.torque_nm(), 0.8 * 1.27, 1.0e-3);
  axis.demand.torque_limit_positive = 100.0F;
  axis.demand.torque = 50.0F;
  axis.run_seconds(0.02);
  EXPECT_NEAR(axis.plant.current_a(), static_cast<double>(axis.motor.peak_current_a), 0.01);
}

// Accelerates to the speed limit; the torque decreases without a change of sign and without a second oscillation. The
// axis stays at the limit with the torque that the load needs.
TEST(TorqueLoop, SpeedLimitTakesTorqueBackSmoothly) {
  for (const float torque : {-1.0F, 0.2F, 1.0F, 2.5F}) {
    plant::Parameters parameters = frictionless(131072);
    parameters.load.viscous_friction_nms = 1.0e-3;
    Axis axis = torque_axis(torque, 1000.0, parameters);
    const double sign = torque > 0.0F ? 1.0 : -1.0;
    double fastest_rpm = 0.0;
    double least_torque = 10.0;
    double largest_jump = 0.0;
    bool reached = false;
    double previous_torque = 0.0;
    for (int i = 0; i < 16000; ++i) {
      axis.tick();
      fastest_rpm = std::max(fastest_rpm, sign * axis.plant.velocity_rpm());
      const double now = sign * static_cast<double>(axis.cascade.state().torque_reference);
      reached = reached || axis.cascade.state().velocity_limited;
      if (reached) {
        least_torque = std::min(least_torque, now);
        largest_jump = std::max(largest_jump, std::fabs(now - previous_torque));
      }
      previous_torque = now;
    }
    EXPECT_TRUE(axis.cascade.state().velocity_limited);
    EXPECT_LT(fastest_rpm, std::fabs(torque) > 1.0F ? 1015.0 : 1001.0);
    EXPECT_GT(least_torque, -0.02);
    EXPECT_LT(largest_jump, 0.1 * std::fabs(static_cast<double>(torque)) + 0.01);
    EXPECT_NEAR(sign * axis.plant.velocity_rpm(), 1000.0, 1.0);
    // In a single tick; the ripple comes from the counts of the encoder.
    EXPECT_NEAR(sign * axis.plant.torque_nm(), 1.0e-3 * 1000.0 * pi / 30.0, 4.0e-3);

    // The demand falls below the load's torque: the limiter is no longer active and its integral fades.
    axis.demand.torque = 0.0F;
    axis.run_seconds(0.3);
    EXPECT_FALSE(axis.cascade.state().velocity_limited);
    EXPECT_NEAR(axis.plant.torque_nm(), 0.0, 2.0e-3);
  }
}

// For any inertia of the load, torque and gains: the shaft reaches the limit and hardly exceeds it.
TEST(TorqueLoop, SpeedLimitWithEveryLoad) {
  for (const double share : {0.1, 0.3, 1.0}) {
    for (const double inertia : {0.0, 1.0e-4, 3.0e-4}) {
      for (const double torque : {0.3, 1.0, 2.5}) {
        for (const double limit_rpm : {100.0, 500.0, 2000.0}) {
          SCOPED_TRACE(testing::Message() << share << " of the gain, " << inertia << " kgm2, torque " << torque << ", "
                                          << limit_rpm << " rpm");
          plant::Parameters parameters = frictionless(131072);
          Axis axis = torque_axis(static_cast<float>(torque), limit_rpm, parameters);
          axis.gains.velocity_kp *= static_cast<float>(share);
          axis.gains.velocity_ki *= static_cast<float>(share * share);
          axis.configure();
          axis.plant.set_load_inertia_kgm2(inertia);
          double fastest_rpm = 0.0;
          for (int i = 0; i < 16000; ++i) {
            axis.tick();
            fastest_rpm = std::max(fastest_rpm, axis.plant.velocity_rpm());
          }
          EXPECT_LT(fastest_rpm, limit_rpm * 1.2);
          EXPECT_NEAR(axis.plant.velocity_rpm(), limit_rpm, 0.01 * limit_rpm);
        }
      }
    }
  }
}

// A load that drives the axis beyond the limit is braked with a torque opposite to the demand.
TEST(TorqueLoop, SpeedLimitBrakesADrivingLoad) {
  plant::Parameters parameters = frictionless(131072);
  parameters.load.gravity_torque_nm = 0.8;  // pulls downwards, with more torque than the demand
  Axis axis = torque_axis(0.2F, 500.0, parameters);
  double fastest_rpm = 0.0;
  for (int i = 0; i < 16000; ++i) {
    axis.tick();
    fastest_rpm = std::min(fastest_rpm, axis.plant.velocity_rpm());
  }
  // At first only the proportional part acts against the load.
  const auto gain_nms = static_cast<double>(axis.gains.velocity_kp * axis.motor.torque_constant_nm_per_a);
  EXPECT_GT(fastest_rpm, -500.0 - 0.8 / gain_nms * 30.0 / pi);
  EXPECT_NEAR(axis.plant.velocity_rpm(), -500.0, 1.0);
  EXPECT_NEAR(axis.plant.torque_nm(), 0.8, 5.0e-3);
  EXPECT_TRUE(axis.cascade.state().velocity_limited);
}

// The limiter's integral is cleared away from the limit, so the next approach to the limit does not overshoot.
TEST(TorqueLoop, SpeedLimiterForgets) {
  plant::Parameters parameters = frictionless(131072);
  parameters.load.gravity_torque_nm = 0.8;
  Axis axis = torque_axis(1.0F, 500.0, parameters);
  axis.run_seconds(1.0);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 500.0, 1.0);
  axis.demand.torque = -0.2F;
  axis.plant.set_external_torque_nm(-0.8);  // removes the load
  axis.run_seconds(0.015);                  // slows down
  axis.demand.torque = 0.0F;
  axis.run_seconds(0.5);
  axis.demand.torque = 1.0F;
  double fastest_rpm = 0.0;
  for (int i = 0; i < 8000; ++i) {
    axis.tick();
    fastest_rpm = std::max(fastest_rpm, axis.plant.velocity_rpm());
  }
  EXPECT_LT(fastest_rpm, 520.0);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 500.0, 1.0);
}

// The torque must not jump when the loop changes to another and back while the axis follows its demand.
TEST(TorqueLoop, ChangesOfLoopAreBumpless) {
  plant::Parameters parameters = frictionless(1 << 20);
  parameters.load.viscous_friction_nms = 2.0e-3;
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(1000.0));
  axis.run_seconds(1.0);
  const float torque = axis.cascade.state().torque_reference;
  EXPECT_NEAR(static_cast<double>(torque), 2.0e-3 * 1000.0 * pi / 30.0 / 1.27, 1.0e-3);
  for (const Loop loop : {Loop::torque, Loop::velocity, Loop::torque, Loop::position}) {
    axis.demand.loop = loop;
    axis.demand.torque = loop == Loop::torque ? torque : 0.0F;
    axis.demand.position = axis.feedback.position_counts;
    for (int i = 0; i < 400; ++i) {
      if (axis.cascade.position_loop_due()) {
        axis.demand.position +=
            loop == Loop::position && i >= 8 ? std::lround(axis.counts_per_s(1000.0) * 8.0 * tick_seconds) : 0;
      }
      axis.tick();
      ASSERT_NEAR(static_cast<double>(axis.cascade.state().torque_reference), static_cast<double>(torque), 0.01)
          << static_cast<int>(loop) << " tick " << i;
    }
  }
}

}  // namespace
}  // namespace loops_torque_test
}  // namespace servodrome::drive::test
