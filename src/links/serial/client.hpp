#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "links/serial/line.hpp"
#include "links/serial/link_name.hpp"
#include "links/virtual_clock.hpp"

namespace servodrome::links {

// The master's end of a serial line or a TCP connection, for host tools: sends and receives bytes. Not thread-safe.
class ByteClient {
 public:
  virtual ~ByteClient() = default;
  // Throws LinkError if the link is lost or accepts nothing for a second.
  virtual void send(std::span<const std::uint8_t> bytes) = 0;
  // Waits at most `timeout` (0: does not wait) for bytes and appends them. Returns false if none came. Throws LinkError
  // if the link is lost.
  virtual bool receive(std::vector<std::uint8_t>& bytes, Time timeout) = 0;
  // The time on the clock that the timeouts refer to: the monotonic clock, or the line's.
  virtual Time now() const = 0;
  // Waits for `span`.
  virtual void wait(Time span) = 0;
};

// Opens `pty:PATH` (the tty at PATH), `serial:DEVICE` or `tcp:HOST:PORT` as a client. `format` applies to the first
// two. Throws LinkError.
std::unique_ptr<ByteClient> open_byte_client(const SerialLinkName& name, const modbus::CharacterFormat& format,
                                             std::chrono::milliseconds connect_timeout = std::chrono::seconds(2));

// A client of a line in virtual time: receive() and wait() advance the line.
class MemoryByteClient final : public ByteClient, private SerialStation {
 public:
  MemoryByteClient(SerialLine& line, VirtualClock& clock) : line_(line), clock_(clock), port_(line.attach(*this)) {}
  ~MemoryByteClient() override { line_.detach(port_); }
  MemoryByteClient(const MemoryByteClient&) = delete;
  MemoryByteClient& operator=(const MemoryByteClient&) = delete;

  void send(std::span<const std::uint8_t> bytes) override { line_.transmit(port_, bytes, clock_.now()); }
  bool receive(std::vector<std::uint8_t>& bytes, Time timeout) override;
  Time now() const override { return clock_.now(); }
  void wait(Time span) override;

 private:
  void receive(std::uint8_t character, bool intact, Time at) override;

  SerialLine& line_;
  VirtualClock& clock_;
  SerialPortId port_;
  std::vector<std::uint8_t> received_;
};

}  // namespace servodrome::links
