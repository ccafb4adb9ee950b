#pragma once

#include <optional>
#include <span>
#include <vector>

#include "host/tuning/frequency_response.hpp"

// Bode's figures of a control loop, and the velocity loop of a drive as a model.
namespace servodrome::host::tuning {

struct BodePoint {
  double frequency_hz = 0.0;
  double gain_db = 0.0;
  double phase_deg = 0.0;  // continuous from point to point; the first in -270 .. 90
};
std::vector<BodePoint> bode(std::span<const double> frequencies_hz, std::span<const Complex> response);

// Of an open loop L in 1 + L, at ascending frequencies; what the frequencies do not reach is not there.
struct Margins {
  std::optional<double> crossover_hz{};      // the first where |L| falls below 1
  std::optional<double> phase_margin_deg{};  // the least of all crossovers: angle between L and -1
  std::optional<double> gain_margin_hz{};    // the first beyond the crossover where L is real and negative
  std::optional<double> gain_margin_db{};
  double greatest_sensitivity = 0.0;  // of |1 / (1 + L)|
};
Margins margins_of(std::span<const double> frequencies_hz, std::span<const Complex> open_loop);

// Where the magnitude of a closed loop first falls below -3 dB for good within the frequencies. A gap of one point does
// not count.
std::optional<double> bandwidth_of(std::span<const double> frequencies_hz, std::span<const Complex> closed_loop);

// The mechanics between torque and velocity: an inertia, and an elastic coupling where there is one. Torque is in the
// unit that the inertia makes of it (Nm, or A of a drive that tells only the current); velocity in rad/s.
struct Resonance {
  double antiresonance_hz = 0.0;
  double antiresonance_damping = 0.0;
  double resonance_hz = 0.0;
  double resonance_damping = 0.0;
};
struct Mechanics {
  double inertia = 0.0;  // rotor and load: torque by rad/s^2
  std::optional<Resonance> resonance{};
  double misfit = 0.0;  // of the measured response to this: relative, rms

  double rotor_inertia() const;  // what moves above the resonance; the whole where there is none
  Complex response(double frequency_hz) const;
};
// From the response of velocity by torque. Points with a low coherence count little. Nothing: no sense is to be made of
// it.
std::optional<Mechanics> identify_mechanics(std::span<const ResponsePoint> velocity_by_torque);

struct NotchSetting {
  double frequency_hz = 0.0;
  double width_hz = 0.0;
  double depth = 0.0;  // gain at the centre

  Complex response(double frequency_hz) const;
};

// Torque = (kp + ki / s) of the velocity error, through a notch, after a delay that stands for sampling, filters and
// current loop together.
struct VelocityController {
  double kp = 0.0;  // torque by rad/s
  double ki = 0.0;  // torque by rad
  double delay_s = 0.0;
  std::optional<NotchSetting> notch{};

  Complex response(double frequency_hz) const;
};

struct IdentifiedController {
  VelocityController controller{};
  double command_delay_s = 0.0;  // from the master's command to the loop
  double misfit = 0.0;           // relative, rms
};
// From what torque and velocity answer to the velocity command: gains and delays, without knowing what unit the
// drive's gains have. `notch` is what the drive is known to have switched on.
std::optional<IdentifiedController> identify_controller(std::span<const ResponsePoint> velocity_by_command,
                                                        std::span<const ResponsePoint> torque_by_command,
                                                        double sample_s, const std::optional<NotchSetting>& notch);

// Controller and mechanics of a loop that was measured through a command held from sample to sample. The torque of a
// sample is then not the torque that moves the shaft: the held command has steps, whose images fold onto the very
// frequencies measured. So the torque gives the controller, and what moves the shaft is the controller's answer to the
// command without its images.
struct IdentifiedLoop {
  IdentifiedController controller{};
  Mechanics mechanics{};
  double effective_delay_s = 0.0;  // of the held command, to the torque: half a sample is the hold's own
  std::vector<ResponsePoint> velocity_by_torque{};
};
std::optional<IdentifiedLoop> identify_loop(std::span<const ResponsePoint> velocity_by_command,
                                            std::span<const ResponsePoint> torque_by_command, double sample_s,
                                            const std::optional<NotchSetting>& notch);

}  // namespace servodrome::host::tuning
