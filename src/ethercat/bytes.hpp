#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

// Numbers as they travel: little endian, at any address (ETG.1000.4 clause 4.2).
namespace servodrome::ethercat {

static_assert(std::endian::native == std::endian::little);

template <typename T>
T load(const std::uint8_t* place) {
  T value;
  std::memcpy(&value, place, sizeof value);
  return value;
}

template <typename T>
void store(std::uint8_t* place, T value) {
  std::memcpy(place, &value, sizeof value);
}

inline std::uint16_t load_u16(const std::uint8_t* place) { return load<std::uint16_t>(place); }
inline std::uint32_t load_u32(const std::uint8_t* place) { return load<std::uint32_t>(place); }
inline void store_u16(std::uint8_t* place, unsigned value) { store(place, static_cast<std::uint16_t>(value)); }
inline void store_u32(std::uint8_t* place, std::uint32_t value) { store(place, value); }

}  // namespace servodrome::ethercat
