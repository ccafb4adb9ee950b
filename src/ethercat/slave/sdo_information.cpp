#include "ethercat/slave/sdo_information.hpp"

#include <string_view>

#include "ethercat/slave/entry_description.hpp"

namespace servodrome::ethercat {

using dictionary::AbortCode;
using dictionary::Entry;

namespace {

// ETG.1000.6 table 42.
constexpr unsigned list_request = 1;
constexpr unsigned list_response = 2;
constexpr unsigned object_request = 3;
constexpr unsigned object_response = 4;
constexpr unsigned entry_request = 5;
constexpr unsigned entry_response = 6;
constexpr unsigned error_response = 7;
constexpr unsigned incomplete = 0x80;

constexpr std::size_t information_header_size = 4;
constexpr std::size_t least_entry_response = coe_header_size + information_header_size + 10;
constexpr unsigned lists = 5;  // 1: all, 2: RxPDO, 3: TxPDO, 4: backup objects, 5: start-up parameters

// Value info of an entry description (ETG.1000.6 table 48).
constexpr unsigned with_unit = 0x08;
constexpr unsigned with_default = 0x10;
constexpr unsigned with_minimum = 0x20;
constexpr unsigned with_maximum = 0x40;

// Objects that are records of a predefined type (ETG.1000.6 table 64, ETG.1020).
constexpr unsigned record_type(std::uint16_t index) {
  if (index == 0x1018) return 0x0023;                      // IDENTITY
  if ((index >= 0x1600 && index < 0x1C00)) return 0x0021;  // PDO_MAPPING
  if (index >= 0x1C30 && index < 0x1C50) return 0x0029;    // SYNC_PAR
  return 0;
}

}  // namespace

void SdoInformation::begin(Message& reply, unsigned opcode, unsigned fragments_left) const {
  begin_coe(reply, CoeService::sdo_information);
  reply.u8(opcode | (fragments_left != 0 ? incomplete : 0U));
  reply.u8(0);
  reply.u16(fragments_left);
}

void SdoInformation::error(AbortCode code, Message& reply) const {
  begin(reply, error_response, 0);
  reply.u32(static_cast<std::uint32_t>(code));
}

void SdoInformation::receive(std::span<const std::uint8_t> request, Message& reply) {
  reset();
  const std::span<const std::uint8_t> data = request.subspan(information_header_size);
  const unsigned opcode = request[0] & 0x7FU;
  const std::size_t least = opcode == entry_request ? 4 : 2;
  if (data.size() < least) return error(AbortCode::length_too_low, reply);
  switch (opcode) {
    case list_request: list(data, reply); break;
    case object_request: describe_object(data, reply); break;
    case entry_request: describe_entry(data, reply); break;
    default: error(AbortCode::command_specifier_unknown, reply);
  }
}

std::size_t SdoInformation::object_end(std::size_t object) const {
  const std::span<const Entry> table = dictionary_.table();
  std::size_t end = object;
  while (end < table.size() && table[end].index == table[object].index) ++end;
  return end;
}

bool SdoInformation::belongs(std::size_t object, unsigned list) const {
  if (list == 1) return true;
  const std::span<const Entry> table = dictionary_.table();
  for (std::size_t i = object, end = object_end(object); i < end; ++i) {
    const Entry& entry = table[i];
    const auto pdo = static_cast<unsigned>(entry.pdo);
    switch (list) {
      case 2:
        if ((pdo & 1) != 0) return true;
        break;
      case 3:
        if ((pdo & 2) != 0) return true;
        break;
      case 4:
        if (entry.saved) return true;
        break;
      default:
        if (is_start_up_parameter(profile_, entry)) return true;
    }
  }
  return false;
}

unsigned SdoInformation::count(unsigned list) const {
  unsigned objects = 0;
  for (std::size_t i = 0; i < dictionary_.table().size(); i = object_end(i)) {
    if (belongs(i, list)) ++objects;
  }
  return objects;
}

void SdoInformation::list(std::span<const std::uint8_t> data, Message& reply) {
  const unsigned list = load_u16(data.data());
  if (list > lists) return error(AbortCode::value_invalid, reply);
  if (list == 0) {  // the lengths of the lists
    begin(reply, list_response, 0);
    reply.u16(0);
    for (unsigned i = 1; i <= lists; ++i) reply.u16(count(i));
    return;
  }
  const std::size_t room = reply.room.size() - coe_header_size - information_header_size;
  const std::size_t per_fragment = room / 2;
  const std::size_t words = 1 + count(list);
  list_ = list;
  position_ = 0;
  fragments_left_ = static_cast<unsigned>((words + per_fragment - 1) / per_fragment - 1);
  begin(reply, list_response, fragments_left_);
  reply.u16(list);
  put_indices(reply);
}

void SdoInformation::next(Message& reply) {
  --fragments_left_;
  begin(reply, list_response, fragments_left_);
  put_indices(reply);
}

void SdoInformation::put_indices(Message& reply) {
  const std::span<const Entry> table = dictionary_.table();
  for (; position_ < table.size() && reply.left() >= 2; position_ = object_end(position_)) {
    if (belongs(position_, list_)) reply.u16(table[position_].index);
  }
}

void SdoInformation::describe_object(std::span<const std::uint8_t> data, Message& reply) const {
  AbortCode code{};
  const Entry* entry = dictionary_.find(load_u16(data.data()), 0, code);
  if (entry == nullptr) return error(AbortCode::object_does_not_exist, reply);
  const std::span<const Entry> table = dictionary_.table();
  const std::size_t end = object_end(static_cast<std::size_t>(entry - table.data()));
  begin(reply, object_response, 0);
  reply.u16(entry->index);
  unsigned type = static_cast<unsigned>(entry->type);
  if (entry->code == dictionary::ObjectCode::array) type = static_cast<unsigned>(table[end - 1].type);
  if (entry->code == dictionary::ObjectCode::record) type = record_type(entry->index);
  reply.u16(type);
  reply.u8(table[end - 1].sub);
  reply.u8(static_cast<unsigned>(entry->code));
  const std::string_view name = entry->name;
  reply.bytes(std::span(name.data(), std::min(name.size(), reply.left())));
}

// Returns true if the object has a higher sub-index than this one.
bool SdoInformation::is_gap(std::uint16_t index, std::uint8_t sub) const {
  AbortCode code{};
  const Entry* first = dictionary_.find(index, 0, code);
  if (first == nullptr) return false;
  const std::span<const Entry> table = dictionary_.table();
  return sub < table[object_end(static_cast<std::size_t>(first - table.data())) - 1].sub;
}

// The usual description of an unused place in a record: no type, no bits, no access, no name. A master that requests
// all sub-indices then continues without an error.
void SdoInformation::describe_gap(std::span<const std::uint8_t> data, Message& reply) const {
  begin(reply, entry_response, 0);
  reply.u16(load_u16(data.data()));
  reply.u8(data[2]);
  reply.u8(0);
  for (int word = 0; word < 3; ++word) reply.u16(0);
}

void SdoInformation::describe_entry(std::span<const std::uint8_t> data, Message& reply) const {
  AbortCode code{};
  const Entry* entry = dictionary_.find(load_u16(data.data()), data[2], code);
  if (entry == nullptr && is_gap(load_u16(data.data()), data[2])) return describe_gap(data, reply);
  if (entry == nullptr) return error(code, reply);
  const std::uint32_t unit = unit_code(entry->unit);
  unsigned info = 0;
  if (unit != 0) info |= data[3] & with_unit;
  if (entry->fixed_size()) info |= data[3] & with_default;
  // The table has no limits for REAL32, and none above 2^63 - 1 for UNSIGNED64.
  const bool limited = entry->type != dictionary::Type::real32 && entry->type != dictionary::Type::unsigned64;
  if (entry->fixed_size() && limited) info |= data[3] & (with_minimum | with_maximum);
  // Values that do not fit into a small mailbox are omitted, beginning with the last.
  const auto size_of_info = [&] {
    const unsigned values = (info >> 4 & 1U) + (info >> 5 & 1U) + (info >> 6 & 1U);
    return least_entry_response + ((info & with_unit) != 0 ? 4U : 0U) + values * dictionary::size_of(entry->type);
  };
  for (unsigned flag = with_maximum; size_of_info() > reply.room.size(); flag >>= 1) info &= ~flag;
  begin(reply, entry_response, 0);
  reply.u16(entry->index);
  reply.u8(entry->sub);
  reply.u8(info);
  reply.u16(static_cast<unsigned>(entry->type));
  reply.u16(bit_length(*entry));
  reply.u16(object_access(profile_, *entry));
  if ((info & with_unit) != 0) reply.u32(unit);
  const auto value = [&](std::int64_t number) {
    const auto bytes = dictionary::encode_number(number);
    reply.bytes(std::span(bytes).first(dictionary::size_of(entry->type)));
  };
  if ((info & with_default) != 0) value(entry->default_value);
  if ((info & with_minimum) != 0) value(entry->minimum);
  if ((info & with_maximum) != 0) value(entry->maximum);
  // The table gives sub-index 0 the name of the object; on the bus it has its own name.
  const bool counts = entry->sub == 0 && entry->code != dictionary::ObjectCode::var;
  const std::string_view name = counts ? "SubIndex 000" : entry->name;
  reply.bytes(std::span(name.data(), std::min(name.size(), reply.left())));
}

}  // namespace servodrome::ethercat
