#pragma once

#include <vector>

#include "links/can/bus.hpp"
#include "links/can/frame_length.hpp"

namespace servodrome::links {

// A controller on the bus, internal to CanBus. Only bus*.cpp may use it.
struct CanBus::Port {
  struct Queued {
    canopen::Frame frame;
    Time delay{};  // added to `ready` by a disturbance
    Time ready{};  // earliest time of sending
    std::uint32_t tag = 0;
    std::uint32_t key = 0;
    unsigned bits = 0;
  };

  Port(PortId its_id, Receiver& its_receiver, std::size_t queue_depth)
      : id(its_id), receiver(&its_receiver), queue(queue_depth) {}

  PortId id;
  Receiver* receiver;  // nullptr: detached
  std::vector<Queued> queue;
  std::size_t first = 0;
  std::size_t count = 0;

  Participation participation = Participation::normal;
  std::uint32_t bit_rate = 0;
  bool cut = false;
  bool automatic_recovery = true;
  bool sending = false;  // its oldest frame is on the wire

  ErrorState error_state = ErrorState::active;
  ErrorState least_state = ErrorState::active;  // of force_error_state
  PortCounters counters;
  Time suspended_until{};           // error passive: suspend transmission
  Time recovers_at = never;         // bus-off
  Time private_attempt_at = never;  // end of an attempt without acknowledge

  bool attached() const { return receiver != nullptr; }
  bool can_send() const { return participation == Participation::normal && error_state != ErrorState::bus_off; }
  const Queued& head() const { return queue[first]; }
  void pop() {
    first = (first + 1) % queue.size();
    --count;
  }
};

}  // namespace servodrome::links
