#include "canopen/301/heartbeat_consumer.hpp"

#include "canopen/object_access.hpp"

namespace servodrome::canopen {

using dictionary::AbortCode;

namespace {
constexpr std::uint16_t consumer_heartbeat_time = 0x1016;
constexpr std::uint8_t node_of(std::uint32_t value) { return static_cast<std::uint8_t>(value >> 16); }
constexpr std::uint16_t milliseconds_of(std::uint32_t value) { return static_cast<std::uint16_t>(value); }
}  // namespace

void HeartbeatConsumers::configure() {
  for (std::size_t i = 0; i < consumers_.size(); ++i) configure(static_cast<std::uint8_t>(i));
}

void HeartbeatConsumers::configure(std::uint8_t number) {
  const auto value =
      value_of<std::uint32_t>(dictionary_, consumer_heartbeat_time, static_cast<std::uint8_t>(number + 1), 0);
  HeartbeatConsumer& consumer = consumers_[number];
  consumer = {};
  const std::uint8_t node_id = node_of(value);
  if (node_id == 0 || node_id > 127 || milliseconds_of(value) == 0) return;
  consumer.node_id = node_id;
  consumer.time = std::chrono::milliseconds(milliseconds_of(value));
}

// Two entries for the same node are refused with 0604 0043h (CiA 301 7.5.2.19).
AbortCode HeartbeatConsumers::check(const dictionary::Entry& entry, std::uint32_t value) const {
  const std::uint8_t node_id = node_of(value);
  if (node_id == 0 || milliseconds_of(value) == 0) return AbortCode::none;
  if (node_id > 127 && profile_.consumers_have_possible_nodes) return AbortCode::value_invalid;
  for (std::size_t i = 0; i < consumers_.size(); ++i) {
    if (i + 1 != entry.sub && consumers_[i].node_id == node_id) return AbortCode::parameter_incompatible;
  }
  return AbortCode::none;
}

bool HeartbeatConsumers::receive(std::uint8_t number, const Frame& frame) {
  if (frame.length != 1) return false;
  HeartbeatConsumer& consumer = consumers_[number];
  const auto state = static_cast<NmtState>(frame.data[0] & 0x7F);
  const bool changed = !consumer.heard || state != consumer.state;
  const bool was_lost = consumer.lost;
  consumer.heard = true;
  consumer.lost = false;
  consumer.state = state;
  consumer.deadline = link_.now() + consumer.time;
  link_.wake_at(consumer.deadline);
  if (changed || was_lost) events_.heartbeat_state(consumer.node_id, state);
  return was_lost;
}

unsigned HeartbeatConsumers::poll() {
  unsigned lost = 0;
  for (HeartbeatConsumer& consumer : consumers_) {
    if (consumer.deadline > link_.now()) {
      link_.wake_at(consumer.deadline);
      continue;
    }
    consumer.deadline = never;
    consumer.lost = true;
    ++lost;
  }
  return lost;
}

}  // namespace servodrome::canopen
