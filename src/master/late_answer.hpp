#pragma once

#include "master/object_address.hpp"

namespace servodrome::master {

// A late answer to an earlier request for an object looks like the answer to the next one. A drive answers in order, so
// after its answer for another object no earlier one comes. Clients read this object (the device type) for that
// purpose. A late answer for this object does no harm: its value is constant.
inline constexpr ObjectAddress object_that_drains{0x1000, 0};

}  // namespace servodrome::master
