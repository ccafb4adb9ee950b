#pragma once

#include "master/ethercat/al_state.hpp"
#include "master/ethercat/sii_content.hpp"

namespace servodrome::master {

// A slave as found on the segment.
struct FoundSlave {
  std::uint16_t position = 0;  // 1: the first after the master
  std::uint16_t station = 0;   // station address, unique on the segment
  std::uint16_t alias = 0;     // 0012h
  AlStatus status;
  std::uint16_t dl_status = 0;  // 0110h
  std::uint16_t features = 0;   // 0008h
  SiiContent sii;

  // True if the port (0 to 3) has a link.
  bool link(unsigned port) const { return (dl_status >> (4 + port) & 1) != 0; }
  bool has_clock() const { return (features & 0x0004) != 0; }
  bool knows_lrw() const { return (features & 0x0200) == 0; }
};

// First of the station addresses that scan_slaves() gives to slaves without a unique one; they count up along the line.
inline constexpr std::uint16_t first_station = 0x1001;

// Number of slaves that answer a broadcast. Also 0 if no frame returns.
unsigned count_slaves(EthercatMaster& master);

// Counts the slaves, gives station addresses to slaves without a unique one, and reads their data. Does not change
// states, nor valid addresses given by another master. Throws EthercatError if a counted slave does not answer.
std::vector<FoundSlave> scan_slaves(EthercatMaster& master);

// The ports with a link, for example "0 1"; "-" if there is none.
std::string text_of_links(const FoundSlave& slave);

}  // namespace servodrome::master
