#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "drive/faults.hpp"
#include "drive/homing/methods.hpp"
#include "drive/io/signals.hpp"
#include "drive/loops/motor_data.hpp"
#include "drive/objects.hpp"
#include "drive/power/power_state.hpp"
#include "drive/trajectory/trajectory.hpp"
#include "drive/units.hpp"

// Where products differ, as data. A drive is constructed with one Policy and never asks which product it is.
namespace servodrome::drive {

enum class Mode : std::int8_t {
  pulse = -4,               // a pulse train is followed; without one the axis stands
  immediate_velocity = -3,  // 60FFh at once, without ramps
  none = 0,
  profile_position = 1,
  velocity = 2,
  profile_velocity = 3,
  profile_torque = 4,
  homing = 6,
  interpolated_position = 7,
  cyclic_sync_position = 8,
  cyclic_sync_velocity = 9,
  cyclic_sync_torque = 10,
};

constexpr bool is_cyclic_synchronous(Mode mode) {
  return mode == Mode::cyclic_sync_position || mode == Mode::cyclic_sync_velocity || mode == Mode::cyclic_sync_torque;
}

// Bit of 6502h for a mode: 0 and up for the profile's, 16 and up for the manufacturer's, which have negative numbers.
constexpr std::uint32_t mode_bit(Mode mode) {
  const int number = static_cast<std::int8_t>(mode);
  if (number < -16 || number == 0 || number > 16) return 0;
  return 1u << static_cast<unsigned>(number > 0 ? number - 1 : 15 - number);
}

// Values an option code object accepts: bit n for value n. CiA 402-2 has 0 to 8; 18 brakes through the windings.
struct OptionCodes {
  std::uint32_t quick_stop = 0b1'1111'1111;
  std::uint32_t quick_stop_stays = 0b1'1110'0000;      // ... with these the axis is held in Quick stop active
  std::uint32_t quick_stop_continues = 0b1'1110'0000;  // ... and transition 16 leads back, where there is one
  std::uint32_t shutdown = 0b11;
  std::uint32_t disable_operation = 0b11;
  std::uint32_t halt = 0b1'1110;
  std::uint32_t fault_reaction = 0b1'1111;
  // 605Ah and 605Dh: every code from here on stops at once, by the current limit. 0: there are no such codes.
  std::int16_t at_once_from = 0;
};

enum class Interpolation : std::uint8_t {
  buffered,  // set-points wait in the buffer 60C4h
  target,    // no buffer: 607Ah is followed while controlword bit 4 is set, at each SYNC or when it is written
  at_sync,   // no buffer: each SYNC takes the last one over, and its failing to come is Cause::interpolation_late
};

enum class DcLink : std::uint8_t {
  always,            // the supply is wired to the DC link
  from_switched_on,  // the drive's relay connects it on the way to Switched on, and above
};

enum class OutOfLimits : std::uint8_t {
  clip,   // the target is moved to the limit, statusword bit 11 is set (CiA 402-2 607Dh)
  fault,  // Cause::position_limit
};

// What an active limit switch does outside of homing to a motion towards it.
enum class LimitSwitches : std::uint8_t {
  stop,   // the motion ends, that direction is blocked
  fault,  // Cause::position_limit
};

// One bit of 60FDh.
struct DigitalInputBit {
  enum class Source : std::uint8_t { wire, signal };
  std::uint8_t bit;
  Source source;
  std::uint8_t number;  // of the wire, or the Signal
};

// What a bit of the statusword shows. `mode_bit_12` and `mode_bit_13` are what CiA 402-2 shows there in the present
// mode.
enum class StatusSource : std::uint8_t {
  remote,
  target_reached,
  internal_limit,  // anything that keeps the axis from doing as it is told
  position_limit,  // at a limit switch or a software limit, and not on the way back
  mode_bit_12,
  mode_bit_13,
  following_error,
  commutation_found,
  home_found,
  halt,            // asked for while operation is enabled
  in_motion,       // the demand moves
  software_limit,  // demand or position is beyond 607Dh
};
inline constexpr std::size_t status_sources_count = static_cast<std::size_t>(StatusSource::software_limit) + 1;
constexpr std::uint32_t bit(StatusSource source) { return 1u << static_cast<unsigned>(source); }

struct StatusBit {
  std::uint8_t bit;
  StatusSource source;
  std::uint32_t modes = 0xFFFFFFFF;  // mode_bit() of the modes it is shown in; modes without a bit count as all
};

inline constexpr std::array cia402_status_bits{
    StatusBit{9, StatusSource::remote},          StatusBit{10, StatusSource::target_reached},
    StatusBit{11, StatusSource::internal_limit}, StatusBit{12, StatusSource::mode_bit_12},
    StatusBit{13, StatusSource::mode_bit_13},
};

// What 603Fh shows of a homing error that is no fault, until homing starts again or the mode changes; 0: nothing.
struct HomingErrorCodes {
  std::uint16_t positive_limit = 0;  // ended by that switch
  std::uint16_t negative_limit = 0;
  std::uint16_t not_possible = 0;  // neither method, encoder nor speeds allow it to start
};

struct Policy {
  // Device control
  std::uint32_t supported_modes = 0;
  bool mode_none = true;         // 6060h takes 0
  bool mode_zero_keeps = false;  // ... and it changes nothing
  OptionCodes option_codes{};
  std::span<const Transition> transitions = drive::transitions;
  StateBits state_bits = cia402_state_bits;
  std::span<const StatusBit> status_bits = cia402_status_bits;
  std::uint32_t modes_without_halt = 0;  // mode_bit() of modes in which controlword bit 8 does nothing
  // An axis with a brake is not let go before the brake holds it, even where the option code says "no ramp".
  bool brake_engages_before_power_off = false;
  bool nmt_aborts_connection = true;     // 6007h acts as well when the node is stopped or its communication reset
  bool reset_word_is_a_command = false;  // bits 0 to 3 of the word that resets a fault count as well
  bool transition_16 = true;             // Quick stop active -> Operation enabled
  bool direct_enable = true;             // 0Fh in Ready to switch on runs through transitions 3 and 4
  bool energised_in_switched_on = false;
  bool remote_bit = true;  // statusword bit 9 is set
  DcLink dc_link = DcLink::always;
  std::span<const FaultRow> faults;
  bool cyclic_modes_show_reached = false;     // statusword bit 10 in cyclic synchronous position and velocity
  std::int16_t halt_code_of_zero = 0;         // what 605Dh does while it reads 0
  bool first_fault_is_shown = false;          // 603Fh keeps the first fault; those that follow it are told, not shown
  bool faults_show_as_warning = false;        // statusword bit 7 is set by faults as well
  bool limit_switches_show_as_limit = false;  // ... bit 11 by an active limit switch, moving or not
  bool communication_errors_are_warnings = false;   // those that the bus node finds itself
  bool communication_loss_is_always_fault = false;  // in every state, and told as the drive's own error

  // Profile position
  std::uint8_t set_point_queue = 1;  // set-points that wait behind the running one
  bool set_points_start_from_rest =
      false;                          // one that waits begins when the shaft stands, unless it is to be passed on to
  std::uint16_t target_tracking = 0;  // controlword bits with which every write of 607Ah is a new set-point
  bool halt_discards_set_points = false;  // the job must be triggered again after halt
  bool jerk_limited_only_from_standstill = false;
  std::uint8_t ramp_shapes = 0b1111;  // 6086h: bit n for type n
  std::array<RampShape, 4> shape_of_type{RampShape::linear, RampShape::sin2, RampShape::jerk_free,
                                         RampShape::jerk_limited};  // what the types mean
  // A jerk-limited profile brakes as it accelerates, ends at rest, and is over before another set-point is taken.
  bool jerk_limited_single_symmetric = false;
  bool acknowledge_blocks_change = false;  // with statusword bit 12 set not even bit 5 of the controlword is heard
  bool zero_values_are_faults = false;     // zero profile values raise the planning causes
  bool zero_ramps_are_greatest = false;    // ... and ramps of zero stand for 60C5h and 60C6h
  bool end_velocity_is_start = false;      // 6082h is the speed that a motion from rest begins with at once
  // mode_bit() of modes in which a set-point above the greatest speed is Cause::velocity_excessive; in the others it is
  // clipped, and Cause::velocity_clipped is there meanwhile.
  std::uint32_t excessive_velocity_faults = 0;
  std::uint32_t shaped_modes = 0xFFFFFFFF;  // mode_bit() of modes to which 6086h applies; the others ramp linearly
  OutOfLimits out_of_limits = OutOfLimits::clip;
  LimitSwitches limit_switches = LimitSwitches::stop;
  bool software_limits_need_homing = false;
  bool software_limits_switch_range_off = false;  // 607Bh is off while 607Dh is valid
  bool slippage_supported = true;                 // statusword bit 13 in profile velocity

  Interpolation interpolation = Interpolation::buffered;
  // What 60C2h takes: values from this one on, times these powers of ten, in seconds.
  struct InterpolationPeriods {
    std::uint8_t least_value = 1;
    std::int8_t least_index = -6;
    std::int8_t greatest_index = 0;
  } interpolation_periods{};

  bool single_turn_encoder = false;  // after power-on the position is that within the turn

  // Homing
  std::span<const Method> homing_methods;
  std::int8_t home_offset_sign = -1;      // position at home = sign * 607Ch
  bool homing_errors_are_faults = false;  // those that the product has a row for
  HomingErrorCodes homing_error_codes{};
  bool homing_reached_means_home = false;  // statusword bit 10 at rest only with home found, else at every rest
  bool home_counts_at_rest = false;      // home is found at the end of homing, not at the latch; a new start forgets it
  bool homing_needs_its_inputs = false;  // without an input for a switch it looks for, homing is an error at once

  // Terminals
  std::span<const DigitalInputBit> digital_inputs;
  std::uint8_t first_output_bit = 16;  // of 60FEh
  std::uint8_t output_count = 4;
  std::int8_t brake_output_bit = -1;          // of 60FEh: 1 closes the brake, while its mask bit is set; -1: none
  bool limit_inputs_follow_polarity = false;  // 607Eh bit 7 exchanges the limit switches in 60FDh as well
  std::uint8_t first_bus_input_bit = 0;  // of 60FEh:01, for inputs that the bus commands (Configuration::bus_inputs)

  // Rates
  std::uint8_t velocity_loop_ticks = 2;  // 8 kHz
  std::uint8_t position_loop_ticks = 8;  // 2 kHz

  // Units from the objects and the motor. Answers false (and leaves `units`) when the objects make no valid ratio.
  bool (*units)(const Objects&, const MotorData&, Units& units) = nullptr;
};

}  // namespace servodrome::drive
