#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "drive/faults.hpp"
#include "drive/homing/methods.hpp"
#include "drive/loops/motor_data.hpp"
#include "drive/objects.hpp"
#include "drive/power/power_state.hpp"
#include "drive/signals.hpp"
#include "drive/trajectory_types.hpp"
#include "drive/units.hpp"

// The differences between products, as data. A drive has one Policy; its code does not depend on the product.
namespace servodrome::drive {

enum class Mode : std::int8_t {
  pulse = -4,               // follows a pulse train; without one the axis stands
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

// Bit of 6502h for a mode: from 0 for modes of the profile, from 16 for the manufacturer's modes, which have negative
// numbers.
constexpr std::uint32_t mode_bit(Mode mode) {
  const int number = static_cast<std::int8_t>(mode);
  if (number < -16 || number == 0 || number > 16) return 0;
  return 1u << static_cast<unsigned>(number > 0 ? number - 1 : 15 - number);
}

// Values an option code object accepts: bit n for value n. CiA 402-2 has 0 to 8; 18 brakes through the windings.
struct OptionCodes {
  std::uint32_t quick_stop = 0b1'1111'1111;
  std::uint32_t quick_stop_stays = 0b1'1110'0000;      // ... of them those that hold the axis in Quick stop active
  std::uint32_t quick_stop_continues = 0b1'1110'0000;  // ... and allow transition 16 back, if the product has it
  std::uint32_t shutdown = 0b11;
  std::uint32_t disable_operation = 0b11;
  std::uint32_t halt = 0b1'1110;
  std::uint32_t fault_reaction = 0b1'1111;
  // 605Ah and 605Dh: every code from this one on stops at once, at the current limit. 0: there are no such codes.
  std::int16_t at_once_from = 0;
};

enum class Interpolation : std::uint8_t {
  buffered,  // set-points wait in the buffer 60C4h
  target,    // no buffer: 607Ah is followed while controlword bit 4 is set, at each SYNC or when it is written
  at_sync,   // no buffer: each SYNC adopts the last set-point; a missing one is Cause::interpolation_late
};

enum class DcLink : std::uint8_t {
  always,            // the supply is wired to the DC link
  from_switched_on,  // the relay of the drive connects it from transition 3 on
};

enum class OutOfLimits : std::uint8_t {
  clip,   // the target is clipped to the limit, and statusword bit 11 is set (CiA 402-2 607Dh)
  fault,  // Cause::position_limit
};

// The effect of an active limit switch on a motion towards it, outside of homing.
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

// The meaning of a bit of the statusword. `mode_bit_12` and `mode_bit_13` have the meaning of CiA 402-2 for the
// present mode.
enum class StatusSource : std::uint8_t {
  remote,
  target_reached,
  internal_limit,  // any limit that prevents the axis from following its command
  position_limit,  // at a limit switch or a software limit, and not on the way back
  mode_bit_12,
  mode_bit_13,
  following_error,
  commutation_found,
  home_found,
  halt,            // halt is commanded while operation is enabled
  in_motion,       // the demand moves
  software_limit,  // demand or position is beyond 607Dh
};
inline constexpr std::size_t status_sources_count = static_cast<std::size_t>(StatusSource::software_limit) + 1;
constexpr std::uint32_t bit(StatusSource source) { return 1u << static_cast<unsigned>(source); }

struct StatusBit {
  std::uint8_t bit;
  StatusSource source;
  std::uint32_t modes = 0xFFFFFFFF;  // mode_bit() of the modes that show it; a mode without a bit always shows it
};

inline constexpr std::array cia402_status_bits{
    StatusBit{9, StatusSource::remote},          StatusBit{10, StatusSource::target_reached},
    StatusBit{11, StatusSource::internal_limit}, StatusBit{12, StatusSource::mode_bit_12},
    StatusBit{13, StatusSource::mode_bit_13},
};

// Codes that 603Fh shows for a homing error that is no fault, until homing starts again or the mode changes; 0: none.
struct HomingErrorCodes {
  std::uint16_t positive_limit = 0;  // this switch ended homing
  std::uint16_t negative_limit = 0;
  std::uint16_t not_possible = 0;  // method, encoder or speeds do not allow homing to start
};

struct ModePolicy {
  std::uint32_t supported = 0;     // mode_bit() of the modes
  bool none = true;                // 6060h accepts 0
  bool zero_keeps = false;         // ... without changing the mode
  std::uint32_t without_halt = 0;  // mode_bit() of modes in which controlword bit 8 has no effect
};

// States, transitions and stops.
struct PowerPolicy {
  OptionCodes option_codes{};
  std::int16_t halt_code_of_zero = 0;  // the code that acts while 605Dh reads 0
  std::span<const Transition> transitions = drive::transitions;
  StateBits state_bits = cia402_state_bits;
  bool transition_16 = true;             // Quick stop active -> Operation enabled
  bool direct_enable = true;             // 0Fh in Ready to switch on runs through transitions 3 and 4
  bool reset_word_is_a_command = false;  // bits 0 to 3 of a word that resets a fault are a command as well
  bool energised_in_switched_on = false;
  // An axis with a brake keeps its power until the brake holds it, even if the option code says "no ramp".
  bool brake_engages_before_off = false;
  DcLink dc_link = DcLink::always;
};

struct StatuswordPolicy {
  std::span<const StatusBit> bits = cia402_status_bits;
  bool remote = true;                         // bit 9 is set
  bool slippage = true;                       // bit 13 in profile velocity
  bool cyclic_modes_show_reached = false;     // bit 10 in cyclic synchronous position and velocity
  bool faults_show_as_warning = false;        // faults set bit 7 as well
  bool limit_switches_show_as_limit = false;  // an active limit switch sets bit 11, moving or not
};

struct FaultPolicy {
  std::span<const FaultRow> rows;
  bool first_is_shown = false;  // 603Fh keeps the first fault; later ones are only reported by EMCY
};

struct CommunicationPolicy {
  bool nmt_aborts_connection = true;  // 6007h acts as well when the node is stopped or its communication reset
  bool errors_are_warnings = false;   // errors that the bus node detects itself are warnings
  bool loss_is_always_fault = false;  // in every state, reported as an error of the drive
};

// Set-points of profile position.
struct PositioningPolicy {
  std::uint8_t queue = 1;         // set-points that wait behind the running one
  bool starts_from_rest = false;  // a waiting set-point begins when the shaft stands, except with "change on set-point"
  bool halt_discards = false;     // after halt the motion needs a new set-point
  bool acknowledge_blocks_change = false;  // while statusword bit 12 is set, controlword bit 5 is ignored too
  bool end_velocity_is_start = false;      // 6082h is the initial speed of a motion from rest
  std::uint16_t target_tracking = 0;       // while these controlword bits are set, each write of 607Ah is a set-point
};

struct RampPolicy {
  std::uint8_t types = 0b1111;  // 6086h: bit n for type n
  std::array<RampShape, 4> shape_of_type{RampShape::linear, RampShape::sin2, RampShape::jerk_free,
                                         RampShape::jerk_limited};
  std::uint32_t shaped_modes = 0xFFFFFFFF;  // mode_bit() of modes to which 6086h applies; the others ramp linearly
  bool jerk_limited_only_from_standstill = false;
  // A jerk-limited profile decelerates with the same ramp as it accelerates, ends at rest, and accepts no set-point
  // before its end.
  bool jerk_limited_single_symmetric = false;
  bool zeros_are_faults = false;      // profile values of 0 raise causes (faults.hpp, "Motion planning")
  bool zeros_are_greatest = false;    // ramps of 0 mean the values of 60C5h and 60C6h
  bool greatest_limit_homing = true;  // 60C5h and 60C6h limit 609Ah as well
};

struct LimitPolicy {
  OutOfLimits target_beyond = OutOfLimits::clip;
  LimitSwitches switches = LimitSwitches::stop;
  bool software_needs_homing = false;
  bool software_switches_range_off = false;  // 607Bh is off while 607Dh is valid
  // mode_bit() of modes in which a set-point above the greatest speed is Cause::velocity_excessive. In other modes it
  // is clipped, and Cause::velocity_clipped is present meanwhile.
  std::uint32_t excessive_velocity_faults = 0;
};

struct InterpolationPolicy {
  Interpolation source = Interpolation::buffered;
  // Values that 60C2h accepts: from `least_value` on, times these powers of ten, in seconds.
  struct Periods {
    std::uint8_t least_value = 1;
    std::int8_t least_index = -6;
    std::int8_t greatest_index = 0;
  } periods{};
};

struct HomingPolicy {
  std::span<const Method> methods;
  std::int8_t offset_sign = -1;    // position at home = sign * 607Ch
  bool errors_are_faults = false;  // homing errors with a row in the product's fault table
  HomingErrorCodes error_codes{};
  bool reached_means_home = false;  // statusword bit 10 is set at rest only if home was found; otherwise at every rest
  bool counts_at_rest = false;      // home is found when homing ends, not at the latch; a new start resets it
  bool needs_its_inputs = false;    // homing fails at once if a switch of its method has no input
};

struct TerminalPolicy {
  std::span<const DigitalInputBit> inputs;
  std::uint8_t first_output_bit = 16;  // of 60FEh
  std::uint8_t output_count = 4;
  std::int8_t brake_output_bit = -1;          // bit of 60FEh: 1 closes the brake if its mask bit is set; -1: none
  bool limit_inputs_follow_polarity = false;  // 607Eh bit 7 exchanges the limit switches in 60FDh as well
  std::uint8_t first_bus_input_bit = 0;  // of 60FEh:01, for inputs that the bus commands (Configuration::bus_inputs)
};

struct LoopPolicy {
  std::uint8_t velocity_ticks = 2;  // 8 kHz
  std::uint8_t position_ticks = 8;  // 2 kHz
};

struct Policy {
  ModePolicy modes{};
  PowerPolicy power{};
  StatuswordPolicy status{};
  FaultPolicy faults{};
  CommunicationPolicy communication{};
  PositioningPolicy positioning{};
  RampPolicy ramps{};
  LimitPolicy limits{};
  InterpolationPolicy interpolation{};
  HomingPolicy homing{};
  TerminalPolicy terminals{};
  LoopPolicy loops{};
  bool single_turn_encoder = false;  // after power-on only the position within the turn is known
  // Computes the units from the objects and the motor. Returns false, without changing `units`, if the objects give no
  // valid ratio.
  bool (*units)(const Objects&, const MotorData&, Units& units) = nullptr;
};

}  // namespace servodrome::drive
