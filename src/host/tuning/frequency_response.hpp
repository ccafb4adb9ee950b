#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <vector>

// Frequency responses from sampled signals. Mathematics only: who excites and who samples is not known here.
namespace servodrome::host::tuning {

using Complex = std::complex<double>;

// Sines that repeat together after one period, all of one amplitude, with phases that keep the sum low (M. R.
// Schroeder, "Synthesis of low-peak-factor signals", 1970). Whatever answers it in a linear way repeats as well, so
// that a period of the answer is transformed without leakage.
class Multisine {
 public:
  // `lines` frequencies from `lowest_hz` to `highest_hz`, at equal ratios as far as multiples of one by the period
  // allow: there may be fewer. `highest_hz` is cut at 0.4 of the sampling rate.
  Multisine(double sample_s, unsigned period_samples, double lowest_hz, double highest_hz, unsigned lines);

  // The sum at sample `n`; its greatest value over a period is 1.
  double value(std::uint64_t n) const { return samples_[n % samples_.size()]; }
  double sample_s() const { return sample_s_; }
  unsigned period_samples() const { return static_cast<unsigned>(samples_.size()); }
  // Lines as multiples of the lowest frequency there is, one by the period.
  std::span<const unsigned> harmonics() const { return harmonics_; }
  double frequency_hz(std::size_t line) const { return harmonics_[line] / (sample_s_ * period_samples()); }

 private:
  double sample_s_;
  std::vector<unsigned> harmonics_;
  std::vector<double> samples_;
};

struct ResponsePoint {
  double frequency_hz = 0.0;
  Complex response{};      // output by input
  double coherence = 0.0;  // 0 .. 1: the share of the output that the input explains
};

// The response at the excitation's lines. Both signals hold the same whole number of periods, one after another, in the
// steady state; with a single period the coherence is 1 and says nothing.
std::vector<ResponsePoint> frequency_response(std::span<const double> input, std::span<const double> output,
                                              const Multisine& excitation);

// Of a signal sampled by its differences from one sample to the next: what its derivative is by them at a frequency.
Complex derivative_of_differences(double frequency_hz, double sample_s);
// Magnitude that a value held from one sample to the next has at a frequency; its delay is half a sample.
double hold_gain(double frequency_hz, double sample_s);

}  // namespace servodrome::host::tuning
