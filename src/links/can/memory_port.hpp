#pragma once

#include <optional>
#include <vector>

#include "links/can/bus.hpp"

namespace servodrome::links {

struct TimedFrame {
  canopen::Frame frame;
  Time at{};
};

// The `mem:` link: a port for a master in the same process. Received frames wait in a bounded inbox. When it is full,
// new frames are lost and counted.
class MemoryPort final : public Receiver {
 public:
  explicit MemoryPort(CanBus& bus, std::size_t inbox_depth = 1024);
  ~MemoryPort() override;
  MemoryPort(const MemoryPort&) = delete;
  MemoryPort& operator=(const MemoryPort&) = delete;

  PortId port() const { return port_; }
  bool send(const canopen::Frame& frame, Time now) { return bus_.transmit(port_, frame, now); }
  std::optional<TimedFrame> receive();
  std::size_t waiting() const { return count_; }
  std::uint64_t dropped() const { return dropped_; }

  void on_frame(const canopen::Frame& frame, Time at) override;

 private:
  CanBus& bus_;
  PortId port_;
  std::vector<TimedFrame> inbox_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  std::uint64_t dropped_ = 0;
};

}  // namespace servodrome::links
