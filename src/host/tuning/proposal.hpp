#pragma once

#include <string>

#include "host/tuning/loop.hpp"

// Gains for a promised bandwidth.
namespace servodrome::host::tuning {

// A notch that a drive has: its width and depth may be fixed, as shares of its frequency and of 1.
struct NotchAbility {
  double relative_width = 0.5;
  double depth = 0.1;
  double highest_hz = 1000.0;
};

struct Request {
  double bandwidth_hz = 50.0;  // -3 dB of the closed velocity loop
  double delay_s = 0.0;        // VelocityController::delay_s of the drive as it is
  std::optional<NotchAbility> notch{};
};

struct Proposal {
  VelocityController velocity{};
  double position_kp = 0.0;   // 1/s
  double bandwidth_hz = 0.0;  // of the closed velocity loop
  Margins margins{};
};

// What is predicted for a controller on mechanics.
Proposal predict(const VelocityController& controller, const Mechanics& mechanics);

// The bandwidth asked for with at least 45 degrees of phase margin and a sensitivity of at most 2, or nothing if there
// is none; the integral is as fast as that allows, a notch is set where it does not do without. The position loop's
// gain is a fifth of the crossover.
std::optional<Proposal> propose(const Mechanics& mechanics, const Request& request);
// The greatest bandwidth, up to the one of the request, for which there is a proposal; 0: none from 1 Hz up.
double greatest_bandwidth(const Mechanics& mechanics, const Request& request);

}  // namespace servodrome::host::tuning
