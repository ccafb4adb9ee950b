#pragma once

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <optional>
#include <span>
#include <utility>

#include "drive/cause_set.hpp"
#include "drive/generator.hpp"
#include "drive/homing/homing.hpp"
#include "drive/loops/cascade.hpp"
#include "drive/loops/gains.hpp"
#include "drive/modes/windows.hpp"
#include "drive/policy.hpp"
#include "drive/shown_velocity.hpp"
#include "drive/touch_probe.hpp"

namespace servodrome::drive {

// Thresholds of the monitors. A threshold of 0 switches its monitor off, except for the chopper, ambient_cold_c, and
// where a comment says otherwise.
struct Monitors {
  float over_voltage_v = 400.0F;
  float under_voltage_v = 200.0F;
  float chopper_on_v = 380.0F;
  float chopper_off_v = 370.0F;
  float ambient_hot_c = 60.0F;
  float ambient_cold_c = -20.0F;
  float power_stage_hot_c = 95.0F;
  float motor_hot_c = 130.0F;
  float encoder_hot_c = 95.0F;
  float warning_margin_c = 10.0F;    // distance of the warning below a hot threshold; 0: no warning
  bool over_speed_by_object = true;  // 120 % of 6080h counts as over speed as well
  float over_speed_rpm = 0.0F;       // 0: 1.2 x the motor's greatest speed
  double velocity_error = 0.0;       // limit of the velocity error, counts/s; 0: no limit
  std::uint32_t velocity_error_ms = 1000;
  bool i2t = true;
  float i2t_peak_time_s = 3.0F;  // time for which the peak current may flow
  // Reduces the torque before the overload and the temperatures of winding and power stage reach their limits.
  bool overload_limits_torque = false;
  // Currents of the power stage as amplitude, if its overload is monitored separately from the motor's; 0: it is not.
  float stage_rated_current_a = 0.0F;
  float stage_peak_current_a = 0.0F;
  bool limit_switches = false;          // reaching a limit switch is a fault once home is known, except during homing
  bool limit_switch_levels = false;     // an active limit switch is a fault, except during homing
  Counts index_deviation = 0;           // between successive index pulses
  std::uint32_t power_failure_ms = 20;  // shorter power failures are ignored
  std::uint32_t brake_resistor_ms = 0;  // longest time that it may conduct without a break; 0: no limit
  bool stage_apart = false;             // the power stage's overload is Cause::stage_i2t, not i2t
  // Warnings before faults and for clipped values; 0 or false: no warning.
  float overload_near_percent = 0.0F;        // i2t_near, stage_i2t_near
  float under_voltage_near_v = 0.0F;         // under_voltage_near
  float following_error_near = 0.0F;         // fraction of 6065h
  bool acceleration_clipped = false;         // 6083h or 6084h above 60C5h or 60C6h in the profile modes
  std::uint32_t index_lost_revolutions = 0;  // index_lost: greatest number of turns without an index pulse
  std::uint32_t jammed_ms = 0;               // jammed: time at the torque limit without motion
  std::uint32_t window_of_zero = 0;          // the window that applies while 6065h is 0
};

// Windows for "target velocity reached" and "speed zero", for devices with windows other than those of CiA 402.
struct SpeedWindows {
  bool used = false;
  double reached_counts_per_s = 0.0;  // greatest distance from the target
  Counts zero_counts_per_ms = 0;      // "speed zero": greatest speed
  std::uint32_t zero_ms = 0;          // ... and the time for which it must last
};

// Settings of a product: data of the nameplate and the product's own parameters. They may change while the drive runs.
struct Configuration {
  MotorData motor{};
  Gains gains{};
  Rates rates{0, 0};  // of the loops; 0: those of the policy. Adopted while the motor has no power
  Monitors monitors{};
  InputMap inputs{};
  TouchProbeCapability touch_probe{};
  CauseSet ignored{};                              // faults that the drive neither reports nor reacts to
  bool remote = true;                              // statusword bit 9: the bus, not an input, enables the drive
  std::uint32_t bus_inputs = 0;                    // input wires whose level comes from a bit of 60FEh:01
  std::uint32_t input_filter_cycles = 0;           // debounce: shorter levels are ignored
  bool index_available = true;                     // the encoder has an index that homing may use
  bool encoder_begins_at_zero = false;             // incremental: it counts from the shaft's position at power-on
  Cause encoder_loss = Cause::encoder_connection;  // the cause that its lost connection raises
  bool locks_to_sync = true;                       // Interpolation::target: 607Ah acts at SYNC, not when written
  double set_point_period_s = 0.0;                 // of cyclic set-points; 0: 60C2h
  double sync_period_s = 0.0;                      // of the SYNC in interpolated mode; 0: 60C2h
  float shown_velocity_ms = 0.0F;                  // lag of 606Ch, see ShownVelocity; 0: chosen for the motor
  float shown_velocity_filter_ms = 0.0F;           // time constant of a low pass after that; 0: none
  std::uint32_t remote_outputs = 0xFFFFFFFF;       // outputs that 60FEh may drive, bit n for output n
  bool brake_inverted = false;                     // the brake's output is inverted
  bool brake_forced = false;                       // ... or forced on, which opens the brake, for commissioning
  std::uint32_t brake_release_ms = 0;              // from power on to the first motion
  std::uint32_t brake_engage_ms = 0;               // from brake command to power off
  // If the axis is faster than this when power goes off, the brake stays open until the axis is this slow, at most for
  // `brake_wait_ms`. 0: it closes at once.
  float brake_speed_rpm = 0.0F;
  std::uint32_t brake_wait_ms = 0;
  std::int16_t velocity_stop_shape = 0;  // ramp type of stops in the velocity modes, a value of 6086h
  // The greatest speeds under torque control, counts/s; empty: the motor's greatest speed.
  std::optional<double> torque_mode_velocity_positive{};
  std::optional<double> torque_mode_velocity_negative{};
  SpeedWindows speed_windows{};
  // Direct current (A, amplitude) that holds the motor in profile position, instead of the position loop, from target
  // reached to the next motion. 0: the position loop holds it.
  float standstill_current_a = 0.0F;
  // Limits of the change from one cyclic position target to the next, in user units; a greater change is clipped.
  struct PositionChange {
    bool limited = false;
    std::int32_t least = 0;
    std::int32_t greatest = 0;
  } position_change{};
  std::uint32_t smoothing_ms = 0;  // moving average of the demand in the profile modes; 0: none
  float position_lag_ms = 0.0F;    // time constant of a low pass on position commands, except in homing; 0: none
  // Limits of the drive in addition to those of the objects, in the directions of the encoder.
  float torque_limit_positive = std::numeric_limits<float>::max();  // fraction of rated
  float torque_limit_negative = std::numeric_limits<float>::max();
  float velocity_limit_positive = std::numeric_limits<float>::max();  // counts/s, of the velocity loop's reference
  float velocity_limit_negative = std::numeric_limits<float>::max();
  // Torque added in the position loop, as fractions of rated torque: the weight torque always, the friction torque by
  // the direction of the present or last motion.
  float weight_torque = 0.0F;
  float friction_torque_positive = 0.0F;
  float friction_torque_negative = 0.0F;  // a negative value supports that motion
  float homing_torque_limit = 0.0F;       // fraction of rated torque; 0: the limit of the drive
  Counts homing_blind_window = 0;         // an index within this distance behind the switch is ignored
  HomingEnd homing_end = HomingEnd::as_method;
  float homing_stall_torque = 0.5F;  // fraction of rated torque
  std::uint32_t homing_stall_ms = 50;
  Counts homing_retraction = 0;
  std::uint32_t homing_timeout_ms = 0;

  bool smooths() const { return smoothing_ms != 0 || position_lag_ms > 0.0F; }
  // Inputs without a capture unit, bit n for input n. The drive polls their levels once per cycle, and an edge has the
  // position of that cycle.
  std::uint32_t inputs_without_capture() const { return input_filter_cycles != 0 ? 0xFFFFFFFF : bus_inputs; }
  bool knows_load() const {
    return weight_torque != 0.0F || friction_torque_positive != 0.0F || friction_torque_negative != 0.0F;
  }
  // If both brake times are 0, the motor has no brake and may coast without power.
  bool has_brake() const { return brake_release_ms != 0 || brake_engage_ms != 0; }
};

// How a motion ends (option codes 605Ah to 605Eh).
enum class Stop : std::uint8_t { power_off, slow_down_ramp, quick_stop_ramp, current_limit, voltage_limit };

constexpr Stop stop_of_option_code(std::int16_t code) {
  switch (code) {
    case 1:
    case 5: return Stop::slow_down_ramp;
    case 2:
    case 6: return Stop::quick_stop_ramp;
    case 3:
    case 7: return Stop::current_limit;
    case 4:
    case 8:
    case 18: return Stop::voltage_limit;
    default: return Stop::power_off;
  }
}

// The state that the modes of operation share: the axis in one position-loop cycle, and the demand of the mode.
// Positions are application counts: encoder counts plus `offset`, which homing changes.
struct Axis {
  Objects& objects;
  const Policy& policy;
  Configuration configuration{};
  Units units{};
  Generator generator{};
  ShownVelocity velocity_display{};
  LoopDemand demand{};

  std::uint16_t controlword = 0;  // the last one without bit 7; a word with bit 7 is no command
  // The speed limit in force from 6080h and the motor, counts/s. If it is lowered during a motion, it falls by the
  // mode's ramp.
  double greatest_velocity = 0.0;
  double cycle_s = 500e-6;
  double cycles_per_ms = 2.0;
  Counts encoder_position = 0;
  Counts counts_per_ms = 0;  // motion in the last whole millisecond, for zero-speed conditions
  Counts offset = 0;
  bool homed = false;
  std::uint32_t signals = 0;            // bit(Signal)
  std::span<const SignalEdge> edges{};  // since the last cycle, encoder counts
  const CascadeState* loops = nullptr;
  bool limited = false;                     // statusword bit 11
  std::optional<std::int64_t> commanded{};  // user units: the last target of a position mode, before any limit
  // -1, +1: the software limit at small (-1) or large (+1) counts ended the motion
  int stopped_at = 0;
  bool synchronised = false;             // a SYNC arrived since the last cycle
  double sync_age = 0.0;                 // age of the SYNC in cycles
  bool new_set_point = false;            // a cyclic set-point was written since the last cycle
  bool shaft_stands = true;              // the shaft has been slow for 2 ms
  bool following_error = false;          // beyond 6065h for longer than 6066h: statusword bit 13 in position modes
  Cause raised = Cause::none;            // the first cause raised in this cycle
  bool velocity_clipped = false;         // the set-point of this cycle was clipped
  bool position_change_clipped = false;  //

  Counts position() const { return encoder_position + offset; }
  double velocity() const { return static_cast<double>(loops->velocity_counts_per_s); }
  // The velocity for 606Ch and its windows: filtered, and late by shown_velocity_lag_s().
  double shown_velocity() const { return velocity_display.counts_per_cycle() / cycle_s; }
  double shown_velocity_lag_s() const { return velocity_display.lag_cycles() * cycle_s; }
  float torque() const { return loops->torque; }
  bool active(Signal signal) const { return (signals & bit(signal)) != 0; }
  std::uint32_t cycles(std::uint32_t milliseconds) const {
    return static_cast<std::uint32_t>(std::min(milliseconds * cycles_per_ms + 0.5, 4294967295.0));
  }

  // Returns true if `condition` has held for this time.
  bool lasts(bool condition, Dwell& dwell, std::uint32_t milliseconds) const {
    return dwell.update(condition, condition ? cycles(milliseconds) : 0);
  }

  // Returns true if the product has the fault and does not ignore it.
  bool monitors(Cause cause) const {
    return !configuration.ignored.test(cause) &&
           std::any_of(policy.faults.rows.begin(), policy.faults.rows.end(),
                       [cause](const FaultRow& row) { return row.cause == cause; });
  }
  // Returns the first cause that is present and monitored, or Cause::none.
  Cause first_monitored(std::initializer_list<std::pair<bool, Cause>> causes) const {
    for (const auto& [present, cause] : causes) {
      if (present && monitors(cause)) return cause;
    }
    return Cause::none;
  }
  // A cause that is not monitored has no effect, and hides none.
  void raise(Cause cause) {
    if (raised == Cause::none && monitors(cause)) raised = cause;
  }

  // The shape for a value of 6086h; linear for an unsupported type. (Planning a motion with an unsupported type is a
  // fault, and the stop after this fault is linear.)
  RampShape shape_of(std::int16_t type) const {
    return has_shape(type) ? policy.ramps.shape_of_type[static_cast<std::size_t>(type)] : RampShape::linear;
  }
  RampShape shape() const {
    const std::uint32_t mode = mode_bit(static_cast<Mode>(objects.modes_of_operation));
    if (mode != 0 && (policy.ramps.shaped_modes & mode) == 0) return RampShape::linear;
    return shape_of(objects.motion_profile_type);
  }
  RampShape velocity_stop_shape() const { return shape_of(configuration.velocity_stop_shape); }
  bool has_shape(std::int16_t type) const { return type >= 0 && type <= 3 && (policy.ramps.types >> type & 1) != 0; }
  double rpm_to_counts_per_s(double rpm) const { return rpm / 60.0 * units.counts_per_revolution; }

  // The least of 607Fh (if `profile`), 6080h and the motor's greatest speed, counts/s.
  double max_velocity(bool profile) const {
    double limit = rpm_to_counts_per_s(static_cast<double>(configuration.motor.max_speed_rpm));
    if (objects.max_motor_speed_rpm != 0) limit = std::min(limit, rpm_to_counts_per_s(objects.max_motor_speed_rpm));
    if (profile && objects.max_profile_velocity != 0) {
      limit = std::min(limit, objects.max_profile_velocity * units.velocity);
    }
    return limit;
  }

  // A ramp of `value` user units in counts/s^2, clipped to `greatest` (60C5h, 60C6h) where that is not 0.
  double ramp(double value, std::uint32_t greatest) const {
    if (greatest == 0) return value * units.acceleration;
    if (value <= 0.0 && policy.ramps.zeros_are_greatest) value = greatest;
    return std::min(value, static_cast<double>(greatest)) * units.acceleration;
  }
  // The limits for the demand of a cyclic mode that catches up with its set-points: the greatest speed and the profile
  // ramps. For a ramp of 0 the first non-zero of these applies: 60C5h or 60C6h, the quick stop ramp, the greatest speed
  // in 100 ms.
  MotionLimits catch_up_limits() const {
    const double velocity = max_velocity(false);
    const auto first = [&](std::uint32_t profile, std::uint32_t greatest) {
      double slope = ramp(profile, greatest);
      if (slope <= 0.0) slope = greatest * units.acceleration;
      if (slope <= 0.0) slope = objects.quick_stop_deceleration * units.acceleration;
      return slope > 0.0 ? slope : 10.0 * velocity;
    };
    return {velocity, first(objects.profile_acceleration, objects.max_acceleration),
            first(objects.profile_deceleration, objects.max_deceleration), 1.0};
  }
  double quick_stop_ramp() const { return ramp(objects.quick_stop_deceleration, objects.max_deceleration); }
  double profile_deceleration() const { return ramp(objects.profile_deceleration, objects.max_deceleration); }

  // Call this for a set-point of `mode` above the greatest speed.
  void exceed_velocity(Mode mode) {
    if ((policy.limits.excessive_velocity_faults & mode_bit(mode)) != 0) {
      raise(Cause::velocity_excessive);
    } else {
      velocity_clipped = true;
    }
  }

  // Profile limits from user values, clipped to 607Fh, 6080h, 60C5h and 60C6h.
  MotionLimits limits(double velocity, double acceleration, double deceleration, double jerk) const {
    return {std::min(velocity, max_velocity(true)), ramp(acceleration, objects.max_acceleration),
            ramp(deceleration, objects.max_deceleration), jerk * units.jerk};
  }
  MotionLimits profile_limits() const {
    return limits(objects.profile_velocity * units.velocity, objects.profile_acceleration, objects.profile_deceleration,
                  objects.profile_jerk[0]);
  }

  // Plans the ramp to rest for a demand without a target; works with any values of the profile objects.
  // `least_deceleration` (counts/s^2) applies if the deceleration of the profile is lower.
  void come_to_rest(RampShape shape, double least_deceleration = 0.0) {
    if (generator.standing()) return;
    MotionLimits ramp = limits(max_velocity(false), objects.profile_acceleration, objects.profile_deceleration,
                               objects.profile_jerk[0]);
    ramp.deceleration = std::max(ramp.deceleration, least_deceleration);
    if (ramp.deceleration <= 0.0) ramp.deceleration = objects.quick_stop_deceleration * units.acceleration;
    if (ramp.deceleration <= 0.0) ramp.deceleration = std::abs(generator.velocity()) / cycle_s;  // at once
    if (ramp.acceleration <= 0.0) ramp.acceleration = ramp.deceleration;
    if (ramp.jerk <= 0.0) shape = RampShape::linear;
    generator.come_to_rest(ramp, shape);
  }

  // Sets the generator to the actual position and velocity.
  void take_over_actual() { generator.start_from(position(), turning_velocity()); }
  // The measured speed, clipped to the greatest speed of a motor. If an encoder loses its position, the measured speed
  // may have any value for a moment.
  double turning_velocity() const {
    const double most = 1.2 * rpm_to_counts_per_s(static_cast<double>(configuration.motor.max_speed_rpm));
    return std::clamp(velocity(), -most, most);
  }

  // The lag of the shaft behind its demand at constant speed in the position loop, counts, signed in the direction of
  // motion.
  double even_lag(double counts_per_s) const {
    const Gains& gains = configuration.gains;
    const double share = std::max(0.0, 1.0 - static_cast<double>(gains.velocity_feed_forward));
    const auto kp = static_cast<double>(gains.position_kp);
    return kp > 0.0 ? share * counts_per_s / kp : 0.0;
  }
  // The greatest lag at this speed, friction and load included.
  double lag(double counts_per_s) const {
    constexpr double margin = 1.25;
    constexpr double static_turns = 0.002;
    return margin * std::abs(even_lag(counts_per_s)) + static_turns * units.counts_per_revolution;
  }
  // Returns true if the shaft follows the demand of the loops, apart from the normal following error.
  bool follows_demand() const {
    if (demand.loop != Loop::position && demand.loop != Loop::velocity) return false;
    constexpr double followed_share = 0.05;
    constexpr double followed_rpm = 6.0;
    const auto wanted = static_cast<double>(demand.velocity);
    const double off = std::abs(wanted - velocity());
    if (off > followed_share * std::abs(wanted) + rpm_to_counts_per_s(followed_rpm)) return false;
    return demand.loop == Loop::velocity ||
           std::abs(static_cast<double>(loops->following_error_counts)) <= lag(velocity());
  }
  // Call this after a constant current held the shaft: a load may have turned the shaft by whole steps.
  void take_over_slipped() {
    if (std::abs(static_cast<double>(generator.nearest_position() - position())) > lag(0.0)) take_over_actual();
  }
  // Like take_over_actual, but without a step in the position loop: the new demand keeps the part of the following
  // error that is normal at the shaft's speed. After another loop the demand gets the following error that the position
  // loop would have.
  void take_over_lagging() { take_over_lagging(turning_velocity()); }
  void take_over_lagging(double velocity) {
    if (demand.loop != Loop::position) return lead_shaft(velocity);
    const double most = lag(velocity);
    const auto error = static_cast<double>(loops->following_error_counts);
    generator.start_from(position() + static_cast<Counts>(std::clamp(error, -most, most)), velocity);
  }
  // Sets the generator to the position demand that the position loop would have at this speed of the shaft, counts/s.
  void lead_shaft(double velocity) { generator.start_from(position() + std::llround(even_lag(velocity)), velocity); }

  // Copies the generator's state to the demand of the loops.
  void follow_generator(Loop loop) {
    demand.loop = loop;
    demand.position = generator.position() - offset;
    demand.position_fraction = static_cast<float>(generator.fraction());
    demand.velocity = static_cast<float>(generator.velocity());
    demand.acceleration = static_cast<float>(generator.acceleration());
    demand.torque = 0.0F;
  }

  // The user position within the range 607Bh, for 6062h and 6064h.
  std::int64_t to_user_position(Counts application) const;
  // Length of the active position range in user units, or 0 while 607Bh is off.
  std::int64_t position_range() const;
  // 607Dh in user units. If 607Dh allows the whole range 607Bh, there is no limit, because positions wrap around. If it
  // allows less, the ends of the range are limits as well: beyond an end, positions wrap around to the other end, where
  // 607Dh may forbid them.
  struct UserLimits {
    std::int64_t least;
    std::int64_t greatest;
  };
  UserLimits software_limits() const;
  bool software_limits_active() const;
  bool range_set() const;  // 607Bh is set, whether in force or not
  // Returns true if 607Dh allows less than the whole range 607Bh.
  bool limits_bound_range() const;
  // The beginning, in user units, of the turn that contains a position: a turn of the range 607Bh, or of the 32 bits of
  // 6064h. A position outside the software limits belongs to the turn of the nearer limit.
  std::int64_t turn_of(Counts place) const;
  std::int64_t turn_of_demand() const { return turn_of(generator.nearest_position()); }
  // The position nearest to `user` (user units) that the software limits allow, in the present turn of the demand.
  std::int64_t within_limits_of_turn(std::int64_t user) const;
  bool beyond_software_limits() const;  // command, demand or position
  bool at_software_limit(std::int64_t user) const {
    if (!software_limits_active()) return false;
    const UserLimits limits = software_limits();
    return user <= limits.least || user >= limits.greatest;
  }
  // Returns true if a target in counts is within the software limits in the present turn of the demand, or if the
  // limits are off.
  bool within_software_limits(Counts target) const { return nearest_within_software_limits(target) == target; }
  Counts nearest_within_software_limits(Counts target) const;
  // Returns true if a limit switch is active, or the demand is at or beyond a software limit. (The shaft itself may
  // oscillate about the limit by one count.)
  bool at_position_limit() const;
  // Returns true if at_position_limit() and the demand does not move away from the limit.
  bool held_by_position_limit() const;
  // The direction of the demand. In its last step on a line of set-points (Line) the demand has no velocity but still
  // moves the shaft. The direction is then that of the step from the demand `before`, if the shaft still has to move
  // that way; otherwise 0.
  double demand_direction(Counts before) const {
    const double velocity = generator.velocity();
    if (velocity != 0.0 || demand.loop != Loop::position) return velocity;
    const auto moved = static_cast<double>(generator.nearest_position() - before);
    const auto ahead = static_cast<double>(generator.nearest_position() - position());
    return moved * ahead > 0.0 ? moved : 0.0;
  }
  bool at_limit_switch() const { return active(Signal::negative_limit) || active(Signal::positive_limit); }
  // Returns true if a motion in this direction leads towards an active limit switch.
  bool runs_into_limit_switch(double direction) const {
    return (active(Signal::negative_limit) && direction < 0.0) || (active(Signal::positive_limit) && direction > 0.0);
  }
  bool at_limit(bool positive) const;
  // The distances to the software limits in counts; negative beyond a limit, infinite while the limits are off.
  struct Room {
    double below;
    double above;
  };
  Room room_from(Counts place) const;
  bool keeps_software_limits() const;  // instead of raising a fault there
  // The distances for modes without a target position. Infinite also if crossing the limits is a fault.
  Room kept_room_from(Counts place) const;
  Room kept_room() const { return kept_room_from(position()); }  // of the shaft
  // Returns true if the demand can just come to rest before the software limit ahead with this deceleration
  // (counts/s^2; 0: at once).
  bool near_software_limit(double deceleration) const {
    return near_software_limit(generator.velocity(), deceleration);
  }
  bool near_software_limit(double velocity, double deceleration) const;  // of a demand with this velocity, counts/s
  // The greatest speed, counts/s, from which a demand in the direction of `velocity` can stop before the software limit
  // ahead with this deceleration (counts/s^2), accurate to one cycle; 0 if the demand is beyond that limit already.
  double approach_velocity(double velocity, double deceleration) const;
  // The mode's deceleration (counts/s^2), or that of the quick stop if the demand needs it to stop before the software
  // limit ahead.
  double deceleration_before_limit(double deceleration) const {
    const double steepest = std::max(deceleration, quick_stop_ramp());
    return near_software_limit(steepest) ? steepest : deceleration;
  }
  // Keeps a demand that comes to rest without a target (come_to_rest) within the software limits, if possible. The
  // shape of its ramp may need up to twice the distance of a linear ramp.
  void rest_within_limits() {
    const double steepest = std::max(profile_deceleration(), quick_stop_ramp());
    if (!has_to_brake_for_limit(steepest)) return;
    limited = true;
    come_to_rest(RampShape::linear, steepest);
  }
  // Returns true if, after one more cycle of the planned motion, this deceleration (counts/s^2) is too low to stop the
  // demand before the software limit ahead.
  bool too_fast_for_software_limit(double deceleration) const;
  // Returns true if this is the last cycle in which a linear ramp of this deceleration (counts/s^2) ends before the
  // limit ahead.
  bool has_to_brake_for_limit(double deceleration) const {
    if (generator.standing() || !keeps_software_limits()) return false;
    return demand.loop == Loop::position ? too_fast_for_software_limit(deceleration)
                                         : near_software_limit(deceleration);
  }
};

}  // namespace servodrome::drive
