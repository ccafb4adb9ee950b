#include "tools/tuning/spectrum.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace servodrome::master::tuning {
namespace {

constexpr std::size_t least_lines = 5;        // minimum of lines in a band
constexpr double taper = 0.02;                // of the signal's length, at each end
constexpr double least_input_power = 1.0e-8;  // relative to the strongest band

// In-place radix-2 FFT (Cooley and Tukey); the size must be a power of two.
void transform(std::vector<Complex>& values) {
  const std::size_t size = values.size();
  for (std::size_t from = 1, to = 0; from < size; ++from) {
    std::size_t bit = size >> 1U;
    for (; (to & bit) != 0; bit >>= 1U) to ^= bit;
    to ^= bit;
    if (from < to) std::swap(values[from], values[to]);
  }
  std::vector<Complex> turns(size / 2);
  for (std::size_t k = 0; k < turns.size(); ++k) {
    turns[k] = std::polar(1.0, -2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(size));
  }
  for (std::size_t half = 1; half < size; half *= 2) {
    for (std::size_t block = 0; block < size; block += 2 * half) {
      for (std::size_t k = 0; k < half; ++k) {
        const Complex lower = values[block + half + k] * turns[k * (size / (2 * half))];
        values[block + half + k] = values[block + k] - lower;
        values[block + k] += lower;
      }
    }
  }
}

// Spectrum of the signal without its mean, tapered at both ends and padded with zeros.
std::vector<Complex> spectrum_of(std::span<const double> signal) {
  double mean = 0.0;
  for (const double value : signal) mean += value;
  mean /= static_cast<double>(signal.size());
  std::vector<Complex> values(std::bit_ceil(signal.size()));
  const double faded = std::max(1.0, taper * static_cast<double>(signal.size()));
  for (std::size_t n = 0; n < signal.size(); ++n) {
    const double from_end = static_cast<double>(std::min(n, signal.size() - 1 - n)) + 0.5;
    const double weight = from_end < faded ? 0.5 - 0.5 * std::cos(std::numbers::pi * from_end / faded) : 1.0;
    values[n] = (signal[n] - mean) * weight;
  }
  transform(values);
  return values;
}

struct Band {
  double frequency_hz = 0.0;
  double input_power = 0.0;
  double output_power = 0.0;
  Complex cross{};
};

}  // namespace

std::vector<ResponsePoint> response_of_signals(std::span<const double> input, std::span<const double> output,
                                               double sample_s, const SpectrumRequest& request) {
  if (input.size() < 2 * least_lines || input.size() != output.size()) return {};
  const std::vector<Complex> in = spectrum_of(input);
  const std::vector<Complex> out = spectrum_of(output);
  const double line_hz = 1.0 / (sample_s * static_cast<double>(in.size()));
  // Zero padding adds interpolated lines without new information. So a band must contain enough lines of the signal
  // itself.
  const double lines_per_own = static_cast<double>(in.size()) / static_cast<double>(input.size());
  const double half_width = 0.5 * (static_cast<double>(least_lines) - 1.0) * lines_per_own;
  const double ratio = std::pow(10.0, 1.0 / request.points_per_decade);
  const double highest = std::min(request.highest_hz, 0.45 / sample_s);
  std::vector<Band> bands;
  for (double frequency = request.lowest_hz; frequency <= highest * (1.0 + 1e-9); frequency *= ratio) {
    const double centre = frequency / line_hz;
    const double width = std::max(half_width, centre * (std::sqrt(ratio) - 1.0));
    const auto first = static_cast<std::ptrdiff_t>(std::lround(centre - width));
    const auto last = static_cast<std::ptrdiff_t>(std::lround(centre + width));
    if (first < 1 || last >= static_cast<std::ptrdiff_t>(in.size() / 2)) continue;
    Band band{.frequency_hz = frequency};
    for (auto line = static_cast<std::size_t>(first); line <= static_cast<std::size_t>(last); ++line) {
      band.input_power += std::norm(in[line]);
      band.output_power += std::norm(out[line]);
      band.cross += out[line] * std::conj(in[line]);
    }
    const auto lines = static_cast<double>(last - first + 1);
    band.input_power /= lines;
    band.output_power /= lines;
    band.cross /= lines;
    bands.push_back(band);
  }
  double strongest = 0.0;
  for (const Band& band : bands) strongest = std::max(strongest, band.input_power);
  std::vector<ResponsePoint> points;
  for (const Band& band : bands) {
    if (band.input_power <= least_input_power * strongest || band.output_power <= 0.0) continue;
    points.push_back({.frequency_hz = band.frequency_hz,
                      .response = band.cross / band.input_power,
                      .coherence = std::norm(band.cross) / (band.input_power * band.output_power)});
  }
  return points;
}

}  // namespace servodrome::master::tuning
