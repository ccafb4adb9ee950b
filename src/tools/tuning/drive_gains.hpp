#pragma once

#include <span>
#include <string>
#include <vector>

#include "axis/dialect.hpp"
#include "master/object_client.hpp"
#include "tools/tuning/proposal.hpp"

// Table of the products: the objects of their gains, the units, and the objects to exchange for a measurement.
namespace servodrome::master::tuning {

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

struct TuningDialect {
  std::string_view product{};
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

// By the product's name. For an unknown name: CiA 402 without gains.
const TuningDialect& tuning_dialect_of(std::string_view product);

// Units of one drive, read from its objects. Throws ObjectError, or MasterError if the drive does not define a
// revolution.
struct TuningUnits {
  double counts_per_rad = 1.0;         // of the position object
  double velocity_per_rad_s = 1.0;     // 60FFh per rad/s
  double torque_unit = 1.0;            // Nm or A for the value 1 of the torque object
  const char* torque_name = "Nm";      // "Nm", or "A" if the drive reports only its current
  const char* inertia_name = "kg m2";  // "kg m2", or "A s2/rad"
  double torque_per_ampere = 1.0;      // `torque_name` per A
  double ismk_torque_per_kvp = 1.0;    // A per rad/s for kvp = 1
};
TuningUnits tuning_units_of(ObjectClient& objects, const TuningDialect& dialect, const AxisUnits& axis);

// A gain with its number, which the drive has or will receive.
struct GainValue {
  const GainObject* gain = nullptr;
  std::int64_t number = 0;
};

double unit_of(const GainObject& gain, const TuningUnits& units);
// In SI units: 1/s, torque per rad/s, torque per rad, Hz, 1.
double value_of(const GainValue& value, const TuningUnits& units);

std::vector<GainValue> read_gains(ObjectClient& objects, const TuningDialect& dialect);
// Writes all of `gains`. Throws ObjectError.
void write_gains(ObjectClient& objects, std::span<const GainValue> gains);
// The rounded numbers of a proposal. Throws MasterError if a number is outside the object's range.
std::vector<GainValue> numbers_of(const Proposal& proposal, const TuningDialect& dialect, const TuningUnits& units,
                                  const std::string& where);
// In 1/s; nullopt if no object has it, or the drive chooses it.
std::optional<double> position_gain(std::span<const GainValue> gains, const TuningDialect& dialect,
                                    const TuningUnits& units);
// The controller that results from the rounded numbers, with this delay.
VelocityController controller_of(std::span<const GainValue> gains, const TuningDialect& dialect,
                                 const TuningUnits& units, const LoopDelay& delay);

}  // namespace servodrome::master::tuning
