#pragma once

#include <algorithm>
#include <initializer_list>

#include "watch.hpp"

// Names and tolerances that the parts of the watch share.
namespace servodrome::motion {

using drive::Loop;
using drive::Mode;
using drive::PowerState;
namespace controlword = drive::controlword;

inline constexpr double tick_s = drive::tick_seconds;
constexpr std::int64_t ms(double milliseconds) { return static_cast<std::int64_t>(milliseconds * ticks_per_ms); }

inline constexpr double pi = 3.14159265358979323846;

// Tolerances and their reasons.
inline constexpr double swing_revolutions = 0.4;  // swing of a soft loop about a demand that stands
inline constexpr double lag_s = 0.08;  // delay of a loop behind its demand: twice 1/Kp of the softest factory gains
inline constexpr double place_revolutions =
    0.05;  // deviation at standstill: friction under a soft integral, and cogging
// an axis stands below this: velocity ripple of a cogging motor held by a soft loop
inline constexpr double still_rpm = 30.0;
// of the rated torque: with more, a motor is near its limits and is not judged
inline constexpr double heavy_load = 0.6;
inline constexpr std::int64_t cycle_ticks = 16;      // cycle of the slowest position loop
inline constexpr double torque_in_flight_s = 0.002;  // until velocity and current loop have reduced a torque
inline constexpr double integral_s = 0.02;  // until a soft loop has reduced the part of its integral that a ramp needed

constexpr bool one_of(PowerState state, std::initializer_list<PowerState> states) {
  return std::find(states.begin(), states.end(), state) != states.end();
}

constexpr bool has_stage(PowerState state) {
  return one_of(state,
                {PowerState::operation_enabled, PowerState::quick_stop_active, PowerState::fault_reaction_active});
}

constexpr std::uint32_t bit(plant::Injection injection) { return 1u << static_cast<unsigned>(injection); }
// Injections with which the motor does not follow its commands.
inline constexpr std::uint32_t spoils_motion =
    bit(plant::Injection::encoder_loss) | bit(plant::Injection::encoder_crc) |
    bit(plant::Injection::encoder_delimiter) | bit(plant::Injection::open_phase_u) |
    bit(plant::Injection::open_phase_v) | bit(plant::Injection::open_phase_w) | bit(plant::Injection::short_phase_u) |
    bit(plant::Injection::short_phase_v) | bit(plant::Injection::short_phase_w) | bit(plant::Injection::brake_stuck) |
    bit(plant::Injection::supply_loss) | bit(plant::Injection::chopper_broken);

}  // namespace servodrome::motion
