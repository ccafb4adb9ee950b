#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "dictionary/entry.hpp"
#include "ethercat/slave/profile.hpp"

// Values that both the SII image and the ESI file derive from the default values of an object table.
namespace servodrome::ethercat {

struct Defaults {
  std::span<const dictionary::Entry> table;

  // Returns nullptr if the table does not have the entry.
  const dictionary::Entry* find(std::uint16_t index, unsigned sub) const {
    const std::uint32_t key = static_cast<std::uint32_t>(index) << 8 | sub;
    const auto at =
        std::lower_bound(table.begin(), table.end(), key,
                         [](const dictionary::Entry& entry, std::uint32_t wanted) { return entry.key() < wanted; });
    return at != table.end() && at->key() == key ? &*at : nullptr;
  }
  std::uint32_t value(std::uint16_t index, unsigned sub) const {
    const dictionary::Entry* entry = find(index, sub);
    return entry == nullptr ? 0 : static_cast<std::uint32_t>(entry->default_value);
  }
  bool assigned(std::uint16_t assignment, std::uint16_t pdo) const {
    for (unsigned sub = 1, count = value(assignment, 0); sub <= count; ++sub) {
      if (value(assignment, sub) == pdo) return true;
    }
    return false;
  }
  // Bytes of all process data that are assigned by default.
  unsigned bytes(std::uint16_t assignment) const {
    unsigned bits = 0;
    for (unsigned sub = 1, count = value(assignment, 0); sub <= count; ++sub) {
      const auto pdo = static_cast<std::uint16_t>(value(assignment, sub));
      for (unsigned i = 1, entries = value(pdo, 0); i <= entries; ++i) bits += value(pdo, i) & 0xFF;
    }
    return (bits + 7) / 8;
  }
};

// A direction of process data: the objects of its PDO mappings and of its assignment.
struct PdoDirection {
  std::uint16_t first_mapping;
  std::uint16_t assignment;
  std::uint8_t sync_manager;

  constexpr bool has(const dictionary::Entry& entry) const {
    return entry.sub == 0 && entry.index >= first_mapping && entry.index < first_mapping + 0x200;
  }
};
inline constexpr PdoDirection rx_pdos{0x1600, 0x1C12, 2};
inline constexpr PdoDirection tx_pdos{0x1A00, 0x1C13, 3};

// A mapping entry: index, sub-index, length in bits; index 0 is a gap (ETG.1000.6 clause 5.6.7.4.7).
struct Mapped {
  std::uint16_t index;
  std::uint8_t sub;
  std::uint8_t bits;

  explicit constexpr Mapped(std::uint32_t mapping)
      : index(static_cast<std::uint16_t>(mapping >> 16)),
        sub(static_cast<std::uint8_t>(mapping >> 8)),
        bits(static_cast<std::uint8_t>(mapping)) {}
};

// The type of a mapped object as a master sees it: its own type, or the number type of the same signedness that has the
// mapped length.
constexpr dictionary::Type mapped_type(const dictionary::Entry& entry, std::uint8_t bits) {
  using dictionary::Type;
  if (bits == dictionary::size_of(entry.type) * 8U || entry.type == Type::boolean) return entry.type;
  const bool negative = dictionary::is_signed(entry.type);
  switch (bits) {
    case 8: return negative ? Type::integer8 : Type::unsigned8;
    case 16: return negative ? Type::integer16 : Type::unsigned16;
    case 32: return negative ? Type::integer32 : Type::unsigned32;
    case 64: return negative ? Type::integer64 : Type::unsigned64;
    default: return entry.type;
  }
}

// The settings that a master uses for a sync manager.
struct SyncManagerChannel {
  std::uint16_t start;
  std::uint16_t default_length;
  std::uint16_t least_length;
  std::uint16_t greatest_length;
  std::uint8_t control;
  std::uint8_t type;  // 1 mailbox out, 2 mailbox in, 3 outputs, 4 inputs (ETG.1000.6 table 24)
  bool enabled;
};

inline std::array<SyncManagerChannel, 4> sync_manager_channels(const Profile& profile, const Defaults& defaults) {
  const auto mailbox = [](const AreaRule& area, std::uint8_t control, std::uint8_t type) {
    return SyncManagerChannel{area.start, area.greatest_length, area.least_length, area.greatest_length, control, type,
                              true};
  };
  const auto process_data = [&defaults](std::uint16_t start, std::uint16_t greatest, const PdoDirection& direction,
                                        std::uint8_t control, std::uint8_t type) {
    const auto length = static_cast<std::uint16_t>(defaults.bytes(direction.assignment));
    return SyncManagerChannel{start, length, 0, greatest, control, type, length != 0};
  };
  return {mailbox(profile.mailbox_out, 0x26, 1), mailbox(profile.mailbox_in, 0x22, 2),
          process_data(profile.outputs_start, profile.greatest_outputs, rx_pdos, 0x64, 3),
          process_data(profile.inputs_start, profile.greatest_inputs, tx_pdos, 0x20, 4)};
}

}  // namespace servodrome::ethercat
