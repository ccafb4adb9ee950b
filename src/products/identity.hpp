#pragma once

#include <cstdint>

// Values of 1000h and 1018h that several products share. Their manuals do not print 1018h; the numbers are this
// project's.
namespace servodrome::products {

inline constexpr std::uint32_t servo_drive = 0x00020192;  // 1000h: CiA 402, servo drive
inline constexpr std::uint32_t vendor_id = 0x53455256;    // 1018h sub 1: "SERV", a number that no vendor has

}  // namespace servodrome::products
