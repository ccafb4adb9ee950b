#include "scenario/coe_messages.hpp"

#include <algorithm>

#include "ethercat/slave/mailbox_wire.hpp"

namespace servodrome::scenario {
namespace {

constexpr std::size_t type_byte = 5;
constexpr std::size_t command_byte = ethercat::mailbox_header_size + ethercat::coe_header_size;
constexpr std::size_t sdo_bytes = 8;

std::optional<ethercat::CoeService> service_of(std::span<const std::uint8_t> bytes) {
  const auto coe = static_cast<unsigned>(ethercat::MailboxType::coe);
  if (bytes.size() < command_byte || (bytes[type_byte] & 0x0FU) != coe) return std::nullopt;
  return static_cast<ethercat::CoeService>(bytes[ethercat::mailbox_header_size + 1] >> 4);
}

// Initiate download and upload, and SDO information, have the address of an object after their command.
bool begins_transfer(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < command_byte + 4) return false;
  const unsigned command = bytes[command_byte] >> 5;
  return command == 1 || command == 2;
}

}  // namespace

Message CoeMessages::outgoing(std::span<const std::uint8_t> bytes) const {
  Message message;
  message.bytes = bytes;
  message.add(MessageKind::from_drive);
  message.add(MessageKind::mailbox_answer);
  const auto service = service_of(bytes);
  if (service == ethercat::CoeService::emergency) message.add(MessageKind::emergency);
  // An abort by the server is sent as an SDO request.
  if (service == ethercat::CoeService::sdo_response || service == ethercat::CoeService::sdo_request) {
    message.add(MessageKind::sdo_answer);
    message.object = transfer_;
  }
  return message;
}

Message CoeMessages::incoming(std::span<const std::uint8_t> bytes) {
  Message message;
  message.bytes = bytes;
  message.add(MessageKind::to_drive);
  message.add(MessageKind::mailbox_request);
  if (service_of(bytes) == ethercat::CoeService::sdo_request) {
    message.add(MessageKind::sdo_request);
    if (begins_transfer(bytes)) {
      const std::uint8_t* sdo = bytes.data() + command_byte;
      transfer_ = ObjectAddress{static_cast<std::uint16_t>(sdo[1] | sdo[2] << 8), sdo[3]};
    }
    message.object = transfer_;
  }
  return message;
}

std::vector<std::uint8_t> coe_abort(std::span<const std::uint8_t> message, const ObjectAddress& object,
                                    std::uint32_t code) {
  constexpr auto service = static_cast<unsigned>(ethercat::CoeService::sdo_request) << 12;
  std::vector<std::uint8_t> bytes(command_byte + sdo_bytes);
  std::copy_n(message.begin(), std::min(message.size(), ethercat::mailbox_header_size), bytes.begin());
  ethercat::store_u16(bytes.data(), static_cast<unsigned>(bytes.size() - ethercat::mailbox_header_size));
  ethercat::store_u16(bytes.data() + ethercat::mailbox_header_size, service);
  std::uint8_t* sdo = bytes.data() + command_byte;
  sdo[0] = 0x80;
  ethercat::store_u16(sdo + 1, object.index);
  sdo[3] = object.sub.value_or(0);
  ethercat::store_u32(sdo + 4, code);
  return bytes;
}

std::vector<std::uint8_t> coe_emergency(std::uint16_t code, std::uint8_t error_register) {
  constexpr auto service = static_cast<unsigned>(ethercat::CoeService::emergency) << 12;
  std::vector<std::uint8_t> bytes(command_byte + sdo_bytes);
  ethercat::store_u16(bytes.data(), static_cast<unsigned>(bytes.size() - ethercat::mailbox_header_size));
  bytes[type_byte] = static_cast<std::uint8_t>(ethercat::MailboxType::coe);
  ethercat::store_u16(bytes.data() + ethercat::mailbox_header_size, service);
  ethercat::store_u16(bytes.data() + command_byte, code);
  bytes[command_byte + 2] = error_register;
  return bytes;
}

}  // namespace servodrome::scenario
