#include "master/canopen/emergency.hpp"

#include <algorithm>

namespace servodrome::master {

std::optional<Emergency> parse_emergency(const canopen::Frame& frame) {
  if (frame.extended || frame.remote || frame.length != 8 || frame.id <= 0x80 || frame.id > 0xFF) return std::nullopt;
  Emergency emergency;
  emergency.node_id = static_cast<std::uint8_t>(frame.id - 0x80);
  emergency.code = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
  emergency.error_register = frame.data[2];
  std::copy_n(frame.data.begin() + 3, emergency.vendor.size(), emergency.vendor.begin());
  return emergency;
}

}  // namespace servodrome::master
