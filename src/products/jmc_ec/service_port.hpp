#pragma once

#include <array>

#include "modbus/character_format.hpp"
#include "modbus/profile.hpp"
#include "modbus/register_map.hpp"
#include "products/jmc_ec/object_table.hpp"

// The service port of the JMC EC drives: RS232 on the micro USB socket, for the PC software (ch. 6, 'RS232
// Communication interface definition'). Its protocol is not printed. This project reads it as Modbus RTU (C-36),
// because the addresses of the parameter list are two bytes wide (ch. 6) and P00-23 to P00-26 are settings of Modbus.
// The parameters of P00 have the addresses 0000h to 002Ah. The others follow the same rule: group in the high byte,
// number in the low byte.
namespace servodrome::products::jmc_ec {

inline constexpr std::uint16_t monitor_page = 0x0D00;   // item dnn: two registers at 0D00h + 2 nn
inline constexpr std::uint16_t function_page = 0x0E00;  // 0E00h, 0E01h: the functions of 200Eh

constexpr std::uint16_t register_of(ParameterId id) { return static_cast<std::uint16_t>(id.group << 8 | id.number); }

inline constexpr auto service_registers = modbus::make_register_map<[] {
  modbus::RegisterMapBuilder<panel_section.size() + monitor_section.size()> builder;
  for (const dictionary::Entry& entry : panel_section) {
    if (entry.sub != 0) builder.add({register_of(parameter_of(entry)), entry.index, entry.sub, 1});
  }
  for (const dictionary::Entry& entry : monitor_section) {
    if (entry.sub == 0) continue;
    const auto number = static_cast<std::uint16_t>(entry.sub - 1);
    if (entry.index == monitor_index) {
      builder.add({static_cast<std::uint16_t>(monitor_page + 2 * number), entry.index, entry.sub, 2});
    } else {
      builder.add({static_cast<std::uint16_t>(function_page + number), entry.index, entry.sub, 1});
    }
  }
  return builder;
}>();
static_assert(modbus::is_valid_map(service_registers, object_table));

// Functions 03, 06 and 10h; items of two registers have the high word first, as in the standard's examples.
inline constexpr modbus::Profile service_profile{.functions = {.read_input_registers = false,
                                                               .read_write_multiple_registers = false,
                                                               .device_identification = false}};

// P00-21 (Table 65, ch. 8.2.1).
inline constexpr std::array<std::uint32_t, 4> rs232_bit_rates{9600, 19200, 57600, 115200};

// RS232 is always 8N1 (Table 115): P00-25 is for members of the family with RS485 (C-36).
constexpr modbus::CharacterFormat rs232_format(std::uint16_t code) {
  return {.bit_rate = rs232_bit_rates[code & 3U], .data_bits = 8, .parity = modbus::Parity::none, .stop_bits = 1};
}

}  // namespace servodrome::products::jmc_ec
