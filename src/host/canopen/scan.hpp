#pragma once

#include <vector>

#include "host/canopen/bus.hpp"
#include "host/canopen/lss_master.hpp"
#include "host/canopen/master.hpp"

namespace servodrome::host {

struct ScanOptions {
  std::uint8_t first = 1;
  std::uint8_t last = 127;
  // For an answer to each question. The questions of all nodes are on the bus at once: a scan takes about as long as
  // one node that does not answer. A node that has answered once is given 2 s for each further question.
  Time timeout = std::chrono::milliseconds(250);
  // Longer listening for heartbeats, which show nodes that answer no SDO (stopped).
  Time listen{0};
};

// A node that answered or was heard. What it did not tell is empty.
struct FoundNode {
  std::uint8_t node_id = 0;
  std::optional<NmtState> state;             // if it was heard while scanning
  std::optional<std::uint32_t> device_type;  // 1000h
  std::optional<LssAddress> identity;        // 1018h; parts it does not have are 0
  std::string name;                          // 1008h
  std::string software_version;              // 100Ah

  // CiA profile number of the device type, 402 for drives; 0: none.
  std::uint16_t profile() const { return static_cast<std::uint16_t>(device_type.value_or(0) & 0xFFFF); }
  bool is_drive() const { return profile() == 402; }
};

// Finds the nodes of a bus by SDO and by what they send themselves. In order of node-ID. Throws HostError if the link
// is lost.
std::vector<FoundNode> scan(Bus& bus, const ScanOptions& options = {});

// "servo drive (CiA 402)", "CiA 401 device", "device without profile"; empty if nothing is known.
std::string kind_of(const FoundNode& node);

}  // namespace servodrome::host
