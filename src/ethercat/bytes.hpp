#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

// Numbers in the byte order of the bus: little endian, at any (also unaligned) address (ETG.1000.4 clause 4.2).
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

// memcpy for the few bytes of process data that a drive has in a frame. It is inlined as two moves, which may overlap.
inline constexpr std::size_t most_few_bytes = 32;
inline void copy_few(std::uint8_t* to, const std::uint8_t* from, std::size_t count) {
  struct Sixteen {
    std::uint64_t half[2];
  };
  const auto two = [&]<typename T>(T) {
    const T first = load<T>(from);
    const T last = load<T>(from + count - sizeof(T));
    store(to, first);
    store(to + count - sizeof(T), last);
  };
  if (count >= 16) {
    two(Sixteen{});
  } else if (count >= 8) {
    two(std::uint64_t{});
  } else if (count >= 4) {
    two(std::uint32_t{});
  } else {
    for (std::size_t i = 0; i < count; ++i) to[i] = from[i];
  }
}

}  // namespace servodrome::ethercat
