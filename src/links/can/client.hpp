#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

#include "canopen/frame.hpp"
#include "links/can/memory_port.hpp"
#include "links/virtual_clock.hpp"

namespace servodrome::links {

// A link that takes nothing for so long is lost.
inline constexpr auto send_timeout = std::chrono::seconds(1);

// The master's end of a CAN link, for host tools. Not for use from several threads at once.
class CanClient {
 public:
  virtual ~CanClient() = default;
  // Throws LinkError if the link is lost or takes nothing for a second.
  virtual void send(const canopen::Frame& frame) = 0;
  // The next frame, waiting for it at most `timeout` (0: look and return). Error frames and what is not a classical
  // frame are skipped. Throws LinkError if the link is lost.
  virtual std::optional<canopen::Frame> receive(Time timeout) = 0;
  // A file descriptor that is readable when receive(0) may have something, or -1 (`mem:`). After readiness call
  // receive(0) until it returns nothing: frames may already be buffered.
  virtual int native_handle() const { return -1; }
};

struct CanClientOptions {
  std::chrono::milliseconds connect_timeout{2000};  // and for the link's greeting
  std::uint32_t bit_rate = 0;  // slcan only: sent as S0 .. S8 before the channel is opened; 0: the adapter's own
};

// Opens `socketcand:HOST:PORT/BUS`, `slcan:/dev/...` or `socketcan:can0` as a client. Throws LinkError.
std::unique_ptr<CanClient> open_can_client(std::string_view link, const CanClientOptions& options = {});

// A client on a line in virtual time: receive() steps the line until a frame is there or the timeout has passed.
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
