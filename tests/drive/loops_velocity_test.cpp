#include <array>
#include <complex>
#include <gtest/gtest.h>

#include "loops_support.hpp"

namespace servodrome::drive::test {
namespace loops_velocity_test {
namespace {

// The continuous model from which the velocity loop was designed: inertia, first-order current loop, PI, two low
// passes. The sampled loop adds half a period each for the difference of positions and for the hold. Its low passes,
// exact for a held input, are each half a period faster than their prototypes, so to first order the delays cancel. A
// step exactly at a sample is not delayed by the hold and therefore acts half a period early.
struct ContinuousVelocityLoop {
  double kp_nms, ki_nm, weight, inertia_kgm2, current_rad_s, velocity_filter_rad_s, torque_filter_rad_s;
  double reference_rad_s;

  // speed, filtered speed, integral, filtered torque, torque
  using State = std::array<double, 5>;
  State derivative(const State& x) const {
    const double error = reference_rad_s - x[1];
    const double torque = kp_nms * (weight * reference_rad_s - x[1]) + x[2];
    return {x[4] / inertia_kgm2, velocity_filter_rad_s * (x[0] - x[1]), ki_nm * error,
            torque_filter_rad_s * (torque - x[3]), current_rad_s * (x[3] - x[4])};
  }
  State stepped(const State& x, double h) const {
    const auto plus = [](const State& a, double scale, const State& b) {
      State sum;
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] = a[i] + scale * b[i];
      return sum;
    };
    const State k1 = derivative(x);
    const State k2 = derivative(plus(x, h / 2.0, k1));
    const State k3 = derivative(plus(x, h / 2.0, k2));
    const State k4 = derivative(plus(x, h, k3));
    State next = x;
    for (std::size_t i = 0; i < next.size(); ++i) next[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
    return next;
  }
};

// Runge-Kutta with a sixteenth of a tick: its own error is below 1e-9 of the step.
TEST(VelocityLoop, StepFollowsTheContinuousModel) {
  for (const float bandwidth_hz : {40.0F, 100.0F}) {
    for (const float weight : {1.0F, 0.4F}) {
      Axis axis(frictionless(1 << 23), {2, 8}, {1000.0F, bandwidth_hz, 100.0F});
      axis.gains.velocity_setpoint_weight = weight;
      axis.configure();
      const double step_rad_s = 10.0;
      const auto kt = static_cast<double>(axis.motor.torque_constant_nm_per_a);
      const ContinuousVelocityLoop model{
          .kp_nms = static_cast<double>(axis.gains.velocity_kp) * kt,
          .ki_nm = static_cast<double>(axis.gains.velocity_ki) * kt,
          .weight = static_cast<double>(weight),
          .inertia_kgm2 = static_cast<double>(axis.motor.inertia_kgm2),
          .current_rad_s = 2.0 * pi * 1000.0,
          .velocity_filter_rad_s = 2.0 * pi * static_cast<double>(axis.gains.velocity_filter_hz),
          .torque_filter_rad_s = 2.0 * pi * static_cast<double>(axis.gains.torque_filter_hz),
          .reference_rad_s = step_rad_s};
      ContinuousVelocityLoop::State x{};
      for (int i = 0; i < 16; ++i) x = model.stepped(x, tick_seconds / 16.0);  // half a velocity period
      axis.demand.loop = Loop::velocity;
      axis.demand.velocity = static_cast<float>(step_rad_s * axis.counts_per_rad);
      double worst = 0.0;
      for (int k = 0; k < 3200; ++k) {
        axis.tick();
        for (int i = 0; i < 16; ++i) x = model.stepped(x, tick_seconds / 16.0);
        worst = std::max(worst, std::fabs(axis.plant.velocity_rpm() * pi / 30.0 - x[0]));
      }
      EXPECT_LT(worst, 0.02 * step_rad_s) << bandwidth_hz << " Hz, weight " << weight;
      EXPECT_NEAR(axis.plant.velocity_rpm() * pi / 30.0, step_rad_s, 1.0e-3 * step_rad_s);
    }
  }
}

// The open-loop response at one frequency, measured in the closed loop: measured velocity divided by velocity error, as
// the controller uses them at the end of each velocity period.
std::complex<double> open_loop(Axis& axis, double frequency_hz, double offset_rpm, double amplitude_rpm) {
  const double period_s = tick_seconds * axis.rates.velocity_loop_ticks;
  axis.demand.loop = Loop::velocity;
  std::complex<double> error = 0.0;
  std::complex<double> measured = 0.0;
  const int settle_periods = static_cast<int>(0.3 / period_s);
  // Whole cycles, so that the offset is eliminated.
  const int cycles = static_cast<int>(std::ceil(0.5 * frequency_hz));
  const int periods = static_cast<int>(std::lround(cycles / (frequency_hz * period_s)));
  const double w = 2.0 * pi * cycles / periods;
  for (int k = 0; k < settle_periods + periods; ++k) {
    axis.demand.velocity =
        static_cast<float>(axis.counts_per_s(offset_rpm + amplitude_rpm * std::sin(w * (k - settle_periods))));
    for (int i = 0; i < axis.rates.velocity_loop_ticks; ++i) axis.tick();
    if (k < settle_periods) continue;
    const CascadeState& state = axis.cascade.state();
    const auto turn = std::polar(1.0, -w * k);
    const auto velocity = static_cast<double>(state.velocity_counts_per_s);
    error += turn * (static_cast<double>(state.velocity_reference_counts_per_s) - velocity);
    measured += turn * velocity;
  }
  return measured / error;
}

struct Margin {
  double crossover_hz;
  double phase_degrees;
};

Margin margin(const plant::Parameters& parameters, Rates rates, Bandwidths bandwidths, double designed_hz) {
  double low_hz = 0.3 * designed_hz;
  double high_hz = 3.0 * designed_hz;
  std::complex<double> response;
  for (int i = 0; i < 8; ++i) {
    const double frequency_hz = std::sqrt(low_hz * high_hz);
    Axis axis(parameters, rates, bandwidths);
    response = open_loop(axis, frequency_hz, 300.0, 20.0);
    (std::abs(response) > 1.0 ? low_hz : high_hz) = frequency_hz;
  }
  return {std::sqrt(low_hz * high_hz), 180.0 + std::arg(response) * 180.0 / pi};
}

TEST(VelocityLoop, CrossoverAndPhaseMarginAreTheDesigned) {
  for (const Rates rates : {Rates{2, 8}, Rates{4, 16}}) {
    for (const float bandwidth_hz : {30.0F, 60.0F, 100.0F}) {
      for (const double inertia_ratio : {1.0, 10.0}) {
        plant::Parameters parameters = frictionless(1 << 20);
        parameters.load.inertia_kgm2 = inertia_ratio * parameters.motor.rotor_inertia_kgm2;
        const Margin found =
            margin(parameters, rates, {1000.0F, bandwidth_hz, 100.0F}, static_cast<double>(bandwidth_hz));
        EXPECT_NEAR(found.crossover_hz, static_cast<double>(bandwidth_hz), 0.15 * static_cast<double>(bandwidth_hz));
        EXPECT_GT(found.phase_degrees, 50.0);
        EXPECT_LT(found.phase_degrees, 70.0);
      }
    }
  }
}

// If more bandwidth is requested than the delays allow, default_gains returns gains that keep the margin.
TEST(VelocityLoop, TooHighABandwidthIsLowered) {
  const plant::Parameters parameters = frictionless(1 << 20);
  const Bandwidths wanted{1000.0F, 1000.0F, 1000.0F};
  const Gains gains = default_gains(motor_data(parameters), {}, wanted);
  const double given_hz = static_cast<double>(gains.velocity_filter_hz) / 12.0;
  EXPECT_LT(given_hz, 300.0);
  EXPECT_FLOAT_EQ(gains.position_kp, static_cast<float>(2.0 * pi * given_hz / 5.0));
  const Margin found = margin(parameters, {}, wanted, given_hz);
  EXPECT_NEAR(found.crossover_hz, given_hz, 0.15 * given_hz);
  EXPECT_GT(found.phase_degrees, 50.0);
}

// One count of a coarse encoder must not cause more torque than a tenth of the rated torque.
TEST(VelocityLoop, ACoarseEncoderLowersTheBandwidth) {
  const MotorData motor = motor_data(frictionless(2500));
  const Gains gains = default_gains(motor, {}, {});
  const float count_rad_s = 2.0F * static_cast<float>(pi) / 2500.0F * 8000.0F;
  const float velocity_rad_s = count_rad_s * low_pass_gain(gains.velocity_filter_hz, 125.0e-6F);
  EXPECT_LT(gains.velocity_kp * velocity_rad_s * motor.torque_constant_nm_per_a, 0.1F * motor.rated_torque_nm);
  EXPECT_GT(gains.velocity_filter_hz / 12.0F, 30.0F);
}

// A large step accelerates with the torque limit and then ends without the overshoot of integral windup.
TEST(VelocityLoop, NoWindUpAtTheTorqueLimit) {
  for (const float limit : {0.3F, 1.0F, 2.5F}) {
    Axis axis(frictionless(131072));
    axis.demand.loop = Loop::velocity;
    axis.demand.torque_limit_positive = limit;
    axis.demand.velocity = static_cast<float>(axis.counts_per_s(2000.0));
    const double acceleration_rpm_s =
        static_cast<double>(limit * axis.motor.rated_torque_nm / axis.motor.inertia_kgm2) * 30.0 / pi;
    const double ramp_s = 2000.0 / acceleration_rpm_s;
    axis.run_seconds(0.5 * ramp_s);
    EXPECT_TRUE(axis.cascade.state().torque_limited);
    EXPECT_NEAR(axis.plant.torque_nm(), static_cast<double>(limit * axis.motor.rated_torque_nm),
                0.015 * static_cast<double>(limit));
    double largest_rpm = 0.0;
    for (double t = 0.5 * ramp_s; t < ramp_s + 0.3; t += tick_seconds) {
      axis.tick();
      largest_rpm = std::max(largest_rpm, axis.plant.velocity_rpm());
    }
    // The same PI overshoots by less than a fifth on a step without saturation. Here the overshoot must be less than a
    // fifth of the remaining step at the end of the saturation, limit * rated / kp.
    const double linear_rpm =
        static_cast<double>(
            limit / (axis.gains.velocity_kp * axis.motor.torque_constant_nm_per_a / axis.motor.rated_torque_nm)) *
        30.0 / pi;
    EXPECT_LT(largest_rpm, 2000.0 + 0.2 * linear_rpm);
    EXPECT_NEAR(axis.plant.velocity_rpm(), 2000.0, 1.0);
    EXPECT_FALSE(axis.cascade.state().torque_limited);
  }
}

// A load above the limit holds the axis and then releases it: the integral must not have changed.
TEST(VelocityLoop, NoWindUpWhileStalled) {
  Axis axis(frictionless(131072));
  axis.demand.loop = Loop::velocity;
  axis.demand.torque_limit_positive = 1.0F;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(100.0));
  axis.plant.lock_rotor(true);
  axis.run_seconds(5.0);
  EXPECT_TRUE(axis.cascade.state().torque_limited);
  axis.plant.lock_rotor(false);
  axis.demand.velocity = 0.0F;
  double largest_rpm = 0.0;
  for (int i = 0; i < 8000; ++i) {
    axis.tick();
    largest_rpm = std::max(largest_rpm, axis.plant.velocity_rpm());
  }
  // The integral that the limit stored: seven tenths of the rated torque, reduced with the integral's time constant.
  EXPECT_LT(largest_rpm, 300.0);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.0, 0.5);
}

// A lowered limit also reduces the integral: the earlier torque does not return when the limit is raised again.
TEST(VelocityLoop, HoldsALoadAndYieldsToALoweredLimit) {
  plant::Parameters parameters = frictionless(131072);
  parameters.load.gravity_torque_nm = 0.5;
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  axis.run_seconds(1.0);
  EXPECT_NEAR(axis.plant.torque_nm(), 0.5, 0.01);
  // The axis oscillates about an edge of the encoder: one count in a period of the velocity loop is 3.7 rpm.
  EXPECT_NEAR(axis.plant.velocity_rpm(), 0.0, 0.4);
  axis.demand.torque_limit_positive = 0.2F;
  axis.run_seconds(0.05);
  EXPECT_TRUE(axis.cascade.state().torque_limited);
  EXPECT_NEAR(axis.plant.torque_nm(), 0.2 * parameters.motor.rated_torque_nm, 2.0e-3);
  EXPECT_LT(axis.plant.velocity_rpm(), -50.0);

  axis.plant.lock_rotor(true);
  axis.run_seconds(0.1);
  axis.demand.torque_limit_positive = 0.1F;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(100.0));
  axis.run_seconds(0.1);
  axis.demand.torque_limit_positive = 3.0F;
  axis.demand.velocity = 0.0F;
  axis.run_seconds(0.01);
  EXPECT_NEAR(static_cast<double>(axis.cascade.state().torque_reference), 0.1, 0.01);
}

TEST(VelocityLoop, ReferenceIsClippedAndStandstillIsExactlyZero) {
  plant::Parameters parameters;
  parameters.supply.charged_at_start = true;
  parameters.encoder.counts_per_revolution = 2500;
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(3000.0));
  axis.demand.velocity_limit_positive = static_cast<float>(axis.counts_per_s(500.0));
  axis.run_seconds(0.5);
  EXPECT_TRUE(axis.cascade.state().velocity_limited);
  EXPECT_NEAR(axis.plant.velocity_rpm(), 500.0, 5.0);
  axis.demand.velocity = 0.0F;
  axis.run_seconds(0.5);
  EXPECT_FALSE(axis.cascade.state().velocity_limited);
  EXPECT_EQ(axis.cascade.state().velocity_counts_per_s, 0.0F);
  EXPECT_EQ(axis.plant.velocity_rpm(), 0.0);
  const float torque = axis.cascade.state().torque_reference;
  axis.run_seconds(1.0);
  EXPECT_EQ(axis.cascade.state().torque_reference, torque);
}

// A turning axis is enabled without a jump of torque: velocity and back-EMF are known immediately.
TEST(VelocityLoop, EnablesOnATurningAxis) {
  Axis axis(frictionless(131072));
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(1500.0));
  axis.run_seconds(0.5);
  axis.cascade.disable();
  axis.actuation.pwm_enabled = false;
  axis.run_seconds(0.1);
  EXPECT_NEAR(axis.measured_rpm(), 1500.0, 5.0);
  axis.actuation.pwm_enabled = true;
  axis.cascade.enable(axis.feedback);
  double largest_a = 0.0;
  for (int i = 0; i < 1600; ++i) {
    axis.tick();
    largest_a = std::max(largest_a, std::fabs(axis.plant.current_a()));
  }
  EXPECT_LT(largest_a, 0.1 * static_cast<double>(axis.motor.rated_current_a));
  EXPECT_NEAR(axis.plant.velocity_rpm(), 1500.0, 2.0);
}

// Without power and motion the drive skips the calculation; the first count is measured as usual.
TEST(VelocityLoop, WithoutPowerIsMeasuredFromTheFirstCountAfterALongRest) {
  for (const int odd : {0, 1}) {
    Axis axis(frictionless(1 << 17));
    axis.cascade.disable();
    axis.actuation.pwm_enabled = false;
    Feedback still = axis.feedback;
    Axis never(frictionless(1 << 17));
    never.cascade.disable();
    for (int tick = 0; tick < 16000 + odd; ++tick) axis.cascade.tick(still, axis.actuation);
    for (int tick = 0; tick < odd; ++tick) never.cascade.tick(still, never.actuation);
    Feedback turning = still;
    for (int tick = 0; tick < 400; ++tick) {
      turning.position_counts += 20;
      turning.phase_current_a = {0.5F, -0.25F, -0.25F};
      axis.cascade.tick(turning, axis.actuation);
      never.cascade.tick(turning, never.actuation);
      ASSERT_EQ(axis.cascade.state().velocity_counts_per_s, never.cascade.state().velocity_counts_per_s);
      ASSERT_EQ(axis.cascade.state().mean_torque, never.cascade.state().mean_torque);
    }
    EXPECT_NEAR(static_cast<double>(axis.cascade.state().velocity_counts_per_s), 20.0 * 16000.0, 3200.0);
    turning.phase_current_a = {};
    for (int tick = 0; tick < 16000; ++tick) axis.cascade.tick(turning, axis.actuation);
    EXPECT_EQ(axis.cascade.state().velocity_counts_per_s, 0.0F);
    EXPECT_EQ(axis.cascade.state().mean_torque, 0.0F);
  }
}

// The same applies to the motion back to the count at which the axis stood when the drive started.
TEST(VelocityLoop, WithoutPowerIsMeasuredBackToWhereItBegan) {
  Axis axis(frictionless(1 << 17));
  axis.cascade.disable();
  Feedback shaft = axis.feedback;
  const Counts began = shaft.position_counts;
  const auto stands_for = [&](Counts position, int ticks) {
    shaft.position_counts = position;
    float fastest = 0.0F;
    for (int tick = 0; tick < ticks; ++tick) {
      axis.cascade.tick(shaft, axis.actuation);
      const float velocity = axis.cascade.state().velocity_counts_per_s;
      if (std::abs(velocity) > std::abs(fastest)) fastest = velocity;
    }
    return fastest;
  };
  stands_for(began, 16);
  EXPECT_GT(stands_for(began + 20, 16000), 0.0F);
  EXPECT_EQ(axis.cascade.state().velocity_counts_per_s, 0.0F);
  EXPECT_LT(stands_for(began, 16), 0.0F);
}

// A load of 150 rotor inertias oscillates about the demand, because the gains are for the rotor alone. At the reversal
// the integral balances the proportional part.
TEST(VelocityLoop, ANewBeginningDropsTheIntegralThatBalancedASwing) {
  plant::Parameters parameters = frictionless(1 << 17);
  Axis axis(parameters);
  parameters.load.inertia_kgm2 = 150.0 * parameters.motor.rotor_inertia_kgm2;
  axis.plant = plant::Plant(parameters);
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(100.0));
  double before = 0.0;
  do {
    before = axis.plant.velocity_rpm();
    axis.run_seconds(0.002);
  } while (axis.plant.velocity_rpm() >= before);
  ASSERT_GT(before, 130.0);  // it overshoots
  axis.demand.velocity = axis.cascade.state().velocity_counts_per_s;
  const auto changed_rpm = [&](bool from_shaft) {
    Axis tried = axis;
    tried.demand.from_shaft = from_shaft;
    tried.run_seconds(static_cast<double>(tried.cascade.ticks_to_position_loop() + 1) * tick_seconds);
    tried.demand.from_shaft = false;
    tried.run_seconds(0.02);
    return tried.plant.velocity_rpm() - before;
  };
  EXPECT_GT(changed_rpm(false), 5.0);
  EXPECT_LT(std::abs(changed_rpm(true)), 0.4 * changed_rpm(false));
}

// The torque that holds a weight is the load's share, also while a jump of the demand saturates the torque. Without it
// the speed differs by 130 rpm.
TEST(VelocityLoop, ANewBeginningKeepsTheTorqueThatHoldsAWeight) {
  plant::Parameters parameters = frictionless(1 << 17);
  parameters.load.gravity_torque_nm = 0.5 * parameters.motor.rated_torque_nm;
  Axis axis(parameters);
  axis.demand.loop = Loop::velocity;
  axis.run_seconds(0.5);
  for (const double jump_rpm : {3000.0, -3000.0}) {
    Axis jumped = axis;
    jumped.demand.velocity = static_cast<float>(axis.counts_per_s(jump_rpm));
    jumped.run_seconds(0.002);
    ASSERT_TRUE(jumped.cascade.state().torque_limited);
    jumped.demand.velocity = jumped.cascade.state().velocity_counts_per_s;
    Axis anew = jumped;
    anew.demand.from_shaft = true;
    for (int ms = 0; ms < 50; ++ms) {
      jumped.run_seconds(0.001);
      anew.run_seconds(0.001);
      anew.demand.from_shaft = false;
      EXPECT_NEAR(anew.plant.velocity_rpm(), jumped.plant.velocity_rpm(), 60.0) << "after " << ms << " ms";
    }
  }
}

// Only the value 0 switches the filter of the command off: the lowest corner frequency filters most.
TEST(VelocityLoop, ACommandFilterMayBeAsSlowAsItLikes) {
  Axis axis(frictionless(1 << 17));
  axis.gains.velocity_command_filter_hz = 0.5F;
  axis.configure();
  axis.demand.loop = Loop::velocity;
  axis.demand.velocity = static_cast<float>(axis.counts_per_s(300.0));
  axis.run_seconds(0.5);
  const double expected = 300.0 * (1.0 - std::exp(-2.0 * pi * 0.5 * 0.5));
  const auto reference = static_cast<double>(axis.cascade.state().velocity_reference_counts_per_s);
  EXPECT_NEAR(reference, axis.counts_per_s(expected), axis.counts_per_s(1.0));
  EXPECT_NEAR(axis.plant.velocity_rpm(), expected, 3.0);
}

// The axis rested with its loops off; the estimate from a torque's current is cleared when that current has ended.
TEST(VelocityLoop, ATorqueBetweenTwoRestsIsNotShownForEver) {
  Axis axis(frictionless(1 << 17));
  axis.demand.loop = Loop::off;
  axis.cascade.set_demand(axis.demand);
  for (int tick = 0; tick < 160; ++tick) axis.cascade.tick(axis.feedback, axis.actuation);
  axis.demand.loop = Loop::torque;
  axis.cascade.set_demand(axis.demand);
  Feedback held = axis.feedback;
  held.phase_current_a = {1.0F, -0.5F, -0.5F};
  for (int tick = 0; tick < 16; ++tick) axis.cascade.tick(held, axis.actuation);
  EXPECT_NE(axis.cascade.state().current_d_a, 0.0F);
  axis.cascade.disable();
  for (int tick = 0; tick < 16; ++tick) axis.cascade.tick(axis.feedback, axis.actuation);
  EXPECT_EQ(axis.cascade.state().current_d_a, 0.0F);
  EXPECT_EQ(axis.cascade.state().mean_torque, 0.0F);
}

}  // namespace
}  // namespace loops_velocity_test
}  // namespace servodrome::drive::test
