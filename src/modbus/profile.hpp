#pragma once

#include "dictionary/abort_code.hpp"
#include "modbus/pdu.hpp"

// Features of a product's Modbus interface and its deviations from the standard.
namespace servodrome::modbus {

struct Functions {
  bool read_holding_registers = true;         // 03
  bool read_input_registers = true;           // 04, the same registers as 03
  bool write_single_register = true;          // 06
  bool write_multiple_registers = true;       // 10h
  bool read_write_multiple_registers = true;  // 17h
  bool device_identification = true;          // 2Bh/0Eh

  constexpr bool contains(std::uint8_t code) const {
    switch (static_cast<Function>(code)) {
      case Function::read_holding_registers: return read_holding_registers;
      case Function::read_input_registers: return read_input_registers;
      case Function::write_single_register: return write_single_register;
      case Function::write_multiple_registers: return write_multiple_registers;
      case Function::read_write_multiple_registers: return read_write_multiple_registers;
      case Function::encapsulated_interface_transport: return device_identification;
    }
    return false;
  }
};

// Function code of an exception response, if it is not the request's + 80h.
struct ErrorFunction {
  std::uint8_t function;
  std::uint8_t error;
};

// Exception that a master receives for an abort code of the dictionary.
struct AbortException {
  dictionary::AbortCode abort;
  Exception exception;
};

// Exceptions of the standard (Application Protocol V1.1b3, 7). A register that exists but cannot be read or written
// also gives illegal_data_address. An abort code that is not listed here gives server_device_failure.
inline constexpr auto standard_exceptions = std::to_array<AbortException>({
    {dictionary::AbortCode::object_does_not_exist, Exception::illegal_data_address},
    {dictionary::AbortCode::sub_index_does_not_exist, Exception::illegal_data_address},
    {dictionary::AbortCode::unsupported_access, Exception::illegal_data_address},
    {dictionary::AbortCode::read_only, Exception::illegal_data_address},
    {dictionary::AbortCode::write_only, Exception::illegal_data_address},
    {dictionary::AbortCode::length_mismatch, Exception::illegal_data_value},
    {dictionary::AbortCode::length_too_high, Exception::illegal_data_value},
    {dictionary::AbortCode::length_too_low, Exception::illegal_data_value},
    {dictionary::AbortCode::value_invalid, Exception::illegal_data_value},
    {dictionary::AbortCode::value_too_high, Exception::illegal_data_value},
    {dictionary::AbortCode::value_too_low, Exception::illegal_data_value},
    {dictionary::AbortCode::maximum_less_than_minimum, Exception::illegal_data_value},
    {dictionary::AbortCode::parameter_incompatible, Exception::illegal_data_value},
});

// Objects of device identification: 00..02 are basic (and mandatory), 03..7Fh regular, 80h..FFh extended (6.21).
struct Identification {
  std::uint8_t object;
  const char* text;
};

enum class WordOrder : std::uint8_t { high_word_first, low_word_first };

// How a number is extended to the size of its registers.
enum class Extension : std::uint8_t {
  by_type,     // signed numbers by their sign, others by zeros
  by_top_bit,  // all by their topmost bit; zeros are accepted as well
};

struct Profile {
  Functions functions{};
  WordOrder word_order = WordOrder::high_word_first;
  Extension extension = Extension::by_type;
  // An object has at least so many registers from its address on, unless another object begins there. 2 lets masters
  // read every object as 32 bits.
  std::uint8_t registers_per_object_at_least = 1;
  bool broadcast = true;  // station 0 on a serial line: executes 06 and 10h without an answer
  std::span<const ErrorFunction> error_functions{};
  std::span<const AbortException> exceptions = standard_exceptions;
  std::span<const Identification> identification{};  // sorted by object; needed for 2Bh/0Eh
};

}  // namespace servodrome::modbus
