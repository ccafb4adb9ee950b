#include "tools/tuning/frequency_response.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace servodrome::master::tuning {
namespace {

constexpr double highest_share = 0.4;  // share of the sampling rate; above it the hold attenuates the excitation
                                       // too much, and causes aliases

}  // namespace

Multisine::Multisine(double sample_s, unsigned period_samples, double lowest_hz, double highest_hz, unsigned lines)
    : sample_s_(sample_s), samples_(std::max(period_samples, 8U)) {
  const double periods_per_hz = sample_s * static_cast<double>(samples_.size());
  const double lowest = std::max(1.0, lowest_hz * periods_per_hz);
  const double highest =
      std::max(lowest, std::min(highest_hz * periods_per_hz, highest_share * static_cast<double>(samples_.size())));
  for (unsigned i = 0; i < lines; ++i) {
    const double share = lines > 1 ? static_cast<double>(i) / (lines - 1) : 0.0;
    const auto harmonic = static_cast<unsigned>(std::lround(lowest * std::pow(highest / lowest, share)));
    if (harmonics_.empty() || harmonic > harmonics_.back()) harmonics_.push_back(harmonic);
  }
  double greatest = 0.0;
  const auto count = static_cast<double>(harmonics_.size());
  for (std::size_t n = 0; n < samples_.size(); ++n) {
    for (std::size_t k = 0; k < harmonics_.size(); ++k) {
      const double turns = static_cast<double>((harmonics_[k] * static_cast<std::uint64_t>(n)) % samples_.size()) /
                           static_cast<double>(samples_.size());
      const auto number = static_cast<double>(k);
      samples_[n] += std::cos(turn * turns - std::numbers::pi * number * (number + 1.0) / count);
    }
    greatest = std::max(greatest, std::abs(samples_[n]));
  }
  for (double& sample : samples_) sample /= greatest;
}

std::vector<ResponsePoint> frequency_response(std::span<const double> input, std::span<const double> output,
                                              const Multisine& excitation) {
  const std::size_t period = excitation.period_samples();
  const std::size_t periods = std::min(input.size(), output.size()) / period;
  std::vector<Complex> turning(period);
  for (std::size_t n = 0; n < period; ++n) {
    turning[n] = std::polar(1.0, -turn * static_cast<double>(n) / static_cast<double>(period));
  }
  std::vector<ResponsePoint> points;
  for (std::size_t line = 0; line < excitation.harmonics().size(); ++line) {
    const std::size_t harmonic = excitation.harmonics()[line];
    Complex cross{};
    double input_power = 0.0;
    double output_power = 0.0;
    for (std::size_t block = 0; block < periods; ++block) {
      Complex in{};
      Complex out{};
      std::size_t place = 0;
      for (std::size_t n = 0; n < period; ++n) {
        in += input[block * period + n] * turning[place];
        out += output[block * period + n] * turning[place];
        place = (place + harmonic) % period;
      }
      cross += out * std::conj(in);
      input_power += std::norm(in);
      output_power += std::norm(out);
    }
    ResponsePoint point{.frequency_hz = excitation.frequency_hz(line)};
    if (input_power > 0.0) point.response = cross / input_power;
    if (input_power > 0.0 && output_power > 0.0) point.coherence = std::norm(cross) / (input_power * output_power);
    points.push_back(point);
  }
  return points;
}

Complex derivative_of_differences(double frequency_hz, double sample_s) {
  const double angle = turn * frequency_hz * sample_s;
  return Complex(0.0, turn * frequency_hz) / (1.0 - std::polar(1.0, -angle));
}

double hold_gain(double frequency_hz, double sample_s) {
  const double half = std::numbers::pi * frequency_hz * sample_s;
  return half > 0.0 ? std::sin(half) / half : 1.0;
}

}  // namespace servodrome::master::tuning
