// Confidence intervals by Monte Carlo: the same motion with new noise in each run. A 95 % interval must contain the
// true value in 95 of 100 recordings, and must not be wider than necessary.
#include <gtest/gtest.h>

#include "draws.hpp"
#include "synthetic_axis.hpp"

namespace servodrome::fit {
namespace fit_confidence_test {
namespace {

using test::Draw;
using test::SyntheticAxis;

// White noise, or noise that is correlated over this number of samples.
void add_noise(std::vector<double>& values, double deviation, double memory, Draw& draw) {
  const double keeps = memory > 0.0 ? std::exp(-1.0 / memory) : 0.0;
  double noise = deviation * draw.normal();
  for (double& value : values) {
    value += noise;
    noise = keeps * noise + std::sqrt(1.0 - keeps * keeps) * deviation * draw.normal();
  }
}

TEST(FitConfidence, IntervalsHoldTheTruthInNineteenOfTwentyRecordings) {
  const auto draws = static_cast<unsigned>(servodrome::test::draws(100));
  SyntheticAxis axis;
  axis.rate_hz = 2000.0;
  axis.duration_s = 3.0;
  const Signals clean = axis.signals();
  const std::array<double, parameter_count> truth{axis.resistance_ohm,
                                                  0.0,
                                                  axis.quadrature_h,
                                                  axis.torque_constant(),
                                                  axis.inertia_kgm2,
                                                  axis.coulomb_nm,
                                                  axis.viscous_nms,
                                                  axis.weight_nm,
                                                  0.0,
                                                  0.0};
  std::array<unsigned, parameter_count> held{};
  std::array<double, parameter_count> squares{};
  std::array<double, parameter_count> widths{};
  for (unsigned n = 0; n < draws; ++n) {
    Signals noisy = clean;
    Draw draw(5000 + n);
    const auto of = [&](Role role) -> std::vector<double>& { return noisy.values[static_cast<std::size_t>(role)]; };
    add_noise(of(Role::quadrature_current), 0.05, 0.0, draw);
    add_noise(of(Role::direct_current), 0.05, 0.0, draw);
    add_noise(of(Role::velocity), 2.0, 0.0, draw);
    add_noise(of(Role::position), 0.002, 0.0, draw);
    add_noise(of(Role::quadrature_voltage), 1.0, 10.0, draw);  // correlated over several windows
    add_noise(of(Role::direct_voltage), 1.0, 10.0, draw);
    const Result result = fit(noisy, axis.motor());
    for (std::size_t i = 0; i < parameter_count; ++i) {
      if (static_cast<Parameter>(i) == Parameter::direct_inductance) continue;
      const Figure& figure = result.figures[i];
      ASSERT_TRUE(figure.value) << text_of(figure.parameter).word << ": " << figure.why_not;
      const double error = *figure.value - truth[i];
      held[i] += std::abs(error) <= figure.half_width ? 1U : 0U;
      squares[i] += error * error;
      widths[i] += figure.half_width;
    }
  }
  for (std::size_t i = 0; i < parameter_count; ++i) {
    const std::string_view name = text_of(static_cast<Parameter>(i)).word;
    if (static_cast<Parameter>(i) == Parameter::direct_inductance) continue;
    const double needed = 1.96 * std::sqrt(squares[i] / draws);
    fmt::print("{:<26} held by {} of {} intervals, {:.2f} times as wide as needed\n", name, held[i], draws,
               widths[i] / draws / needed);
    // 95 %, less three deviations of the binomial distribution.
    EXPECT_GE(held[i], 0.95 * draws - 3.0 * std::sqrt(0.95 * 0.05 * draws)) << name;
    EXPECT_LT(widths[i] / draws, 1.6 * needed) << name;
  }
}

}  // namespace
}  // namespace fit_confidence_test
}  // namespace servodrome::fit
