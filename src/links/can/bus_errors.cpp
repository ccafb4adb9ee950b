// Fault confinement (ISO 11898-1, clause 12): error counters, error passive, bus-off, and senders without acknowledge.

#include <algorithm>
#include <array>

#include "links/can/bus_port.hpp"

namespace servodrome::links {
namespace {

constexpr std::uint16_t error_passive_above = 127;
constexpr std::uint16_t bus_off_above = 255;
// 128 occurrences of 11 recessive bits. On a real bus with traffic they take longer; here they always take this time.
constexpr unsigned recovery_bits = 128 * 11;
// The sender detects a missing acknowledge in the acknowledge slot, so the last 8 bits of the frame (acknowledge
// delimiter and end of frame) are not sent. An error frame (flag 6, delimiter 8) and the interframe space follow.
constexpr unsigned bits_after_acknowledge_slot = 8;
constexpr unsigned lone_error_frame_bits = 14;

}  // namespace

void CanBus::count_transmit_error(Port& port, Time when) {
  port.counters.transmit_errors = static_cast<std::uint16_t>(port.counters.transmit_errors + 8);
  update_error_state(port, when);
}

void CanBus::count_receive_error(Port& port, Time when) {
  port.counters.receive_errors =
      std::min<std::uint16_t>(static_cast<std::uint16_t>(port.counters.receive_errors + 1), error_passive_above + 1);
  update_error_state(port, when);
}

// Rules g and h of 12.1.4.2.
void CanBus::count_success(Port& port, bool sent, Time when) {
  std::uint16_t& counter = sent ? port.counters.transmit_errors : port.counters.receive_errors;
  if (sent) ++port.counters.sent;
  if (counter > 0) --counter;
  if (!sent) counter = std::min(counter, error_passive_above);
  update_error_state(port, when);
}

void CanBus::update_error_state(Port& port, Time when) {
  ErrorState state = ErrorState::active;
  if (std::max(port.counters.transmit_errors, port.counters.receive_errors) > error_passive_above) {
    state = ErrorState::passive;
  }
  if (port.counters.transmit_errors > bus_off_above) state = ErrorState::bus_off;
  state = std::max(state, port.least_state);
  if (state == port.error_state) return;
  port.error_state = state;
  if (state == ErrorState::bus_off) {
    ++port.counters.bus_off_count;
    discard_queue(port);
    if (port.automatic_recovery && port.least_state != ErrorState::bus_off)
      port.recovers_at = when + duration(recovery_bits);
  }
  port.receiver->on_error_state(state, when);
}

void CanBus::force_error_state(PortId id, ErrorState state, Time now) {
  constexpr std::array counts{std::uint16_t{0}, std::uint16_t{error_passive_above + 1},
                              std::uint16_t{bus_off_above + 1}};
  Port& port = at(id);
  port.least_state = state;
  port.counters.transmit_errors = counts[static_cast<std::size_t>(state)];
  port.counters.receive_errors = 0;
  port.recovers_at = never;
  update_error_state(port, now);
  review_private_attempts();
}

void CanBus::set_automatic_recovery(PortId port, bool automatic) { at(port).automatic_recovery = automatic; }

void CanBus::recover(PortId port, Time now) {
  Port& node = at(port);
  if (node.error_state != ErrorState::bus_off || node.recovers_at != never) return;
  if (node.least_state == ErrorState::bus_off) return;
  node.recovers_at = std::max(now, now_) + duration(recovery_bits);
}

void CanBus::recover_ports(Time when) {
  for (const auto& port : ports_) {
    if (port->recovers_at > when) continue;
    port->recovers_at = never;
    port->counters.transmit_errors = 0;
    port->counters.receive_errors = 0;
    port->suspended_until = Time{};
    update_error_state(*port, when);
  }
}

void CanBus::discard_queue(Port& port) {
  port.counters.discarded += port.count;
  port.count = 0;
  port.sending = false;
}

void CanBus::run_private_attempts(Time when) {
  bool any = false;
  for (const auto& port : ports_) {
    if (port->private_attempt_at > when) continue;
    port->private_attempt_at = never;
    ++port->counters.errors;
    count_transmit_error(*port, when);
    any = true;
  }
  if (any) review_private_attempts();
}

// A sender that gets no acknowledge repeats its frame until it is error passive. From then on a missing acknowledge no
// longer counts (12.1.4.2 c, exception 1). The state then stays the same, so nothing needs to be simulated.
void CanBus::review_private_attempts() {
  if (config_.ideal) return;
  const bool wire_acknowledges = acknowledged();
  for (const auto& port : ports_) {
    const bool alone = port->attached() && port->count > 0 && port->participation == Participation::normal &&
                       port->error_state != ErrorState::bus_off && !port->sending &&
                       port->counters.transmit_errors <= error_passive_above && !(on_wire(*port) && wire_acknowledges);
    if (!alone) {
      port->private_attempt_at = never;
    } else if (port->private_attempt_at == never) {
      const unsigned bits =
          port->head().bits - bits_after_acknowledge_slot + lone_error_frame_bits + interframe_space_bits;
      port->private_attempt_at = std::max(port->head().ready, now_) + duration(bits);
    }
  }
}

}  // namespace servodrome::links
