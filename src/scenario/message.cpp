#include "scenario/message.hpp"

#include "canopen/301/sdo_wire.hpp"
#include "canopen/connection_set.hpp"
#include "canopen/object_access.hpp"

namespace servodrome::scenario {
namespace {

namespace connection_set = canopen::connection_set;
namespace sdo = canopen::sdo;

constexpr unsigned pdos = 4;

MessageKind numbered(MessageKind first, unsigned number) {
  return static_cast<MessageKind>(static_cast<unsigned>(first) + number);
}

ObjectAddress object_in(const canopen::Frame& frame) { return {sdo::multiplexer_index(frame), frame.data[3]}; }

Message canopen_message(const canopen::Frame& frame, MessageKind direction) {
  Message message;
  message.id = frame.id;
  message.bytes = std::span(frame.data).first(frame.length);
  message.add(direction);
  return message;
}

// The request that begins a transfer contains the object: initiate of download, upload, block download and block upload
// (CiA 301 7.2.4.3).
bool begins_transfer(const canopen::Frame& frame) {
  const unsigned subcommand = frame.data[0] & sdo::subcommand_mask;
  switch (sdo::specifier(frame.data[0])) {
    case sdo::client::initiate_download:
    case sdo::client::initiate_upload: return true;
    case sdo::client::block_upload: return subcommand == sdo::block_upload_subcommand::initiate;
    case sdo::client::block_download: return (subcommand & 1U) == sdo::block_download_subcommand::initiate;
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
  const dictionary::Dictionary& objects = device_.dictionary();
  const dictionary::Entry* entry = objects.find(parameter, 1);
  if (entry == nullptr) return std::nullopt;
  const std::int64_t id = objects.number(*entry);
  if ((id & canopen::cob_id::invalid) != 0) return std::nullopt;
  return static_cast<std::uint32_t>(id & canopen::cob_id::can_id_mask);
}

void CanopenMessages::add_pdo(Message& message, std::uint16_t parameter, MessageKind any, MessageKind first) const {
  for (unsigned n = 0; n < pdos; ++n) {
    if (pdo_id(static_cast<std::uint16_t>(parameter + n)) != message.id) continue;
    message.add(any);
    message.add(numbered(first, n));
  }
}

Message CanopenMessages::outgoing(const canopen::Frame& frame) const {
  Message message = canopen_message(frame, MessageKind::from_drive);
  const std::uint32_t node = device_.node_id();
  if (frame.id == connection_set::sdo_response + node) {
    message.add(MessageKind::sdo_answer);
    message.object = transfer_;
  } else if (frame.id == connection_set::emergency + node) {
    message.add(MessageKind::emergency);
  } else if (frame.id == connection_set::error_control + node) {
    message.add(frame.length > 0 && frame.data[0] == 0 ? MessageKind::boot_up : MessageKind::heartbeat);
  } else if (frame.id == connection_set::lss_response) {
    message.add(MessageKind::lss_answer);
  }
  add_pdo(message, 0x1800, MessageKind::tpdo, MessageKind::tpdo1);
  return message;
}

Message CanopenMessages::incoming(const canopen::Frame& frame) {
  Message message = canopen_message(frame, MessageKind::to_drive);
  const std::uint32_t node = device_.node_id();
  if (frame.id == connection_set::sdo_request + node) {
    message.add(MessageKind::sdo_request);
    if (frame.length == 8 && begins_transfer(frame)) transfer_ = object_in(frame);
    message.object = transfer_;
  } else if (frame.id == connection_set::nmt && frame.length == 2 && (frame.data[1] == 0 || frame.data[1] == node)) {
    message.add(MessageKind::nmt);
  } else if (frame.id == connection_set::sync) {
    message.add(MessageKind::sync);
  } else if (frame.id == connection_set::time) {
    message.add(MessageKind::time);
  } else if (frame.id == connection_set::lss_request) {
    message.add(MessageKind::lss_request);
  }
  add_pdo(message, 0x1400, MessageKind::rpdo, MessageKind::rpdo1);
  return message;
}

}  // namespace servodrome::scenario
