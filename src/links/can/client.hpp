#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

#include "canopen/frame.hpp"
#include "links/can/memory_port.hpp"
#include "links/file_descriptor.hpp"
#include "links/virtual_clock.hpp"

namespace servodrome::links {

// If a link accepts nothing for this time, it is lost.
inline constexpr auto send_timeout = std::chrono::seconds(1);

// The master's end of a CAN link, for host tools. Not thread-safe.
class CanClient {
 public:
  virtual ~CanClient() = default;
  // Throws LinkError if the link is lost or accepts nothing for a second (send_timeout).
  virtual void send(const canopen::Frame& frame) = 0;
  // Waits at most `timeout` (0: does not wait) for the next frame. Skips error frames and everything else that is no
  // classical CAN frame. Throws LinkError if the link is lost.
  virtual std::optional<canopen::Frame> receive(Time timeout) = 0;
  // Returns a file descriptor that is readable when receive(0) may return a frame, or no_descriptor (`mem:`). When it
  // is readable, call receive(0) until it returns nothing, because several frames may be buffered.
  virtual Descriptor native_handle() const { return no_descriptor; }
};

struct CanClientOptions {
  std::chrono::milliseconds connect_timeout{2000};  // also for the server's greeting
  std::uint32_t bit_rate = 0;  // slcan only: sent as S0 .. S8 before the channel is opened; 0: the adapter's setting
};

// Opens `socketcand:HOST:PORT/BUS`, `slcan:/dev/...` or `socketcan:can0` as a client. Throws LinkError.
std::unique_ptr<CanClient> open_can_client(std::string_view link, const CanClientOptions& options = {});

// A client of a line in virtual time: receive() advances the line until a frame has come or the timeout has passed.
class MemoryCanClient final : public CanClient {
 public:
  MemoryCanClient(CanBus& bus, VirtualClock& clock) : port_(bus), clock_(clock) {}

  void send(const canopen::Frame& frame) override;
  std::optional<canopen::Frame> receive(Time timeout) override;
  MemoryPort& port() { return port_; }

 private:
  MemoryPort port_;
  VirtualClock& clock_;
};

}  // namespace servodrome::links
