#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

// Parameters of a plant. The defaults describe a 400 W servo motor with a 60 mm flange on a rectified 220 V supply. The
// range in brackets is what `validate` accepts; within it the plant is stable and finite for every combination.
//
// Signs: positive is the direction in which the encoder counts up, for positions, speeds and torques. Gravity and load
// torque are given as the torque that the motor has to hold: a positive value pulls towards smaller counts.
namespace servodrome::plant {

// A harmonic of the cogging torque: -torque_nm * sin(2 pi (periods * turns of the rotor + phase_turns)).
struct CoggingHarmonic {
  double torque_nm = 0.0;    // [0, 1e3] amplitude
  int periods = 1;           // [1, 1000] per revolution
  double phase_turns = 0.0;  // [0, 1) of the harmonic's own period
};

inline constexpr std::size_t most_cogging_harmonics = 6;

// Permanent-magnet synchronous motor with three phases, or a hybrid stepper with two. Values per phase are line to
// neutral (half the line-to-line value of a data sheet); with two phases they are those of one winding, as in its data
// sheet.
struct Motor {
  // [2, 3]; 3: a star on three half bridges; 2: windings in quadrature, U and V, each on its own full bridge
  int phases = 3;
  double rated_torque_nm = 1.27;              // (0, 1e5]: for users' per-unit values; the step does not use it
  double rated_current_a = 2.7;               // (0, 1e4] A rms: for users' per-unit values
  double rated_speed_rpm = 3000.0;            // (0, 1e5]: for users' per-unit values
  int pole_pairs = 5;                         // [1, 100]
  double resistance_ohm = 0.775;              // [1e-3, 1e3] at 25 degC
  double direct_inductance_h = 3.355e-3;      // [1e-6, 1]
  double quadrature_inductance_h = 3.355e-3;  // [1e-6, 1], ratio to the direct one within [0.1, 10]
  double quadrature_saturation_a = 0.0;       // [0, 1e5] amplitude: scale of the saturation of Lq; 0: none
  double saturated_inductance_share = 0.4;    // [0.1, 1] of Lq: what remains of it at very high current
  double torque_constant_nm_per_a = 0.47;     // [1e-4, 1e3] per A rms; limited by inertia and inductance: see validate
  double magnet_temperature_coefficient = 0.0;  // [0, 0.005] per K: the flux falls with the temperature of the case
  double rotor_inertia_kgm2 = 0.28e-4;          // [1e-8, 10]
  double viscous_friction_nms = 0.0;            // [0, 1e3] Nm per rad/s, bearings
  double coulomb_friction_nm = 0.0;             // [0, 1e5] bearings
  double iron_hysteresis_nm = 0.0;              // [0, 1e5] drag torque by hysteresis; its heat goes to the case
  double iron_eddy_nms = 0.0;                   // [0, 1e3] Nm per rad/s by eddy currents; its heat goes to the case
  double cogging_torque_nm = 0.0;               // [0, 1e3] amplitude
  int cogging_periods_per_revolution = 30;      // [1, 1000]; with the amplitude: see validate
  std::array<CoggingHarmonic, most_cogging_harmonics> cogging{};  // more harmonics
  std::size_t cogging_count = 0;                                  // number of them in use, at the start of the array
  double copper_temperature_coefficient = 3.93e-3;                // [0, 0.01] per K
  double brake_torque_nm = 0.0;                                   // [0, 1e5] static holding torque; 0: no brake
  double brake_release_ms = 30.0;                                 // [0, 1e4] from command until the torque is gone
  double brake_engage_ms = 20.0;                                  // [0, 1e4] from command to full torque
  double brake_rise_ms = 0.0;        // [0, brake_engage_ms] last part of that time, in which the torque grows
  double brake_half_torque_j = 0.0;  // [0, 1e12] friction work that halves the torque by wear; 0: no wear
};

// Amplitude of the flux linkage per phase: torque = phases / 2 * pole pairs * flux * q current (amplitude).
double flux_linkage_vs(const Motor& motor);

inline constexpr std::int64_t no_low_limit = std::numeric_limits<std::int64_t>::min();
inline constexpr std::int64_t no_high_limit = std::numeric_limits<std::int64_t>::max();
inline constexpr std::int64_t largest_position_counts = std::int64_t{1} << 61;  // of any position parameter

// The load, referred to the motor shaft.
struct Load {
  double inertia_kgm2 = 0.28e-4;         // [0, 1e3]; elastic: [1e-8, 1e3]
  double viscous_friction_nms = 1.0e-5;  // [0, 1e3] Nm per rad/s
  double coulomb_friction_nm = 0.01;     // [0, 1e5] while sliding
  double static_friction_nm = 0.015;     // [coulomb, 1e5] breakaway
  double stribeck_speed_rad_s = 0.0;     // [0, 1e5] scale of the decrease from static to sliding; 0: at once
  double gravity_torque_nm = 0.0;        // [-1e5, 1e5] constant, as from a hanging load
  double external_torque_nm = 0.0;       // [-1e5, 1e5] changed by the bench while running

  // Weight and inertia that depend on the place in a cycle, as in an arm or a crank. The angle of the cycle is
  // 2 pi (motor revolutions / cycle_revolutions + cycle_offset_turns).
  double cycle_revolutions = 1.0;   // [0.001, 1e6] motor revolutions in a turn of the arm or crank
  double cycle_offset_turns = 0.0;  // [0, 1) place in the cycle at encoder count 0
  double arm_torque_nm = 0.0;       // [-1e5, 1e5] weight of the arm times the cosine of the angle: 0 is horizontal
  double crank_inertia_kgm2 = 0.0;  // [0, 1e3] slider's mass * (crank radius)^2, referred to the motor shaft
  double crank_torque_nm = 0.0;     // [-1e5, 1e5] slider's weight * crank radius, referred to the motor shaft
  double crank_ratio = 0.0;         // [0, 0.9] crank radius / length of the rod

  bool elastic = false;                 // false: the load is rigid with the rotor
  double stiffness_nm_per_rad = 500.0;  // [1e-3, 1e8] of the coupling
  double damping_nms = 0.01;            // [0, 1e4] of the coupling
  double backlash_rad = 0.0;            // [0, 6.3] total play of the coupling
  // A belt axis: the coupling is two spans of a belt, and stiffness_nm_per_rad is that in the middle of the travel.
  double belt_length_revolutions = 0.0;  // [0, 1e6] distance of the pulleys in motor revolutions; 0: no belt
  double belt_middle_revolutions = 0.0;  // [-1e6, 1e6] place of the middle, from encoder count 0

  std::int64_t low_stop_counts = no_low_limit;    // hard stops; no_low_limit, no_high_limit: none
  std::int64_t high_stop_counts = no_high_limit;  // at least two counts above the low stop
  double stop_stiffness_nm_per_rad = 1.0e5;       // [1e-3, 1e9]
  double stop_damping_nms = 1.0;                  // [0, 1e5]
};

// A spring with a damper between the loads of two axes, as the beam between the two sides of a gantry. Angles are those
// of the motor shafts; stiffness, damping and backlash are referred to the shaft of the first axis.
struct CouplingParameters {
  double ratio = 1.0;                  // 0.001 .. 1000, of either sign: turns of the first shaft in one of the second
  double stiffness_nm_per_rad = 10.0;  // [1e-3, 1e8], if the base tick resolves the vibration
  double damping_nms = 0.002;          // [0, 1e4]; validate() gives the least for a coupling with play
  double backlash_rad = 0.0;           // [0, 6.3] total play
};

// Supply, DC link and protection of the power stage.
struct Supply {
  double volts = 310.0;                     // [0, 2000] rectified, no load: the peak of the mains
  int mains_phases = 0;                     // 0: a constant voltage; 1 or 3: rectified mains with their ripple
  double mains_hz = 50.0;                   // [1, 1000]
  double source_resistance_ohm = 0.3;       // [1e-4, 1e3]
  double capacitance_f = 680.0e-6;          // [1e-6, 10]
  double precharge_time_constant_s = 0.03;  // [0, 10]: charging after the relay closed; then direct
  double bleeder_resistance_ohm = 50.0e3;   // [1, 1e9]: discharges the link
  double standby_w = 0.0;                   // [0, 1e4] of the electronics, from the link if the source is off or lower
  double chopper_resistance_ohm = 40.0;     // [0.1, 1e6] brake resistor
  bool charged_at_start = false;            // the link starts at `volts` with the relay closed, not empty
  double overcurrent_a = 20.0;              // [0.01, 1e5] phase amplitude that trips the comparators
  double bus_overcurrent_a = 40.0;          // [0.01, 1e5] DC current likewise
};

struct Encoder {
  std::int32_t counts_per_revolution = 131072;  // [1, 2^24]
  std::int64_t start_position_counts = 0;       // multi-turn position at power on
  int direction = 1;                            // +1 or -1: direction of counting while the phases turn U, V, W
  double commutation_offset_turns = 0.0;        // [0, 1) electrical angle of the d axis at single-turn count 0
  std::int32_t index_position_counts = 0;       // [0, counts per revolution)
  std::int32_t index_width_counts = 1;          // [0, counts per revolution); 0: no index
};

// A switch on an input wire, actuated while the encoder position lies within [from, to].
struct Switch {
  std::uint8_t wire = 0;                    // 0..31, one switch per wire
  std::int64_t from_counts = no_low_limit;  // open-ended: no_low_limit
  std::int64_t to_counts = no_high_limit;   // open-ended: no_high_limit
  std::int64_t hysteresis_counts = 0;       // [0, 2^31]: releases only this far outside of the region
  bool normally_closed = false;             // the wire is high while not actuated
};

inline constexpr std::size_t most_switches = 8;

// Heat flows from winding to case to ambient in the motor, and from power stage to ambient in the drive. The encoder
// has the temperature of the case.
struct Thermal {
  double ambient_c = 25.0;                      // [-60, 150]
  double winding_heat_capacity_j_per_k = 60.0;  // [0.01, 1e7]
  double winding_to_case_k_per_w = 1.0;         // [1e-4, 1e4]
  double case_heat_capacity_j_per_k = 400.0;    // [0.01, 1e7]
  double case_to_ambient_k_per_w = 1.8;         // [1e-4, 1e4]
  double stage_heat_capacity_j_per_k = 200.0;   // [0.01, 1e7]
  double stage_to_ambient_k_per_w = 1.5;        // [1e-4, 1e4]
  double stage_standby_w = 5.0;                 // [0, 1e5] while the PWM runs
  double stage_resistance_ohm = 0.1;            // [0, 100] per phase, of the switches: heats, without a voltage drop
};

// Deviations of the real power stage from its command. Typical values of a drive of a few hundred watts.
struct Stage {
  bool ideal = true;                    // no deviations
  int delay_ticks = 1;                  // [0, 3] from the current sampling to the voltage that responds to it
  double dead_time_us = 1.5;            // [0, 10] of a half bridge
  double dead_time_compensation = 0.9;  // [0, 1] share of the dead time that the drive compensates
  double switch_drop_v = 1.0;           // [0, 10] across a conducting transistor or diode
  double modulation_limit = 0.96;       // [0.1, 1] greatest share of the DC link that the duty cycles use
};

// Errors of the current and position sensors. Current errors are shares of the range.
struct Sensors {
  bool ideal = true;                         // true values, in whole counts
  std::uint32_t seed = 1;                    // for noise, offsets, gains and phases
  double current_range_a = 0.0;              // [0, 1e5] amplitude; 0: supply.overcurrent_a
  int current_bits = 12;                     // [0, 24] of the converter, for both directions; 0: no quantisation
  double current_noise = 0.0003;             // [0, 0.1] r.m.s.
  double current_offset = 0.001;             // [0, 0.1] at most, of each phase; the drive measures it at power-on
  double current_gain_error = 0.005;         // [0, 0.2] at most, of each phase
  double encoder_noise_arcsec = 2.0;         // [0, 36000] r.m.s.
  double encoder_latency_us = 20.0;          // [0, 250]
  double eccentricity_arcsec = 20.0;         // [0, 36000] amplitude, once per turn
  int encoder_lines = 64;                    // [0, 1000000] signal periods of a turn; 0: no interpolation
  double interpolation_arcsec = 5.0;         // [0, 36000] amplitude, once per signal period
  double interpolation_second_arcsec = 3.0;  // [0, 36000] twice per signal period
};

struct Parameters {
  Motor motor;
  Load load;
  Supply supply;
  Encoder encoder;
  std::array<Switch, most_switches> switches{};
  std::size_t switch_count = 0;  // number of switches in use, at the start of the array
  Thermal thermal;
  Stage stage;
  Sensors sensors;
};

// Switches off everything in which a real machine differs from an ideal one: errors of power stage and sensors, ripple
// of the mains, saturation, warm magnets, iron loss, cogging, Stribeck friction, the brake's rise and wear, the change
// of a belt's stiffness. The machine itself stays: its friction, elastic coupling, backlash, arm and crank.
void remove_imperfections(Parameters& parameters);

// Returns one message for each error in `parameters`, beginning with the name of the parameter ("motor.pole_pairs:
// ..."). If it is empty, a Plant can be constructed.
std::vector<std::string> validate(const Parameters& parameters);
// The same for the coupling of two axes ("ratio: ..."), and valid parameters of its axes.
std::vector<std::string> validate(const CouplingParameters& coupling, const Parameters& first,
                                  const Parameters& second);

}  // namespace servodrome::plant
