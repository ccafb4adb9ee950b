#pragma once

#include <string>

#include "catalogue/gains.hpp"
#include "tools/tuning/loop.hpp"

// Computes gains for a requested bandwidth.
namespace servodrome::master::tuning {

struct Request {
  double bandwidth_hz = 50.0;  // -3 dB of the closed velocity loop
  LoopDelay delay{};           // of the present drive
  std::optional<catalogue::NotchAbility> notch{};
};

struct Proposal {
  VelocityController velocity{};
  double position_kp = 0.0;   // 1/s
  double bandwidth_hz = 0.0;  // -3 dB of the closed velocity loop
  Margins margins{};
};

// Predicts the result of a controller on these mechanics.
Proposal predict(const VelocityController& controller, const Mechanics& mechanics);

// Gains for the requested bandwidth; nullopt if there are none. The phase margin is at least 45 degrees and the
// sensitivity at most 2; if the inertia is 20 % lower or higher, at least 40 degrees and at most 2.5. The integral is
// as fast as these allow; a notch is used only if it is necessary. The gain of the position loop is a fifth of the
// crossover.
std::optional<Proposal> propose(const Mechanics& mechanics, const Request& request);
// The greatest bandwidth, at most the requested one, that has a proposal; 0: none down to 1 Hz.
double greatest_bandwidth(const Mechanics& mechanics, const Request& request);

}  // namespace servodrome::master::tuning
