#pragma once

#include <algorithm>
#include <cstdint>

#include "ethercat/bytes.hpp"

namespace servodrome::ethercat {

// A fieldbus memory management unit: maps bits of the logical address space to bits of this slave's memory (ETG.1000.4
// clause 6.6).
struct Fmmu {
  static constexpr unsigned size = 16;  // bytes of registers

  std::uint32_t logical = 0;
  std::uint16_t length = 0;  // bytes of the logical address space that it touches, also in part
  std::uint8_t first_bit = 0;
  std::uint8_t last_bit = 7;
  std::uint16_t physical = 0;
  std::uint8_t physical_bit = 0;
  bool reads = false;
  bool writes = false;
  bool active = false;

  static Fmmu from(const std::uint8_t* registers) {
    Fmmu fmmu;
    fmmu.logical = load_u32(registers);
    fmmu.length = load_u16(registers + 4);
    fmmu.first_bit = registers[6] & 7;
    fmmu.last_bit = registers[7] & 7;
    fmmu.physical = load_u16(registers + 8);
    fmmu.physical_bit = registers[10] & 7;
    fmmu.reads = (registers[11] & 1) != 0;
    fmmu.writes = (registers[11] & 2) != 0;
    fmmu.active = (registers[12] & 1) != 0 && fmmu.length != 0 && (fmmu.reads || fmmu.writes) && fmmu.bits() > 0;
    return fmmu;
  }

  bool whole_bytes() const { return first_bit == 0 && last_bit == 7 && physical_bit == 0; }

  // Number of mapped bits. Zero or negative if the last bit lies before the first.
  std::int32_t bits() const { return (length - 1) * 8 + last_bit + 1 - first_bit; }
  // First mapped bit, counted from the start of the logical address space.
  std::uint64_t logical_bit() const { return std::uint64_t{logical} * 8 + first_bit; }
  std::uint32_t physical_first_bit() const { return physical * 8U + physical_bit; }
};

}  // namespace servodrome::ethercat
