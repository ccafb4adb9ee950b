#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

// Protocol data units (Modbus Application Protocol V1.1b3): function code and data, independent of the transport.
namespace servodrome::modbus {

inline constexpr std::size_t longest_pdu = 253;

enum class Function : std::uint8_t {
  read_holding_registers = 0x03,
  read_input_registers = 0x04,
  write_single_register = 0x06,
  write_multiple_registers = 0x10,
  read_write_multiple_registers = 0x17,
  encapsulated_interface_transport = 0x2B,
};

inline constexpr std::uint8_t error_bit = 0x80;                   // set in the function code of an exception response
inline constexpr std::uint8_t read_device_identification = 0x0E;  // MEI type of function 2Bh

// Greatest number of registers in a request (6.3, 6.4, 6.12, 6.17).
inline constexpr std::uint16_t most_registers_read = 125;
inline constexpr std::uint16_t most_registers_written = 123;
inline constexpr std::uint16_t most_registers_written_and_read = 121;

// Exception codes (7). `none` is success.
enum class Exception : std::uint8_t {
  none = 0x00,
  illegal_function = 0x01,
  illegal_data_address = 0x02,
  illegal_data_value = 0x03,
  server_device_failure = 0x04,
  acknowledge = 0x05,
  server_device_busy = 0x06,
  memory_parity_error = 0x08,
  gateway_path_unavailable = 0x0A,
  gateway_target_failed_to_respond = 0x0B,
};

// The text of the standard for a code, or "unknown exception".
const char* text(Exception exception);

// 16-bit numbers are sent with the most significant byte first (4.2).
constexpr std::uint16_t read_u16(const std::uint8_t* bytes) {
  return static_cast<std::uint16_t>(bytes[0] << 8 | bytes[1]);
}
constexpr void write_u16(std::uint8_t* bytes, std::uint16_t value) {
  bytes[0] = static_cast<std::uint8_t>(value >> 8);
  bytes[1] = static_cast<std::uint8_t>(value);
}

}  // namespace servodrome::modbus
