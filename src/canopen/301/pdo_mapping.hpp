#pragma once

#include "canopen/profile.hpp"
#include "dictionary/dictionary.hpp"

// PDO mappings resolved to addresses in memory (CiA 301 7.4.7, 7.5.2.36, 7.5.2.38). A PDO has at most 64 bits, so its
// data are handled as one little-endian word: bit n of the word is bit n % 8 of byte n / 8, the numbering of CANopen.
namespace servodrome::canopen {

enum class Direction : std::uint8_t { receive, transmit };

inline constexpr std::uint8_t last_synchronous_type = 240;  // transmission types from 1, or 0 (acyclic)

struct MappedObject {
  const dictionary::Entry* entry = nullptr;
  std::byte* place = nullptr;  // nullptr: no storage (a dummy, an owner's command, or a constant)
  std::uint64_t mask = 0;      // mask of the object's bits, before the shift
  std::uint8_t shift = 0;      // first bit within the PDO
  std::uint8_t bytes = 0;      // size of the object in memory
  bool plain = true;           // no owner to call and no range to check
};

struct ResolvedMapping {
  std::uint8_t count = 0;
  std::uint8_t bits = 0;
  std::uint8_t bytes() const { return static_cast<std::uint8_t>((bits + 7) / 8); }
};

// Resolves one mapping entry (index << 16 | sub-index << 8 | bits) that starts at bit `shift`. Returns
// object_does_not_exist, not_mappable or mapping_exceeds_pdo_length on error.
dictionary::AbortCode resolve(const dictionary::Dictionary& dictionary, const Profile& profile, Direction direction,
                              std::uint32_t mapping_entry, unsigned shift, MappedObject& object);

// Resolves the first `count` entries of the mapping object `index`. On error `resolved` is empty.
dictionary::AbortCode resolve_all(const dictionary::Dictionary& dictionary, const Profile& profile, Direction direction,
                                  std::uint16_t index, unsigned count, std::span<MappedObject> objects,
                                  ResolvedMapping& resolved);

// Each size is a constant, so that the compiler replaces each memcpy by a single instruction.
inline std::uint64_t load(const std::byte* place, unsigned bytes) {
  std::uint64_t value = 0;
  switch (bytes) {
    case 1: std::memcpy(&value, place, 1); break;
    case 2: std::memcpy(&value, place, 2); break;
    case 4: std::memcpy(&value, place, 4); break;
    default: std::memcpy(&value, place, 8); break;
  }
  return value;
}

inline void store(std::byte* place, std::uint64_t value, unsigned bytes) {
  switch (bytes) {
    case 1: std::memcpy(place, &value, 1); break;
    case 2: std::memcpy(place, &value, 2); break;
    case 4: std::memcpy(place, &value, 4); break;
    default: std::memcpy(place, &value, 8); break;
  }
}

// Apply the view to a value. shown() returns the value that the bus reads. taken() changes a value from the bus, and
// returns false if the device shall not get it.
std::uint64_t shown(dictionary::View& view, const MappedObject& object, std::uint64_t value);
bool taken(dictionary::View& view, const MappedObject& object, std::uint64_t& value);

// Packs the data of a TPDO from its objects.
inline std::uint64_t pack(const dictionary::Dictionary& dictionary, std::span<const MappedObject> objects) {
  std::uint64_t word = 0;
  for (const MappedObject& object : objects) {
    if (!object.plain) {
      if (dictionary::Listener* owner = dictionary.listener(*object.entry)) owner->refresh(*object.entry);
    }
    std::uint64_t value = object.place != nullptr ? load(object.place, object.bytes)
                                                  : static_cast<std::uint64_t>(object.entry->default_value);
    if (dictionary::View* view = dictionary.view()) value = shown(*view, object, value);
    word |= (value & object.mask) << object.shift;
  }
  return word;
}

bool store_checked(dictionary::Dictionary& dictionary, const MappedObject& object, std::uint64_t value);
// Writes the data of an RPDO to its objects. An object whose range or owner refuses the value keeps its old value; the
// other objects are written. Returns the objects whose owners must be called, bit n for object n. The caller calls the
// owners after all values are written, also those of the other PDOs of the same SYNC. So a controlword acts together
// with the target of the same frame, in any order of the mapping.
inline std::uint64_t unpack(dictionary::Dictionary& dictionary, std::span<const MappedObject> objects,
                            std::uint64_t word) {
  std::uint64_t to_tell = 0;  // a PDO has at most 64 objects
  std::uint64_t bit = 1;
  for (const MappedObject& object : objects) {
    std::uint64_t value = word >> object.shift & object.mask;
    if (dictionary.view() != nullptr && !taken(*dictionary.view(), object, value)) {
      // The view refuses the value, so the device does not receive it.
    } else if (!object.plain) {
      if (store_checked(dictionary, object, value)) to_tell |= bit;
    } else if (object.place != nullptr) {
      store(object.place, value, object.bytes);
    }
    bit <<= 1;
  }
  return to_tell;
}

inline void tell_owners(const dictionary::Dictionary& dictionary, std::span<const MappedObject> objects,
                        std::uint64_t to_tell) {
  for (std::size_t i = 0; to_tell != 0; ++i, to_tell >>= 1) {
    if ((to_tell & 1) == 0) continue;
    const dictionary::Entry& entry = *objects[i].entry;
    if (dictionary::Listener* owner = dictionary.listener(entry)) owner->written(entry);
  }
}

// Checks of the objects 14xxh..1Axxh for both directions.
struct PdoConfiguration {
  dictionary::Dictionary& dictionary;
  const Profile& profile;

  bool is_valid(std::uint16_t parameter_index) const;
  // Checks sub-index 1 of the communication parameter.
  dictionary::AbortCode check_cob_id(std::uint16_t parameter_index, std::uint32_t value) const;
  // Checks the mapping parameter before `value` is written to `entry`.
  dictionary::AbortCode check_mapping(Direction direction, std::uint16_t parameter_index,
                                      const dictionary::Entry& entry, std::uint32_t value, std::size_t capacity) const;
};

}  // namespace servodrome::canopen
