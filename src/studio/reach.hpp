#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "axis/axis402.hpp"
#include "drive/policy.hpp"

// How far an axis can move: checked before a move begins.
namespace servodrome::studio {

struct Order;

struct TravelEnd {
  std::int64_t position = 0;
  bool highest = false;  // false: the axis cannot go to smaller positions
  const char* what = "";
  bool limits_target = false;  // the drive shortens or refuses every target beyond it, also of a move back towards it
  std::int64_t slack = 0;      // greatest distance beyond it at which a move may end
};

struct PositionSpan {
  std::int64_t lowest;
  std::int64_t highest;
};

// Positions in the units of 6064h.
struct Travel {
  std::int64_t place = 0;                      // the demand; a relative move starts there
  std::optional<PositionSpan> limits{};        // the software limits, if they act; they are among the ends as well
  std::optional<PositionSpan> wraps_within{};  // 607Bh of an axis that wraps around
  std::vector<TravelEnd> ends{};
};

// The place, the software limits 607Dh and the range 607Bh, by the rules of the drive with this policy. Throws
// MasterError.
Travel travel_by_objects(master::ObjectClient& objects, const master::AxisOptions& options, const drive::Policy& policy,
                         bool homed);

// Throws ApiError 409 if the target of the order lies beyond an end. An axis beyond a switch or a stop can move back
// towards it; beyond a software limit it can only move to within the limits.
void require_within_travel(const Order& order, const Travel& travel, const std::string& axis);

}  // namespace servodrome::studio
