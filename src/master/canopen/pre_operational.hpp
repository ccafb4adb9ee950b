#pragma once

#include "master/canopen/master.hpp"
#include "master/object_client.hpp"

namespace servodrome::master {

// Brings a node into pre-operational, the state in which PDOs are configured (CiA 301 7.3.2.2). The constructor throws
// MasterError if a node with heartbeat does not confirm the state.
class PreOperational {
 public:
  PreOperational(Bus& bus, std::uint8_t node_id, ObjectClient& objects);

  // True if no heartbeat showed the state of the node: leave() then leaves it pre-operational. The caller
  // tells the user.
  bool was_unknown() const { return !was_; }
  // Starts the node if it was operational before; does not wait for a confirmation. Throws MasterError if the link is
  // lost.
  void leave();

 private:
  Master master_;
  std::uint8_t node_id_;
  std::optional<NmtState> was_{};
};

}  // namespace servodrome::master
