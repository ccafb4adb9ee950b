// Measurements of curves whose properties are known.
#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

#include "scope/measurements.hpp"
#include "scope/recordings.hpp"

namespace servodrome::scope {
namespace scope_measurements_test {
namespace {

using namespace std::chrono_literals;
using test::made_of;

TEST(ScopeMeasurements, OfASine) {
  std::vector<double> sine;
  for (int i = 0; i < 1000; ++i) sine.push_back(3 + 2 * std::sin(2 * std::numbers::pi * i / 100));
  const Measurement measured = measure(made_of(sine, 1ms), 0);
  EXPECT_NEAR(measured.mean, 3, 1e-12);
  EXPECT_NEAR(measured.rms, std::sqrt(9 + 2), 1e-12);
  EXPECT_NEAR(measured.greatest, 5, 1e-12);
  EXPECT_NEAR(measured.least, 1, 1e-12);
  EXPECT_FALSE(measured.step);
}

// A second-order system: overshoot exp(-pi d / sqrt(1 - d^2)); it settles at the last crossing of the 2 % band.
TEST(ScopeMeasurements, OfAStep) {
  constexpr double damping = 0.4;
  constexpr double frequency = 2 * std::numbers::pi * 10;
  const double damped = frequency * std::sqrt(1 - damping * damping);
  std::vector<double> response(400, -50.0);
  const auto exact = [&](double t) {
    return 1 - std::exp(-damping * frequency * t) *
                   (std::cos(damped * t) + damping / std::sqrt(1 - damping * damping) * std::sin(damped * t));
  };
  for (int i = 0; i < 4000; ++i) response.push_back(-50 + 100 * exact(i * 0.1e-3));
  double settled = 0;
  for (int i = 0; i < 4000; ++i) {
    if (std::abs(exact(i * 0.1e-3) - 1) > 0.02) settled = (i + 1) * 0.1e-3;
  }
  double tenth = 0, nine_tenths = 0;
  while (exact(tenth) < 0.1) tenth += 1e-6;
  while (exact(nine_tenths) < 0.9) nine_tenths += 1e-6;
  for (const double sign : {1.0, -1.0}) {
    std::vector<double> signed_response = response;
    for (double& value : signed_response) value *= sign;
    const Measurement measured = measure(made_of(signed_response, 100us), 0);
    ASSERT_TRUE(measured.step);
    EXPECT_NEAR(measured.step->from, sign * -50, 1e-9);
    EXPECT_NEAR(measured.step->to, sign * 50, 1e-2);
    EXPECT_NEAR(measured.step->overshoot_percent,
                100 * std::exp(-std::numbers::pi * damping / std::sqrt(1 - damping * damping)), 0.1);
    EXPECT_NEAR(measured.step->settling_s, settled, 1e-3);
    EXPECT_NEAR(measured.step->rise_s, nine_tenths - tenth, 0.2e-3);
    EXPECT_NEAR(measured.step->begin_s, 0.04, 1e-3);
  }
}

TEST(ScopeMeasurements, WhatMovesAtTheEndIsNoStep) {
  std::vector<double> ramp(100, 0.0);
  for (int i = 0; i < 100; ++i) ramp.push_back(i);
  EXPECT_FALSE(measure(made_of(ramp, 1ms), 0).step);
  EXPECT_FALSE(measure(made_of(std::vector<double>(100, 4.0), 1ms), 0).step) << "a line";
  EXPECT_FALSE(measure(made_of({1}, 1ms), 0).step);
}

// The end differs a little from the start: this difference does not count as a step, and the motion does not count as
// overshoot.
TEST(ScopeMeasurements, ThereAndBackIsNoStep) {
  std::vector<double> way(100, 0.0);
  for (int i = 0; i <= 100; ++i) way.push_back(131072.0 * i / 100);
  for (int i = 100; i >= 0; --i) way.push_back(131072.0 * i / 100 + 230);
  way.insert(way.end(), 100, 230.0);
  EXPECT_FALSE(measure(made_of(way, 1ms), 0).step);
}

}  // namespace
}  // namespace scope_measurements_test
}  // namespace servodrome::scope
