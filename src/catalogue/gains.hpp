#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "catalogue/object_address.hpp"

// Objects of a drive's loops, for automatic and manual tuning.
namespace servodrome::catalogue {

enum class GainRole : std::uint8_t {
  velocity_kp,
  velocity_ki,
  velocity_ki_coarse,  // a second object added to velocity_ki; set to 0
  position_kp,
  notch_frequency,
  notch_width,
  notch_depth,
  notch_switch,  // 1: the notch is active, 0: off
};

// The SI value of a gain depends on motor and encoder: it is the object's number times `unit` times a factor that the
// base selects.
enum class GainBase : std::uint8_t {
  plain,
  nameplate_torque,  // the object is in A (amplitude); torque per ampere from 6076h and 6075h
  ismk_current,      // kvp: a current in DEC divided by a velocity in DEC, over 2^18
};

struct GainObject {
  GainRole role;
  std::string_view name;
  ObjectAddress object;
  std::uint8_t bytes;
  std::string_view unit_text;  // unit of the number, as in the drive's manual
  GainBase base;
  double unit;
  double greatest;  // greatest value of the number
};

// The notch filter of a drive: its width divided by its frequency, and its gain at the centre. A drive without objects
// for width and depth has these as fixed values.
struct NotchAbility {
  double relative_width = 0.5;
  double depth = 0.1;
  double highest_hz = 1000.0;
};

// What automatic tuning must know: the objects of the gains, and those to exchange for a measurement.
struct TuningDialect {
  // A mode that follows velocity commands without a ramp of the drive, and the objects of its actual values.
  std::int8_t velocity_mode = 9;
  ObjectAddress position{0x6064, 0};
  ObjectAddress torque{0x6077, 0};
  double full_torque = 1000.0;  // value of `torque` at rated torque or at the drive's peak current
  const char* full_torque_text = "rated torque";
  std::span<const GainObject> gains{};
  std::optional<NotchAbility> notch{};
  bool zero_is_automatic = false;  // a gain of 0 leaves it to the drive, which does not report its value
  // True for drives with an automatic tuning: 2340h sub 10h and 60F9h sub 4 of the iSMK.
  bool tunes_itself = false;
};

// A line of the guide to manual tuning. Names, units, ranges and defaults come from the dictionary.
struct GainLine {
  ObjectAddress object;
  std::string_view set;   // "Gain set 1", "Filters": heading of a group of lines
  std::string_view does;  // effect of a greater number
};

// Effects that several products describe in the same words.
namespace gain_effects {

inline constexpr std::string_view velocity_kp =
    "higher bandwidth (stiffer), less phase margin; if too high, the axis oscillates";
inline constexpr std::string_view velocity_ki = "removes a steady-state error faster; if too high, a step overshoots";
inline constexpr std::string_view position_kp =
    "the axis reaches its target sooner; about a third of the velocity loop's bandwidth at most";
inline constexpr std::string_view velocity_forward =
    "less following error at constant speed; at 100 % none remains for the position loop";
inline constexpr std::string_view acceleration_forward =
    "less following error during acceleration; correct when it matches the inertia";
inline constexpr std::string_view notch =
    "frequency that the notch filter removes: set it to a resonance of the machine; 0: off";

}  // namespace gain_effects

}  // namespace servodrome::catalogue
