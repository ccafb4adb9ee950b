#pragma once

#include "dictionary/dictionary.hpp"
#include "dictionary/medium.hpp"

namespace servodrome::dictionary {

// The non-volatile values of a dictionary: the entries with `saved`, as 1010h and 1011h of CiA 301 treat them.
//
// The medium is two banks of half its size. A bank is a header (StoreHeader) and its records: first the identity (1018h
// sub 1 and 2, if the table has them), then the values, area by area in the order of their keys:
//     index u16 | sub-index u8 | size u16 | `size` bytes of value        (all little endian)
// The valid bank with the newest sequence number holds the values. A new image is written to the other bank: its old
// header is erased, then the records are written, then the header, whose last word makes it valid, with a flush after
// each step. So a loss of power at any byte leaves either all old values or all new values.
class Store {
 public:
  enum class Loaded : std::uint8_t {
    values,   // the objects have the saved values
    nothing,  // the medium is as manufactured: all bytes 00h, or all FFh
    damaged,  // the saved values are corrupt, are of another product, or cannot be read
  };

  static constexpr std::uint32_t record_overhead = 5;
  static constexpr std::uint32_t largest_value = 0xFFFF;  // bytes; of a string or domain

  explicit Store(Medium& medium) : medium_(medium) {}

  // Saves the values of `areas`; saved values of other areas stay. Owners refresh their values first. Errors:
  // hardware_error if the medium is too small or does not respond. The old values remain then; if only the last step
  // failed, the medium has the old or the new values.
  AbortCode save(const Dictionary& dictionary, Area areas) { return rewrite(dictionary, areas, Content::present); }

  // Saves the values of single objects, for values that a device saves by itself. `keys` are their Entry::key, in
  // ascending order; objects that are not `saved` are skipped. The saved values of all other objects stay, and an
  // object without a saved value gets none. Errors as `save`.
  AbortCode save_objects(const Dictionary& dictionary, std::span<const std::uint32_t> keys) {
    return rewrite(dictionary, Area{}, Content::present, keys);
  }

  // Deletes the saved values of `areas`, so that factory values act after the next reset (CiA 301 7.5.2.14). The values
  // in use do not change. A damaged medium is empty afterwards. Errors as `save`.
  AbortCode restore_defaults(const Dictionary& dictionary, Area areas) {
    return rewrite(dictionary, areas, Content::factory);
  }

  // Copies the saved values of `areas` to the objects, without access checks and callbacks: for use after
  // `load_defaults`, before a device starts. Records that no longer fit an object of this table (unknown, not `saved`,
  // another size, out of range) are skipped. Unless the result is `values`, the objects of `areas` must be set to their
  // factory values again.
  Loaded load(Dictionary& dictionary, Area areas) const;

 private:
  enum class Content : std::uint8_t { present, factory };
  AbortCode rewrite(const Dictionary& dictionary, Area areas, Content content,
                    std::span<const std::uint32_t> keys = {});

  Medium& medium_;
};

// The signatures that a master writes to 1010h and 1011h (CiA 301 7.5.2.13 and 7.5.2.14), and the areas of their
// sub-indices.
inline constexpr std::uint32_t save_signature = 0x65766173;  // "save"
inline constexpr std::uint32_t load_signature = 0x64616F6C;  // "load"
constexpr Area area_of_storage_sub(std::uint8_t sub) {
  switch (sub) {
    case 1: return Area::all;
    case 2: return Area::communication;
    case 3: return Area::profile | Area::motor;
    default: return Area::manufacturer;
  }
}

// The first bytes of a bank. `mark` is written last and makes the bank valid.
struct StoreHeader {
  static constexpr std::uint32_t current_version = 1;
  static constexpr std::uint32_t valid_mark = 0x524F5453;  // "STOR"
  static constexpr std::uint32_t begun_mark = 0x4E474542;  // "BEGN": the records are not complete yet

  std::uint32_t version;
  std::uint32_t sequence;        // +1 with every image, wrapping
  std::uint32_t payload_length;  // bytes of records
  std::uint32_t crc;             // CRC-32 (IEEE 802.3) of the three words above and the records
  std::uint32_t mark;
};
static_assert(sizeof(StoreHeader) == 20);

// CRC-32 of IEEE 802.3 (reflected, polynomial 04C11DB7h), continued from the `crc` of earlier bytes; 0 at the
// beginning.
std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t crc = 0);

}  // namespace servodrome::dictionary
