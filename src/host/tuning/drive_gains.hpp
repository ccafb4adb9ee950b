#pragma once

#include <span>
#include <string>
#include <vector>

#include "host/dialect.hpp"
#include "host/object_client.hpp"
#include "host/tuning/proposal.hpp"

// Where the drives of a product have their gains, in which unit, and what of the drive is exchanged to measure them: a
// row of a table for each.
namespace servodrome::host::tuning {

enum class GainRole : std::uint8_t {
  velocity_kp,
  velocity_ki,
  velocity_ki_coarse,  // a second object that adds to velocity_ki: it is set to 0
  position_kp,
  notch_frequency,
  notch_width,
  notch_depth,
  notch_switch,  // 1: the notch acts, 0: not
};

// What a unit of the object's number is in SI units depends on the motor and the encoder: the number is multiplied by
// `unit`, and by what the base says.
enum class GainBase : std::uint8_t {
  plain,
  nameplate_torque,  // the object counts A (amplitude); the torque of an ampere by 6076h and 6075h
  ismk_current,      // kvp: a current in DEC by a velocity in DEC, over 2^18
};

struct GainObject {
  GainRole role;
  std::string_view name;
  ObjectAddress object;
  std::uint8_t bytes;
  std::string_view unit_text;  // of the number, as the drive's manual has it
  GainBase base;
  double unit;
  double greatest;  // the number
};

struct TuningDialect {
  std::string_view product{};
  // What moves the axis by velocity without a ramp of the drive's own, and what it answers.
  std::int8_t velocity_mode = 9;
  ObjectAddress position{0x6064, 0};
  ObjectAddress torque{0x6077, 0};
  double full_torque = 1000.0;  // the number of `torque` at rated torque, or at the drive's peak current
  const char* full_torque_text = "rated torque";
  std::span<const GainObject> gains{};
  std::optional<NotchAbility> notch{};
  // Drives that tune themselves: 2340h sub 10h and 60F9h sub 4 of the iSMK.
  bool tunes_itself = false;
};

// By the product's name; that of CiA 402, without gains, for one that is not in the table.
const TuningDialect& tuning_dialect_of(std::string_view product);

// One drive's units, by its objects. Throws ObjectError, or HostError if the drive does not say what a revolution is.
struct TuningUnits {
  double counts_per_rad = 1.0;         // of the position object
  double velocity_per_rad_s = 1.0;     // 60FFh by rad/s
  double torque_unit = 1.0;            // Nm or A, of the number 1 of the torque object
  const char* torque_name = "Nm";      // "Nm", or "A" where the drive tells only its current
  const char* inertia_name = "kg m2";  // "kg m2", or "A s2/rad"
  double torque_per_ampere = 1.0;      // of `torque_name` by A
  double ismk_torque_per_kvp = 1.0;    // A by rad/s of kvp 1
};
TuningUnits tuning_units_of(ObjectClient& objects, const TuningDialect& dialect, const AxisUnits& axis);

// A gain and the number that the drive has or is to get.
struct GainValue {
  const GainObject* gain = nullptr;
  std::int64_t number = 0;
};

double unit_of(const GainObject& gain, const TuningUnits& units);
// In SI units: 1/s, torque by rad/s, torque by rad, Hz, 1.
double value_of(const GainValue& value, const TuningUnits& units);

std::vector<GainValue> read_gains(ObjectClient& objects, const TuningDialect& dialect);
// Writes those that differ from what `known` has. Throws ObjectError.
void write_gains(ObjectClient& objects, std::span<const GainValue> gains);
// The numbers for a proposal, rounded. Throws HostError if the drive does not hold one.
std::vector<GainValue> numbers_of(const Proposal& proposal, const TuningDialect& dialect, const TuningUnits& units,
                                  const std::string& where);
// The controller that the numbers make, with a delay: what is left of the proposal after rounding.
VelocityController controller_of(std::span<const GainValue> gains, const TuningDialect& dialect,
                                 const TuningUnits& units, double delay_s);

}  // namespace servodrome::host::tuning
