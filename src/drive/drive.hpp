#pragma once

#include <array>
#include <optional>
#include <span>

#include "dictionary/dictionary.hpp"
#include "drive/axis.hpp"
#include "drive/cause_set.hpp"
#include "drive/demand_smoothing.hpp"
#include "drive/hardware.hpp"
#include "drive/io/input_filter.hpp"
#include "drive/loops/current_offset.hpp"
#include "drive/modes/cyclic_modes.hpp"
#include "drive/modes/homing_mode.hpp"
#include "drive/modes/no_mode.hpp"
#include "drive/modes/profile_position.hpp"
#include "drive/modes/velocity_modes.hpp"
#include "drive/power/dc_link_watch.hpp"
#include "drive/power/power_stage.hpp"
#include "drive/power/power_state.hpp"
#include "drive/power/stop_run.hpp"
#include "drive/supervision.hpp"
#include "drive/touch_probe.hpp"
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
  void show_warning(bool present) { faults_.device_warns = present; }

  // --- Terminals
  // A command that the device derives from its inputs; it acts like a controlword from the bus.
  void command(std::uint16_t controlword);
  // Clears bits of the controlword without a command: the mode sees the edge, but the rest of the word, which may be an
  // old command that was refused, does not act again.
  void clear_controlword_bits(std::uint16_t bits);
  // Levels of outputs that the device controls itself, bit n for output n, in addition to those of 60FEh.
  void set_outputs(std::uint32_t levels) { terminal_outputs_ = levels; }
  std::uint32_t wires() const { return inputs_.wires; }  // levels of the inputs, including inputs that the bus commands
  // Application counts at which the limit switch last became active.
  Counts positive_limit_position() const { return inputs_.limit_positions[1]; }
  Counts negative_limit_position() const { return inputs_.limit_positions[0]; }
  const TouchProbe& touch_probe() const { return touch_probe_; }
  void set_touch_probe_function(std::uint16_t function);  // same effect as a write of 60B8h

  // --- Faults
  void raise(Cause cause);                 // by the device around the drive, e.g. sync_lost
  void inject(Cause cause, bool present);  // for causes that only hardware has
  bool is_active(Cause cause) const { return faults_.active.test(cause); }
  bool any_fault() const { return faults_.active.any(); }
  bool warns(Cause cause) const { return faults_.warned.test(cause); }
  std::uint8_t error_register() const;  // the bits of 1001h of all present faults and warnings
  // The fault in 603Fh: the newest, or the first (FaultPolicy::first_is_shown).
  const FaultRow* shown_fault() const { return faults_.shown; }
  const FaultRow* row(Cause cause) const;
  void clear_multi_turn() {
    faults_.multi_turn_cleared = true;
  }  // the user declares that the encoder's turns are valid

  // --- State of the drive
  PowerState state() const { return state_; }
  // Returns true if the mode of operation controls the axis: no stop, halt, brake or end of operation does.
  bool runs_mode() const {
    return state_ == PowerState::operation_enabled && stage_.is_on() && !pending_.active && !stop_.active() && !halted_;
  }
  // Returns true if the axis rests under the control of its loops, so that a tuning function may excite it.
  bool rests_under_control() const {
    return (runs_mode() || halted_at_rest()) && !in_motion() && axis_.demand.loop != Loop::locked;
  }
  // Returns true if a halt holds the axis at rest.
  bool halted_at_rest() const { return halted_ && !pending_.active && axis_.generator.standing(); }
  // Returns true if this row of PowerPolicy::transitions could happen now; false if the row does not begin in the
  // present state.
  bool accepts(const Transition& transition) const;
  Mode mode() const { return mode_; }
  std::uint16_t statusword() const;
  bool in_motion() const { return !axis_.generator.standing(); }
  const Rates& rates() const { return rates_; }                // in force
  bool demand_smoothed() const { return !smoothing_.lags(); }  // the smoothed demand has reached the demand
  bool energised() const { return stage_.energised(); }
  bool brake_released() const { return stage_.brake_released(); }
  bool chopper_on() const { return supervision_.chopper(); }
  bool homed() const { return axis_.homed; }
  // Homing handles limit switches itself from its first leg on.
  bool homes() const { return mode_ == Mode::homing && homing_mode_.active() && !homing_mode_.awaits_rest(); }
  // The direction (-1, +1) in which homing presses against a hard stop; 0: it does not, or the axis is stopping, for
  // which it has its full torque.
  int presses() const { return mode_ == Mode::homing && !stop_.active() ? homing_mode_.pressing() : 0; }
  // The leg of the homing that runs, from 0; -1: none.
  int homing_leg() const { return mode_ == Mode::homing && homing_mode_.active() ? homing_mode_.leg() : -1; }
  bool homing_running() const { return mode_ == Mode::homing && homing_mode_.running(); }
  // Homing::index_distance of the last homing, in counts.
  Counts homing_index_distance() const { return homing_mode_.index_distance(); }
  float dc_link_v() const { return dc_link_.voltage_v(); }
  float winding_temperature_c() const { return measured_.winding_temperature_c; }
  float power_stage_temperature_c() const { return measured_.power_stage_temperature_c; }
  Counts position_offset() const { return axis_.offset; }
  void set_position_offset(Counts offset) { axis_.offset = offset; }
  const CascadeState& loops() const { return cascade_.state(); }
  const CurrentOffset& current_offset() const { return current_offset_; }
  const Axis& axis() const { return axis_; }
  std::uint32_t single_turn_counts() const {
    return measured_.single_turn_counts;
  }  // Feedback::single_turn_counts of now
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
  // An enabling command that waits for the voltage of the DC link.
  struct WaitingCommand {
    bool waits = false;
    std::uint16_t word_before = 0;
  };
  struct FaultState {
    CauseSet active{};  // latched faults
    CauseSet injected{};
    CauseSet kept{};    // that the failed part itself keeps until it loses its supply
    CauseSet warned{};  // warnings that were reported
    const FaultRow* shown = nullptr;
    bool multi_turn_cleared = false;
    bool warns = false;         // the drive itself
    bool device_warns = false;  // the device around it
  };
  struct Measured {
    std::uint32_t single_turn_counts = 0;
    Counts position_of_ms = 0;
    std::uint32_t cycles_of_ms = 0;
    float winding_temperature_c = 0.0F;
    float power_stage_temperature_c = 0.0F;
    std::uint32_t tripped = 0;      // HardwareFault bits since the last cycle
    std::uint32_t comparators = 0;  // HardwareFault bits of the comparators that the product has
    std::uint32_t reported = 0;     // ... without those that Configuration::ignored has
  };
  struct InputLevels {
    std::uint32_t wires = 0;
    std::uint32_t evaluated = 0;  // wires from which the signals are made
    std::uint32_t changed = 0;    // levels at their last change
    InputFilter filter{};
    std::array<Counts, 2> limit_positions{};  // negative, positive
  };
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
  Stop stop_in_switched_on(Command command) const;
  // A quick stop ends in Switch on disabled; from Switched on there is no state Quick stop active on the way.
  bool quick_stops_in_switched_on() const {
    return state_ == PowerState::switched_on && pending_.active && pending_.to == PowerState::switch_on_disabled;
  }
  // Interpolated position is active, with the buffer 60C4h.
  bool buffers_records() const {
    return mode_ == Mode::interpolated_position && state_ == PowerState::operation_enabled &&
           policy_.interpolation.source == Interpolation::buffered;
  }
  bool has_power_in(PowerState state) const;
  bool dc_link_charged() const;
  void step_dc_link();
  void leave_operation(Stop stop, PowerState to);
  bool hold_for_brake();
  bool too_fast_for_brake() const;
  void close_brake();
  void enter_state(PowerState to);
  void begin_stop(Stop stop, bool apart = false);
  void begin_ramp();
  double deceleration_of(Stop stop) const;
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
  bool stop_finished() const { return stop_.finished(axis_); }
  void step_stop();
  void step_power();
  void switch_power(bool on);

  // fault_reactions.cpp
  void choose_comparators();
  void trip(std::uint32_t faults, bool cycle_due, Actuation& actuation);
  void show_fault(const FaultRow& row);
  void react_to_fault(const FaultRow& row);
  bool reset_faults();
  void collect_faults();
  CauseSet present_causes() const;

  // drive.cpp
  void cycle(const Feedback& feedback);
  void look_for_open_phase(const Feedback& feedback, const Actuation& actuation);
  void update_inputs(const Feedback& feedback);
  void calibrate_currents(const Feedback& feedback);
  void capture_edges(const Feedback& feedback);
  void note_edge(const SignalEdge& edge);
  void note_level_edges(std::uint32_t changed);
  void change_mode() {
    const auto wanted = static_cast<Mode>(axis_.objects.modes_of_operation);
    if (wanted != mode_ && (wanted != Mode::none || !policy_.modes.zero_keeps)) enter_mode(wanted);
  }
  void enter_mode(Mode wanted);
  void run_mode();
  bool smoothing_passes_software_limit() const;
  void note_demand_source();
  void limit_switches(Counts before);
  double demanded_direction(Counts before) const;
  bool demand_lags() const { return smoothing_.lags(axis_.demand.loop); }
  double velocity_of_demand() const;
  bool pushes_limit_switch(Counts before) const;
  void end_identification();
  void return_to_mode();
  void stop_after_identification();
  DemandSmoothing::Filter smoothing_asked_for() const;
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
  float own_velocity_limit(bool positive, float before, float speed);
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
  Mode demand_source_ = Mode::none;  // of the demand in the previous cycle; none: not a mode, for example a stop
  std::uint16_t controlword_ = 0;
  WaitingCommand waiting_{};
  PendingTransition pending_{};
  PowerStage stage_{};
  StopRun stop_{};
  DcLinkWatch dc_link_{};
  bool halted_ = false;
  bool zero_speed_ = false;             // held at once, without a ramp, until the brake has closed
  bool held_by_current_ = false;        // a direct current holds the axis, as in a stepper drive
  double set_greatest_velocity_ = 0.0;  // counts/s, in the previous cycle
  // the 6080h it was computed from; empty: units or motor have changed
  std::optional<std::uint32_t> greatest_of_rpm_{};
  // the demand was set to another position, so the following error of the loops is obsolete
  bool moved_demand_ = false;
  Dwell standstill_{};
  Dwell outrun_{};              // time for which a ramp to rest was much faster than the shaft
  int friction_direction_ = 0;  // direction of the last motion in the position loop

  FaultState faults_{};
  bool units_valid_ = true;
  bool current_offset_great_ = false;

  Actuation outputs_{};  // all members but the phase voltages, set once per cycle
  std::uint32_t terminal_outputs_ = 0;
  InputLevels inputs_{};
  Measured measured_{};
  std::size_t edge_count_ = 0;  // of edges_
  std::uint32_t look_at_ = 0;   // next check for an open phase, in ticks of the cascade
  Rates rates_{0, 0};           // in force
  // Large and seldom used, so placed after the members that each cycle needs.
  std::array<SignalEdge, edge_capacity> edges_{};  // since the last cycle
  DemandSmoothing smoothing_{};
};

}  // namespace servodrome::drive
