#pragma once

#include "catalogue/object_address.hpp"

namespace servodrome::master {

using catalogue::ObjectAddress;
using catalogue::text_of;

}  // namespace servodrome::master
