#pragma once

#include <cstdint>
#include <vector>

// Moments of sampled signals with a smooth bump that slides along a recording: the integral of x times the bump, which
// is 0, with three of its derivatives, at both ends of its window. Partial integration turns the moment of a signal's
// derivative into the moment of the signal with the bump's derivative and the opposite sign. So measured data are never
// differentiated, and values at the ends of the window are not needed (Shinbrot's modulating functions, 1957). A delay
// of the signal moves the bump, not the samples.
namespace servodrome::fit {

// Samples further apart have a gap between them, which counts for no sampling rate: the recording was interrupted.
inline constexpr double gap_s = 1.0;
// Mean time between two samples, without the gaps; with nothing but gaps, the mean of all. 0 for fewer than two
// samples.
double period_of(const std::vector<double>& seconds);

// Selects samples. Even and odd samples contain the same signal with independent noise.
enum class Half : std::uint8_t { all, even, odd };

class Windows {
 public:
  // Windows of `length_s`, each shifted by a quarter of it. No window is without a sample. There is none at all if a
  // window would be shorter than four samples. `seconds` must outlive this object.
  Windows(const std::vector<double>& seconds, double length_s);

  static constexpr double overlap = 4.0;  // number of windows that cover a moment

  std::size_t size() const { return starts_.size(); }
  double length_s() const { return length_; }

  // For each window the integral of x(t - delay_s), or of its first, second or third derivative, times the bump,
  // normalised to an integral of 1. NaN if samples are missing.
  std::vector<double> moments(const std::vector<double>& x, unsigned derivative, double delay_s, Half half) const;
  // The least and the greatest value in each window.
  void range(const std::vector<double>& x, std::vector<double>& least, std::vector<double>& greatest) const;

 private:
  const std::vector<double>& seconds_;
  double length_;
  double longest_gap_;
  std::vector<double> starts_;
};

}  // namespace servodrome::fit
