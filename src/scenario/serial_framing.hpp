#pragma once

#include "line/axis.hpp"
#include "scenario/packets.hpp"

namespace servodrome::scenario {

// The messages of Modbus RTU, Modbus TCP and the 10-byte protocol, as the rules see them.
extern const Framing rtu_framing;
extern const Framing tcp_framing;
extern const Framing serial10_framing;

// True: the drive uses Modbus RTU on its RS485 line. False: the 10-byte protocol, or no protocol.
bool speaks_modbus(const line::Axis& axis);

// `bytes` must outlive the message.
Message serial_message(std::span<const std::uint8_t> bytes, bool modbus);
Message tcp_message(std::span<const std::uint8_t> bytes, MessageKind kind);

// The characters are a complete request to a drive with this station number.
bool is_request(std::span<const std::uint8_t> characters, bool modbus, std::uint8_t station);

}  // namespace servodrome::scenario
