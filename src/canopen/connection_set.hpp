#pragma once

#include <cstdint>

// CAN-IDs of the predefined connection set (CiA 301 7.3.5) and of LSS (CiA 305). Those of a node are relative to its
// node-ID.
namespace servodrome::canopen::connection_set {

inline constexpr std::uint32_t nmt = 0x000;
inline constexpr std::uint32_t sync = 0x080;
inline constexpr std::uint32_t emergency = 0x080;  // of a node
inline constexpr std::uint32_t time = 0x100;
inline constexpr std::uint32_t sdo_response = 0x580;   // of a node
inline constexpr std::uint32_t sdo_request = 0x600;    // of a node
inline constexpr std::uint32_t error_control = 0x700;  // of a node
inline constexpr std::uint32_t lss_response = 0x7E4;
inline constexpr std::uint32_t lss_request = 0x7E5;

}  // namespace servodrome::canopen::connection_set
