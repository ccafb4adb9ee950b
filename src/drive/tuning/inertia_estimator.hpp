#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drive/units.hpp"

namespace servodrome::drive {

// Estimated load, in SI units. Motor torque = inertia x acceleration + viscous x speed + coulomb x sign(speed) +
// constant.
struct InertiaEstimate {
  double inertia_kgm2 = 0.0;  // rotor and load
  double viscous_nms = 0.0;
  double coulomb_nm = 0.0;
  double constant_nm = 0.0;           // gravity: the torque that the motor holds
  double relative_uncertainty = 1.0;  // standard deviation of the inertia / inertia
  std::uint32_t windows = 0;          // number of windows used
};

// Identifies inertia and friction from any motion of an axis, by least squares. Each window of the motion gives one
// equation: the equation of motion weighted by a bump that is 0 with slope 0 at both ends, summed over the window. The
// bump suppresses what is fast compared with the window, such as resonances and the noise of differentiating encoder
// counts.
class InertiaEstimator {
 public:
  struct Settings {
    double counts_per_revolution = 65536.0;
    double rated_torque_nm = 1.0;
    double cycle_s = 1e-3;  // period of sample()
    double window_s = 32e-3;
    double least_acceleration = 15.0;  // rad/s^2, mean over a window; windows with less are ignored
    double memory_windows = 0.0;       // forgetting: time constant in windows; 0: off
    bool forward = true;               // use windows of motion in this direction
    bool reverse = true;
  };

  void begin(const Settings& settings);
  // Called once per position-loop cycle with the encoder position and the mean of the measured torque since the last
  // call, as a fraction of rated torque. The mean is used because the torque follows a pattern within the cycle that a
  // single sample would miss.
  void sample(Counts position, float torque);
  // Discards the current window, because the next sample does not continue the previous ones (sampling was stopped, or
  // the position was changed).
  void interrupt();

  std::uint32_t windows() const { return windows_; }
  // Returns false while the data are not sufficient.
  bool estimate(InertiaEstimate& estimate) const;

 private:
  static constexpr std::size_t terms = 4;  // inertia, coulomb, constant, viscous
  using Row = std::array<double, terms>;

  void close_window();

  Settings settings_{};
  std::uint32_t window_cycles_ = 32;
  double rad_per_count_ = 0.0;

  // The three latest samples. The equation is evaluated at the middle one.
  std::uint32_t samples_ = 0;
  std::array<Counts, 3> position_{};
  std::array<double, 3> torque_{};

  // Current window
  std::uint32_t cycle_ = 0;
  std::uint32_t standing_ = 0;
  Row sums_{};
  double torque_sum_ = 0.0;
  double weight_sum_ = 0.0;

  // Normal equations
  std::uint32_t windows_ = 0;
  double weight_ = 0.0;
  std::array<Row, terms> matrix_{};
  Row right_{};
  double square_ = 0.0;
};

}  // namespace servodrome::drive
