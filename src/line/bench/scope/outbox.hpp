#pragma once

#include <cstddef>
#include <string>

namespace servodrome::line::bench {

// Where messages for a client go, in order. Nothing blocks: what the client does not take waits.
class Outbox {
 public:
  virtual void text(std::string message) = 0;
  virtual void binary(std::string message) = 0;
  virtual std::size_t queued() const = 0;  // bytes that wait
  // No more after this. `reason` is at most 123 bytes (RFC 6455 5.5).
  virtual void close(const std::string& reason) = 0;

 protected:
  ~Outbox() = default;
};

}  // namespace servodrome::line::bench
