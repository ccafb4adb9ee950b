#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "master/canopen/bus.hpp"
#include "master/canopen/pdo_set_up.hpp"
#include "tools/sampling/channel.hpp"

// Process data of CAN drives for sampling: which TPDOs carry the channels, and whether another master uses them.
namespace servodrome::master::sampling {

// CAN-IDs by CiA 301 table 39
inline constexpr std::uint32_t sync_id = 0x080;
inline constexpr std::uint32_t first_pdo = 0x180;
inline constexpr std::uint32_t after_pdos = 0x580;

inline constexpr Time shortest_sync_period = std::chrono::milliseconds(1);
inline constexpr Time longest_sync_period = std::chrono::milliseconds(20);

// First-fit packing of the channels into few PDOs: 8 bytes and 4 objects in each.
std::vector<std::vector<PdoObject>> pack_into_pdos(const std::vector<Channel>& channels);

// A sign that another master uses process data.
struct UseOfPdos {
  enum class By : std::uint8_t { sync, pdo, operational } by{};
  std::uint8_t node_id = 0;  // of the drive; 0 with SYNC
};
// What a received frame shows; nullopt: nothing.
std::optional<UseOfPdos> use_of_pdos(const Frame& frame);

// Time to listen for such signs. If there is another master, it sends SYNC or PDOs, or has started the node, which the
// node's heartbeat shows. `heartbeat`: period of 1017h; 0: none.
Time time_to_listen(Time heartbeat);

}  // namespace servodrome::master::sampling
