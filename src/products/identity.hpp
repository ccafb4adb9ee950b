#pragma once

#include <cstdint>

#include "dictionary/table.hpp"

// Values of 1000h and 1018h that several products share. Their manuals do not print 1018h; the numbers are this
// project's.
namespace servodrome::products {

inline constexpr std::uint32_t servo_drive = 0x00020192;  // 1000h: CiA 402, servo drive
inline constexpr std::uint32_t vendor_id = 0x53455256;    // 1018h sub 1: "SERV", a number that no vendor has

template <std::size_t Capacity>
constexpr void set_identity(dictionary::TableBuilder<Capacity>& builder, std::uint32_t product_code,
                            std::uint32_t revision_number) {
  builder.set_default(0x1000, 0, servo_drive)
      .set_default(0x1018, 1, vendor_id)
      .set_default(0x1018, 2, product_code)
      .set_default(0x1018, 3, revision_number);
}

}  // namespace servodrome::products
