#pragma once

#include "host/ethercat/al_state.hpp"
#include "host/ethercat/sii_content.hpp"

namespace servodrome::host {

// A slave as it is found.
struct FoundSlave {
  std::uint16_t position = 0;  // 1: the first behind the master
  std::uint16_t station = 0;   // its address, which no other slave answers to
  std::uint16_t alias = 0;     // 0012h
  AlStatus status;
  std::uint16_t dl_status = 0;  // 0110h
  std::uint16_t features = 0;   // 0008h
  SiiContent sii;

  // Ports 0 to 3.
  bool link(unsigned port) const { return (dl_status >> (4 + port) & 1) != 0; }
  bool has_clock() const { return (features & 0x0004) != 0; }
  bool knows_lrw() const { return (features & 0x0200) == 0; }
};

// Station addresses that scan_slaves gives to slaves without one: this and up, in the order of the line.
inline constexpr std::uint16_t first_station = 0x1001;

// How many slaves answer a broadcast. 0 also where no frame comes back.
unsigned count_slaves(EthercatMaster& master);

// Counts the slaves, gives station addresses to those that have none of their own, and reads what they are. States stay
// as they are, and so do addresses that another master gave. Throws EthercatError if a slave that was counted does not
// answer.
std::vector<FoundSlave> scan_slaves(EthercatMaster& master);

// "0 1": the ports with a link; "-" without one.
std::string text_of_links(const FoundSlave& slave);

}  // namespace servodrome::host
