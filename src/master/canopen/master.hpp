#pragma once

#include <array>
#include <span>
#include <vector>

#include "canopen/device_events.hpp"
#include "master/canopen/bus.hpp"
#include "master/canopen/emergency.hpp"

namespace servodrome::master {

using canopen::NmtCommand;
using canopen::NmtState;

// For example "pre-operational".
const char* name(NmtState state);

// The health of a node, from the messages that it sends by itself.
struct NodeHealth {
  std::optional<NmtState> state;  // from heartbeat, boot-up or node guarding
  Time heard{};                   // time of the last such message
  unsigned boot_ups = 0;
  std::optional<Emergency> emergency;  // the latest one, including "error reset"
};

// NMT master of the network: commands the NMT states, receives heartbeats, boot-ups and EMCYs of all nodes, produces
// SYNC and heartbeat, and sends and receives PDOs as raw bytes. CiA 301 7.2.8, 7.2.5, 7.2.7, 7.2.2.
class Master {
 public:
  explicit Master(Bus& bus);

  // Addresses one node, or all (0).
  void command(NmtCommand command, std::uint8_t node_id = 0);
  // Sends the command and waits until the node's heartbeat or boot-up confirms it. Throws MasterError if no
  // confirmation arrives within `timeout`. A node without heartbeat confirms only resets.
  void command_and_wait(NmtCommand command, std::uint8_t node_id, Time timeout);

  const NodeHealth& health(std::uint8_t node_id) const { return nodes_[node_id & 0x7F]; }
  // Returns false after `timeout`.
  bool wait_for_state(std::uint8_t node_id, NmtState state, Time timeout);
  bool wait_for_boot_up(std::uint8_t node_id, Time timeout);

  // Callbacks, called while the bus runs.
  void on_state(std::function<void(std::uint8_t node_id, NmtState)> handler) { on_state_ = std::move(handler); }
  void on_boot_up(std::function<void(std::uint8_t node_id)> handler) { on_boot_up_ = std::move(handler); }
  void on_emergency(std::function<void(const Emergency&)> handler) { on_emergency_ = std::move(handler); }

  void send_sync();
  // `counter_overflow`: value of object 1019h, 2..240; SYNC then carries a counter 1..overflow. 0: no counter.
  [[nodiscard]] Bus::Subscription produce_sync(Time period, std::uint8_t counter_overflow = 0);
  // Sends the first heartbeat at once.
  [[nodiscard]] Bus::Subscription produce_heartbeat(std::uint8_t own_node_id, Time period,
                                                    NmtState state = NmtState::operational);

  void send_pdo(std::uint32_t can_id, std::span<const std::uint8_t> data);
  // Requests a TPDO by remote frame; `length` is its length in bytes.
  void request_pdo(std::uint32_t can_id, std::uint8_t length);
  // Waits for the next frame with this identifier; nullopt after `timeout`.
  std::optional<Frame> wait_for_pdo(std::uint32_t can_id, Time timeout);

  struct GuardAnswer {
    bool toggle = false;
    NmtState state{};
  };
  // Node guarding by remote frame. A node with life guarding (100Ch, 100Dh) must be guarded periodically from then on.
  std::optional<GuardAnswer> guard(std::uint8_t node_id, Time timeout);

  Bus& bus() { return bus_; }

 private:
  void receive(const Frame& frame);
  void receive_error_control(std::uint8_t node_id, const Frame& frame);

  Bus& bus_;
  std::array<NodeHealth, 128> nodes_{};
  std::function<void(std::uint8_t, NmtState)> on_state_;
  std::function<void(std::uint8_t)> on_boot_up_;
  std::function<void(const Emergency&)> on_emergency_;
  std::uint8_t sync_counter_ = 0;
  Bus::Subscription listening_;
};

}  // namespace servodrome::master
