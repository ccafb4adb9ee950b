// The voltages and currents in the rotor's frame, as signals of a line.
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>
#include <string>

#include "axis_rig.hpp"
#include "line/tap.hpp"

namespace servodrome::master {
namespace voltage_signals_test {
namespace {

using test::AxisRig;

double value_of(AxisRig& rig, const char* name) { return line::signal_channel(rig.drive(), name).value(); }

void expect_equations_hold(const char* product, const char* axis_text, double phases_half) {
  const std::string text = std::string("ideal = true\n") + axis_text;
  AxisRig rig({.product = product, .axis_text = text.c_str()});
  EXPECT_TRUE(std::isnan(value_of(rig, "quadrature_voltage_v"))) << "no switch works";
  EXPECT_TRUE(std::isnan(value_of(rig, "direct_voltage_v")));
  Axis402 axis(rig.objects(), rig.options());
  axis.enable();
  const double counts = rig.drive().settings().plant.encoder.counts_per_revolution;
  axis.run_at(static_cast<std::int32_t>(30.0 * counts), {}, std::chrono::seconds(10));
  rig.line.run_until(rig.line.now() + std::chrono::milliseconds(500));

  const plant::Motor& motor = rig.drive().settings().plant.motor;
  const double iq = value_of(rig, "current_a");
  const double id = value_of(rig, "direct_current_a");
  const double shaft_rad_s = value_of(rig, "velocity_rpm") * std::numbers::pi / 30.0;
  const double electrical_rad_s = motor.pole_pairs * shaft_rad_s;
  EXPECT_NEAR(shaft_rad_s, 30.0 * 2.0 * std::numbers::pi, 1.0);
  const double constant = motor.torque_constant_nm_per_a / (phases_half * std::numbers::sqrt2);
  const double d = motor.resistance_ohm * id - electrical_rad_s * motor.quadrature_inductance_h * iq;
  const double q =
      motor.resistance_ohm * iq + electrical_rad_s * motor.direct_inductance_h * id + constant * shaft_rad_s;
  // A voltage set now acts in the next tick; in the middle of that the rotor has turned by half a tick.
  const double turned = electrical_rad_s * 0.5 * drive::tick_seconds;
  EXPECT_NEAR(value_of(rig, "direct_voltage_v"), d * std::cos(turned) - q * std::sin(turned), 0.005 * q);
  EXPECT_NEAR(value_of(rig, "quadrature_voltage_v"), q * std::cos(turned) + d * std::sin(turned), 0.005 * q);
}

TEST(VoltageSignals, AreWhatTheWindingsNeed) { expect_equations_hold("generic402", "", 1.5); }

TEST(VoltageSignals, OfTwoPhasesAreThoseOfAWinding) {
  expect_equations_hold("generic402", "[axis.motor]\nphases = 2\n", 1.0);
}

}  // namespace
}  // namespace voltage_signals_test
}  // namespace servodrome::master
