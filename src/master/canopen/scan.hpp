#pragma once

#include <vector>

#include "master/canopen/bus.hpp"
#include "master/canopen/lss_master.hpp"
#include "master/canopen/master.hpp"

namespace servodrome::master {

struct ScanOptions {
  std::uint8_t first = 1;
  std::uint8_t last = 127;
  // Timeout of each request. All nodes are read in parallel, so a scan takes about as long as one node that does not
  // answer. A node that has answered once gets 2 s for each further request.
  Time timeout = std::chrono::milliseconds(250);
  // Additional time to listen for heartbeats, which reveal nodes that do not answer SDO requests (state stopped).
  Time listen{0};
};

// A node that answered or whose messages were received. Values that it did not report are empty.
struct FoundNode {
  std::uint8_t node_id = 0;
  std::optional<NmtState> state;             // if a message with the state was received during the scan
  std::optional<std::uint32_t> device_type;  // 1000h
  std::optional<LssAddress> identity;        // 1018h; 0 for parts that the node does not have
  std::string name;                          // 1008h
  std::string software_version;              // 100Ah

  // CiA profile number from the device type, 402 for drives; 0: none or unknown.
  std::uint16_t profile() const { return static_cast<std::uint16_t>(device_type.value_or(0) & 0xFFFF); }
  bool is_drive() const { return profile() == 402; }
};

// Finds the nodes of a bus by SDO requests and by the messages that nodes send by themselves. Sorted by node-ID. Throws
// MasterError if the link is lost.
std::vector<FoundNode> scan(Bus& bus, const ScanOptions& options = {});

// For example "servo drive (CiA 402)", "CiA 401 device", "device without profile"; "" if the device type is unknown.
std::string kind_of(const FoundNode& node);

}  // namespace servodrome::master
