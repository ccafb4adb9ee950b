#include <gtest/gtest.h>

#include "drive/lag_filter.hpp"
#include "loops_support.hpp"

// Filters of the feed-forwards, and the disturbance observer, compared with their formulas.
namespace servodrome::drive::test {
namespace loops_feed_forward_test {
namespace {

constexpr double position_period_s = 8 * tick_seconds;

float corner_hz(double time_constant_s) { return static_cast<float>(1.0 / (2.0 * pi * time_constant_s)); }

// With a position loop without gain the velocity reference is the feed-forward alone.
TEST(FeedForward, VelocityIsLowPassed) {
  for (const double time_constant_s : {0.5e-3, 5e-3, 64e-3}) {
    Axis axis(frictionless(65536));
    axis.gains.position_kp = 0.0F;
    axis.gains.velocity_feed_forward = 0.3F;
    axis.gains.velocity_feed_forward_filter_hz = corner_hz(time_constant_s);
    axis.configure();
    axis.demand.loop = Loop::position;
    axis.run_seconds(0.01);
    axis.demand.velocity = 10000.0F;
    for (int cycle = 1; cycle <= 200; ++cycle) {
      for (int i = 0; i < axis.rates.position_loop_ticks; ++i) axis.tick();
      const double expected = 3000.0 * -std::expm1(-cycle * position_period_s / time_constant_s);
      ASSERT_NEAR(static_cast<double>(axis.cascade.state().velocity_reference_counts_per_s), expected, 0.2)
          << time_constant_s << " s, cycle " << cycle;
    }
  }
}

// With a velocity loop without gain the torque is the feed-forward alone.
TEST(FeedForward, TorqueIsLowPassed) {
  const double time_constant_s = 8e-3;
  Axis axis(frictionless(65536));
  axis.gains.velocity_kp = axis.gains.velocity_ki = 0.0F;
  axis.gains.torque_filter_hz = 0.0F;
  axis.gains.acceleration_feed_forward = 0.5F;
  axis.gains.acceleration_feed_forward_filter_hz = corner_hz(time_constant_s);
  axis.configure();
  axis.demand.loop = Loop::velocity;
  axis.run_seconds(0.01);
  const double acceleration = 500.0;  // rad/s^2
  axis.demand.acceleration = static_cast<float>(acceleration * axis.counts_per_rad);
  const double full = 0.5 * acceleration * static_cast<double>(axis.motor.inertia_kgm2 / axis.motor.rated_torque_nm);
  for (int cycle = 1; cycle <= 100; ++cycle) {
    for (int i = 0; i < axis.rates.position_loop_ticks; ++i) axis.tick();
    const double expected = full * -std::expm1(-cycle * position_period_s / time_constant_s);
    ASSERT_NEAR(static_cast<double>(axis.cascade.state().torque_reference), expected, 1e-5 * full) << cycle;
  }
}

// A filter that is switched on while the axis moves must not make the reference jump.
TEST(FeedForward, FilterGoesOnFromWhereItIs) {
  Axis axis(frictionless(65536));
  axis.gains.position_kp = 0.0F;
  axis.configure();
  axis.demand.loop = Loop::position;
  axis.demand.velocity = 10000.0F;
  axis.run_seconds(0.01);
  axis.gains.velocity_feed_forward_filter_hz = corner_hz(20e-3);
  axis.configure();
  axis.run_seconds(0.001);
  EXPECT_FLOAT_EQ(axis.cascade.state().velocity_reference_counts_per_s, 10000.0F);
}

struct Droop {
  double rest;   // rad/s, final deviation
  double worst;  // rad/s, greatest deviation
};

// A load torque steps up against a proportional velocity loop.
Droop droop(float share, double filter_s) {
  Axis axis(frictionless(1 << 20), {2, 8}, {1000.0F, 60.0F, 100.0F});
  axis.gains.velocity_ki = 0.0F;
  axis.gains.disturbance_share = share;
  axis.gains.disturbance_filter_hz = corner_hz(filter_s);
  axis.configure();
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(300.0));
  axis.run_seconds(0.3);
  const double before = axis.plant.velocity_rpm();
  axis.plant.set_external_torque_nm(0.2 * static_cast<double>(axis.motor.rated_torque_nm));
  Droop result{};
  for (int i = 0; i < 3200; ++i) {
    axis.tick();
    result.worst = std::max(result.worst, (before - axis.plant.velocity_rpm()) * pi / 30.0);
  }
  result.rest = (before - axis.plant.velocity_rpm()) * pi / 30.0;
  return result;
}

// The remaining deviation under a steady load is the share that is not compensated: the ratio to the droop T / kp of
// the bare loop.
TEST(DisturbanceObserver, RejectsItsShare) {
  const Axis axis(frictionless(1 << 20), {2, 8}, {1000.0F, 60.0F, 100.0F});
  const double bare = 0.2 * static_cast<double>(axis.motor.rated_torque_nm) /
                      static_cast<double>(axis.gains.velocity_kp * axis.motor.torque_constant_nm_per_a);
  for (const float share : {0.0F, 0.25F, 0.5F, 0.9F, 1.0F}) {
    const Droop measured = droop(share, 0.8e-3);
    EXPECT_NEAR(measured.rest, bare * static_cast<double>(1.0F - share), 0.01 * bare) << share;
  }
  // A faster observer filter gives a smaller deviation.
  const double quick = droop(1.0F, 0.8e-3).worst;
  const double slow = droop(1.0F, 8e-3).worst;
  EXPECT_LT(quick, 0.5 * slow);
  EXPECT_LT(slow, 0.9 * bare);
}

// The observer estimates the load through its low pass. With a held shaft, all torque is load.
TEST(DisturbanceObserver, LearnsWithItsTimeConstant) {
  const double filter_s = 10e-3;
  const double torque = 0.1;
  // Half of the low pass's output is added to the demand: t' = (t0 - t / 2) / T, from t0 to 2 t0.
  for (const double seconds : {5e-3, 10e-3, 20e-3, 60e-3}) {
    Axis axis(frictionless(65536));
    axis.gains.velocity_ki = 0.0F;
    axis.gains.torque_filter_hz = 0.0F;
    axis.gains.disturbance_share = 0.5F;
    axis.gains.disturbance_filter_hz = corner_hz(filter_s);
    axis.configure();
    axis.plant.lock_rotor(true);
    axis.demand.loop = Loop::velocity;
    axis.run_seconds(0.01);
    axis.demand.torque = static_cast<float>(torque);
    axis.run_seconds(seconds);
    const double expected = torque * (2.0 - std::exp(-seconds / (2.0 * filter_s)));
    EXPECT_NEAR(static_cast<double>(axis.cascade.state().torque_reference), expected, 0.01 * torque) << seconds;
  }
}

TEST(LagFilter, IsExponentialAndEndsExactly) {
  LagFilter filter;
  const double time_constant = 100.0;
  filter.configure(time_constant);
  filter.begin(1'000'000'000'000);
  const std::int64_t step = 65536 * 4000;
  std::int64_t value = 0;
  for (int n = 1; n <= 500; ++n) {
    value = filter.update(1'000'000'000'000 + step);
    const double expected = static_cast<double>(step) * -std::expm1(-n / time_constant);
    ASSERT_NEAR(static_cast<double>(value - 1'000'000'000'000), expected, 100.0) << n;
  }
  for (int n = 0; n < 3000; ++n) value = filter.update(1'000'000'000'000 + step);
  EXPECT_EQ(value, 1'000'000'000'000 + step);
}

}  // namespace
}  // namespace loops_feed_forward_test
}  // namespace servodrome::drive::test
