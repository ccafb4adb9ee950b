#pragma once

#include "drive/hardware.hpp"
#include "plant/injection.hpp"
#include "plant/parameters.hpp"

namespace servodrome::plant {

// Energy book, in J since construction, for tests and the curious.
struct Energy {
  double supplied_j = 0.0;     // from the source into the DC link (after the source resistance)
  double chopped_j = 0.0;      // into brake and bleeder resistor
  double to_motor_j = 0.0;     // from the DC link into the phases; negative while regenerating
  double copper_j = 0.0;       // into the windings' heat
  double shaft_j = 0.0;        // work of the electromagnetic torque
  double link_stored_j = 0.0;  // now in the DC link's capacitor
  double magnetic_j = 0.0;     // now in the windings
  double kinetic_j = 0.0;      // now in rotor and load
  double elastic_j = 0.0;      // now in coupling and hard stops
};

// One axis: what a drive's power stage and terminals are connected to. A pure function of its parameters and of the
// calls made to it: no clock, no randomness, no memory taken by step().
class Plant {
 public:
  // `parameters` must be such that validate() has nothing to say; throws std::invalid_argument with its first message.
  explicit Plant(const Parameters& parameters);

  // Advances by one base tick (62.5 us) with `actuation` held, then samples `feedback` at its end.
  void step(const drive::Actuation& actuation, drive::Feedback& feedback);

  // Fills `feedback` with the present state without advancing; no edges. For a drive that is just powered up.
  void sample(drive::Feedback& feedback) const;

  // --- Bench hooks; effective from the next step. Values outside of the accepted range throw std::invalid_argument.
  void set_external_torque_nm(double torque_nm);
  void set_load_inertia_kgm2(double inertia_kgm2);
  void set_coulomb_friction_nm(double torque_nm);  // of the load; breakaway torque is raised by the same amount
  void set_supply_v(double volts);
  void set_ambient_c(double temperature_c);
  void set_position_counts(std::int64_t position_counts);  // places the axis at rest; switch levels follow, no edges
  void lock_rotor(bool locked);
  void force_input(int wire, bool level);  // wire 0..31; a change of level gives an edge at the present position
  void release_input(int wire);            // back to the geometry
  void inject(Injection injection, bool on);
  bool injected(Injection injection) const;

  // Power cycle of the drive's electronics: the DC link is emptied, injections and forced inputs stay.
  void discharge_dc_link();

  // --- The true state, whatever the sensors say.
  const Parameters& parameters() const;
  std::int64_t position_counts() const;
  double position_fraction() const;       // of a count, [0, 1): true position = counts + fraction
  double velocity_rpm() const;            // of the rotor
  double load_velocity_rpm() const;       // differs from the rotor's with an elastic coupling
  double load_position_counts() const;    // likewise; relative to the encoder
  double coupling_twist_rad() const;      // rotor minus load
  double torque_nm() const;               // electromagnetic, average of the last tick
  double current_a() const;               // torque-producing (q), amplitude, signed
  double direct_current_a() const;        // amplitude
  double electrical_angle_turns() const;  // of the d axis against phase U, [0, 1)
  double dc_link_v() const;
  double winding_temperature_c() const;
  double case_temperature_c() const;
  double power_stage_temperature_c() const;
  bool brake_engaged() const;
  bool rotor_locked() const;
  Energy energy() const;
};

}  // namespace servodrome::plant
