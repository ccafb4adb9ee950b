#include "canopen/301/pdo_mapping.hpp"

#include <algorithm>

#include "canopen/object_access.hpp"

namespace servodrome::canopen {

using dictionary::AbortCode;
using dictionary::Entry;

namespace {

constexpr std::uint16_t mapping_offset = 0x200;  // from 14xxh to 16xxh and from 18xxh to 1Axxh

// A BOOLEAN may be mapped with one bit, or with the byte that it has in memory.
bool length_fits(const Entry& entry, std::uint32_t mapping_entry, const Profile& profile) {
  const unsigned bits = mapping_entry & 0xFF;
  const unsigned own = dictionary::size_of(entry.type) * 8U;
  if (bits == own) return true;
  if (entry.type == dictionary::Type::boolean && bits == 1) return true;
  if (bits < own) return false;
  return profile.mapped_length_may_exceed_object ||
         std::find(profile.padded_mappings.begin(), profile.padded_mappings.end(), mapping_entry) !=
             profile.padded_mappings.end();
}

bool mappable(const Entry& entry, Direction direction) {
  const auto wanted = direction == Direction::receive ? dictionary::Pdo::rpdo : dictionary::Pdo::tpdo;
  return (static_cast<unsigned>(entry.pdo) & static_cast<unsigned>(wanted)) != 0 && entry.fixed_size();
}

}  // namespace

AbortCode resolve(const dictionary::Dictionary& dictionary, const Profile& profile, Direction direction,
                  std::uint32_t mapping_entry, unsigned shift, MappedObject& object) {
  AbortCode ignored{};
  const Entry* entry = dictionary.find(static_cast<std::uint16_t>(mapping_entry >> 16),
                                       static_cast<std::uint8_t>(mapping_entry >> 8), ignored);
  if (entry == nullptr) return AbortCode::object_does_not_exist;
  const unsigned bits = mapping_entry & 0xFF;
  if (!mappable(*entry, direction) || bits == 0 || !length_fits(*entry, mapping_entry, profile)) {
    return AbortCode::not_mappable;
  }
  if (shift + bits > 64) return AbortCode::mapping_exceeds_pdo_length;

  const unsigned own_bits = std::min(bits, dictionary::size_of(entry->type) * 8U);
  object.entry = entry;
  object.place = dictionary.storage(*entry);
  object.mask = own_bits < 64 ? (std::uint64_t{1} << own_bits) - 1 : ~std::uint64_t{0};
  object.shift = static_cast<std::uint8_t>(shift);
  object.bytes = dictionary::size_of(entry->type);
  object.plain = entry->owner == dictionary::Owner::none && (direction == Direction::transmit || !entry->has_range);
  return AbortCode::none;
}

AbortCode resolve_all(const dictionary::Dictionary& dictionary, const Profile& profile, Direction direction,
                      std::uint16_t index, unsigned count, std::span<MappedObject> objects, ResolvedMapping& resolved) {
  resolved = {};
  if (count > objects.size()) return AbortCode::value_invalid;
  unsigned bits = 0;
  for (unsigned i = 0; i < count; ++i) {
    const auto mapping_entry = value_of<std::uint32_t>(dictionary, index, static_cast<std::uint8_t>(i + 1), 0);
    const AbortCode abort = resolve(dictionary, profile, direction, mapping_entry, bits, objects[i]);
    if (abort != AbortCode::none) return abort;
    bits += mapping_entry & 0xFF;
  }
  resolved.count = static_cast<std::uint8_t>(count);
  resolved.bits = static_cast<std::uint8_t>(bits);
  return AbortCode::none;
}

std::uint64_t shown(dictionary::View& view, const MappedObject& object, std::uint64_t value) {
  view.show(*object.entry, std::as_writable_bytes(std::span(&value, 1)).first(object.bytes));
  return value;
}

bool taken(dictionary::View& view, const MappedObject& object, std::uint64_t& value) {
  return view.take(*object.entry, std::as_writable_bytes(std::span(&value, 1)).first(object.bytes));
}

bool store_checked(dictionary::Dictionary& dictionary, const MappedObject& object, std::uint64_t value) {
  const auto bytes = std::as_bytes(std::span(&value, 1)).first(object.bytes);
  const Entry& entry = *object.entry;
  if (dictionary.check_range(entry, bytes) != AbortCode::none) return false;
  dictionary::Listener* owner = dictionary.listener(entry);
  if (owner != nullptr && owner->check(entry, bytes) != AbortCode::none) return false;
  if (object.place != nullptr) store(object.place, value, object.bytes);
  return true;
}

bool PdoConfiguration::is_valid(std::uint16_t parameter_index) const {
  return (value_of<std::uint32_t>(dictionary, parameter_index, 1, cob_id::invalid) & cob_id::invalid) == 0;
}

AbortCode PdoConfiguration::check_cob_id(std::uint16_t parameter_index, std::uint32_t value) const {
  const auto present = value_of<std::uint32_t>(dictionary, parameter_index, 1, cob_id::invalid);
  const std::uint32_t can_id = value & cob_id::can_id_mask;
  if (!cob_id::is_base(value)) return AbortCode::value_invalid;
  for (const CobIdRange& range : profile.cob_id_ranges) {
    if (range.index == parameter_index && (can_id < range.lowest || can_id > range.highest)) {
      return AbortCode::value_invalid;
    }
  }
  // An invalid PDO may keep its CAN-ID, or have none.
  const bool invalid = (value & cob_id::invalid) != 0;
  if (invalid && (can_id == 0 || can_id == (present & cob_id::can_id_mask))) return AbortCode::none;
  if (cob_id::is_restricted(can_id)) return AbortCode::value_invalid;
  if (invalid) return AbortCode::none;
  // Bits 29 to 0 cannot change while the PDO is valid (CiA 301 7.5.2.35).
  if (!profile.valid_pdo_cob_id_may_change && is_valid(parameter_index) && (present & cob_id::can_id_mask) != can_id) {
    return AbortCode::value_invalid;
  }
  return AbortCode::none;
}

AbortCode PdoConfiguration::check_mapping(Direction direction, std::uint16_t parameter_index, const Entry& entry,
                                          std::uint32_t value, std::size_t capacity) const {
  if (!profile.valid_pdo_may_be_remapped && is_valid(parameter_index)) return AbortCode::unsupported_access;
  const auto index = static_cast<std::uint16_t>(parameter_index + mapping_offset);
  if (entry.sub != 0) {
    // "Disable mapping by setting sub-index 00h to 00h" is required before an entry may change.
    if (value_of<std::uint8_t>(dictionary, index, 0, 0) != 0) return AbortCode::unsupported_access;
    if (value == 0) return AbortCode::none;  // an empty entry
    MappedObject object;
    return resolve(dictionary, profile, direction, value, 0, object);
  }
  if (value > capacity) return AbortCode::value_invalid;
  unsigned bits = 0;
  for (unsigned sub = 1; sub <= value; ++sub) {
    MappedObject object;
    const auto mapping_entry = value_of<std::uint32_t>(dictionary, index, static_cast<std::uint8_t>(sub), 0);
    const AbortCode abort = resolve(dictionary, profile, direction, mapping_entry, bits, object);
    if (abort != AbortCode::none) return abort;
    bits += mapping_entry & 0xFF;
  }
  return AbortCode::none;
}

}  // namespace servodrome::canopen
