#pragma once

#include <array>

#include "modbus/character_format.hpp"
#include "modbus/profile.hpp"
#include "modbus/register_map.hpp"
#include "products/jmc_ec/object_table.hpp"

// The service port of the JMC EC drives: RS232 on the micro USB socket, for the PC software (ch. 6, 'RS232
// Communication interface definition'). Its protocol is not printed (C-36). That it is Modbus RTU is a reading: the
// addresses of the parameter list are two bytes wide (ch. 6), and P00-23 to P00-26 are its settings. The parameters of
// P00 have the addresses 0000h to 002Ah; the others follow the same rule, group in the high byte and number in the low
// one.
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

// 03, 06 and 10h; items high word first, as the standard's examples have it.
inline constexpr modbus::Profile service_profile{.functions = {.read_input_registers = false,
                                                               .read_write_multiple_registers = false,
                                                               .device_identification = false}};

// P00-21 (Table 65, ch. 8.2.1).
inline constexpr std::array<std::uint32_t, 4> rs232_bit_rates{9600, 19200, 57600, 115200};

// RS232 is 8N1 whatever P00-25 says, which is for the RS485 members of the family (Table 115, C-36).
constexpr modbus::CharacterFormat rs232_format(std::uint16_t code) {
  return {.bit_rate = rs232_bit_rates[code & 3U], .data_bits = 8, .parity = modbus::Parity::none, .stop_bits = 1};
}

}  // namespace servodrome::products::jmc_ec
