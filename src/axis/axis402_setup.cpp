// Limits and touch probes.
#include <fmt/format.h>
#include <vector>

#include "axis/axis402.hpp"
#include "catalogue/product.hpp"
#include "links/time.hpp"

namespace servodrome::master {
namespace {

// 60B8h and 60B9h have a byte for each probe.
constexpr std::uint16_t probe_on = 1U << 0;
constexpr std::uint16_t probe_continuous = 1U << 1;
constexpr std::uint16_t probe_index = 1U << 2;
constexpr std::uint16_t probe_positive = 1U << 4;
constexpr std::uint16_t probe_negative = 1U << 5;
constexpr std::uint16_t seen_positive = 1U << 1;
constexpr std::uint16_t seen_negative = 1U << 2;

unsigned shift_of(std::uint8_t probe) { return probe == 2 ? 8 : 0; }

}  // namespace

AxisLimits Axis402::limits() {
  const catalogue::SoftwareLimitSubs subs = product().dialect.software_limits;
  AxisLimits limits;
  limits.lowest_position = objects_.read_if_present<std::int32_t>(0x607D, subs.lowest);
  limits.highest_position = objects_.read_if_present<std::int32_t>(0x607D, subs.highest);
  limits.profile_velocity = objects_.read_if_present<std::uint32_t>(0x607F);
  limits.motor_speed_rpm = objects_.read_if_present<std::uint32_t>(0x6080);
  limits.acceleration = objects_.read_if_present<std::uint32_t>(0x60C5);
  limits.deceleration = objects_.read_if_present<std::uint32_t>(0x60C6);
  limits.torque_permille = objects_.read_if_present<std::uint16_t>(0x6072);
  limits.positive_torque_permille = objects_.read_if_present<std::uint16_t>(0x60E0);
  limits.negative_torque_permille = objects_.read_if_present<std::uint16_t>(0x60E1);
  return limits;
}

void Axis402::set_limits(const AxisLimits& limits) {
  if (limits.lowest_position && limits.highest_position && *limits.lowest_position > *limits.highest_position) {
    throw MasterError(fmt::format("the lowest position {} is above the highest {}", *limits.lowest_position,
                                  *limits.highest_position),
                      objects_.where(), "give the lower one first");
  }
  struct Change {
    ObjectAddress object;
    std::optional<std::int64_t> value;
  };
  const catalogue::SoftwareLimitSubs subs = product().dialect.software_limits;
  const Change changes[] = {{{0x607D, subs.lowest}, limits.lowest_position},
                            {{0x607D, subs.highest}, limits.highest_position},
                            {{0x607F, 0}, limits.profile_velocity},
                            {{0x6080, 0}, limits.motor_speed_rpm},
                            {{0x60C5, 0}, limits.acceleration},
                            {{0x60C6, 0}, limits.deceleration},
                            {{0x6072, 0}, limits.torque_permille},
                            {{0x60E0, 0}, limits.positive_torque_permille},
                            {{0x60E1, 0}, limits.negative_torque_permille}};
  std::vector<std::pair<ObjectAddress, std::vector<std::byte>>> before;
  try {
    for (const Change& change : changes) {
      if (!change.value) continue;
      before.emplace_back(change.object, objects_.upload(change.object));
      write_number(change.object, *change.value);
    }
  } catch (const MasterError&) {
    try {
      for (auto undo = before.rbegin(); undo != before.rend(); ++undo) objects_.download(undo->first, undo->second);
    } catch (const MasterError&) {
      // The first error is rethrown below; this error is ignored.
    }
    throw;
  }
}

void Axis402::arm_probe(const ProbeRequest& request) {
  if (request.probe != 1 && request.probe != 2) {
    throw MasterError(fmt::format("there is no touch probe {}", request.probe), objects_.where(), "give 1 or 2");
  }
  if (!request.positive_edge && !request.negative_edge) {
    throw MasterError("a touch probe without an edge", objects_.where(),
                      "give a positive edge, a negative edge or both");
  }
  disarm_probe(request.probe);
  unsigned function = probe_on;
  if (request.continuous) function |= probe_continuous;
  if (request.source == ProbeRequest::Source::index) function |= probe_index;
  if (request.positive_edge) function |= probe_positive;
  if (request.negative_edge) function |= probe_negative;
  const unsigned shift = shift_of(request.probe);
  const auto others = static_cast<std::uint16_t>(objects_.read<std::uint16_t>(0x60B8) & ~(0xFFU << shift));
  objects_.write<std::uint16_t>(0x60B8, 0, static_cast<std::uint16_t>(others | function << shift));
  const Time deadline = objects_.now() + options_.state_timeout;
  while ((static_cast<unsigned>(objects_.read<std::uint16_t>(0x60B9)) >> shift & probe_on) == 0) {
    if (objects_.now() >= deadline) {
      fail(fmt::format("the drive did not switch touch probe {} on (60B8h {:04X}h, 60B9h {:04X}h)", request.probe,
                       objects_.read<std::uint16_t>(0x60B8), objects_.read<std::uint16_t>(0x60B9)),
           "it may not support this probe, source or edge");
    }
    pause();
  }
}

void Axis402::disarm_probe(std::uint8_t probe) {
  const auto function = objects_.read<std::uint16_t>(0x60B8);
  objects_.write<std::uint16_t>(0x60B8, 0, static_cast<std::uint16_t>(function & ~(0xFFU << shift_of(probe))));
}

ProbePositions Axis402::probe_positions(std::uint8_t probe) {
  const unsigned status = static_cast<unsigned>(objects_.read<std::uint16_t>(0x60B9)) >> shift_of(probe);
  const auto first = static_cast<std::uint16_t>(probe == 2 ? 0x60BC : 0x60BA);
  ProbePositions positions;
  if ((status & seen_positive) != 0) positions.positive = objects_.read<std::int32_t>(first);
  if ((status & seen_negative) != 0) {
    positions.negative = objects_.read<std::int32_t>(static_cast<std::uint16_t>(first + 1));
  }
  return positions;
}

ProbePositions Axis402::wait_for_probe(const ProbeRequest& request, Time timeout, const Progress& progress) {
  const std::string doing = fmt::format("waiting for touch probe {}", request.probe);
  const bool enabled_before = state() == PowerState::operation_enabled;
  const Time deadline = objects_.now() + timeout;
  for (;; objects_.wait(options_.poll_interval)) {
    leave_if_cancelled(doing);
    const ProbePositions seen = probe_positions(request.probe);
    if ((!request.positive_edge || seen.positive) && (!request.negative_edge || seen.negative)) return seen;
    if (progress) progress(status());
    if (enabled_before && state() != PowerState::operation_enabled) {
      fail("the drive left operation enabled while " + doing, "look at the error code; then reset the fault");
    }
    if (objects_.now() >= deadline) {
      const auto came = [](bool wanted, bool seen_edge) {
        return !wanted ? "not requested" : seen_edge ? "detected" : "not detected";
      };
      if (enabled_before) try_to_stop();
      fail(fmt::format("{} took longer than {:g} s (positive edge: {}, negative edge: {})", doing,
                       links::to_seconds(timeout), came(request.positive_edge, seen.positive.has_value()),
                       came(request.negative_edge, seen.negative.has_value())),
           "check the probe's wiring and the travel; a drive may accept an edge that it does not support");
    }
  }
}

}  // namespace servodrome::master
