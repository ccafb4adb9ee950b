#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

// Lists this computer's ports that may lead to drives: CAN interfaces, network cards, serial ports.
namespace servodrome::links {

struct LocalBus {
  enum class Kind : std::uint8_t { can, ethernet, serial };
  Kind kind;
  std::string link;      // in the commands' form: "socketcan:can0", "raw:eth0", "serial:/dev/ttyUSB0"
  std::string state;     // "up", "down", "no cable"; empty for a serial port
  std::string hardware;  // the system's name of an adapter; may be empty
};

// Returns the ports in order of kind and name. `root` is the folder with `sys` and `dev`. Unreadable entries are left
// out.
std::vector<LocalBus> local_buses(const std::filesystem::path& root = "/");

}  // namespace servodrome::links
