#include "scenario/serial_framing.hpp"

#include <algorithm>

#include "modbus/crc16.hpp"
#include "modbus/tcp_connection.hpp"
#include "serial10/frame.hpp"

namespace servodrome::scenario {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint8_t exception_bit = 0x80;  // of the function code (MODBUS Application Protocol, clause 7)
constexpr std::size_t least_rtu_bytes = 4;    // station, function, CRC

std::uint8_t byte_at(std::span<const std::uint8_t> bytes, std::size_t place) {
  return place < bytes.size() ? bytes[place] : std::uint8_t{0};
}

void seal_rtu(Bytes& bytes) {
  const std::uint16_t crc = modbus::crc16(bytes);
  bytes.push_back(static_cast<std::uint8_t>(crc));
  bytes.push_back(static_cast<std::uint8_t>(crc >> 8));
}

Bytes rtu_refusal(std::span<const std::uint8_t> message, std::uint32_t code) {
  return {byte_at(message, 0), static_cast<std::uint8_t>(byte_at(message, 1) | exception_bit),
          static_cast<std::uint8_t>(code)};
}

// The length in the header counts the bytes after the length.
void seal_tcp(Bytes& bytes) {
  constexpr std::size_t counted_from = modbus::Mbap::size - 1;
  if (bytes.size() < counted_from) return;
  const std::size_t length = bytes.size() - counted_from;
  bytes[4] = static_cast<std::uint8_t>(length >> 8);
  bytes[5] = static_cast<std::uint8_t>(length);
}

Bytes tcp_refusal(std::span<const std::uint8_t> message, std::uint32_t code) {
  Bytes bytes(message.begin(),
              message.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(message.size(), modbus::Mbap::size)));
  bytes.resize(modbus::Mbap::size);
  bytes.push_back(static_cast<std::uint8_t>(byte_at(message, modbus::Mbap::size) | exception_bit));
  bytes.push_back(static_cast<std::uint8_t>(code));
  return bytes;
}

// The sum of all bytes is 0 (iSMK manual, ch. 8.4.1).
void seal_serial10(Bytes& bytes) {
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes) sum += byte;
  bytes.push_back(static_cast<std::uint8_t>(0x100U - sum % 0x100U));
}

// Command 80h with the code as data (iSMK manual, ch. 8.4.2).
Bytes serial10_refusal(std::span<const std::uint8_t> message, std::uint32_t code) {
  Bytes bytes(message.begin(), message.end());
  bytes.resize(serial10::frame_bytes - 1);
  bytes[1] = static_cast<std::uint8_t>(serial10::Command::error);
  for (unsigned n = 0; n < 4; ++n) bytes[5 + n] = static_cast<std::uint8_t>(code >> 8 * n);
  return bytes;
}

}  // namespace

const Framing rtu_framing{.checksum_bytes = 2, .seal = seal_rtu, .refusal = rtu_refusal};
const Framing tcp_framing{.checksum_bytes = 0, .seal = seal_tcp, .refusal = tcp_refusal};
const Framing serial10_framing{.checksum_bytes = 1, .seal = seal_serial10, .refusal = serial10_refusal};

bool speaks_modbus(const line::Axis& axis) {
  const products::SerialPort* port = axis.serial_port();
  return port != nullptr && port->protocol() == products::SerialProtocol::modbus_rtu;
}

Message serial_message(std::span<const std::uint8_t> bytes, bool modbus) {
  Message message;
  message.bytes = bytes;
  if (modbus) {
    if (bytes.size() > 1) message.function = static_cast<std::uint8_t>(bytes[1] & ~exception_bit);
  } else if (bytes.size() == serial10::frame_bytes) {
    message.object = ObjectAddress{static_cast<std::uint16_t>(bytes[2] | bytes[3] << 8), bytes[4]};
  }
  return message;
}

Message tcp_message(std::span<const std::uint8_t> bytes, MessageKind kind) {
  Message message;
  message.bytes = bytes;
  message.add(kind);
  message.add(kind == MessageKind::answer ? MessageKind::from_drive : MessageKind::to_drive);
  if (bytes.size() > modbus::Mbap::size) {
    message.function = static_cast<std::uint8_t>(bytes[modbus::Mbap::size] & ~exception_bit);
  }
  return message;
}

bool is_request(std::span<const std::uint8_t> characters, bool modbus, std::uint8_t station) {
  if (modbus) {
    return characters.size() >= least_rtu_bytes && (characters[0] == station || characters[0] == 0) &&
           modbus::crc16(characters) == 0;
  }
  serial10::Frame frame;
  if (characters.size() != serial10::frame_bytes) return false;
  std::copy(characters.begin(), characters.end(), frame.bytes.begin());
  return frame.is_intact() && (frame.id() == station || frame.id() == serial10::universal_id);
}

}  // namespace servodrome::scenario
