#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "dictionary/entry.hpp"

// Assignment of registers to objects of a dictionary. A product builds its map at compile time from its dictionary's
// table.
namespace servodrome::modbus {

// An object at `address` and the following words - 1 registers. Numbers are extended to that length; strings have two
// characters per register, the first in the high byte, and end with zeros.
struct Register {
  std::uint16_t address = 0;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  std::uint8_t words = 1;

  friend bool operator==(const Register&, const Register&) = default;
};

// Number of registers for `type`; 0 for types of variable length.
constexpr std::uint8_t words_of(dictionary::Type type) {
  return static_cast<std::uint8_t>((dictionary::size_of(type) + 1) / 2);
}

// Address at which an object's sub-indices begin.
struct Page {
  std::uint16_t index;
  std::uint16_t address;
};

template <std::size_t Capacity>
struct RegisterMapBuilder {
  std::array<Register, Capacity> registers{};
  std::size_t count = 0;

  constexpr RegisterMapBuilder& add(const Register& row) {
    registers[count++] = row;
    return *this;
  }

  // Adds every number of `table` whose index has a page: sub-index n is at the page's address + n * stride.
  constexpr RegisterMapBuilder& add_pages(std::span<const dictionary::Entry> table, std::span<const Page> pages,
                                          std::uint16_t stride) {
    for (const dictionary::Entry& entry : table) {
      if (!entry.fixed_size()) continue;
      for (const Page& page : pages) {
        if (page.index != entry.index) continue;
        add({static_cast<std::uint16_t>(page.address + entry.sub * stride), entry.index, entry.sub,
             words_of(entry.type)});
      }
    }
    return *this;
  }

  // Removes an object that has no register although its index has a page.
  constexpr RegisterMapBuilder& remove(std::uint16_t index, std::uint8_t sub) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (registers[i].index != index || registers[i].sub != sub) registers[kept++] = registers[i];
    }
    count = kept;
    return *this;
  }
};

// Makes a sorted map with exactly the registers that `Build` returns (a captureless constexpr lambda that returns a
// RegisterMapBuilder).
template <auto Build>
constexpr auto make_register_map() {
  constexpr auto builder = Build();
  std::array<Register, builder.count> map{};
  std::copy_n(builder.registers.begin(), builder.count, map.begin());
  std::sort(map.begin(), map.end(), [](const Register& a, const Register& b) { return a.address < b.address; });
  return map;
}

// Checks that the map is sorted, no register belongs to two objects, none is beyond FFFFh, and every object is in the
// sorted `table` and has enough registers.
constexpr bool is_valid_map(std::span<const Register> map, std::span<const dictionary::Entry> table) {
  for (std::size_t i = 0; i < map.size(); ++i) {
    const Register& row = map[i];
    if (row.words == 0 || row.address + row.words > 0x10000) return false;
    if (i > 0 && map[i - 1].address + map[i - 1].words > row.address) return false;
    const auto key = static_cast<std::uint32_t>(row.index) << 8 | row.sub;
    const auto entry = std::lower_bound(table.begin(), table.end(), key,
                                        [](const dictionary::Entry& one, auto wanted) { return one.key() < wanted; });
    if (entry == table.end() || entry->key() != key || words_of(entry->type) > row.words) return false;
  }
  return true;
}

}  // namespace servodrome::modbus
