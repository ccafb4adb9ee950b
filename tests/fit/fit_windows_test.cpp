// Moments over window functions, and the regression over them, tested with signals whose derivatives are known.
#include <cmath>
#include <gtest/gtest.h>

#include "fit/regression.hpp"
#include "fit_rig.hpp"

namespace servodrome::fit {
namespace fit_windows_test {
namespace {

// Irregular times: one to three milliseconds apart.
std::vector<double> uneven_times() {
  test::Draw draw(7);
  std::vector<double> seconds{0.0};
  while (seconds.back() < 2.0) seconds.push_back(seconds.back() + draw.uniform(1e-3, 3e-3));
  return seconds;
}

template <typename Function>
std::vector<double> sampled(const std::vector<double>& seconds, Function function) {
  std::vector<double> values;
  for (const double t : seconds) values.push_back(function(t));
  return values;
}

unsigned compared(const std::vector<double>& moments, double constant, double tolerance) {
  unsigned whole = 0;
  for (const double moment : moments) {
    if (!std::isfinite(moment)) continue;
    EXPECT_NEAR(moment, constant, tolerance);
    ++whole;
  }
  return whole;
}

TEST(FitWindows, StraightLinesAreExactWhateverTheTimes) {
  const std::vector<double> seconds = uneven_times();
  const Windows windows(seconds, 0.1);
  const std::vector<double> far = sampled(seconds, [](double) { return 1e6; });
  const std::vector<double> line = sampled(seconds, [](double t) { return 1e6 + 3.0 * t; });
  for (const Half half : {Half::all, Half::even, Half::odd}) {
    EXPECT_GT(compared(windows.moments(far, 0, 0.0, half), 1e6, 1e-4), 60U);
    EXPECT_GT(compared(windows.moments(far, 1, 0.0, half), 0.0, 1e-5), 60U);
    EXPECT_GT(compared(windows.moments(line, 1, 0.0, half), 3.0, 1e-5), 60U);
    EXPECT_GT(compared(windows.moments(line, 2, 0.0, half), 0.0, 1e-2), 60U);
  }
}

TEST(FitWindows, DerivativesAreThoseOfTheSignal) {
  std::vector<double> seconds;
  for (int i = 0; i < 2000; ++i) seconds.push_back(1e-3 * i);
  const Windows windows(seconds, 0.1);
  const std::vector<double> square = sampled(seconds, [](double t) { return 4.0 * t * t; });
  const std::vector<double> cube = sampled(seconds, [](double t) { return 2.0 * t * t * t; });
  EXPECT_GT(compared(windows.moments(square, 2, 0.0, Half::all), 8.0, 1e-4), 60U);
  EXPECT_GT(compared(windows.moments(cube, 3, 0.0, Half::all), 12.0, 1e-3), 60U);
  // A signal that was sampled 20 ms ago, and a present one that is late by the same time.
  const std::vector<double> slow = sampled(seconds, [](double t) { return std::sin(5.0 * t); });
  const std::vector<double> late = sampled(seconds, [](double t) { return std::sin(5.0 * (t - 0.0204)); });
  const std::vector<double> moved = windows.moments(slow, 0, 0.0204, Half::all);
  const std::vector<double> now = windows.moments(late, 0, 0.0, Half::all);
  for (std::size_t i = 2; i + 2 < now.size(); ++i) EXPECT_NEAR(moved[i], now[i], 1e-5) << i;
}

TEST(FitWindows, GapsAndNumbersThatAreNoneAreLeftOut) {
  std::vector<double> seconds;
  for (int i = 0; i < 2000; ++i) seconds.push_back(1e-3 * i + (i < 1000 ? 0.0 : 0.05));
  std::vector<double> ones = sampled(seconds, [](double) { return 1.0; });
  ones[300] = std::nan("");
  const Windows windows(seconds, 0.1);
  const std::vector<double> moments = windows.moments(ones, 0, 0.0, Half::all);
  unsigned missing = 0;
  for (const double moment : moments) missing += std::isfinite(moment) ? 0U : 1U;
  // Four windows cover the sample, six the gap of half a window; others begin before the second or end after the last
  // sample.
  EXPECT_GE(missing, 10U);
  EXPECT_LE(missing, 13U);
}

// A column with much noise; plain least squares would give 3.9 in place of 5.
TEST(FitRegression, NoiseOfAColumnDoesNotDrawItsFactorDown) {
  test::Draw draw(11);
  std::vector<double> seconds;
  std::vector<double> left;
  std::vector<double> column;
  for (int i = 0; i < 40000; ++i) {
    seconds.push_back(1e-3 * i);
    const double truth = std::sin(3.0 * seconds.back()) + std::sin(7.7 * seconds.back());
    left.push_back(5.0 * truth);
    column.push_back(truth + 4.0 * draw.normal());
  }
  const Windows windows(seconds, 0.1);
  const Equation equation{.left = {{&left}}, .columns = {{{&column}}}};
  const Estimate estimate = regress(windows, {equation}, std::vector<char>(windows.size(), 1));
  ASSERT_TRUE(estimate.solved);
  EXPECT_NEAR(estimate.unknowns[0].value, 5.0, 0.2);
  EXPECT_LT(std::abs(estimate.unknowns[0].value - 5.0), estimate.unknowns[0].half_width);
  EXPECT_LT(estimate.unknowns[0].signal_share, 0.9);
}

}  // namespace
}  // namespace fit_windows_test
}  // namespace servodrome::fit
