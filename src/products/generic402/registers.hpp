#pragma once

#include "modbus/profile.hpp"
#include "products/generic402/objects.hpp"

// Modbus registers of the reference drive. Every numeric object of the dictionary has registers in one of three blocks:
// communication objects (1000h..1FFFh) from register 1000h on, manufacturer's objects (2000h..5FFFh) from 2000h on,
// profile objects (6000h on) from 6000h on; within a block in the order of the dictionary and without gaps, one
// register for 8 and 16 bits, two for 32, four for 64. The objects for cyclic exchange are also at contiguous registers
// from 0 (to write) and from 100h (to read), so that one request of function 17h exchanges all of them.
namespace servodrome::products::generic402 {

inline constexpr auto cyclic_registers = std::to_array<modbus::Register>({
    {0x0000, 0x6040, 0, 1},  // controlword
    {0x0001, 0x6060, 0, 1},  // mode of operation
    {0x0002, 0x607A, 0, 2},  // target position
    {0x0004, 0x60FF, 0, 2},  // target velocity
    {0x0006, 0x6071, 0, 1},  // target torque
    {0x0100, 0x6041, 0, 1},  // statusword
    {0x0101, 0x6061, 0, 1},  // mode of operation display
    {0x0102, 0x6064, 0, 2},  // position actual value
    {0x0104, 0x606C, 0, 2},  // velocity actual value
    {0x0106, 0x6077, 0, 1},  // torque actual value
    {0x0107, 0x603F, 0, 1},  // error code
});

struct RegisterBlock {
  std::uint16_t first_index;
  std::uint16_t last_index;
  std::uint16_t address;
};
inline constexpr auto register_blocks = std::to_array<RegisterBlock>({
    {0x1000, 0x1FFF, 0x1000},
    {0x2000, 0x5FFF, 0x2000},
    {0x6000, 0xFFFF, 0x6000},
});

constexpr bool is_in(const RegisterBlock& block, const dictionary::Entry& entry) {
  return entry.index >= block.first_index && entry.index <= block.last_index && entry.fixed_size();
}

inline constexpr auto registers = modbus::make_register_map<[] {
  modbus::RegisterMapBuilder<object_table.size() + cyclic_registers.size()> builder;
  for (const modbus::Register& row : cyclic_registers) builder.add(row);
  for (const RegisterBlock& block : register_blocks) {
    std::uint16_t next = block.address;
    for (const dictionary::Entry& entry : object_table) {
      if (!is_in(block, entry)) continue;
      builder.add({next, entry.index, entry.sub, modbus::words_of(entry.type)});
      next = static_cast<std::uint16_t>(next + modbus::words_of(entry.type));
    }
  }
  return builder;
}>();
static_assert(modbus::is_valid_map(registers, object_table));

inline constexpr auto identification = std::to_array<modbus::Identification>({
    {0x00, "Servodrome"},
    {0x01, "generic402"},
    {0x02, "1.0"},
    {0x04, "Reference drive"},
    {0x05, "CiA 402"},
});

}  // namespace servodrome::products::generic402
