#pragma once

#include <filesystem>
#include <string>
#include <vector>

// What this computer has that may lead to drives: CAN interfaces, network cards, serial ports.
namespace servodrome::links {

struct LocalBus {
  enum class Kind : std::uint8_t { can, ethernet, serial };
  Kind kind;
  std::string link;      // as the commands take it: "socketcan:can0", "raw:eth0", "serial:/dev/ttyUSB0"
  std::string state;     // "up", "down", "no cable"; empty of a serial port
  std::string hardware;  // what the system calls an adapter; may be empty
};

// In order of kind and name. `root` is where `sys` and `dev` are. What cannot be read is left out.
std::vector<LocalBus> local_buses(const std::filesystem::path& root = "/");

}  // namespace servodrome::links
