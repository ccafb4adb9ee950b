#pragma once

#include <cstdint>

#include "axis/cyclic/motion_axis.hpp"

namespace servodrome::master::plcopen {

// Values of ErrorID, which the standard leaves to the supplier: from 1 errors of a block, from 100 errors of the axis.
enum class ErrorId : std::uint16_t {
  none = 0,
  state_does_not_permit = 1,
  parameter_invalid = 2,
  above_limit = 3,
  beyond_software_limit = 4,
  queue_full = 5,
  not_mapped = 6,
  no_such_parameter = 7,
  parameter_is_read_only = 8,
  master_invalid = 9,
  not_on_the_cam = 10,
  probe_in_use = 11,
  drive_fault = 100,
  left_operation = 101,
  communication_lost = 102,
  following_error = 103,
  mode_refused = 104,
  homing_failed = 105,
  software_limit_reached = 106,
  reset_failed = 107,
  not_following = 108,
  quick_stop = 109,
};
// Description and remedy.
const char* text_of(ErrorId error);
ErrorId error_of(AxisFault fault);

}  // namespace servodrome::master::plcopen
