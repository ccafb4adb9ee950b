// Checks and effects of writes to the objects 1000h..1FFFh (CiA 301 7.5.2).
#include "canopen/node.hpp"
#include "canopen/object_access.hpp"
#include "dictionary/store.hpp"

namespace servodrome::canopen {

using dictionary::AbortCode;
using dictionary::Entry;

namespace {

enum class Group : std::uint8_t { general, rpdo, tpdo };

constexpr Group group_of(std::uint16_t index) {
  const unsigned block = index & 0xFE00U;
  if (block == 0x1400 || block == 0x1600) return Group::rpdo;
  if (block == 0x1800 || block == 0x1A00) return Group::tpdo;
  return Group::general;
}
constexpr std::uint16_t number_of(std::uint16_t index) { return index & 0x1FF; }

// For a COB-ID whose bit 31 means "not valid" (1014h, 1028h): the CAN-ID may change only while it is not valid.
AbortCode check_cob_id(std::uint32_t present, std::uint32_t value) {
  if (!cob_id::is_base(value) || (value & cob_id::bit_30) != 0) return AbortCode::value_invalid;
  const bool id_changes = ((present ^ value) & cob_id::can_id_mask) != 0;
  if (id_changes && cob_id::is_restricted(value & cob_id::can_id_mask)) return AbortCode::value_invalid;
  if (id_changes && (present & cob_id::invalid) == 0 && (value & cob_id::invalid) == 0) {
    return AbortCode::value_invalid;
  }
  return AbortCode::none;
}

}  // namespace

AbortCode Node::check(const Entry& entry, std::span<const std::byte> bytes) {
  const std::uint32_t value = unsigned_of(bytes);
  const std::uint16_t number = number_of(entry.index);
  switch (group_of(entry.index)) {
    case Group::rpdo: return number < rpdos_.capacity() ? rpdos_.check(entry, value) : AbortCode::out_of_memory;
    case Group::tpdo: return number < tpdos_.capacity() ? tpdos_.check(entry, value) : AbortCode::out_of_memory;
    case Group::general: break;
  }
  if (entry.index == 0x1010 || entry.index == 0x1011) return check_signature(entry, value);
  return check_general(entry, value);
}

// Stores the parameters or restores the defaults already in this check, because written() cannot return an error.
AbortCode Node::check_signature(const Entry& entry, std::uint32_t value) {
  const bool storing = entry.index == 0x1010;
  if (value != (storing ? dictionary::save_signature : dictionary::load_signature))
    return AbortCode::cannot_transfer_or_store;
  const dictionary::Area areas = dictionary::area_of_storage_sub(entry.sub);
  return storing ? events_.store(areas) : events_.restore_defaults(areas);
}

AbortCode Node::check_general(const Entry& entry, std::uint32_t value) const {
  switch (entry.index) {
    case 0x1003: return value == 0 ? AbortCode::none : AbortCode::value_invalid;
    case 0x1005:
    case 0x1019: return sync_.check(entry, value);
    case 0x1012: {
      // Bit 31: consumes TIME; bit 30: produces TIME, which this stack does not support
      const auto present = static_cast<std::uint32_t>(dictionary_.number(entry));
      const std::uint32_t can_id = value & cob_id::can_id_mask;
      const bool id_changes = can_id != (present & cob_id::can_id_mask);
      if (!cob_id::is_base(value) || (value & cob_id::bit_30) != 0) return AbortCode::value_invalid;
      return id_changes && cob_id::is_restricted(can_id) ? AbortCode::value_invalid : AbortCode::none;
    }
    case 0x1014:
    case 0x1028: return check_cob_id(static_cast<std::uint32_t>(dictionary_.number(entry)), value);
    case 0x1016: return heartbeat_consumers_.check(entry, value);
    case 0x1029: return value > 2 ? AbortCode::value_invalid : AbortCode::none;
    default: return AbortCode::none;
  }
}

void Node::written(const Entry& entry) {
  const std::uint16_t number = number_of(entry.index);
  switch (group_of(entry.index)) {
    case Group::rpdo:
      if (number >= rpdos_.capacity()) return;
      rpdos_.configure(number);
      rebuild_dispatch();
      return;
    case Group::tpdo:
      if (number < tpdos_.capacity()) tpdos_.configure(number);
      return;
    case Group::general: break;
  }
  switch (entry.index) {
    case 0x1003: emergency_.clear_history(); break;
    case 0x1005:
      sync_.configure();
      rebuild_dispatch();
      break;
    case 0x1006:
    case 0x1007:
    case 0x1019: sync_.configure(); break;
    case 0x100C:
    case 0x100D:
    case 0x1017: error_control_.reconfigure(); break;
    case 0x1014:
    case 0x1015: emergency_.reconfigure(); break;
    case 0x1016: {
      const auto consumer = static_cast<std::uint8_t>(entry.sub - 1);
      if (consumer >= heartbeat_consumers_.capacity()) break;
      if (heartbeat_consumers_[consumer].lost) {
        emergency_.end(CommunicationError::heartbeat);
        events_.communication_restored(LossCause::heartbeat);
      }
      heartbeat_consumers_.configure(consumer);
      rebuild_dispatch();
      break;
    }
    case 0x1012:
    case 0x1028: rebuild_dispatch(); break;
    default: break;
  }
}

}  // namespace servodrome::canopen
