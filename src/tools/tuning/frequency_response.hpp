#pragma once

#include <complex>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

// Frequency responses from sampled signals. Pure mathematics, without any access to a drive.
namespace servodrome::master::tuning {

inline constexpr double turn = 2.0 * std::numbers::pi;  // in radians

using Complex = std::complex<double>;

// Periodic excitation: a sum of sines of equal amplitude with a common period, whose phases give a low peak (M. R.
// Schroeder, "Synthesis of low-peak-factor signals", 1970). The response of a linear system has the same period, so one
// period of it can be transformed without leakage.
class Multisine {
 public:
  // `lines` frequencies from `lowest_hz` to `highest_hz`, spaced by equal ratios as far as possible: each is a multiple
  // of 1/period, so there may be fewer. `highest_hz` is limited to 0.4 of the sampling rate.
  Multisine(double sample_s, unsigned period_samples, double lowest_hz, double highest_hz, unsigned lines);

  // Value at sample `n`; the maximum over a period is 1.
  double value(std::uint64_t n) const { return samples_[n % samples_.size()]; }
  double sample_s() const { return sample_s_; }
  unsigned period_samples() const { return static_cast<unsigned>(samples_.size()); }
  // The frequencies as multiples of 1/period.
  std::span<const unsigned> harmonics() const { return harmonics_; }
  double frequency_hz(std::size_t line) const { return harmonics_[line] / (sample_s_ * period_samples()); }

 private:
  double sample_s_;
  std::vector<unsigned> harmonics_;
  std::vector<double> samples_;
};

struct ResponsePoint {
  double frequency_hz = 0.0;
  Complex response{};      // output divided by input
  double coherence = 0.0;  // 0 .. 1: share of the output's power that the input explains
};

// The response at the frequencies of the excitation. Both signals must contain the same whole number of consecutive
// periods in steady state. With a single period the coherence is always 1.
std::vector<ResponsePoint> frequency_response(std::span<const double> input, std::span<const double> output,
                                              const Multisine& excitation);

// The spectrum of a signal's derivative divided by that of the differences between its consecutive samples, at this
// frequency.
Complex derivative_of_differences(double frequency_hz, double sample_s);
// Magnitude of a zero-order hold at this frequency; its delay is half a sample.
double hold_gain(double frequency_hz, double sample_s);

}  // namespace servodrome::master::tuning
