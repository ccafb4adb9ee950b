#pragma once

#include "dictionary/dictionary.hpp"

// Access to communication objects that a device may lack.
namespace servodrome::canopen {

// The value of an object, or `absent` if the device does not have it.
template <typename T>
T value_of(const dictionary::Dictionary& dictionary, std::uint16_t index, std::uint8_t sub, T absent) {
  const dictionary::Entry* entry = dictionary.find(index, sub);
  return entry == nullptr ? absent : static_cast<T>(dictionary.number(*entry));
}

// The bytes of an object that the stack itself updates (1001h, 1003h), or nullptr.
inline std::byte* storage_of(const dictionary::Dictionary& dictionary, std::uint16_t index, std::uint8_t sub) {
  const dictionary::Entry* entry = dictionary.find(index, sub);
  return entry == nullptr ? nullptr : dictionary.storage(*entry);
}

inline std::uint32_t unsigned_of(std::span<const std::byte> value) {
  return static_cast<std::uint32_t>(dictionary::decode_number(dictionary::Type::unsigned64, value));
}

// COB-ID parameters (CiA 301 tables 66, 71 and 7.5.2.5): bit 31 valid (or "consumes"), 30 per object, 29 extended.
namespace cob_id {
inline constexpr std::uint32_t invalid = 0x80000000;
inline constexpr std::uint32_t bit_30 = 0x40000000;
inline constexpr std::uint32_t extended = 0x20000000;
inline constexpr std::uint32_t can_id_mask = 0x7FF;

// CAN-IDs that no configurable object may use (CiA 301 table 40).
constexpr bool is_restricted(std::uint32_t id) {
  return id <= 0x07F || (id >= 0x101 && id <= 0x180) || (id >= 0x581 && id <= 0x5FF) || (id >= 0x601 && id <= 0x67F) ||
         (id >= 0x6E0 && id <= 0x6FF) || id >= 0x701;
}

// Only base frames are supported (bit 29 and bits 28..11 are 0).
constexpr bool is_base(std::uint32_t value) { return (value & 0x3FFFF800) == 0; }
}  // namespace cob_id

}  // namespace servodrome::canopen
