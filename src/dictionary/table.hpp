#pragma once

#include <algorithm>
#include <array>
#include <initializer_list>
#include <span>

#include "dictionary/entry.hpp"

// Composition of a device's table at compile time: shared sections, the product's additions, its overrides.
namespace servodrome::dictionary {

template <std::size_t Capacity>
struct TableBuilder {
  std::array<Entry, Capacity> entries{};
  std::size_t count = 0;

  // Adds one entry, replacing an entry of the same index and sub-index. `base` is the offset of the entry's objects
  // struct within the device's.
  constexpr TableBuilder& add(Entry entry, std::size_t base = 0) {
    if (entry.offset != Field::no_storage) entry.offset += static_cast<std::uint32_t>(base);
    for (std::size_t i = 0; i < count; ++i) {
      if (entries[i].key() == entry.key()) {
        entries[i] = entry;
        return *this;
      }
    }
    entries[count++] = entry;
    return *this;
  }

  constexpr TableBuilder& add(std::span<const Entry> section, std::size_t base = 0) {
    for (const Entry& entry : section) add(entry, base);
    return *this;
  }

  // Adds a section that shares no object with the entries so far; linear, while `add` is quadratic.
  constexpr TableBuilder& append(std::span<const Entry> section, std::size_t base = 0) {
    for (Entry entry : section) {
      if (entry.offset != Field::no_storage) entry.offset += static_cast<std::uint32_t>(base);
      entries[count++] = entry;
    }
    return *this;
  }

  // Adds only the named objects (all their sub-indices) of a section.
  constexpr TableBuilder& pick(std::span<const Entry> section, std::span<const std::uint16_t> indices,
                               std::size_t base = 0) {
    for (const Entry& entry : section) {
      for (const std::uint16_t index : indices) {
        if (entry.index == index) add(entry, base);
      }
    }
    return *this;
  }

  constexpr TableBuilder& remove(std::uint16_t index) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (entries[i].index != index) entries[kept++] = entries[i];
    }
    count = kept;
    return *this;
  }

  // The entry, to change it. A missing entry is a compile-time error (out-of-bounds access).
  constexpr Entry& at(std::uint16_t index, std::uint8_t sub = 0) {
    std::size_t i = 0;
    while (i < count && (entries[i].index != index || entries[i].sub != sub)) ++i;
    return i < count ? entries[i] : entries[Capacity];
  }

  constexpr TableBuilder& set_default(std::uint16_t index, std::uint8_t sub, std::int64_t value) {
    at(index, sub).default_value = value;
    return *this;
  }

  // Sets the factory mapping of the PDO with mapping object `index` (16xxh, 1Axxh): index, sub-index and length in bits
  // of each object (CiA 301 table 74).
  constexpr TableBuilder& map_pdo(std::uint16_t index, std::initializer_list<std::uint32_t> objects) {
    std::uint8_t sub = 0;
    for (const std::uint32_t object : objects) set_default(index, ++sub, object);
    return set_default(index, 0, sub);
  }

  constexpr TableBuilder& set_range(std::uint16_t index, std::uint8_t sub, std::int64_t minimum, std::int64_t maximum) {
    Entry& entry = at(index, sub);
    entry.minimum = minimum;
    entry.maximum = maximum;
    entry.has_range = true;
    return *this;
  }
};

// A sorted table of exactly the entries that `Build` (a captureless constexpr lambda returning a TableBuilder)
// composes.
template <auto Build>
constexpr auto make_table() {
  constexpr auto builder = Build();
  std::array<Entry, builder.count> table{};
  std::copy_n(builder.entries.begin(), builder.count, table.begin());
  std::sort(table.begin(), table.end(), [](const Entry& a, const Entry& b) { return a.key() < b.key(); });
  return table;
}

// The part of a table that a fieldbus can access: the entries that are not local.
template <const auto& Table>
constexpr auto make_bus_table() {
  constexpr auto is_seen = [](const Entry& entry) { return !entry.local; };
  constexpr auto count = static_cast<std::size_t>(std::count_if(Table.begin(), Table.end(), is_seen));
  std::array<Entry, count> table{};
  std::copy_if(Table.begin(), Table.end(), table.begin(), is_seen);
  return table;
}

constexpr bool is_sorted_and_unique(std::span<const Entry> table) {
  for (std::size_t i = 1; i < table.size(); ++i) {
    if (table[i - 1].key() >= table[i].key()) return false;
  }
  return true;
}

constexpr bool defaults_are_in_range(std::span<const Entry> table) {
  for (const Entry& entry : table) {
    if (!entry.fixed_size() || entry.type == Type::unsigned64 || entry.type == Type::real32) continue;
    if (entry.default_value < entry.minimum || entry.default_value > entry.maximum) return false;
  }
  return true;
}

// Every object with sub-indices has a sub-index 0 with their number, and the same object code and `local` flag in all
// its entries.
constexpr bool sub_indices_are_complete(std::span<const Entry> table) {
  for (std::size_t i = 0; i < table.size(); ++i) {
    const bool first = i == 0 || table[i - 1].index != table[i].index;
    if (first && table[i].sub != 0) return false;
    if (!first && (table[i - 1].code != table[i].code || table[i - 1].local != table[i].local)) return false;
  }
  return true;
}

constexpr bool is_valid_table(std::span<const Entry> table) {
  return is_sorted_and_unique(table) && defaults_are_in_range(table) && sub_indices_are_complete(table);
}

}  // namespace servodrome::dictionary
