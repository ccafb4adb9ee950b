#include "master/canopen/master.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "canopen/connection_set.hpp"
#include "master/error.hpp"

namespace servodrome::master {
namespace {

namespace connection_set = canopen::connection_set;

constexpr NmtState expected_after(NmtCommand command) {
  switch (command) {
    case NmtCommand::start: return NmtState::operational;
    case NmtCommand::stop: return NmtState::stopped;
    default: return NmtState::pre_operational;
  }
}

}  // namespace

const char* name(NmtState state) {
  switch (state) {
    case NmtState::initialising: return "initialising";
    case NmtState::stopped: return "stopped";
    case NmtState::operational: return "operational";
    case NmtState::pre_operational: return "pre-operational";
  }
  return "unknown";
}

Master::Master(Bus& bus) : bus_(bus), listening_(bus.listen([this](const Frame& frame) { receive(frame); })) {}

void Master::receive(const Frame& frame) {
  if (frame.extended || frame.remote) return;
  if (const auto emergency = parse_emergency(frame)) {
    nodes_[emergency->node_id].emergency = *emergency;
    if (on_emergency_) on_emergency_(*emergency);
  } else if (frame.id > connection_set::error_control && frame.id <= connection_set::error_control + 127 &&
             frame.length == 1) {
    receive_error_control(static_cast<std::uint8_t>(frame.id - connection_set::error_control), frame);
  }
}

void Master::receive_error_control(std::uint8_t node_id, const Frame& frame) {
  NodeHealth& node = nodes_[node_id];
  const auto state = static_cast<NmtState>(frame.data[0] & 0x7F);  // bit 7 is the toggle bit of node guarding
  const bool boot_up = frame.data[0] == 0;
  const NmtState now_in = boot_up ? NmtState::pre_operational : state;
  const bool changed = node.state != now_in;
  node.state = now_in;
  node.heard = bus_.now();
  if (boot_up) {
    ++node.boot_ups;
    if (on_boot_up_) on_boot_up_(node_id);
  }
  if (changed && on_state_) on_state_(node_id, now_in);
}

void Master::command(NmtCommand command, std::uint8_t node_id) {
  bus_.send(connection_set::nmt, {static_cast<std::uint8_t>(command), node_id});
}

void Master::command_and_wait(NmtCommand nmt_command, std::uint8_t node_id, Time timeout) {
  bus_.drain();
  NodeHealth& node = nodes_[node_id & 0x7F];
  node.state.reset();  // a state received before the command is no confirmation
  const bool is_reset = nmt_command == NmtCommand::reset_node || nmt_command == NmtCommand::reset_communication;
  const unsigned boot_ups = node.boot_ups;
  command(nmt_command, node_id);
  const bool confirmed = bus_.run_until(bus_.now() + timeout, [&] {
    return is_reset ? node.boot_ups != boot_ups : node.state == expected_after(nmt_command);
  });
  if (confirmed) return;
  const std::string where = fmt::format("{}, node {}", bus_.name(), node_id);
  if (is_reset) throw MasterError("no boot-up message after the reset", where, "check the node-ID, bit rate and power");
  throw MasterError(
      fmt::format("the node did not confirm NMT state {}{}", name(expected_after(nmt_command)),
                  node.state ? fmt::format(" but reports {}", name(*node.state)) : " (no heartbeat was received)"),
      where, "set its heartbeat time 1017h, or send the command without waiting");
}

bool Master::wait_for_state(std::uint8_t node_id, NmtState state, Time timeout) {
  return bus_.run_until(bus_.now() + timeout, [&] { return nodes_[node_id & 0x7F].state == state; });
}

bool Master::wait_for_boot_up(std::uint8_t node_id, Time timeout) {
  const unsigned before = nodes_[node_id & 0x7F].boot_ups;
  return bus_.run_until(bus_.now() + timeout, [&] { return nodes_[node_id & 0x7F].boot_ups != before; });
}

void Master::send_sync() { bus_.send(connection_set::sync, {}); }

Bus::Subscription Master::produce_sync(Time period, std::uint8_t counter_overflow) {
  sync_counter_ = 0;
  return bus_.every(period, [this, counter_overflow] {
    if (counter_overflow == 0) return send_sync();
    sync_counter_ = static_cast<std::uint8_t>(sync_counter_ % counter_overflow + 1);
    bus_.send(connection_set::sync, {sync_counter_});
  });
}

Bus::Subscription Master::produce_heartbeat(std::uint8_t own_node_id, Time period, NmtState state) {
  const auto beat = [this, own_node_id, state] {
    bus_.send(connection_set::error_control + own_node_id, {static_cast<std::uint8_t>(state)});
  };
  beat();
  return bus_.every(period, beat);
}

void Master::send_pdo(std::uint32_t can_id, std::span<const std::uint8_t> data) {
  Frame frame;
  if (data.size() > frame.data.size()) {
    throw MasterError(fmt::format("{} bytes do not fit a PDO", data.size()), fmt::format("PDO {:03X}h", can_id),
                      "send at most 8 bytes");
  }
  frame.id = can_id;
  frame.length = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data.begin());
  bus_.send(frame);
}

void Master::request_pdo(std::uint32_t can_id, std::uint8_t length) {
  Frame frame;
  frame.id = can_id;
  frame.remote = true;
  frame.length = length;
  bus_.send(frame);
}

std::optional<Frame> Master::wait_for_pdo(std::uint32_t can_id, Time timeout) {
  std::optional<Frame> arrived;
  const Bus::Subscription listening = bus_.listen([&](const Frame& frame) {
    if (!arrived && frame.id == can_id && !frame.extended && !frame.remote) arrived = frame;
  });
  bus_.run_until(bus_.now() + timeout, [&] { return arrived.has_value(); });
  return arrived;
}

std::optional<Master::GuardAnswer> Master::guard(std::uint8_t node_id, Time timeout) {
  bus_.drain();
  request_pdo(connection_set::error_control + node_id, 1);
  const auto answer = wait_for_pdo(connection_set::error_control + node_id, timeout);
  if (!answer || answer->length != 1) return std::nullopt;
  return GuardAnswer{(answer->data[0] & 0x80) != 0, static_cast<NmtState>(answer->data[0] & 0x7F)};
}

}  // namespace servodrome::master
