#pragma once

#include "dictionary/dictionary.hpp"
#include "dictionary/medium.hpp"

namespace servodrome::dictionary {

// The non-volatile values of a dictionary: the entries with `saved`, as 1010h and 1011h of CiA 301 treat them.
//
// The medium is two banks of half its size. A bank is a header (StoreHeader) and the records that it counts: whose
// values they are (1018h sub 1 and 2, where the table has them), then the values, area by area in the order of their
// keys:
//     index u16 | sub-index u8 | size u16 | `size` bytes of value        (all little endian)
// The valid bank with the newest sequence number holds the values. A new image goes to the other bank: its old header
// is wiped, then the records are written, then the header, whose last word makes it valid, with a flush after each. So
// a loss of power at any byte leaves either all the old values or all the new ones.
class Store {
 public:
  enum class Loaded : std::uint8_t {
    values,   // the objects have what was saved
    nothing,  // the medium is as it was made: all bytes 00h, or all FFh
    damaged,  // what was saved is spoilt, is another product's, or cannot be read
  };

  static constexpr std::uint32_t record_overhead = 5;
  static constexpr std::uint32_t largest_value = 0xFFFF;  // bytes; of a string or domain

  explicit Store(Medium& medium) : medium_(medium) {}

  // Saves the values of `areas`; what was saved of the other areas stays. Owners are asked to refresh first.
  // Errors: hardware_error when the medium is too small or does not answer; the old values are then still there, unless
  // only the medium's last answer was a failure, which leaves old or new.
  AbortCode save(const Dictionary& dictionary, Area areas) { return rewrite(dictionary, areas, Content::present); }

  // Forgets what was saved of `areas`, so that their factory values act after the next reset (CiA 301 7.5.2.14). The
  // values in use do not change. A damaged medium holds nothing afterwards. Errors as `save`.
  AbortCode restore_defaults(const Dictionary& dictionary, Area areas) {
    return rewrite(dictionary, areas, Content::factory);
  }

  // Puts the saved values of `areas` into the objects, past access rules and owners: for use after `load_defaults`,
  // before a device starts. Records that fit no object of this table any more (unknown, not `saved`, another size, out
  // of range) are skipped. Unless the answer is `values`, the objects of `areas` need their factory values again.
  Loaded load(Dictionary& dictionary, Area areas) const;

 private:
  enum class Content : std::uint8_t { present, factory };
  AbortCode rewrite(const Dictionary& dictionary, Area areas, Content content);

  Medium& medium_;
};

// What a master writes to 1010h and 1011h (CiA 301 7.5.2.13 and 7.5.2.14), and what their sub-indices are about.
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

// The first bytes of a bank. `mark` comes last: it is what makes a bank valid.
struct StoreHeader {
  static constexpr std::uint32_t current_version = 1;
  static constexpr std::uint32_t valid_mark = 0x524F5453;  // "STOR"

  std::uint32_t version;
  std::uint32_t sequence;        // +1 with every image, wrapping
  std::uint32_t payload_length;  // bytes of records
  std::uint32_t crc;             // CRC-32 (IEEE 802.3) of the three words above and the records
  std::uint32_t mark;
};
static_assert(sizeof(StoreHeader) == 20);

// CRC-32 of IEEE 802.3 (reflected, polynomial 04C11DB7h), continued from `crc` of the bytes before; 0 to begin with.
std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t crc = 0);

}  // namespace servodrome::dictionary
