#pragma once

#include "canopen/device_events.hpp"
#include "canopen/link.hpp"
#include "dictionary/dictionary.hpp"

namespace servodrome::canopen {

// One sub-index of 1016h.
struct HeartbeatConsumer {
  std::uint8_t node_id = 0;  // 0: unused
  bool heard = false;
  bool lost = false;
  NmtState state = NmtState::initialising;
  Time time{0};
  Time deadline = never;
};

// Heartbeat consumers (CiA 301 7.2.8.2.2.2, object 1016h). Monitoring of a node begins with its first message.
class HeartbeatConsumers {
 public:
  HeartbeatConsumers(Link& link, dictionary::Dictionary& dictionary, const Profile& profile, DeviceEvents& events,
                     std::span<HeartbeatConsumer> consumers)
      : link_(link), dictionary_(dictionary), profile_(profile), events_(events), consumers_(consumers) {}

  void configure();                     // after a reset
  void configure(std::uint8_t number);  // after a write to sub-index `number` + 1
  dictionary::AbortCode check(const dictionary::Entry& entry, std::uint32_t value) const;

  std::size_t capacity() const { return consumers_.size(); }
  const HeartbeatConsumer& operator[](std::size_t number) const { return consumers_[number]; }

  // Returns true if the node had been lost.
  bool receive(std::uint8_t number, const Frame& frame);
  // Returns the number of nodes that were lost just now.
  unsigned poll();

 private:
  Link& link_;
  dictionary::Dictionary& dictionary_;
  const Profile& profile_;
  DeviceEvents& events_;
  std::span<HeartbeatConsumer> consumers_;
};

}  // namespace servodrome::canopen
