#pragma once

#include "host/canopen/master.hpp"
#include "host/object_client.hpp"

namespace servodrome::host {

// Takes a node to pre-operational, where PDOs are configured (CiA 301 7.3.2.2), and back to where it was.
class PreOperational {
 public:
  PreOperational(Bus& bus, std::uint8_t node_id, ObjectClient& objects);

  // What to tell people: a node whose state cannot be told, since it has no heartbeat, stays pre-operational.
  bool was_unknown() const { return !was_; }
  // Starts the node again if it was operational. Throws HostError if it does not.
  void leave();

 private:
  Master master_;
  std::uint8_t node_id_;
  std::optional<NmtState> was_{};
};

}  // namespace servodrome::host
