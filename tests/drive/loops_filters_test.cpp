#include <cmath>
#include <complex>
#include <gtest/gtest.h>

#include "drive/loops/filters.hpp"
#include "drive/loops/i2t.hpp"
#include "loops_support.hpp"

namespace servodrome::drive::test {
namespace loops_filters_test {
namespace {

using Complex = std::complex<double>;

constexpr double period_s = 125.0e-6;

// The response to a sine after the transient, calculated from the filter's output.
template <typename Filter>
Complex measured_response(Filter filter, double frequency_hz) {
  const int settle = 16000;
  const int cycles = static_cast<int>(std::ceil(frequency_hz));
  const int samples = static_cast<int>(std::lround(cycles / (frequency_hz * period_s)));
  const double w = 2.0 * pi * cycles / samples;
  Complex in = 0.0;
  Complex out = 0.0;
  for (int k = -settle; k < samples; ++k) {
    const auto x = static_cast<float>(std::sin(w * k));
    const float y = filter.apply(x);
    if (k < 0) continue;
    in += std::polar(1.0, -w * k) * static_cast<double>(x);
    out += std::polar(1.0, -w * k) * static_cast<double>(y);
  }
  return out / in;
}

// The bilinear transform maps a frequency to tan(w T / 2) of the continuous prototype, so the prototype is evaluated
// there.
double warped(double frequency_hz) { return std::tan(pi * frequency_hz * period_s); }

TEST(Filters, NotchIsThePrototype) {
  for (const float centre_hz : {60.0F, 800.0F, 2500.0F}) {
    for (const float depth : {0.0F, 0.2F, 1.0F}) {
      const float width_hz = 0.3F * centre_hz;
      const Biquad notch = make_notch(centre_hz, width_hz, depth, static_cast<float>(period_s));
      const double w = warped(static_cast<double>(centre_hz));
      const double b = w * static_cast<double>(width_hz / centre_hz);
      for (const double ratio : {0.1, 0.5, 0.86, 1.0, 1.16, 1.5}) {
        const double frequency_hz = ratio * static_cast<double>(centre_hz);
        const Complex s(0.0, warped(frequency_hz));
        const Complex expected = (s * s + static_cast<double>(depth) * b * s + w * w) / (s * s + b * s + w * w);
        const Complex found = measured_response(notch, frequency_hz);
        ASSERT_NEAR(std::abs(found - expected), 0.0, 2.0e-3) << centre_hz << " Hz, depth " << depth << ", at " << ratio;
      }
    }
  }
}

// The definition in the manual: zero gain at the centre, -3 dB at half the width on each side.
TEST(Filters, NotchWidthIsTheDistanceOfItsCorners) {
  const Biquad notch = make_notch(200.0F, 20.0F, 0.0F, static_cast<float>(period_s));
  EXPECT_LT(std::abs(measured_response(notch, 200.0)), 1.0e-3);
  const double corner_hz = std::sqrt(200.0 * 200.0 + 10.0 * 10.0);
  EXPECT_NEAR(std::abs(measured_response(notch, corner_hz - 10.0)), std::sqrt(0.5), 0.01);
  EXPECT_NEAR(std::abs(measured_response(notch, corner_hz + 10.0)), std::sqrt(0.5), 0.01);
}

TEST(Filters, SecondOrderLowPassIsThePrototype) {
  for (const float damping : {0.3F, 0.707F}) {
    const Biquad filter = make_low_pass(500.0F, damping, static_cast<float>(period_s));
    const double w = warped(500.0);
    for (const double frequency_hz : {20.0, 300.0, 500.0, 900.0, 3000.0}) {
      const Complex s(0.0, warped(frequency_hz));
      const Complex expected = w * w / (s * s + 2.0 * static_cast<double>(damping) * w * s + w * w);
      ASSERT_NEAR(std::abs(measured_response(filter, frequency_hz) - expected), 0.0, 2.0e-3) << frequency_hz;
    }
  }
}

TEST(Filters, LowPassIsExactForAHeldInput) {
  LowPass filter{low_pass_gain(100.0F, static_cast<float>(period_s)), 0.0F};
  for (int k = 1; k <= 100; ++k) {
    const double expected = 1.0 - std::exp(-2.0 * pi * 100.0 * period_s * k);
    ASSERT_NEAR(static_cast<double>(filter.apply(1.0F)), expected, 2.0e-6);
  }
  EXPECT_EQ(low_pass_gain(0.0F, static_cast<float>(period_s)), 1.0F);
  for (const double frequency_hz : {10.0, 100.0, 1000.0}) {
    const double pole = std::exp(-2.0 * pi * 100.0 * period_s);
    const Complex expected = (1.0 - pole) / (1.0 - pole * std::polar(1.0, -2.0 * pi * frequency_hz * period_s));
    const LowPass fresh{low_pass_gain(100.0F, static_cast<float>(period_s)), 0.0F};
    EXPECT_NEAR(std::abs(measured_response(fresh, frequency_hz) - expected), 0.0, 1.0e-3);
  }
}

TEST(Filters, SettledOrRetunedAtRestNothingMoves) {
  Biquad notch = make_notch(300.0F, 50.0F, 0.1F, static_cast<float>(period_s));
  notch.settle(0.7F);
  for (int k = 0; k < 100; ++k) ASSERT_NEAR(notch.apply(0.7F), 0.7F, 1.0e-5F);
  // A replaced notch takes over the state: at rest the output does not move, whatever the new frequency is.
  Biquad resting = make_notch(300.0F, 50.0F, 0.1F, static_cast<float>(period_s));
  resting.settle(0.0F);
  for (const float frequency_hz : {100.0F, 900.0F, 2500.0F}) {
    resting = make_notch(frequency_hz, 0.2F * frequency_hz, 0.0F, static_cast<float>(period_s), resting);
    for (int k = 0; k < 100; ++k) ASSERT_EQ(resting.apply(0.0F), 0.0F) << frequency_hz;
  }
  // With a constant input the output continues from its value and returns to it: the state is not reset to 0.
  Biquad retuned = make_notch(320.0F, 50.0F, 0.1F, static_cast<float>(period_s), notch);
  EXPECT_EQ(retuned.state1, notch.state1);
  EXPECT_EQ(retuned.state2, notch.state2);
  float least = 1.0F;
  for (int k = 0; k < 4000; ++k) least = std::min(least, retuned.apply(0.7F));
  EXPECT_GT(least, 0.6F);
  EXPECT_NEAR(retuned.apply(0.7F), 0.7F, 1.0e-5F);
  Biquad low_pass = make_low_pass(500.0F, 0.7F, static_cast<float>(period_s));
  low_pass.settle(-0.3F);
  EXPECT_NEAR(low_pass.apply(-0.3F), -0.3F, 1.0e-5F);
  EXPECT_EQ(make_low_pass(400.0F, 0.7F, static_cast<float>(period_s), low_pass).state1, low_pass.state1);
}

// The notch filters the torque reference: an elastic load with a resonance at which the axis oscillates is stable with
// it.
TEST(Filters, NotchQuietensAResonance) {
  const auto ringing = [](bool with_notch) {
    plant::Parameters parameters = frictionless(1 << 20);
    parameters.load.elastic = true;
    parameters.load.inertia_kgm2 = 2.0e-4;
    const double reduced = 0.28e-4 * 2.0e-4 / 2.28e-4;
    const double resonance = 2.0 * pi * 500.0;
    parameters.load.stiffness_nm_per_rad = resonance * resonance * reduced;
    parameters.load.damping_nms = 0.002;
    Axis axis(parameters);
    if (with_notch) axis.gains.notches[1] = {500.0F, 300.0F, 0.05F};
    axis.configure();
    axis.demand.loop = Loop::velocity;
    axis.demand.velocity = static_cast<float>(axis.counts_per_s(100.0));
    axis.run_seconds(0.5);
    double largest = 0.0;
    for (int i = 0; i < 1600; ++i) {
      axis.tick();
      largest = std::max(largest, std::fabs(axis.plant.velocity_rpm() - 100.0));
    }
    return largest;
  };
  EXPECT_GT(ringing(false), 50.0);
  EXPECT_LT(ringing(true), 1.0);
}

TEST(I2t, TripsAtTheTimeOfTheClosedForm) {
  const double update_s = 0.5e-3;
  for (const double peak_ratio : {2.0, 3.0}) {
    for (const double peak_time_s : {1.0, 3.0}) {
      const double tau_s = -peak_time_s / std::log(1.0 - 1.0 / (peak_ratio * peak_ratio));
      for (const double ratio : {1.05, 1.5, peak_ratio, 4.0}) {
        I2t model;
        model.configure(5.0, 5.0 * peak_ratio, peak_time_s, update_s);
        const auto squared = static_cast<float>(25.0 * ratio * ratio);
        double time_s = 0.0;
        while (!model.tripped() && time_s < 1000.0) {
          model.update(squared);
          time_s += update_s;
        }
        const double expected_s = -tau_s * std::log(1.0 - 1.0 / (ratio * ratio));
        EXPECT_NEAR(time_s, expected_s, 1.01 * update_s) << peak_ratio << ' ' << peak_time_s << ' ' << ratio;
      }
      // The utilisation follows the closed form, and the rated current never trips the monitor.
      I2t model;
      model.configure(5.0, 5.0 * peak_ratio, peak_time_s, update_s);
      for (int k = 0; k < 1000; ++k) model.update(25.0F);
      EXPECT_NEAR(model.utilisation_percent(), 100.0 * (1.0 - std::exp(-0.5 / tau_s)), 1.0e-6);
      for (int k = 0; k < 200000; ++k) model.update(25.0F);
      EXPECT_FALSE(model.tripped());
      EXPECT_NEAR(model.utilisation_percent(), 100.0 * (1.0 - std::exp(-100.5 / tau_s)), 1.0e-6);
      for (int k = 0; k < 1000; ++k) model.update(0.0F);
      EXPECT_NEAR(model.utilisation_percent(), 100.0 * (1.0 - std::exp(-100.5 / tau_s)) * std::exp(-0.5 / tau_s),
                  1.0e-6);
    }
  }
}

}  // namespace
}  // namespace loops_filters_test
}  // namespace servodrome::drive::test
