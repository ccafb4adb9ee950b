#pragma once

#include "host/modbus/client.hpp"

namespace servodrome::host {

// A station that answered.
struct FoundStation {
  std::uint8_t unit = 0;
  std::map<std::uint8_t, std::string> identification{};  // function 2Bh/0Eh; empty: it does not have it

  // Product and vendor of the identification, or empty.
  std::string text(std::uint8_t object) const {
    const auto found = identification.find(object);
    return found == identification.end() ? std::string() : found->second;
  }
};

// Asks each unit from `first` to `last` (1..247) who it is. One that refuses is there; one that a gateway cannot reach
// is not. Takes the client's timeout for each that is silent. Throws HostError if the link is lost.
std::vector<FoundStation> scan_stations(ModbusClient& client, std::uint8_t first, std::uint8_t last);

}  // namespace servodrome::host
