#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "tools/tuning/frequency_response.hpp"

// Frequency domain figures of a control loop, and a model of a drive's velocity loop.
namespace servodrome::master::tuning {

struct BodePoint {
  double frequency_hz = 0.0;
  double gain_db = 0.0;
  double phase_deg = 0.0;  // without jumps; the first is in -270 .. 90
};
std::vector<BodePoint> bode(std::span<const double> frequencies_hz, std::span<const Complex> response);

// Margins of an open loop L in 1 + L, for ascending frequencies. A value outside the range of the frequencies is
// nullopt.
struct Margins {
  std::optional<double> crossover_hz{};      // first frequency at which |L| falls below 1
  std::optional<double> phase_margin_deg{};  // smallest of all crossovers: angle between L and -1
  std::optional<double> gain_margin_hz{};    // first beyond the crossover where L is real and negative
  std::optional<double> gain_margin_db{};
  double greatest_sensitivity = 0.0;  // maximum of |1 / (1 + L)|
};
Margins margins_of(std::span<const double> frequencies_hz, std::span<const Complex> open_loop);

// -3 dB bandwidth: the frequency at which the magnitude of a closed loop first falls below -3 dB. A single point below
// is ignored.
std::optional<double> bandwidth_of(std::span<const double> frequencies_hz, std::span<const Complex> closed_loop);

// Mechanics between torque and velocity: an inertia, with an elastic coupling if there is one. The unit of torque
// follows from the inertia (Nm, or A for a drive that reports only its current); velocity in rad/s.
struct Resonance {
  double antiresonance_hz = 0.0;
  double antiresonance_damping = 0.0;
  double resonance_hz = 0.0;
  double resonance_damping = 0.0;
};
struct Mechanics {
  double inertia = 0.0;  // rotor and load: torque per rad/s^2
  std::optional<Resonance> resonance{};
  double misfit = 0.0;  // relative rms error of this model against the measured response

  double rotor_inertia() const;  // moving inertia above the resonance; the whole inertia if rigid
  Complex response(double frequency_hz) const;
};
// Identifies the mechanics from the response velocity/torque. Points with low coherence have little weight. nullopt: no
// model fits.
std::optional<Mechanics> identify_mechanics(std::span<const ResponsePoint> velocity_by_torque);

struct NotchSetting {
  double frequency_hz = 0.0;
  double width_hz = 0.0;
  double depth = 0.0;  // gain at the centre

  Complex response(double frequency_hz) const;
};

// Delay of a drive's loop: sampling, filters and current loop together, as a dead time and a first-order lag.
struct LoopDelay {
  double dead_s = 0.0;
  double lag_s = 0.0;

  double total_s() const { return dead_s + lag_s; }
  Complex response(double frequency_hz) const;
};

// Torque = (kp + ki / s) times the velocity error, through a notch filter and the delay of the loop.
struct VelocityController {
  double kp = 0.0;  // torque per rad/s
  double ki = 0.0;  // torque per rad
  LoopDelay delay{};
  std::optional<NotchSetting> notch{};

  Complex response(double frequency_hz) const;
};

// A drive's velocity loop as the master sees it: the master holds each command for a sample, and gets position and
// torque as samples. The steps of the held command contain images of each frequency. The images are above half of the
// master's sampling rate, so sampling aliases them onto the frequency. In the torque their share is about the crossover
// frequency divided by the sampling rate, at every frequency. So the sampled torque differs from the torque that moves
// the shaft, and the difference depends on the time within the cycle at which the drive samples.
struct SampledLoop {
  VelocityController controller{};
  Mechanics mechanics{};
  // Delays of the samples after the command. They include half a sample of the hold, but not the lag of the loop.
  double velocity_delay_s = 0.0;
  double torque_delay_s = 0.0;
  double misfit = 0.0;  // relative rms error

  // Responses of the sampled signals to the command. The velocity is computed from differences of the position, with
  // derivative_of_differences.
  struct Response {
    Complex velocity{};
    Complex torque{};
    Complex velocity_without_images{};
  };
  Response response(double frequency_hz, double sample_s) const;
};

struct IdentifiedLoop : SampledLoop {
  // From the measured velocity, without the delays outside of the loop and without images; one value for each
  // frequency.
  std::vector<Complex> closed_loop{};
  std::vector<Complex> open_loop{};
  std::vector<ResponsePoint> velocity_by_torque{};
};
// Identifies a sampled loop from the responses of velocity and torque to the command; the units of the drive's gains
// need not be known. `notch`: the notch filter that is active in the drive. `between` is called at least every few ms
// of the calculation, which may take half a second. nullopt: no model fits.
std::optional<IdentifiedLoop> identify_loop(std::span<const ResponsePoint> velocity_by_command,
                                            std::span<const ResponsePoint> torque_by_command, double sample_s,
                                            const std::optional<NotchSetting>& notch,
                                            const std::function<void()>& between = {});

}  // namespace servodrome::master::tuning
