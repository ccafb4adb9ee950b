#pragma once

#include <cstdint>
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
};

// Positions in the units of 6064h.
struct Travel {
  std::int64_t place = 0;  // the demand; a relative move starts there
  std::vector<TravelEnd> ends{};
};

// The place, and the software limits 607Dh that act. An axis that wraps around (607Bh) has no ends. Throws MasterError.
Travel travel_by_objects(master::ObjectClient& objects, const master::AxisOptions& options, const drive::Policy& policy,
                         bool homed);

// Throws ApiError 409 if the target of the order lies beyond an end, in the direction of the move: an axis beyond an
// end can move back.
void require_within_travel(const Order& order, const Travel& travel, const std::string& axis);

}  // namespace servodrome::studio
