// Frequency responses computed from whole signals, compared with systems whose response is known in closed form.
#include "tools/tuning/spectrum.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <numbers>

namespace servodrome::master::tuning {
namespace spectrum_test {
namespace {

constexpr double sample_s = 1.0 / 4000.0;

// A sine sweep from `from_hz` to `to_hz`, with rest before and after.
std::vector<double> sweep(double from_hz, double to_hz, double seconds) {
  std::vector<double> values(static_cast<std::size_t>(seconds * 1.1 / sample_s));
  const double growth = std::log(to_hz / from_hz);
  for (std::size_t n = 0; n < values.size(); ++n) {
    const double t = static_cast<double>(n) * sample_s - 0.02 * seconds;
    if (t < 0 || t > seconds) continue;
    values[n] = std::sin(2 * std::numbers::pi * from_hz * seconds / growth * std::expm1(growth * t / seconds));
  }
  return values;
}

// y(n) = a y(n-1) + (1 - a) x(n): its response is (1 - a) / (1 - a / z).
std::vector<double> lag(const std::vector<double>& input, double a) {
  std::vector<double> output(input.size());
  double y = 0.0;
  for (std::size_t n = 0; n < input.size(); ++n) output[n] = y = a * y + (1 - a) * input[n];
  return output;
}
Complex response_of_lag(double hz, double a) {
  return (1 - a) / (1.0 - a * std::polar(1.0, -2 * std::numbers::pi * hz * sample_s));
}

TEST(Spectrum, OfALagIsThatOfItsFormula) {
  const double a = 0.95;
  const auto input = sweep(2.0, 400.0, 4.0);
  const auto points = response_of_signals(input, lag(input, a), sample_s, {.lowest_hz = 3.0, .highest_hz = 350.0});
  ASSERT_GT(points.size(), 30U);
  for (const ResponsePoint& point : points) {
    const Complex expected = response_of_lag(point.frequency_hz, a);
    EXPECT_NEAR(std::abs(point.response) / std::abs(expected), 1.0, 0.02) << point.frequency_hz;
    EXPECT_NEAR(std::arg(point.response / expected), 0.0, 0.02) << point.frequency_hz;
    EXPECT_GT(point.coherence, 0.99) << point.frequency_hz;
  }
}

TEST(Spectrum, OfADelayIsItsPhase) {
  const auto input = sweep(2.0, 400.0, 4.0);
  std::vector<double> output(input.size());
  constexpr std::size_t delay = 8;  // 2 ms
  for (std::size_t n = delay; n < input.size(); ++n) output[n] = -2.0 * input[n - delay];
  for (const ResponsePoint& point :
       response_of_signals(input, output, sample_s, {.lowest_hz = 3.0, .highest_hz = 350.0})) {
    const Complex expected = -2.0 * std::polar(1.0, -2 * std::numbers::pi * point.frequency_hz * delay * sample_s);
    EXPECT_NEAR(std::abs(point.response / expected - 1.0), 0.0, 0.03) << point.frequency_hz;
  }
}

// Noise in the output lowers the coherence.
TEST(Spectrum, NoiseTakesTheCoherenceAway) {
  const auto input = sweep(2.0, 400.0, 4.0);
  auto output = lag(input, 0.95);
  std::uint32_t random = 1;
  std::vector<double> noise(output.size());
  for (std::size_t n = 0; n < output.size(); ++n) {
    random = random * 1664525U + 1013904223U;
    noise[n] = static_cast<double>(random >> 8U) / 8388608.0 - 1.0;
    output[n] += 0.5 * noise[n];
  }
  const SpectrumRequest request{.lowest_hz = 3.0, .highest_hz = 350.0};
  const auto noisy = response_of_signals(input, output, sample_s, request);
  const auto unrelated = response_of_signals(input, noise, sample_s, request);
  ASSERT_FALSE(noisy.empty());
  EXPECT_GT(noisy.front().coherence, 0.9);  // where the lag has a high gain
  EXPECT_LT(noisy.back().coherence, noisy.front().coherence);
  double mean = 0.0;
  for (const ResponsePoint& point : unrelated) mean += point.coherence / static_cast<double>(unrelated.size());
  EXPECT_LT(mean, 0.3);
}

TEST(Spectrum, OfNothingIsEmpty) {
  EXPECT_TRUE(response_of_signals({}, {}, sample_s, {}).empty());
  const std::vector<double> still(1000, 5.0);
  EXPECT_TRUE(response_of_signals(still, still, sample_s, {}).empty());
  // There are no points below the frequency resolution of the recording.
  const auto input = sweep(20.0, 400.0, 0.5);
  const auto points = response_of_signals(input, input, sample_s, {.lowest_hz = 0.01, .highest_hz = 350.0});
  ASSERT_FALSE(points.empty());
  EXPECT_GT(points.front().frequency_hz, 4.0);
}

}  // namespace
}  // namespace spectrum_test
}  // namespace servodrome::master::tuning
