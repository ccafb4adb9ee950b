#pragma once

#include "scenario/message.hpp"

namespace servodrome::scenario {

// Recognises the CoE messages of one slave's mailbox (ETG.1000.6 clause 5.6), and remembers the object of the SDO
// transfer in progress.
class CoeMessages {
 public:
  // `bytes` is a mailbox message with its header.
  Message outgoing(std::span<const std::uint8_t> bytes) const;
  Message incoming(std::span<const std::uint8_t> bytes);

 private:
  std::optional<ObjectAddress> transfer_;
};

// An SDO abort in the place of `message`, with the same header (ETG.1000.6 clause 5.6.2.7).
std::vector<std::uint8_t> coe_abort(std::span<const std::uint8_t> message, const ObjectAddress& object,
                                    std::uint32_t code);

// An emergency with its header (ETG.1000.6 clause 5.6.4), without the counter.
std::vector<std::uint8_t> coe_emergency(std::uint16_t code, std::uint8_t error_register);

}  // namespace servodrome::scenario
