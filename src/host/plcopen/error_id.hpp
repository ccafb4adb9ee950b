#pragma once

#include <cstdint>

#include "host/cyclic/motion_axis.hpp"

namespace servodrome::host::plcopen {

// What ErrorID says; the standard leaves the numbers to the supplier. From 1 on a block's own, from 100 on the axis's.
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
};
// What it is, and what to do.
const char* text_of(ErrorId error);
ErrorId error_of(AxisFault fault);

}  // namespace servodrome::host::plcopen
