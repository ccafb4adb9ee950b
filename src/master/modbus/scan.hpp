#pragma once

#include "master/modbus/client.hpp"

namespace servodrome::master {

// A station that answered.
struct FoundStation {
  std::uint8_t unit = 0;
  std::map<std::uint8_t, std::string> identification{};  // function 2Bh/0Eh; empty: not supported

  // Text of an identification object, such as product or vendor; "" if it is missing.
  std::string text(std::uint8_t object) const {
    const auto found = identification.find(object);
    return found == identification.end() ? std::string() : found->second;
  }
};

// Requests the identification of each unit from `first` to `last` (1..247). A unit that refuses is present; one that a
// gateway cannot reach is absent. Each unit that does not answer takes the client's timeout. Throws MasterError if the
// link is lost.
std::vector<FoundStation> scan_stations(ModbusClient& client, std::uint8_t first, std::uint8_t last);

}  // namespace servodrome::master
