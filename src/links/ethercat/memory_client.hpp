#pragma once

#include <vector>

#include "links/ethercat/bus.hpp"
#include "links/ethercat/client.hpp"
#include "links/virtual_clock.hpp"

namespace servodrome::links {

// The `mem:` link: a master in the line's process, in virtual time. Time advances only in receive() and wait(). A frame
// enters the bus when it is sent, and can be received from the nanosecond at which it comes back.
class MemoryEthercatClient final : public EthercatClient {
 public:
  MemoryEthercatClient(EthercatBus& bus, VirtualClock& clock, EthercatBus::Port port = EthercatBus::Port::primary)
      : bus_(bus), clock_(clock), port_(port) {}

  void send(std::span<const std::uint8_t> content) override;
  std::size_t receive(std::span<std::uint8_t> into, Time timeout) override;
  Time now() const override { return clock_.now(); }
  void wait(Time span) override { clock_.run_until(clock_.now() + span); }
  std::string name() const override { return "mem:"; }

 private:
  void keep(Time at, std::vector<std::uint8_t> bytes);

  struct Returning {
    Time at;
    std::vector<std::uint8_t> content;
  };

  EthercatBus& bus_;
  VirtualClock& clock_;
  EthercatBus::Port port_;
  std::vector<Returning> returning_;  // sorted by time
};

}  // namespace servodrome::links
