#include "tools/tuning/drive_gains.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <numbers>

namespace servodrome::master::tuning {
namespace {

using enum catalogue::GainRole;
using enum catalogue::GainBase;

const catalogue::GainObject* find(std::span<const catalogue::GainObject> gains, catalogue::GainRole role) {
  const auto found =
      std::find_if(gains.begin(), gains.end(), [role](const catalogue::GainObject& one) { return one.role == role; });
  return found != gains.end() ? &*found : nullptr;
}

}  // namespace

TuningUnits tuning_units_of(ObjectClient& objects, const catalogue::TuningDialect& dialect, const AxisUnits& axis) {
  TuningUnits units;
  units.counts_per_rad = axis.position / turn;
  units.velocity_per_rad_s = axis.velocity / turn;
  const bool by_dec = !dialect.gains.empty() && dialect.gains[0].base == ismk_current;
  if (by_dec) {
    // 6510h sub 3 is the peak current in A; 2048 DEC correspond to it. Velocities: 16.384 DEC per inc/s.
    const double peak_a = objects.read<std::uint16_t>(0x6510, 3);
    units.torque_unit = peak_a / 2048.0;
    units.torque_name = "A";
    units.inertia_name = "A s2/rad";
    units.ismk_torque_per_kvp = 16.384 * units.counts_per_rad / 262144.0 * units.torque_unit;
    return units;
  }
  const auto torque_mnm = objects.read_if_present<std::uint32_t>(0x6076).value_or(0);
  if (torque_mnm == 0) {
    throw MasterError("6076h (rated torque) is missing or 0", objects.where(),
                      "torques cannot be converted to Nm without it: set it to the motor's rated torque in mNm");
  }
  units.torque_unit = torque_mnm * 1e-6;  // for 0.1 % of the rated torque
  const auto current_ma = objects.read_if_present<std::uint32_t>(0x6075).value_or(0);
  if (current_ma != 0) units.torque_per_ampere = torque_mnm / (current_ma * std::numbers::sqrt2);
  return units;
}

double unit_of(const catalogue::GainObject& gain, const TuningUnits& units) {
  switch (gain.base) {
    case nameplate_torque: return gain.unit * units.torque_per_ampere;
    case ismk_current: return gain.unit * units.ismk_torque_per_kvp;
    default: return gain.unit;
  }
}

double value_of(const GainValue& value, const TuningUnits& units) {
  return static_cast<double>(value.number) * unit_of(*value.gain, units);
}

std::vector<GainValue> read_gains(ObjectClient& objects, const catalogue::TuningDialect& dialect) {
  std::vector<GainValue> values;
  for (const catalogue::GainObject& gain : dialect.gains) {
    values.push_back(
        {&gain, static_cast<std::int64_t>(objects.read<std::uint32_t>(gain.object.index, gain.object.sub))});
  }
  return values;
}

void write_gains(ObjectClient& objects, std::span<const GainValue> gains) {
  for (const GainValue& value : gains) {
    std::uint64_t number = static_cast<std::uint64_t>(value.number);
    objects.download(value.gain->object, std::as_bytes(std::span(&number, 1)).first(value.gain->bytes));
  }
}

std::vector<GainValue> numbers_of(const Proposal& proposal, const catalogue::TuningDialect& dialect,
                                  const TuningUnits& units, const std::string& where) {
  const auto& notch = proposal.velocity.notch;
  const auto wanted = [&](catalogue::GainRole role) {
    switch (role) {
      case velocity_kp: return proposal.velocity.kp;
      case velocity_ki: return proposal.velocity.ki;
      case position_kp: return proposal.position_kp;
      case notch_frequency: return notch ? notch->frequency_hz : 0.0;
      case notch_width: return notch ? notch->width_hz : 0.0;
      case notch_depth: return notch ? notch->depth : 0.0;
      case notch_switch: return notch ? 1.0 : 0.0;
      default: return 0.0;
    }
  };
  std::vector<GainValue> values;
  for (const catalogue::GainObject& gain : dialect.gains) {
    const double number = std::round(wanted(gain.role) / unit_of(gain, units));
    if (number > gain.greatest || (number < 1.0 && gain.role == velocity_kp)) {
      throw MasterError(fmt::format("{} ({}) would have to be {:.0f}, but its range is 1 to {:.0f}", gain.name,
                                    text_of(gain.object), number, gain.greatest),
                        where, "choose another --bandwidth");
    }
    values.push_back({&gain, static_cast<std::int64_t>(number)});
  }
  return values;
}

std::optional<double> position_gain(std::span<const GainValue> gains, const catalogue::TuningDialect& dialect,
                                    const TuningUnits& units) {
  for (const GainValue& value : gains) {
    if (value.gain->role != position_kp) continue;
    if (value.number != 0 || !dialect.zero_is_automatic) return value_of(value, units);
  }
  return std::nullopt;
}

VelocityController controller_of(std::span<const GainValue> gains, const catalogue::TuningDialect& dialect,
                                 const TuningUnits& units, const LoopDelay& delay) {
  VelocityController controller{.delay = delay};
  NotchSetting notch;
  bool switched = true;
  for (const GainValue& value : gains) {
    const double si = value_of(value, units);
    switch (value.gain->role) {
      case velocity_kp: controller.kp = si; break;
      case velocity_ki:
      case velocity_ki_coarse: controller.ki += si; break;
      case notch_frequency: notch.frequency_hz = si; break;
      case notch_width: notch.width_hz = si; break;
      case notch_depth: notch.depth = si; break;
      case notch_switch: switched = (value.number & 3) != 0; break;
      default: break;
    }
  }
  if (notch.frequency_hz > 0.0 && switched) {
    // If width and depth are no objects, they have the drive's fixed values.
    if (find(dialect.gains, notch_width) == nullptr && dialect.notch) {
      notch.width_hz = dialect.notch->relative_width * notch.frequency_hz;
      notch.depth = dialect.notch->depth;
    }
    controller.notch = notch;
  }
  return controller;
}

}  // namespace servodrome::master::tuning
