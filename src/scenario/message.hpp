#pragma once

#include <span>

#include "canopen/frame.hpp"
#include "products/device.hpp"
#include "scenario/scenario.hpp"

namespace servodrome::scenario {

// A message that passes between a drive and its bus, as the rules see it.
struct Message {
  MessageKinds kinds;
  std::string_view bus{};               // name of the bus, if the message belongs to no axis
  std::optional<ObjectAddress> object;  // of the SDO transfer that it belongs to
  std::uint32_t id = 0;                 // CAN identifier
  std::span<const std::uint8_t> bytes;
  std::optional<std::uint8_t> function;
  std::optional<std::uint8_t> command;
  std::optional<std::uint16_t> address;

  void add(MessageKind kind) { kinds.set(static_cast<std::size_t>(kind)); }
};

bool matches(const MessagePattern& pattern, const Message& message);

// Recognises the CANopen messages of one drive by the predefined connection set and the COB-IDs of its PDOs. It
// remembers the object of the SDO transfer in progress, because segments do not contain the object.
class CanopenMessages {
 public:
  explicit CanopenMessages(products::Device& device) : device_(device) {}

  // The frame that the drive sends. Only incoming() remembers the begin of an SDO transfer, so this function changes
  // nothing.
  Message outgoing(const canopen::Frame& frame) const;
  // The frame that the drive receives, from a master or another drive.
  Message incoming(const canopen::Frame& frame);

 private:
  std::optional<std::uint32_t> pdo_id(std::uint16_t parameter) const;
  // If the message is a PDO, adds the kinds `any` and `first` + n. n is the number of the PDO, from 0 on; `parameter`
  // is the index of the first PDO's communication parameter.
  void add_pdo(Message& message, std::uint16_t parameter, MessageKind any, MessageKind first) const;

  products::Device& device_;
  std::optional<ObjectAddress> transfer_;
};

}  // namespace servodrome::scenario
