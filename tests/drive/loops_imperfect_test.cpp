#include <algorithm>
#include <gtest/gtest.h>
#include <vector>

#include "loops_support.hpp"
#include "velocity_margin.hpp"

// The loops with a power stage that has a delay, and with sensors that have errors.
namespace servodrome::drive::test {
namespace loops_imperfect_test {
namespace {

plant::Parameters late_stage(int delay_ticks) {
  plant::Parameters parameters = frictionless(131072);
  parameters.stage.ideal = false;
  parameters.stage.delay_ticks = delay_ticks;
  parameters.stage.dead_time_us = 0.0;
  parameters.stage.switch_drop_v = 0.0;
  parameters.stage.modulation_limit = 1.0;
  return parameters;
}

MotorData told_of_delay(MotorData motor, int delay_ticks) {
  motor.voltage_delay_ticks = static_cast<std::uint8_t>(delay_ticks);
  return motor;
}

// If the winding's pole is cancelled and the delay is d ticks, the closed loop is i(k+1) = i(k) + (1 - p) (I - i(k -
// d)).
TEST(LateStage, CurrentLoopIsTheDesignedOneWithItsDelay) {
  for (int delay = 0; delay <= 3; ++delay) {
    for (const float bandwidth_hz : {300.0F, 600.0F, 1000.0F}) {
      SCOPED_TRACE(delay);
      SCOPED_TRACE(bandwidth_hz);
      Axis axis(late_stage(delay));
      axis.plant.lock_rotor(true);
      axis.gains.current_bandwidth_hz = bandwidth_hz;
      axis.gains.torque_filter_hz = 0.0F;
      axis.configure();
      axis.demand.loop = Loop::torque;
      axis.demand.torque = 0.2F;
      const double target_a = 0.2 * static_cast<double>(axis.motor.rated_torque_nm) /
                              static_cast<double>(axis.motor.torque_constant_nm_per_a);
      const double share = -std::expm1(-2.0 * pi * static_cast<double>(bandwidth_hz) * tick_seconds);
      std::vector<double> current(static_cast<std::size_t>(delay) + 1, 0.0);  // the last element is the present tick
      for (int k = 1; k <= 80; ++k) {
        axis.tick();
        current.push_back(current.back() +
                          share * (target_a - current[current.size() - 1 - static_cast<std::size_t>(delay)]));
        // The controller begins with the first tick: the demand before it is zero.
        if (k <= delay) current.back() = 0.0;
        ASSERT_NEAR(axis.plant.current_a(), current.back(), 1.0e-3 * target_a) << "tick " << k;
      }
    }
  }
}

// At 2500 rpm the rotor turns by 4.7 electrical degrees in a tick. A drive that knows its delay rotates the voltage of
// a torque step to the angle at which the rotor will be, so less of the current becomes direct current.
TEST(LateStage, VoltagesAreTurnedByTheDelay) {
  const auto direct_share = [](int told) {
    Axis axis(late_stage(2));
    axis.motor = told_of_delay(axis.motor, told);
    axis.gains.torque_filter_hz = 0.0F;
    axis.configure();
    axis.demand.loop = Loop::velocity;
    axis.demand.velocity = static_cast<float>(axis.counts_per_s(2500.0));
    axis.run_seconds(0.5);
    axis.demand.loop = Loop::torque;
    axis.demand.torque = 1.0F;
    double greatest = 0.0;
    for (int i = 0; i < 32; ++i) {
      axis.tick();
      greatest = std::max(greatest, std::abs(axis.plant.direct_current_a()));
    }
    return greatest / static_cast<double>(axis.motor.rated_current_a);
  };
  const double untold = direct_share(0);
  EXPECT_GT(untold, 0.3);
  EXPECT_LT(direct_share(2), 0.6 * untold) << "the rest is what the axes couple while the voltage is on its way";
}

// The gains are calculated for 55 degrees with all delays, including that of the stage; sampling at 8 kHz reduces this
// by up to 2 degrees.
TEST(LateStage, VelocityLoopKeepsItsPhaseMargin) {
  for (int delay = 0; delay <= 2; ++delay) {
    for (const float wanted_hz : {50.0F, 100.0F, 200.0F}) {
      SCOPED_TRACE(delay);
      SCOPED_TRACE(wanted_hz);
      plant::Parameters parameters = late_stage(delay);
      parameters.encoder.counts_per_revolution = 1 << 23;
      Axis axis(parameters);
      axis.motor = told_of_delay(axis.motor, delay);
      axis.gains = default_gains(axis.motor, axis.rates, {.velocity_hz = wanted_hz});
      axis.configure();
      const Margin margin = velocity_margin(axis, 20.0, 400.0);
      EXPECT_GT(margin.crossover_hz, 20.0);
      EXPECT_GT(margin.degrees, 53.0);
      EXPECT_LT(margin.degrees, 75.0);
    }
  }
}

// A move with all effects: the axis arrives, and its deviation at rest is within the noise and the errors of the
// encoder.
TEST(RealSensors, AMoveArrivesAndStands) {
  plant::Parameters parameters;
  parameters.supply.charged_at_start = true;
  parameters.stage.ideal = parameters.sensors.ideal = false;
  Axis axis(parameters);
  axis.motor = told_of_delay(axis.motor, 1);
  axis.gains = default_gains(axis.motor, axis.rates, {});
  axis.configure();
  axis.demand.loop = Loop::position;
  axis.run_seconds(0.2);
  const Counts start = axis.plant.position_counts();
  const double speed = axis.counts_per_s(1000.0);
  double position = 0.0;
  for (int k = 0; k < 1000; ++k) {  // half a second at 1000 rpm
    position += speed * 500e-6;
    axis.demand.position = start + std::llround(position);
    axis.demand.velocity = static_cast<float>(speed);
    axis.run_seconds(500e-6);
  }
  axis.demand.velocity = 0.0F;
  axis.run_seconds(0.5);
  const double arcsec = 131072.0 / (360.0 * 3600.0);  // counts
  for (int k = 0; k < 200; ++k) {
    axis.run_seconds(1e-3);
    EXPECT_NEAR(static_cast<double>(axis.plant.position_counts() - axis.demand.position), 0.0, 28.0 * arcsec + 8.0);
    EXPECT_LT(std::abs(axis.plant.velocity_rpm()), 5.0);
  }
}

}  // namespace
}  // namespace loops_imperfect_test
}  // namespace servodrome::drive::test
