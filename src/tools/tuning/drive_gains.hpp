#pragma once

#include <span>
#include <string>
#include <vector>

#include "axis/axis402.hpp"
#include "catalogue/gains.hpp"
#include "master/object_client.hpp"
#include "tools/tuning/proposal.hpp"

// The gains of a drive, in its units and in SI units.
namespace servodrome::master::tuning {

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
TuningUnits tuning_units_of(ObjectClient& objects, const catalogue::TuningDialect& dialect, const AxisUnits& axis);

// A gain with its number, which the drive has or will receive.
struct GainValue {
  const catalogue::GainObject* gain = nullptr;
  std::int64_t number = 0;
};

double unit_of(const catalogue::GainObject& gain, const TuningUnits& units);
// In SI units: 1/s, torque per rad/s, torque per rad, Hz, 1.
double value_of(const GainValue& value, const TuningUnits& units);

std::vector<GainValue> read_gains(ObjectClient& objects, const catalogue::TuningDialect& dialect);
// Writes all of `gains`. Throws ObjectError.
void write_gains(ObjectClient& objects, std::span<const GainValue> gains);
// The rounded numbers of a proposal. Throws MasterError if a number is outside the object's range.
std::vector<GainValue> numbers_of(const Proposal& proposal, const catalogue::TuningDialect& dialect,
                                  const TuningUnits& units, const std::string& where);
// In 1/s; nullopt if no object has it, or the drive chooses it.
std::optional<double> position_gain(std::span<const GainValue> gains, const catalogue::TuningDialect& dialect,
                                    const TuningUnits& units);
// The controller that results from the rounded numbers, with this delay.
VelocityController controller_of(std::span<const GainValue> gains, const catalogue::TuningDialect& dialect,
                                 const TuningUnits& units, const LoopDelay& delay);

}  // namespace servodrome::master::tuning
