#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "drive/units.hpp"

namespace servodrome::drive {

// What turns with the shaft, in SI units. Torque of the motor = inertia x acceleration + viscous x speed + coulomb x
// sign(speed) + constant.
struct InertiaEstimate {
  double inertia_kgm2 = 0.0;  // rotor and load
  double viscous_nms = 0.0;
  double coulomb_nm = 0.0;
  double constant_nm = 0.0;           // gravity: what the motor holds
  double relative_uncertainty = 1.0;  // standard deviation of the inertia by itself
  std::uint32_t windows = 0;          // that went into it
};

// Identifies inertia and friction from any motion of an axis, by least squares. Every window of the motion gives one
// equation: the equation of motion times a bump that is 0 with its slope at both ends, summed over the window. By parts
// the bump takes the two differentiations over, so that no acceleration is made of encoder counts; and what is fast
// against the window, a resonance or noise, does not come through it.
class InertiaEstimator {
 public:
  struct Settings {
    double counts_per_revolution = 65536.0;
    double rated_torque_nm = 1.0;
    double cycle_s = 1e-3;  // of sample()
    double window_s = 32e-3;
    double least_acceleration = 15.0;  // rad/s^2, mean over a window: with less it is left out
    double memory_windows = 0.0;       // older ones fade; 0: none does
    bool forward = true;               // windows whose motion goes this way count
    bool reverse = true;
  };

  void begin(const Settings& settings);
  // Once per position-loop cycle: the encoder, and the mean of the measured torque since the last time, as a fraction
  // of rated torque. The mean, because what the loops do within a cycle repeats in every cycle.
  void sample(Counts position, float torque);
  // What comes next does not join on to what came: a stop of sampling, another position.
  void interrupt();

  std::uint32_t windows() const { return windows_; }
  // False while the motion has not been enough to tell.
  bool estimate(InertiaEstimate& estimate) const;

 private:
  static constexpr std::size_t terms = 4;  // inertia, coulomb, constant, viscous
  using Row = std::array<double, terms>;

  void close_window();

  Settings settings_{};
  std::uint32_t window_cycles_ = 32;
  double rad_per_count_ = 0.0;

  // The three latest samples: the equation holds for the middle one.
  std::uint32_t samples_ = 0;
  std::array<Counts, 3> position_{};
  std::array<double, 3> torque_{};

  // Of the window
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
