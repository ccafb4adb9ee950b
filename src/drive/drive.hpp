#pragma once

#include <array>
#include <optional>
#include <span>

#include "dictionary/dictionary.hpp"
#include "drive/axis.hpp"
#include "drive/cause_set.hpp"
#include "drive/hardware.hpp"
#include "drive/io/input_filter.hpp"
#include "drive/loops/current_offset.hpp"
#include "drive/modes/cyclic_modes.hpp"
#include "drive/modes/homing_mode.hpp"
#include "drive/modes/no_mode.hpp"
#include "drive/modes/profile_position.hpp"
#include "drive/modes/velocity_modes.hpp"
#include "drive/power/power_state.hpp"
#include "drive/power/slowing.hpp"
#include "drive/supervision.hpp"
#include "drive/touch_probe.hpp"
#include "drive/trajectory/lag_filter.hpp"
#include "drive/trajectory/moving_average.hpp"
#include "drive/tuning/inertia_identification.hpp"

namespace servodrome::drive {

// Callbacks for changes in the list of faults; a device sends an EMCY and keeps its history.
class DriveEvents {
 public:
  virtual void fault_raised(const FaultRow&) {}
  virtual void warning_raised(const FaultRow&) {}  // Reaction::none
  // Faults were reset, or warnings ended. `remaining` are the error register bits of the remaining faults and warnings.
  virtual void errors_gone(std::uint8_t /*remaining*/) {}

 protected:
  ~DriveEvents() = default;
};

// A CiA 402 servo drive: power states, modes of operation, loops, monitors, terminals. It is the same for all products,
// which differ in Policy and Configuration. It owns the objects with Owner::drive in the device's dictionary.
class Drive final : public dictionary::Listener {
 public:
  // `objects_base`: offset of `objects` in the struct to which the dictionary's offsets refer.
  Drive(const Policy& policy, Objects& objects, std::size_t objects_base);

  void set_events(DriveEvents* events) { events_ = events; }
  const Policy& policy() const { return policy_; }

  // Adopts motor, gains, thresholds and terminals; may be called while the drive runs.
  void configure(const Configuration& configuration);
  const Configuration& configuration() const { return axis_.configuration; }
  // Sets the gains only, for devices that switch them while the axis moves.
  void set_gains(const Gains& gains) {
    axis_.configuration.gains = gains;
    cascade_.configure(axis_.configuration.motor, gains, rates_);
  }

  // Resets all volatile state, as a switch-on of the control supply does. The caller loads the values of the objects
  // before.
  void power_on(const Feedback& feedback);
  // The same without a loss of supply, for NMT reset node. Encoder, coordinates and input levels keep their values.
  void restart();

  // Call this when the encoder's position was changed without a motion while the motor was off.
  void displaced(const Feedback& feedback);

  // One base tick: 62.5 us. Returns true if it ran a position-loop cycle. Such a tick writes all of `actuation`, the
  // others write the phase voltages only, so the caller must pass the same object every time.
  bool tick(const Feedback& feedback, Actuation& actuation);

  // --- Tuning
  // Identifies the load by motions of the drive itself, instead of the mode of operation; afterwards the mode continues
  // from the axis' position. Returns false unless operation is enabled and the axis is commanded to stand.
  bool identify_inertia(const InertiaIdentification::Request& request);
  void stop_identification();  // the axis comes to rest
  const InertiaIdentification& identification() const { return identification_; }
  // See Cascade::set_analysis; cleared by power_on. A motion, and the beginning of a stop, such as a halt, end the
  // analysis.
  void set_analysis(ResonanceAnalysis* analysis) { cascade_.set_analysis(analysis); }

  // --- Events from the bus
  void synchronise();
  // The reaction is that of 6007h or, for some products, always the fault `cause`.
  void communication_lost(Cause cause = Cause::communication_lost);
  // A warning of the device around the drive. It sets bit 7 of the statusword.
  void show_warning(bool present) { outside_warning_ = present; }

  // --- Terminals
  // A command that the device derives from its inputs; it acts like a controlword from the bus.
  void command(std::uint16_t controlword);
  // Clears bits of the controlword without a command: the mode sees the edge, but the rest of the word, which may be an
  // old command that was refused, does not act again.
  void clear_controlword_bits(std::uint16_t bits);
  // Levels of outputs that the device controls itself, bit n for output n, in addition to those of 60FEh.
  void set_outputs(std::uint32_t levels) { terminal_outputs_ = levels; }
  std::uint32_t wires() const { return wires_; }  // levels of the inputs, including inputs that the bus commands
  // Application counts at which the limit switch last became active.
  Counts positive_limit_position() const { return limit_positions_[1]; }
  Counts negative_limit_position() const { return limit_positions_[0]; }
  const TouchProbe& touch_probe() const { return touch_probe_; }
  void set_touch_probe_function(std::uint16_t function);  // same effect as a write of 60B8h

  // --- Faults
  void raise(Cause cause);                 // by the device around the drive, e.g. sync_lost
  void inject(Cause cause, bool present);  // for causes that only hardware has
  bool is_active(Cause cause) const { return active_.test(cause); }
  bool any_fault() const { return active_.any(); }
  bool warns(Cause cause) const { return warned_.test(cause); }
  std::uint8_t error_register() const;  // the bits of 1001h of all present faults and warnings
  // The fault in 603Fh: the newest, or the first (Policy::first_fault_is_shown).
  const FaultRow* shown_fault() const { return shown_fault_; }
  const FaultRow* row(Cause cause) const;
  void clear_multi_turn() { multi_turn_cleared_ = true; }  // the user declares that the encoder's turns are valid

  // --- State of the drive
  PowerState state() const { return state_; }
  // Returns true if the mode of operation controls the axis: no stop, halt, brake or end of operation does.
  bool runs_mode() const {
    return state_ == PowerState::operation_enabled && stage_ == Stage::on && !pending_.active && !stopping_ && !halted_;
  }
  // Returns true if the axis rests under the control of its loops, so that a tuning function may excite it.
  bool rests_under_control() const {
    return (runs_mode() || halted_at_rest()) && !in_motion() && axis_.demand.loop != Loop::locked;
  }
  // Returns true if a halt holds the axis at rest.
  bool halted_at_rest() const { return halted_ && !pending_.active && axis_.generator.standing(); }
  // Returns true if this row of Policy::transitions could happen now; false if the row does not begin in the present
  // state.
  bool accepts(const Transition& transition) const;
  Mode mode() const { return mode_; }
  std::uint16_t statusword() const;
  bool in_motion() const { return !axis_.generator.standing(); }
  bool demand_smoothed() const { return !smoothing_pending_; }  // the smoothed demand has reached the demand
  bool energised() const { return stage_ != Stage::off; }
  bool brake_released() const {
    return stage_ == Stage::releasing_brake || stage_ == Stage::on || coasting_cycles_ != 0;
  }
  bool chopper_on() const { return supervision_.chopper(); }
  bool homed() const { return axis_.homed; }
  // Homing handles limit switches itself from its first leg on.
  bool homes() const { return mode_ == Mode::homing && homing_mode_.active() && !homing_mode_.awaits_rest(); }
  // The direction (-1, +1) in which homing presses against a hard stop; 0: it does not, or a stop has its torque.
  int presses() const { return mode_ == Mode::homing && !stopping_ ? homing_mode_.pressing() : 0; }
  // The leg of the homing that runs, from 0; -1: none.
  int homing_leg() const { return mode_ == Mode::homing && homing_mode_.active() ? homing_mode_.leg() : -1; }
  bool homing_running() const { return mode_ == Mode::homing && homing_mode_.running(); }
  // Homing::index_distance of the last homing, in counts.
  Counts homing_index_distance() const { return homing_mode_.index_distance(); }
  float dc_link_v() const { return dc_link_v_; }
  float winding_temperature_c() const { return winding_temperature_c_; }
  float power_stage_temperature_c() const { return power_stage_temperature_c_; }
  Counts position_offset() const { return axis_.offset; }
  void set_position_offset(Counts offset) { axis_.offset = offset; }
  const CascadeState& loops() const { return cascade_.state(); }
  const CurrentOffset& current_offset() const { return current_offset_; }
  const Axis& axis() const { return axis_; }
  std::uint32_t single_turn_counts() const { return single_turn_counts_; }  // Feedback::single_turn_counts of now
  double i2t_utilisation_percent() const { return supervision_.i2t_utilisation_percent(); }
  double stage_utilisation_percent() const { return supervision_.stage_utilisation_percent(); }

  // --- dictionary::Listener
  dictionary::AbortCode check(const dictionary::Entry& entry, std::span<const std::byte> value) override;
  void written(const dictionary::Entry& entry) override;
  void refresh(const dictionary::Entry& entry) override;
  dictionary::Handlers handlers(const dictionary::Entry& entry) override;

  // Applies objects that have an effect when written, after they were loaded without the callback `written`. The
  // controlword is a command and acts only when it is written.
  void objects_loaded();

 private:
  // The transition at the end of the present stop.
  struct PendingTransition {
    bool active = false;
    PowerState to = PowerState::switch_on_disabled;
  };
  enum class Stage : std::uint8_t { off, releasing_brake, on, engaging_brake };
  static constexpr std::size_t edge_capacity = 16;

  // object_access.cpp
  struct OwnObjects;  // objects from `first` to `last` with callbacks
  static std::span<const OwnObjects> own_objects();
  static const dictionary::Handlers* handlers_of(const dictionary::Entry& entry);
  void show_touch_probe_position(std::size_t slot);
  void show_digital_inputs();
  dictionary::AbortCode check_units(const dictionary::Entry& entry, std::span<const std::byte> value) const;

  // power.cpp
  void handle_controlword(std::uint16_t before, std::uint16_t now);
  void handle_command(Command command);
  Stop stop_of(std::int16_t code) const;
  // Interpolated position is active, with the buffer 60C4h.
  bool buffers_records() const {
    return mode_ == Mode::interpolated_position && state_ == PowerState::operation_enabled &&
           policy_.interpolation == Interpolation::buffered;
  }
  bool has_power_in(PowerState state) const;
  bool dc_link_charged() const;
  void step_dc_link();
  void leave_operation(Stop stop, PowerState to);
  bool hold_for_brake();
  bool too_fast_for_brake() const;
  void engage_brake();
  void enter_state(PowerState to);
  void begin_stop(Stop stop, bool apart = false);
  void begin_ramp();
  double deceleration_of(Stop stop) const;
  bool without_ramp() const { return stop_ == Stop::current_limit || stop_ == Stop::voltage_limit; }
  bool meets_limit_switch() const;
  void end_halted_motion_at_limit_switch();
  void keep_stop_within_limits();
  void take_over_shaft(bool apart = false);
  void leave_smoothing();
  void keep_near_shaft();
  void come_to_rest_at_brake();
  void slow_down_with_shaft();
  void watch_standstill();
  double quick_stop_deceleration() const;  // counts/s^2
  bool stop_finished() const;
  void step_stop();
  void step_power();
  void switch_power(bool on);

  // fault_reactions.cpp
  void show_fault(const FaultRow& row);
  void react_to_fault(const FaultRow& row);
  bool reset_faults();
  void collect_faults();
  CauseSet present_causes() const;

  // drive.cpp
  void cycle(const Feedback& feedback);
  void trip(std::uint32_t faults, bool cycle_due, Actuation& actuation);
  void look_for_open_phase(const Feedback& feedback, const Actuation& actuation);
  void update_inputs(const Feedback& feedback);
  void calibrate_currents(const Feedback& feedback);
  void capture_edges(const Feedback& feedback);
  void note_edge(const SignalEdge& edge);
  void note_level_edges(std::uint32_t changed);
  void change_mode() {
    const auto wanted = static_cast<Mode>(axis_.objects.modes_of_operation);
    if (wanted != mode_ && (wanted != Mode::none || !policy_.mode_zero_keeps)) enter_mode(wanted);
  }
  void enter_mode(Mode wanted);
  void run_mode();
  void limit_switches(Counts before);
  double demanded_direction(Counts before) const;
  bool demand_lags() const { return smoothing_pending_ && smoothed_loop_ == axis_.demand.loop; }
  double velocity_of_demand() const;
  bool pushes_limit_switch(Counts before) const;
  void end_identification();
  void return_to_mode();
  void stop_after_identification();
  struct Smoothing {
    std::size_t cycles = 0;  // of the moving average; 0: none
    float lag_ms = 0.0F;     // of a low pass; 0: none
    bool any() const { return cycles > 0 || lag_ms > 0.0F; }
    friend bool operator==(const Smoothing&, const Smoothing&) = default;
  };
  Smoothing smoothing_asked_for() const;
  std::optional<std::int64_t> standing_demand() const;
  void smooth_demand(std::optional<std::int64_t> from);
  float known_load();  // torque, fraction of rated
  void hold_by_current();
  // Returns true if update_greatest_velocity() has nothing to do, as in nearly all cycles: 6080h has not changed, the
  // limit in force is the one that is set, and the shaft does not turn without power.
  bool holds_greatest_velocity() const {
    return axis_.objects.max_motor_speed_rpm == greatest_of_rpm_ && axis_.greatest_velocity == set_greatest_velocity_ &&
           (energised() || axis_.velocity() == 0.0);
  }
  void update_greatest_velocity();
  void set_limits();
  void write_actuation();
  void set_mode(Mode mode);
  std::uint32_t status_sources() const;
  bool shows(StatusSource source) const { return (shown_sources_ & bit(source)) != 0; }
  bool set_units();
  void load_touch_probe();
  Rates wanted_rates() const;
  void set_rates();
  // Calls `function` with the object of the present mode.
  template <typename Self, typename Function>
  static auto with_mode(Self& self, Function&& function);

  const Policy& policy_;
  TransitionTable transitions_;
  std::uint32_t shown_sources_ = 0;  // bit(StatusSource) of the sources that this policy shows
  std::array<std::uint16_t, status_sources_count> shown_bits_{};  // bits that show each of them in the present mode
  std::size_t objects_base_;
  DriveEvents* events_ = nullptr;
  Axis axis_;
  Cascade cascade_{};
  Supervision supervision_;
  CurrentOffset current_offset_{};
  TouchProbe touch_probe_;

  NoMode no_mode_{};
  ProfilePosition profile_position_{};
  VelocityMode velocity_mode_{};
  ProfileVelocity profile_velocity_{};
  ImmediateVelocity immediate_velocity_{};
  ProfileTorque profile_torque_{};
  HomingMode homing_mode_{};
  InterpolatedPosition interpolated_position_{};
  SynchronousInterpolation synchronous_interpolation_{};
  CyclicSyncPosition cyclic_sync_position_{};
  CyclicSyncVelocity cyclic_sync_velocity_{};
  CyclicSyncTorque cyclic_sync_torque_{};
  InertiaIdentification identification_{};  // replaces the mode while it runs

  PowerState state_ = PowerState::not_ready_to_switch_on;
  Mode mode_ = Mode::none;
  std::uint16_t controlword_ = 0;
  PendingTransition pending_{};
  bool stopping_ = false;  // the generator runs a stop instead of the mode
  bool halted_ = false;
  bool limit_stop_ = false;             // a limit switch caused the stop
  double set_greatest_velocity_ = 0.0;  // counts/s, in the previous cycle
  // the 6080h it was computed from; empty: units or motor have changed
  std::optional<std::uint32_t> greatest_of_rpm_{};
  // the demand was set to another position, so the following error of the loops is obsolete
  bool moved_demand_ = false;
  bool held_by_current_ = false;
  Stop stop_ = Stop::power_off;
  Loop stop_loop_ = Loop::position;
  double stop_deceleration_ = 0.0;  // planned deceleration of its ramp, counts/s^2
  Stage stage_ = Stage::off;
  std::uint32_t stage_cycles_ = 0;
  std::uint32_t brake_closed_cycles_ = 0;
  std::uint32_t coasting_cycles_ = 0;  // cycles that the brake may still wait for an axis without power to slow down
  bool short_circuit_ = false;
  Dwell standstill_{};
  std::uint32_t rest_wait_cycles_ = 0;  // since the end of a stop's ramp
  Slowing slowing_{};                   // of a stop without a ramp
  Dwell braked_{};                      // time braked by short circuit
  Dwell outrun_{};                      // time for which a ramp to rest was much faster than the shaft
  bool braked_to_rest_ = false;
  bool zero_speed_ = false;  // held at once, without a ramp, until the brake has closed

  CauseSet active_{};  // latched faults
  CauseSet injected_{};
  CauseSet latched_{};  // faults that the failed part itself keeps until it loses its supply
  CauseSet warned_{};   // warnings that were reported
  bool outside_warning_ = false;
  bool units_valid_ = true;
  bool current_offset_great_ = false;
  const FaultRow* shown_fault_ = nullptr;
  bool multi_turn_cleared_ = false;

  LagFilter lag_{};
  Loop smoothed_loop_ = Loop::off;  // loop of the averaged demand
  Smoothing smoothing_by_{};
  static constexpr std::int64_t smoothed_unit = 65536;  // parts of a count, or of a count per second
  std::int64_t smoothed_value_ = 0;                     // the mean
  float smoothed_velocity_ = 0.0F;                      // counts/s
  bool smoothing_pending_ = false;                      // the smoothed demand has not reached the demand
  int friction_direction_ = 0;                          // direction of the last motion in the position loop

  Actuation outputs_{};  // all members but the phase voltages, set once per cycle
  std::uint32_t last_inputs_ = 0;
  std::uint32_t levels_ = 0;  // levels of the inputs at their last change
  InputFilter input_filter_{};
  std::uint32_t wires_ = 0;
  std::uint32_t single_turn_counts_ = 0;
  Counts position_of_ms_ = 0;
  std::uint32_t cycles_of_ms_ = 0;
  std::uint32_t terminal_outputs_ = 0;
  std::array<Counts, 2> limit_positions_{};  // negative, positive
  bool warnings_ = false;
  std::uint32_t dc_link_cycles_ = 0;  // since the DC link was connected
  bool awaits_dc_link_ = false;       // transition 3 waits for the DC link's voltage
  std::uint16_t word_before_wait_ = 0;
  float dc_link_v_ = 0.0F;
  float dc_link_rise_v_ = 0.0F;  // rise in the last cycle
  float winding_temperature_c_ = 0.0F;
  float power_stage_temperature_c_ = 0.0F;
  std::size_t edge_count_ = 0;     // of edges_
  std::uint32_t tripped_ = 0;      // HardwareFault bits since the last cycle
  std::uint32_t comparators_ = 0;  // HardwareFault bits of the comparators that the product has
  std::uint32_t look_at_ = 0;      // next check for an open phase, in ticks of the cascade
  Rates rates_{0, 0};              // in force
  // Large and seldom used, so placed after the members that each cycle needs.
  std::array<SignalEdge, edge_capacity> edges_{};  // since the last cycle
  MovingAverage smoothing_{};
};

}  // namespace servodrome::drive
