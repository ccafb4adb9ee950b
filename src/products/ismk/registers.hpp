#pragma once

#include "modbus/profile.hpp"
#include "modbus/register_map.hpp"
#include "products/ismk/object_table.hpp"

// Modbus on the iSMK's RS485 port (ch. 8.1 to 8.3): the registers of the objects (ch. 7) and the answers of the
// functions.
namespace servodrome::products::ismk {

// Each object index has a page; sub-index n is at 10h * n from its beginning. Objects without a printed address, such
// as 3041h (ch. 7.14), have no register.
inline constexpr auto register_pages = std::to_array<modbus::Page>({
    {0x2010, 0x0800}, {0x2020, 0x0C00}, {0x2508, 0x1900}, {0x2601, 0x1F00}, {0x2602, 0x2000}, {0x2FE2, 0x2600},
    {0x2FF0, 0x2900}, {0x2FFF, 0x2F00}, {0x6040, 0x3100}, {0x6041, 0x3200}, {0x605A, 0x3400}, {0x605B, 0x3410},
    {0x605C, 0x3420}, {0x605D, 0x3430}, {0x605E, 0x3440}, {0x6060, 0x3500}, {0x6063, 0x3700}, {0x6065, 0x3800},
    {0x6067, 0x3900}, {0x606C, 0x3B00}, {0x6071, 0x3C00}, {0x6073, 0x3D00}, {0x6078, 0x3E00}, {0x607A, 0x4000},
    {0x607C, 0x4100}, {0x607D, 0x4400}, {0x607E, 0x4700}, {0x6080, 0x4900}, {0x6081, 0x4A00}, {0x6083, 0x4B00},
    {0x6084, 0x4C00}, {0x6085, 0x3300}, {0x6098, 0x4D00}, {0x6099, 0x5000}, {0x609A, 0x5200}, {0x60F6, 0x5800},
    {0x60F9, 0x6300}, {0x60FB, 0x6800}, {0x60FD, 0x6D00}, {0x60FF, 0x6F00}, {0x6410, 0x7000}, {0x6510, 0x8600},
});
inline constexpr std::uint16_t sub_index_stride = 0x10;

inline constexpr auto registers = modbus::make_register_map<[] {
  modbus::RegisterMapBuilder<object_table.size() + 1> builder;
  builder.add_pages(object_table, register_pages, sub_index_stride);
  builder.remove(0x6410, 0x1F);            // printed with "-" (ch. 7.14)
  builder.add({0x2A01, 0x2FF0, 0x11, 1});  // as printed (ch. 3.7); the rule gives 2A10h: both work
  return builder;
}>();
static_assert(modbus::is_valid_map(registers, object_table));

// A read that is refused is answered with function code 81h (ch. 8.3.1), where the standard has 83h.
inline constexpr auto error_functions = std::to_array<modbus::ErrorFunction>({{0x03, 0x81}});

inline constexpr modbus::Profile modbus_profile{
    .functions = {.read_input_registers = false,
                  .read_write_multiple_registers = false,
                  .device_identification = false},    // 03, 06 and 10h (ch. 8.3.1)
    .word_order = modbus::WordOrder::low_word_first,  // ch. 8.3.1, Table 8-1
    .extension = modbus::Extension::by_top_bit,       // as SDO answers are padded (Table 9-9)
    .registers_per_object_at_least = 2,               // Table 8-1
    .error_functions = error_functions,
};

// 2FE2h (ch. 8.2).
constexpr std::uint32_t rs485_bit_rate_of(std::uint16_t code) { return 10'368'000U / code; }
inline constexpr auto rs485_bit_rates = std::to_array<std::uint16_t>({1080, 540, 270, 90});

}  // namespace servodrome::products::ismk
