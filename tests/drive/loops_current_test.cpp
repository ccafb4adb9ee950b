#include <gtest/gtest.h>

#include "loops_support.hpp"

namespace servodrome::drive::test {
namespace loops_current_test {
namespace {

TEST(Transforms, SineAndCosineOfEveryPhase) {
  double largest = 0.0;
  for (std::uint64_t phase = 0; phase < 1ULL << 32; phase += 39'989) {
    const SinCos angle = sin_cos(static_cast<Phase>(phase));
    const double rad = static_cast<double>(phase) * 0x1p-32 * 2.0 * pi;
    largest = std::max({largest, std::fabs(static_cast<double>(angle.sine) - std::sin(rad)),
                        std::fabs(static_cast<double>(angle.cosine) - std::cos(rad))});
  }
  EXPECT_LT(largest, 2.0e-7);
  // The rotor stands exactly on an axis, so that the currents of the two axes are independent.
  constexpr std::array<SinCos, 4> quarters{{{0.0F, 1.0F}, {1.0F, 0.0F}, {0.0F, -1.0F}, {-1.0F, 0.0F}}};
  for (std::uint32_t quarter = 0; quarter < 4; ++quarter) {
    EXPECT_EQ(sin_cos(quarter << 30).sine, quarters[quarter].sine) << quarter;
    EXPECT_EQ(sin_cos(quarter << 30).cosine, quarters[quarter].cosine) << quarter;
  }
}

TEST(Transforms, PhasesWrap) {
  EXPECT_EQ(phase_of(0.25), 0x4000'0000U);
  EXPECT_EQ(phase_of(-0.25F), 0xC000'0000U);
  EXPECT_EQ(phase_of(-7.5), 0x8000'0000U);
  EXPECT_EQ(phase_of(1000.75F), 0xC000'0000U);
}

// If the zero of the PI controller cancels the pole of the winding, the samples of the closed loop are first-order:
// i(k) = I (1 - p^k), p = exp(-bandwidth * tick), from the first tick after the step, for any winding.
TEST(CurrentLoop, StepResponseIsTheDesignedFirstOrder) {
  for (const double inductance_h : {1.0e-3, 3.355e-3, 20.0e-3}) {
    for (const float bandwidth_hz : {300.0F, 1000.0F, 2000.0F}) {
      plant::Parameters parameters = frictionless(131072);
      parameters.motor.direct_inductance_h = parameters.motor.quadrature_inductance_h = inductance_h;
      Axis axis(parameters);
      axis.plant.lock_rotor(true);
      axis.gains.current_bandwidth_hz = bandwidth_hz;
      axis.gains.torque_filter_hz = 0.0F;
      axis.configure();
      axis.demand.loop = Loop::torque;
      axis.demand.torque = 0.2F;
      const double target_a = 0.2 * static_cast<double>(axis.motor.rated_torque_nm) /
                              static_cast<double>(axis.motor.torque_constant_nm_per_a);
      const double pole = std::exp(-2.0 * pi * static_cast<double>(bandwidth_hz) * tick_seconds);
      for (int k = 1; k <= 80; ++k) {
        axis.tick();
        ASSERT_NEAR(axis.plant.current_a(), target_a * (1.0 - std::pow(pole, k)), 2.0e-4 * target_a)
            << "tick " << k << ", " << inductance_h << " H, " << bandwidth_hz << " Hz";
        ASSERT_NEAR(axis.plant.direct_current_a(), 0.0, 2.0e-4 * target_a);
        ASSERT_FALSE(axis.cascade.state().voltage_limited);
      }
    }
  }
}

// The torque is correct at any rotor angle: commutation offset, pole pairs, order of the phases, transforms.
TEST(CurrentLoop, TorqueAtEveryAngle) {
  for (const double offset_turns : {0.0, 0.37, 0.9}) {
    for (int position = 0; position < 131072; position += 2913) {
      plant::Parameters parameters = frictionless(131072);
      parameters.encoder.commutation_offset_turns = offset_turns;
      parameters.encoder.direction = position % 2 == 0 ? 1 : -1;
      parameters.encoder.start_position_counts = position - 65536;
      Axis axis(parameters);
      axis.plant.lock_rotor(true);
      axis.demand.loop = Loop::torque;
      axis.demand.torque = -0.5F;
      axis.run_seconds(0.01);
      ASSERT_NEAR(axis.plant.torque_nm(), -0.5 * parameters.motor.rated_torque_nm, 1.0e-3) << position;
      ASSERT_NEAR(static_cast<double>(axis.cascade.state().torque), -0.5, 1.0e-3);
      ASSERT_NEAR(static_cast<double>(axis.cascade.state().current_q_a), -0.5 * std::sqrt(2.0) * 2.7, 0.02);
    }
  }
}

// At speed, decoupling and the advance of half a tick keep the d current small while the q current steps. The remaining
// error comes from the rotation within a tick.
TEST(CurrentLoop, AxesStayDecoupledAtSpeed) {
  plant::Parameters parameters = frictionless(1 << 20);
  parameters.load.inertia_kgm2 = 0.01;  // the speed stays constant
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(3000.0));
  axis.plant.set_external_torque_nm(-3000.0 / 60.0 * 2.0 * pi * (0.01 + 0.28e-4) / tick_seconds);
  axis.actuation.pwm_enabled = false;
  axis.tick();
  axis.plant.set_external_torque_nm(0.0);
  axis.actuation.pwm_enabled = true;
  axis.cascade.enable(axis.feedback);
  axis.demand.loop = Loop::torque;
  axis.run_seconds(0.05);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 3000.0, 5.0);
  EXPECT_NEAR(axis.plant.current_a(), 0.0, 0.02);
  axis.demand.torque = 1.0F;
  double largest_direct_a = 0.0;
  for (int k = 0; k < 80; ++k) {
    axis.tick();
    largest_direct_a = std::max(largest_direct_a, std::fabs(axis.plant.direct_current_a()));
  }
  RecordProperty("largest_direct_ma", static_cast<int>(1000.0 * largest_direct_a));
  EXPECT_LT(largest_direct_a, 0.03 * static_cast<double>(axis.motor.rated_current_a));
  EXPECT_NEAR(
      axis.plant.current_a(),
      static_cast<double>(axis.motor.rated_torque_nm) / static_cast<double>(axis.motor.torque_constant_nm_per_a), 0.01);
}

TEST(CurrentLoop, RunsWithThePhasesReversed) {
  plant::Parameters parameters = frictionless(131072);
  parameters.encoder.direction = -1;
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(2500.0));
  axis.run_seconds(0.3);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 2500.0, 1.0);
  EXPECT_NEAR(axis.plant.direct_current_a(), 0.0, 0.02);
  EXPECT_FALSE(axis.cascade.state().voltage_limited);
}

// With a low DC link voltage the axis runs as fast as the voltage allows, |v| = vdc / sqrt(3), and slows down
// immediately when a lower speed is demanded: there is no windup.
TEST(CurrentLoop, VoltageLimitsTheSpeed) {
  plant::Parameters parameters = frictionless(131072);
  parameters.supply.volts = 60.0;
  parameters.load.viscous_friction_nms = 1.0e-4;
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(6000.0));
  axis.demand.torque_limit_positive = axis.demand.torque_limit_negative = 1.0F;
  axis.run_seconds(2.0);

  // Steady state: viscous torque gives iq; vd = -w L iq, vq = R iq + w flux.
  const double flux = plant::flux_linkage_vs(parameters.motor);
  const double available_v = axis.plant.dc_link_v() / std::sqrt(3.0);
  double low = 0.0;
  double high = 1000.0;
  for (int i = 0; i < 60; ++i) {
    const double speed = 0.5 * (low + high);
    const double current_a = 1.0e-4 * speed / (1.5 * 5.0 * flux);
    const double electrical = 5.0 * speed;
    const double volts = std::hypot(electrical * parameters.motor.quadrature_inductance_h * current_a,
                                    parameters.motor.resistance_ohm * current_a + electrical * flux);
    (volts < available_v ? low : high) = speed;
  }
  EXPECT_TRUE(axis.cascade.state().voltage_limited);
  EXPECT_NEAR(axis.plant.velocity_rpm(), low * 30.0 / pi, 0.01 * low * 30.0 / pi);

  const double before_rpm = axis.plant.velocity_rpm();
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(0.5 * before_rpm));
  // A rated torque needs this time; with a tenth more the axis must have arrived.
  const double inertia = static_cast<double>(axis.motor.inertia_kgm2);
  const double brake_s = 0.5 * before_rpm * pi / 30.0 * inertia / parameters.motor.rated_torque_nm;
  double lowest_rpm = before_rpm;
  const auto ticks = std::lround((1.1 * brake_s + 0.01) / tick_seconds);
  for (long i = 0; i < ticks; ++i) axis.tick();
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.5 * before_rpm, 0.04 * before_rpm);
  for (int i = 0; i < 4000; ++i) {
    axis.tick();
    lowest_rpm = std::min(lowest_rpm, axis.plant.velocity_rpm());
  }
  EXPECT_GT(lowest_rpm, 0.45 * before_rpm);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.5 * before_rpm, 1.0);
}

// For any demand the voltage vector stays within the DC link's limit.
TEST(CurrentLoop, VoltageStaysWithinTheDcLink) {
  plant::Parameters parameters = frictionless(131072);
  parameters.supply.volts = 100.0;
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  double largest_share = 0.0;
  int limited = 0;
  for (const double rpm : {4000.0, -4000.0}) {
    axis.demand.velocity = static_cast<float>(axis.counts_per_s(rpm));
    for (int i = 0; i < 8000; ++i) {
      const auto available_v = static_cast<double>(axis.feedback.dc_link_v) / std::sqrt(3.0);
      axis.tick();
      const std::array<float, 3>& v = axis.actuation.phase_voltage_v;
      const auto alpha_v = static_cast<double>(2.0F * v[0] - v[1] - v[2]) / 3.0;
      const auto beta_v = static_cast<double>(v[1] - v[2]) / std::sqrt(3.0);
      largest_share = std::max(largest_share, std::hypot(alpha_v, beta_v) / available_v);
      limited += axis.cascade.state().voltage_limited ? 1 : 0;
    }
  }
  EXPECT_GT(limited, 1000);
  EXPECT_NEAR(largest_share, 1.0, 1.0e-5);
}

// Just above the speed that the voltage allows, with torque in reserve: the velocity integral also stops.
TEST(CurrentLoop, NothingWindsUpAtTheVoltageLimit) {
  plant::Parameters parameters = frictionless(131072);
  parameters.supply.volts = 60.0;
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(6000.0));
  axis.run_seconds(1.0);
  const double reached_rpm = axis.plant.velocity_rpm();
  const double more_rpm = reached_rpm + 50.0;
  Axis gentle(parameters);
  gentle.demand.loop = Loop::velocity;
  gentle.demand.velocity = static_cast<float>(gentle.counts_per_s(more_rpm));
  const auto integral = [&gentle] {
    const CascadeState& state = gentle.cascade.state();
    const float gain = gentle.gains.velocity_kp * gentle.motor.torque_constant_nm_per_a / gentle.motor.rated_torque_nm;
    const auto error = static_cast<double>(state.velocity_reference_counts_per_s - state.velocity_counts_per_s);
    return static_cast<double>(state.torque_reference) - static_cast<double>(gain) * error / gentle.counts_per_rad;
  };
  gentle.run_seconds(0.5);
  const double before = integral();
  gentle.run_seconds(5.0);
  EXPECT_TRUE(gentle.cascade.state().voltage_limited);
  EXPECT_FALSE(gentle.cascade.state().torque_limited);
  EXPECT_NEAR(integral(), before, 0.02);
}

TEST(CurrentLoop, DisabledOrOffThereIsNoVoltage) {
  Axis axis(frictionless(131072));
  axis.demand.loop = Loop::torque;
  axis.demand.torque = 0.5F;
  axis.run_seconds(0.001);
  EXPECT_NE(axis.actuation.phase_voltage_v[1], 0.0F);
  axis.demand.loop = Loop::off;
  axis.run_seconds(0.001);
  EXPECT_EQ(axis.actuation.phase_voltage_v, (std::array<float, 3>{}));
  EXPECT_EQ(axis.cascade.state().torque_reference, 0.0F);
  axis.demand.loop = Loop::torque;
  axis.run_seconds(0.001);
  EXPECT_NE(axis.actuation.phase_voltage_v[1], 0.0F);
  axis.cascade.disable();
  axis.cascade.tick(axis.feedback, axis.actuation);
  EXPECT_EQ(axis.actuation.phase_voltage_v, (std::array<float, 3>{}));
  EXPECT_FALSE(axis.cascade.enabled());
}

}  // namespace
}  // namespace loops_current_test
}  // namespace servodrome::drive::test
