#pragma once

#include <cstdint>

#include "drive/hardware.hpp"
#include "drive/transforms.hpp"
#include "plant/dc_link.hpp"
#include "plant/heat.hpp"
#include "plant/injection.hpp"
#include "plant/measurement.hpp"
#include "plant/parameters.hpp"
#include "plant/power_stage.hpp"
#include "plant/shaft.hpp"
#include "plant/travel.hpp"
#include "plant/windings.hpp"

namespace servodrome::plant {

// Energy balance in J since construction, for tests and information.
struct Energy {
  double supplied_j = 0.0;     // from the source into the DC link (after the source resistance)
  double chopped_j = 0.0;      // into brake and bleeder resistor
  double standby_j = 0.0;      // from the DC link into the drive's electronics, while the source does not feed them
  double stage_j = 0.0;        // from the DC link into the power stage's heat
  double to_motor_j = 0.0;     // from the DC link into the phases; negative while regenerating
  double copper_j = 0.0;       // into the windings' heat
  double iron_j = 0.0;         // into the iron's heat, by hysteresis and eddy currents
  double brake_j = 0.0;        // friction work of the brake
  double shaft_j = 0.0;        // work of the electromagnetic torque
  double link_stored_j = 0.0;  // now in the DC link's capacitor
  double magnetic_j = 0.0;     // now in the windings
  double kinetic_j = 0.0;      // now in rotor and load
  double elastic_j = 0.0;      // now in coupling and hard stops
  double weight_j = 0.0;       // now in the height of arm or crank
  double cogging_j = 0.0;      // now in the attraction of magnets and teeth
  double stop_j = 0.0;         // into the damping of the hard stops
};

// One axis: everything that a drive's power stage and terminals are connected to. Its state depends only on its
// parameters and on the calls: no clock, no true randomness, no memory allocation in step().
class Plant {
 public:
  // Throws std::invalid_argument with the first message of validate(), if there is one.
  explicit Plant(const Parameters& parameters);

  // Advances by one base tick (62.5 us) with `actuation` held, then samples `feedback` at its end.
  void step(const drive::Actuation& actuation, drive::Feedback& feedback) {
    imperfect_ ? step_imperfect(actuation, feedback) : step_machine(actuation, feedback);
  }

  // For AxisCoupling: the axis is coupled to another one, whose torque on the load in the next ticks `pull` sets,
  // positive towards larger counts.
  void couple() { shaft_.couple(); }
  void pull(double torque_nm) {
    if (torque_nm == shaft_.pull_nm()) return;
    shaft_.set_pull(torque_nm);
    rests_ = false;
  }

  // Fills `feedback` with the present state without advancing; without edges. For a drive that was just switched on.
  void sample(drive::Feedback& feedback) const;

  // --- Bench hooks; effective from the next step. Values outside the accepted range throw std::invalid_argument.
  void set_external_torque_nm(double torque_nm);
  void set_load_inertia_kgm2(double inertia_kgm2);
  void set_coulomb_friction_nm(double torque_nm);  // of the load; also raises the breakaway torque by the same amount
  void set_supply_v(double volts);
  void set_ambient_c(double temperature_c);
  void set_position_counts(std::int64_t position_counts);  // places the axis at rest; no edges
  void lock_rotor(bool locked);
  void force_input(int wire, bool level);  // wire 0..31; a changed level gives an edge at the present position
  void release_input(int wire);            // the wire follows its switch again
  void inject(Injection injection, bool on);
  bool injected(Injection injection) const { return (injections_ >> static_cast<unsigned>(injection) & 1u) != 0; }

  // Power cycle of the drive's electronics: empties the DC link; injections and forced inputs remain.
  void discharge_dc_link();

  // --- The true state, without sensor errors.
  const Parameters& parameters() const;
  std::int64_t position_counts() const;
  double position_fraction() const;                       // of a count, [0, 1): true position = counts + fraction
  double velocity_rpm() const;                            // of the rotor
  double load_velocity_rpm() const;                       // differs from the rotor's with an elastic coupling
  double load_position_counts() const;                    // also differs then; in counts of the encoder
  double coupling_twist_rad() const;                      // rotor minus load
  double load_angle_rad(std::int64_t from_counts) const;  // of the motor shaft, from this position
  double load_speed_rad_s() const { return shaft_.load_speed_rad_s(); }
  double torque_nm() const;               // electromagnetic, average of the last tick
  double current_a() const;               // torque-producing (q), amplitude, signed
  double direct_current_a() const;        // amplitude
  double electrical_angle_turns() const;  // of the d axis against phase U, [0, 1); V leads by 1/3, with two phases 1/4
  double dc_link_v() const;
  double winding_temperature_c() const;
  double case_temperature_c() const;
  double power_stage_temperature_c() const;
  double brake_torque_nm() const;  // friction of the brake at present
  bool brake_engaged() const;
  bool rotor_locked() const;
  Energy energy() const;

 private:
  static constexpr double phases_in_turn = 0x1p32;  // of drive::Phase

  enum class Bridge : std::uint8_t { driven, freewheeling, open_phase };

  // Deviations from three sound phases and a sound encoder, in unusual_: one bit for each open phase U, V, W, one for
  // each shorted phase, one for two windings in quadrature, one for a frozen position.
  static constexpr unsigned open_shift = 0;
  static constexpr unsigned short_shift = 3;
  static constexpr unsigned open_bits = 7u << open_shift;
  static constexpr unsigned two_phases = 1u << 6;
  static constexpr unsigned encoder_frozen = 1u << 7;
  static constexpr unsigned seen_otherwise = open_bits | two_phases | encoder_frozen;  // visible in the feedback

  struct Stationary {
    double alpha = 0.0;
    double beta = 0.0;
  };

  // State of the inverter in this tick, in the stator frame.
  struct Excitation {
    Bridge bridge = Bridge::driven;
    Stationary volts{};
    Stationary axis{};     // open_phase: direction of the current; zero: there is no path for one
    bool blocked = false;  // open_phase: freewheeling
  };

  // Windings and shaft at the end of a tick.
  struct Motion {
    WindingTick windings{};
    ShaftTick shaft{};
  };

  void step_machine(const drive::Actuation& actuation, drive::Feedback& feedback);
  void step_imperfect(const drive::Actuation& actuation, drive::Feedback& feedback);
  Turn foresee(double speed_rad_s) const { return {speed_rad_s, angle_per_speed_ * speed_rad_s}; }
  // Returns true if the real speed differs from the predicted speed by more than the windings tolerate.
  bool astray(const WindingTick& tick) const {
    constexpr double most_rad = 1.0e-3;  // electrical
    return std::abs(angle_per_speed_ * tick.unforeseen_rad_s) > most_rad;
  }
  WindingTick solve_driven(Stationary volts, const Turn& turn, const ShaftResponse& shaft) const;
  WindingTick solve_turn(const Excitation& excitation, const Turn& turn, const ShaftResponse& shaft,
                         const Guess& guess) const;
  WindingTick solve_windings(const Excitation& excitation, const ShaftResponse& shaft) const;
  WindingTick solve_further(const Excitation& excitation, const ShaftResponse& shaft) const;
  Stationary inverter_voltage(const drive::Actuation& actuation) const;
  Excitation unusual_excitation(const drive::Actuation& actuation) const;
  template <typename MeanSpeed>
  WindingTick solve_bracketed(const Excitation& excitation, MeanSpeed mean_speed) const;
  template <typename SolveShaft>
  Motion settle(const Excitation& excitation, double torque, ShaftTick tick, SolveShaft solve_shaft) const;
  Motion solve_turning(const Excitation& excitation, double other_torque_nm, const Motion& first) const;
  Motion solve_general(const Excitation& excitation, double rotor_torque_nm, double torque_nm) const;
  void apply_load();
  void queue_edge(int wire);
  StopDistance stop_distance() const;
  double cogging_torque_nm() const;
  double cogging_j() const;
  double adapt();
  void book(const ShaftTick& shaft);
  double load_revolutions() const { return load_position_counts() / counts_per_revolution_; }
  void operate_brake(bool released);
  void update_brake();
  void update_heat(bool pwm);
  void update_resistance();
  void update_flux();
  void update_readings();
  double fraction() const { return off_middle_ + 0.5; }
  // The electrical angle in units of drive::Phase.
  double electrical_phase() const { return (single_turn_ + off_middle_) * phase_per_count_ + middle_phase_; }
  void update_angle(double phase);
  bool at_rest() const;
  void rest(const drive::Actuation& actuation, drive::Feedback& feedback);
  void wrap_single_turn();
  void place(std::int64_t position_counts);
  std::uint32_t overcurrent_bits(const drive::Feedback& feedback) const;
  void fill(drive::Feedback& feedback) const;
  void fill_without_current(drive::Feedback& feedback) const;
  void fill_unusual(Stationary current, drive::Feedback& feedback) const;

  // Used in every tick, in the order of use.
  Windings windings_;
  double torque_nm_ = 0.0;
  double sine_ = 0.0;  // of the electrical angle at the end of the last tick
  double cosine_ = 1.0;
  double angle_per_speed_;     // electrical rad in a tick per rad/s
  std::int64_t position_ = 0;  // counts; true position = position_ + fraction()
  double off_middle_ = -0.5;   // the shaft's place from the middle of the count, [-0.5, 0.5)
  double single_turn_ = 0.0;   // whole counts
  double counts_per_speed_;    // counts per tick per rad/s
  double phase_per_count_;     // drive::Phase per count
  double phase_per_speed_;     // drive::Phase per tick per rad/s
  double middle_phase_;        // at the middle of the count 0
  double overcurrent_squared_;
  double bus_overcurrent_a_;
  double stage_factor_;               // W in the power stage per square of the current amplitude
  double stage_standby_w_;            // while the PWM runs
  double current_squared_sum_ = 0.0;  // since the last heat step
  double motor_power_sum_w_ = 0.0;    // of all ticks
  double shaft_power_sum_w_ = 0.0;
  double stop_j_ = 0.0;
  int heat_countdown_ = Heat::ticks_per_step;
  bool uneven_ = false;  // cogging, or a load that depends on its place or speed
  bool books_ = false;   // book() has something to do
  bool brake_engaged_ = true;
  bool brake_command_released_ = false;
  std::int32_t brake_countdown_ = 0;  // ticks until the command takes effect; 0: settled
  std::uint8_t unusual_ = 0;
  bool bridges_run_ = false;  // in the last tick, for two phases
  bool imperfect_;            // the power stage or the sensors have errors
  bool rests_ = false;        // held by friction without current: nothing moves until the drive or the bench acts
  std::uint32_t encoder_faults_ = 0;
  std::uint32_t hardware_faults_ = 0;
  std::int32_t counts_per_revolution_;
  float winding_reading_c_ = 25.0F;
  float stage_reading_c_ = 25.0F;
  float encoder_reading_c_ = 25.0F;
  float ambient_reading_c_ = 25.0F;
  Travel travel_;
  DcLink dc_link_;
  Shaft shaft_;

  // Used rarely.
  Heat heat_;
  PowerStage stage_;
  Measurement measurement_;
  std::array<double, 3> current_a_{};  // true currents of the phases, kept because the feedback holds measured ones
  double switch_j_ = 0.0;              // loss in switches and diodes since the last heat step
  double copper_j_ = 0.0;
  double iron_j_ = 0.0;
  double iron_since_j_ = 0.0;  // since the last heat step
  double brake_j_ = 0.0;
  double brake_share_ = 1.0;       // of the torque, while it builds up
  double resistance_at_c_ = 25.0;  // winding temperature for which the present resistance was calculated
  double flux_at_c_ = 25.0;        // case temperature for which the magnets' present flux was calculated
  std::int64_t frozen_position_ = 0;
  std::uint32_t injections_ = 0;
  bool locked_ = false;
  std::uint8_t pending_edge_count_ = 0;  // edges of forced inputs, for the next tick
  std::array<drive::Edge, 4> pending_edges_{};
  Parameters parameters_;
};

}  // namespace servodrome::plant
