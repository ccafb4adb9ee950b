#pragma once

#include <cstddef>
#include <string>

namespace servodrome::api {

// Sends messages to a client in order. No call blocks: messages that the client does not receive yet are queued.
class Outbox {
 public:
  virtual void text(std::string message) = 0;
  virtual void binary(std::string message) = 0;
  virtual std::size_t queued() const = 0;  // bytes in the queue
  // Closes the connection; no message may follow. `reason` has at most 123 bytes (RFC 6455 5.5).
  virtual void close(const std::string& reason) = 0;

 protected:
  ~Outbox() = default;
};

}  // namespace servodrome::api
