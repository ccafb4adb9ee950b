#include <gtest/gtest.h>

#include "loops_support.hpp"
#include "plant/stepper_motor.hpp"

// The current loop of a motor with two windings in quadrature.
namespace servodrome::drive::test {
namespace loops_two_phase_test {
namespace {

plant::Parameters stepper() {
  plant::Parameters p = frictionless(200000);
  plant::test::make_stepper(p.motor);
  p.supply.volts = 72.0;
  return p;
}

// As with three phases: i(k) = I (1 - p^k), p = exp(-bandwidth * tick).
TEST(TwoPhaseLoop, StepResponseIsTheDesignedFirstOrder) {
  Axis axis(stepper());
  axis.plant.lock_rotor(true);
  axis.gains.current_bandwidth_hz = 300.0F;
  axis.gains.torque_filter_hz = 0.0F;
  axis.configure();
  axis.demand.loop = Loop::torque;
  axis.demand.torque = 0.5F;
  const double target_a = 0.5 * 4.4 / (0.74 / std::sqrt(2.0));
  const double pole = std::exp(-2.0 * pi * 300.0 * tick_seconds);
  for (int k = 1; k <= 80; ++k) {
    axis.tick();
    ASSERT_NEAR(axis.plant.current_a(), target_a * (1.0 - std::pow(pole, k)), 2.0e-4 * target_a) << k;
    ASSERT_NEAR(axis.plant.direct_current_a(), 0.0, 2.0e-4 * target_a);
    ASSERT_EQ(axis.actuation.phase_voltage_v[2], 0.0F);
  }
}

TEST(TwoPhaseLoop, TorqueAtEveryAngle) {
  for (const double offset_turns : {0.0, 0.37}) {
    for (int position = 0; position < 200000; position += 6113) {
      plant::Parameters p = stepper();
      p.encoder.commutation_offset_turns = offset_turns;
      p.encoder.direction = position % 2 == 0 ? 1 : -1;
      p.encoder.start_position_counts = position - 100000;
      Axis axis(p);
      axis.plant.lock_rotor(true);
      axis.demand.loop = Loop::torque;
      axis.demand.torque = -0.5F;
      axis.run_seconds(0.02);
      ASSERT_NEAR(axis.plant.torque_nm(), -2.2, 5.0e-3) << position;
      ASSERT_NEAR(static_cast<double>(axis.cascade.state().torque), -0.5, 1.0e-3);
      ASSERT_NEAR(static_cast<double>(axis.cascade.state().current_q_a), -2.2 / 0.74 * std::sqrt(2.0), 0.02);
    }
  }
}

// |v| reaches the full DC link voltage and does not exceed it.
TEST(TwoPhaseLoop, TheLinkLimitsTheSpeed) {
  plant::Parameters p = stepper();
  p.load.viscous_friction_nms = 1.0e-3;
  Axis axis(p);
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(3000.0));
  axis.demand.torque_limit_positive = axis.demand.torque_limit_negative = 1.0F;
  double largest_share = 0.0;
  for (int i = 0; i < 32000; ++i) {
    const auto available_v = static_cast<double>(axis.feedback.dc_link_v);
    axis.tick();
    const std::array<float, 3>& v = axis.actuation.phase_voltage_v;
    largest_share =
        std::max(largest_share, std::hypot(static_cast<double>(v[0]), static_cast<double>(v[1])) / available_v);
  }
  EXPECT_NEAR(largest_share, 1.0, 1.0e-5);
  // Steady state: viscous torque gives iq; vd = -w L iq, vq = R iq + w flux.
  const double flux = plant::flux_linkage_vs(p.motor);
  double low = 0.0;
  double high = 1000.0;
  for (int i = 0; i < 60; ++i) {
    const double speed = 0.5 * (low + high);
    const double current_a = 1.0e-3 * speed / (50.0 * flux);
    const double electrical = 50.0 * speed;
    const double volts = std::hypot(electrical * 2.3e-3 * current_a, 0.4 * current_a + electrical * flux);
    (volts < axis.plant.dc_link_v() ? low : high) = speed;
  }
  EXPECT_TRUE(axis.cascade.state().voltage_limited);
  // The voltage is constant for a tick in which the field turns by we h = 0.43 rad: its mean is smaller, and it lags.
  EXPECT_NEAR(axis.plant.velocity_rpm(), low * 30.0 / pi, 0.03 * low * 30.0 / pi);
}

TEST(TwoPhaseLoop, LockedCurrentHoldsTheRotor) {
  Axis axis(stepper());
  axis.demand.loop = Loop::locked;
  axis.demand.lock_current_a = 8.0F;
  axis.run_seconds(0.05);
  axis.plant.set_external_torque_nm(2.0);
  axis.run_seconds(1.0);
  // The torque by the rotor's displacement angle x: p flux I sin(p x).
  const double electrical = std::asin(2.0 / (0.74 / std::sqrt(2.0) * 8.0));
  const double counts = -electrical / 50.0 / (2.0 * pi) * 200000.0;
  double mean = 0.0;
  for (int i = 0; i < 16000; ++i) {
    axis.tick();
    mean += static_cast<double>(axis.plant.position_counts()) / 16000.0;
  }
  EXPECT_NEAR(mean, counts, 0.1 * std::abs(counts));
}

}  // namespace
}  // namespace loops_two_phase_test
}  // namespace servodrome::drive::test
