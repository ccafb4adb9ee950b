#pragma once

#include <cstdint>
#include <vector>

// Moments of sampled signals. A moment is the integral of a signal times the bump, a smooth weight function on a window
// that slides along the recording. The bump and its first three derivatives are 0 at both ends of the window. By
// integration by parts, the moment of a signal's derivative is minus the moment of the signal with the bump's
// derivative. So the fit never differentiates measured data, and does not need values at the ends of the window
// (Shinbrot's modulating functions, 1957). A delay of the signal moves the bump, not the samples.
namespace servodrome::fit {

// If two samples are further apart than this, the recording has a gap between them. Sampling rates ignore gaps.
inline constexpr double gap_s = 1.0;
// Mean time between two samples, without the gaps; the mean with the gaps if there are only gaps. 0 for fewer than two
// samples.
double period_of(const std::vector<double>& seconds);

// Selects samples. Even and odd samples contain the same signal with independent noise.
enum class Half : std::uint8_t { all, even, odd };

class Windows {
 public:
  // Windows of `length_s`, each shifted by a quarter of it. Each window contains at least one sample. There are no
  // windows if `length_s` is shorter than four sampling periods. `seconds` must outlive this object.
  Windows(const std::vector<double>& seconds, double length_s);

  static constexpr double overlap = 4.0;  // number of windows that contain a point in time

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
