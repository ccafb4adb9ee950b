#include "scenario/message.hpp"

#include <algorithm>

namespace servodrome::scenario {
namespace {

constexpr unsigned pdos = 4;

MessageKind numbered(MessageKind first, unsigned number) {
  return static_cast<MessageKind>(static_cast<unsigned>(first) + number);
}

ObjectAddress object_in(const canopen::Frame& frame) {
  return {static_cast<std::uint16_t>(frame.data[1] | frame.data[2] << 8), frame.data[3]};
}

// A request that begins a transfer names its object: initiate of download, upload, block download and block upload
// (CiA 301 7.2.4.3).
bool begins_transfer(const canopen::Frame& frame) {
  const unsigned command = frame.data[0];
  switch (command >> 5) {
    case 1:
    case 2: return true;
    case 5: return (command & 3) == 0;  // block upload
    case 6: return (command & 1) == 0;  // block download
    default: return false;
  }
}

}  // namespace

bool matches(const MessagePattern& pattern, const Message& message) {
  if (!message.kinds.test(static_cast<std::size_t>(pattern.kind))) return false;
  if (pattern.object) {
    if (!message.object || message.object->index != pattern.object->index) return false;
    if (pattern.object->sub && message.object->sub != pattern.object->sub) return false;
  }
  if (pattern.id && ((*pattern.id ^ message.id) & pattern.id_mask) != 0) return false;
  if (pattern.function && pattern.function != message.function) return false;
  if (pattern.command && pattern.command != message.command) return false;
  if (pattern.address && pattern.address != message.address) return false;
  if (pattern.data.size() > message.bytes.size()) return false;
  for (std::size_t i = 0; i < pattern.data.size(); ++i) {
    const unsigned mask = i < pattern.data_mask.size() ? pattern.data_mask[i] : 0xFFU;
    if (pattern.data[i] && ((*pattern.data[i] ^ message.bytes[i]) & mask) != 0) return false;
  }
  return true;
}

std::optional<std::uint32_t> CanopenMessages::pdo_id(std::uint16_t parameter) const {
  constexpr std::int64_t invalid = 1LL << 31;
  const dictionary::Dictionary& objects = device_.dictionary();
  const dictionary::Entry* entry = objects.find(parameter, 1);
  if (entry == nullptr) return std::nullopt;
  const std::int64_t id = objects.number(*entry);
  if ((id & invalid) != 0) return std::nullopt;
  return static_cast<std::uint32_t>(id & 0x7FF);
}

Message CanopenMessages::outgoing(const canopen::Frame& frame) const {
  Message message;
  message.id = frame.id;
  message.bytes = std::span(frame.data).first(frame.length);
  message.add(MessageKind::from_drive);
  const std::uint32_t node = device_.node_id();
  if (frame.id == cob_id::sdo_answer + node) {
    message.add(MessageKind::sdo_answer);
    message.object = transfer_;
  } else if (frame.id == cob_id::emergency + node) {
    message.add(MessageKind::emergency);
  } else if (frame.id == cob_id::error_control + node) {
    message.add(frame.length > 0 && frame.data[0] == 0 ? MessageKind::boot_up : MessageKind::heartbeat);
  } else if (frame.id == cob_id::lss_answer) {
    message.add(MessageKind::lss_answer);
  }
  for (unsigned n = 0; n < pdos; ++n) {
    if (pdo_id(static_cast<std::uint16_t>(0x1800 + n)) != frame.id) continue;
    message.add(MessageKind::tpdo);
    message.add(numbered(MessageKind::tpdo1, n));
  }
  return message;
}

Message CanopenMessages::incoming(const canopen::Frame& frame) {
  Message message;
  message.id = frame.id;
  message.bytes = std::span(frame.data).first(frame.length);
  message.add(MessageKind::to_drive);
  const std::uint32_t node = device_.node_id();
  if (frame.id == cob_id::sdo_request + node) {
    message.add(MessageKind::sdo_request);
    if (frame.length == 8 && begins_transfer(frame)) transfer_ = object_in(frame);
    message.object = transfer_;
  } else if (frame.id == cob_id::nmt && frame.length == 2 && (frame.data[1] == 0 || frame.data[1] == node)) {
    message.add(MessageKind::nmt);
  } else if (frame.id == cob_id::sync) {
    message.add(MessageKind::sync);
  } else if (frame.id == cob_id::time) {
    message.add(MessageKind::time);
  } else if (frame.id == cob_id::lss_request) {
    message.add(MessageKind::lss_request);
  }
  for (unsigned n = 0; n < pdos; ++n) {
    if (pdo_id(static_cast<std::uint16_t>(0x1400 + n)) != frame.id) continue;
    message.add(MessageKind::rpdo);
    message.add(numbered(MessageKind::rpdo1, n));
  }
  return message;
}

}  // namespace servodrome::scenario
