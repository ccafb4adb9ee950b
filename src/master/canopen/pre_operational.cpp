#include "master/canopen/pre_operational.hpp"

#include <algorithm>

namespace servodrome::master {
namespace {

constexpr Time longest_listening = std::chrono::seconds(3);
constexpr Time confirmation = std::chrono::seconds(5);
constexpr Time settling = std::chrono::milliseconds(20);  // waiting time for a node without heartbeat, which does not
                                                          // confirm the state

}  // namespace

PreOperational::PreOperational(Bus& bus, std::uint8_t node_id, ObjectClient& objects)
    : master_(bus), node_id_(node_id) {
  const auto heartbeat_ms = objects.read_if_present<std::uint16_t>(0x1017).value_or(0);
  if (heartbeat_ms != 0) {
    const Time twice = 2 * std::chrono::milliseconds(heartbeat_ms);
    bus.run_until(bus.now() + std::min(twice, longest_listening),
                  [&] { return master_.health(node_id_).state.has_value(); });
    was_ = master_.health(node_id_).state;
  }
  if (was_ == NmtState::pre_operational) return;
  if (was_) {
    master_.command_and_wait(NmtCommand::enter_pre_operational, node_id_, confirmation);
  } else {
    master_.command(NmtCommand::enter_pre_operational, node_id_);
    bus.run_for(settling);
  }
}

void PreOperational::leave() {
  if (was_ != NmtState::operational) return;
  master_.command(NmtCommand::start, node_id_);
  master_.bus().run_for(settling);
}

}  // namespace servodrome::master
