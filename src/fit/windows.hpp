#pragma once

#include <cstdint>
#include <vector>

// Moments of sampled signals under a smooth bump that is slid along a recording: the integral of x times a bump that
// is 0, with three of its derivatives, at both ends of its window. By partial integration a derivative of the signal is
// the same moment under the derivative of the bump, with the other sign: nothing that was measured is differentiated,
// and no value at the ends of the window is needed (Shinbrot's modulating functions, 1957). A delay of the signal moves
// the bump, not the samples.
namespace servodrome::fit {

// Which samples are taken. The even and the odd ones show the same signal with noises that have nothing to do with
// each other.
enum class Half : std::uint8_t { all, even, odd };

class Windows {
 public:
  // Windows of `length_s`, each a quarter of it later than the one before. `seconds` outlives them.
  Windows(const std::vector<double>& seconds, double length_s);

  static constexpr double overlap = 4.0;  // windows over one moment

  std::size_t size() const { return starts_.size(); }
  double length_s() const { return length_; }

  // For each window the integral of x(t - delay_s), or of its first, second or third derivative, times the bump; the
  // bump's own integral is 1. Not a number where samples are missing.
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
