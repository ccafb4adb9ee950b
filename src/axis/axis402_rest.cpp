// Standstill of the shaft, and targets that remain in the drive. Stops are in axis402_run.cpp.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <fmt/format.h>

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"
#include "axis/standstill.hpp"

namespace servodrome::master {
namespace {

// A target that acts as soon as the axis is enabled, and the modes in which it acts. Profile position and homing are
// safe: they start at an edge of the controlword; interpolated position needs bit 4.
struct StandingTarget {
  enum class Rest : std::uint8_t { zero, present_position, zero_where_it_acts };

  std::uint16_t index;
  Rest rest;
  std::array<std::int8_t, 3> modes;  // 0: unused
};
constexpr std::int8_t immediate_velocity = -3;  // iSMK manual, ch. 5.2.1.1
constexpr std::array standing_targets{
    StandingTarget{0x60FF, StandingTarget::Rest::zero, {3, 9, immediate_velocity}},
    StandingTarget{0x6042, StandingTarget::Rest::zero, {2}},
    StandingTarget{0x6071, StandingTarget::Rest::zero, {4, 10}},
    StandingTarget{0x607A, StandingTarget::Rest::present_position, {8}},
    // The offsets may be settings that matter in these modes only.
    StandingTarget{0x60B1, StandingTarget::Rest::zero_where_it_acts, {8, 9}},
    StandingTarget{0x60B2, StandingTarget::Rest::zero_where_it_acts, {8, 9, 10}},
};
constexpr std::int8_t most_modes = 10;

bool acts_in(const StandingTarget& target, std::int8_t mode) {
  return mode != 0 && std::find(target.modes.begin(), target.modes.end(), mode) != target.modes.end();
}

// True for the modes in which this master knows which targets move the axis.
bool is_known(std::int8_t mode) { return mode == immediate_velocity || (mode >= 0 && mode <= most_modes && mode != 5); }

}  // namespace

// Returns nullopt if the target is at its rest value or the drive does not have the object.
std::optional<std::string> Axis402::take_back(std::uint16_t index, bool to_present_position) {
  const Time deadline = objects_.now() + options_.state_timeout;
  for (;;) {
    const std::int64_t rest = to_present_position ? position() : 0;
    try {
      write_number({index, 0}, rest);
    } catch (const ObjectError& error) {
      if (error.object_is_absent()) return std::nullopt;
      if (!error.answered()) throw;
      return fmt::format("{:04X}h does not accept {}: {}", index, rest, error.happened());
    }
    objects_.wait(options_.poll_interval);
    const std::int64_t kept = objects_.read<std::int32_t>(index);
    const bool stands = !to_present_position || std::abs(position() - rest) <= still_counts;
    if (kept == rest && stands) return std::nullopt;
    if (objects_.now() < deadline && !stands) continue;
    if (!stands) return fmt::format("the shaft turns, and {:04X}h would pull it back", index);
    return fmt::format("{:04X}h is {} after {} was written", index, kept, rest);
  }
}

void Axis402::take_back_targets_before_enabling() {
  if (!is_known(mode())) set_mode(OperationMode::profile_position);
  const std::int8_t present = mode();
  for (const StandingTarget& target : standing_targets) {
    if (target.rest == StandingTarget::Rest::zero_where_it_acts && !acts_in(target, present)) continue;
    const auto problem = take_back(target.index, target.rest == StandingTarget::Rest::present_position);
    if (!problem || !acts_in(target, present)) continue;
    fail(fmt::format("the axis would move as soon as it is enabled in {}: {}",
                     name(static_cast<OperationMode>(present), product().name), *problem),
         "check what else writes this target (process data of another master, an input, a limit), or choose another "
         "mode (6060h)");
  }
}

void Axis402::take_back_targets() {
  for (const StandingTarget& target : standing_targets) {
    if (target.rest == StandingTarget::Rest::zero) take_back(target.index, false);
  }
}

// A fault or another master has switched the axis off. The target of its motion stays in the drive, and the next
// enabling would start it.
void Axis402::take_back_targets_of_idle_axis() {
  for (const StandingTarget& target : standing_targets) {
    if (target.rest != StandingTarget::Rest::zero) continue;
    try {
      if (objects_.read_if_present<std::int32_t>(target.index).value_or(0) != 0) take_back(target.index, false);
    } catch (const ObjectError& error) {
      if (!error.answered()) throw;
    }
  }
}

// Uses the position of the shaft, because on some drives the standstill in the statusword refers to the demand, and
// 606Ch is noisy.
bool Axis402::rests_within(Time span) {
  const Time deadline = objects_.now() + span;
  std::int32_t lowest = position();
  std::int32_t highest = lowest;
  for (Time since = objects_.now();;) {
    objects_.wait(options_.poll_interval);
    const std::int32_t at = position();
    lowest = std::min(lowest, at);
    highest = std::max(highest, at);
    const Time now = objects_.now();
    if (std::int64_t{highest} - lowest > still_counts) {
      lowest = highest = at;
      since = now;
    } else if (now - since >= still_time) {
      return true;
    }
    if (now >= deadline) return false;
  }
}

}  // namespace servodrome::master
