// Finds the objects that a drive has.
#include <algorithm>
#include <fmt/format.h>

#include "canopen/301/communication_section.hpp"
#include "dictionary/dictionary.hpp"
#include "drive/cia402_section.hpp"
#include "tools/clone/clone.hpp"

namespace servodrome::master {

using describe::DeviceFile;
using describe::FileEntry;
using dictionary::Access;
using dictionary::Entry;
using dictionary::ObjectCode;
using dictionary::Type;

namespace {

FileEntry whole_entry_of(const Entry& entry, const std::string& object_name) {
  FileEntry made = describe::file_entry_of(entry, object_name);
  made.capacity = entry.capacity;
  made.unit = entry.unit;
  made.saved = entry.saved;
  if (entry.has_range) {
    made.minimum = entry.minimum;
    made.maximum = entry.maximum;
  }
  if (entry.text != nullptr) made.content = entry.text;
  return made;
}

// Types of ETG.1020 table 98 that this dictionary does not support become blocks of bytes.
void set_type(FileEntry& entry, std::uint16_t type, std::uint16_t bits) {
  constexpr std::uint16_t bit1 = 0x30;
  constexpr std::uint16_t bit8 = 0x37;
  constexpr auto known =
      std::to_array({Type::boolean, Type::integer8, Type::integer16, Type::integer32, Type::unsigned8, Type::unsigned16,
                     Type::unsigned32, Type::real32, Type::visible_string, Type::octet_string, Type::domain,
                     Type::integer64, Type::unsigned64});
  entry.capacity = (bits + 7U) / 8U;
  const auto found = std::find(known.begin(), known.end(), static_cast<Type>(type));
  if (type <= 0xFF && found != known.end()) {
    entry.type = *found;
  } else if (type == 0x1E || (type > bit1 && type <= bit8)) {
    entry.type = Type::unsigned8;
  } else if (type == 0x1F) {
    entry.type = Type::unsigned16;
  } else if (type == 0x20) {
    entry.type = Type::unsigned32;
  } else {
    entry.type = type == bit1 ? Type::boolean : Type::octet_string;
  }
  if (dictionary::size_of(entry.type) != 0) entry.capacity = 0;
}

std::optional<std::int64_t> limit_of(const std::vector<std::uint8_t>& bytes, Type type) {
  if (bytes.empty() || dictionary::size_of(type) == 0 || type == Type::real32) return std::nullopt;
  return dictionary::decode_number(type, std::as_bytes(std::span(bytes)));
}

FileEntry file_entry_of(const EntryDescription& described, const ObjectDescription& object, bool has_parts) {
  FileEntry made;
  made.index = described.address.index;
  made.sub = described.address.sub;
  made.code = object.code == 8 ? ObjectCode::array : object.code == 9 ? ObjectCode::record : ObjectCode::var;
  set_type(made, described.type, described.bits);
  const bool reads = (described.access & entry_access::read) != 0;
  const bool writes = (described.access & entry_access::write) != 0;
  made.access = !writes ? Access::ro : reads ? Access::rw : Access::wo;
  const unsigned pdo = ((described.access & entry_access::rx_pdo) != 0 ? 1U : 0U) |
                       ((described.access & entry_access::tx_pdo) != 0 ? 2U : 0U);
  made.pdo = static_cast<dictionary::Pdo>(pdo);
  made.object_name = object.name;
  made.name = has_parts ? described.name : object.name;
  made.saved = (described.access & entry_access::stored) != 0;
  made.minimum = limit_of(described.minimum, made.type);
  made.maximum = limit_of(described.maximum, made.type);
  // A range equal to that of the type is no limit.
  if (made.minimum == dictionary::minimum_of(made.type) && made.maximum == dictionary::maximum_of(made.type)) {
    made.minimum.reset();
    made.maximum.reset();
  }
  return made;
}

// ---- Objects that answer ----

struct Area {
  std::uint16_t first;
  std::uint16_t last;
};
constexpr Area areas[] = {{0x1000, 0x1029}, {0x1200, 0x1203}, {0x1400, 0x141F}, {0x1600, 0x161F}, {0x1800, 0x181F},
                          {0x1A00, 0x1A1F}, {0x1F80, 0x1F80}, {0x2000, 0x5FFF}, {0x6000, 0x67FF}};

using Communication = canopen::CommunicationObjects<32, 32, 64>;

// The entry of the standards for an object; nullptr: none.
const Entry* standard_entry(std::uint16_t index, std::uint8_t sub) {
  const auto find = [&](std::span<const Entry> section) -> const Entry* {
    const auto found = std::find_if(section.begin(), section.end(),
                                    [&](const Entry& entry) { return entry.index == index && entry.sub == sub; });
    return found != section.end() ? &*found : nullptr;
  };
  for (const std::span<const Entry> section :
       {std::span<const Entry>(canopen::general_section<Communication>),
        std::span<const Entry>(canopen::sdo_server_section<Communication>),
        std::span<const Entry>(canopen::rpdo_section<Communication>),
        std::span<const Entry>(canopen::tpdo_section<Communication>), std::span<const Entry>(drive::cia402_section)}) {
    if (const Entry* entry = find(section)) return entry;
  }
  return nullptr;
}

bool is_printable(std::span<const std::byte> bytes) {
  return std::all_of(bytes.begin(), bytes.end(), [](std::byte byte) {
    const auto code = std::to_integer<unsigned>(byte);
    return code == 0 || (code >= 0x20 && code < 0x7F);
  });
}

FileEntry entry_that_answered(ObjectAddress address, ObjectCode code, std::span<const std::byte> value) {
  const Entry* standard = standard_entry(address.index, address.sub);
  const bool fits = standard != nullptr && dictionary::size_of(standard->type) == value.size();
  if (fits && standard->fixed_size()) {
    FileEntry made = whole_entry_of(*standard, standard->name);
    made.code = code;
    made.minimum.reset();
    made.maximum.reset();
    return made;
  }
  FileEntry made;
  made.index = address.index;
  made.sub = address.sub;
  made.code = code;
  made.name = made.object_name =
      standard != nullptr ? standard->name : fmt::format("Object {:04X}:{:02X}", address.index, address.sub);
  switch (value.size()) {
    case 1: made.type = Type::unsigned8; break;
    case 2: made.type = Type::unsigned16; break;
    case 4: made.type = Type::unsigned32; break;
    case 8: made.type = Type::unsigned64; break;
    default: made.type = is_printable(value) ? Type::visible_string : Type::octet_string;
  }
  if (dictionary::size_of(made.type) == 0) made.capacity = static_cast<std::uint32_t>(value.size());
  const bool is_text = address.index >= 0x1008 && address.index <= 0x100A;
  if (is_text) made.type = Type::visible_string;
  if (standard != nullptr) made.access = standard->access;
  if (is_text || (code != ObjectCode::var && address.sub == 0 && standard == nullptr)) made.access = Access::ro;
  return made;
}

// Returns nullopt if the drive refuses the read, usually because the object does not exist. Throws if it does not
// answer.
std::optional<std::vector<std::byte>> try_upload(ObjectClient& objects, ObjectAddress address) {
  try {
    return objects.upload(address);
  } catch (const ObjectError& error) {
    if (!error.answered()) throw;
    return std::nullopt;
  }
}

void find_object(ObjectClient& objects, std::uint16_t index, DeviceFile& device) {
  const auto first = try_upload(objects, {index, 0});
  if (!first) return;
  std::vector<FileEntry> parts;
  const Entry* standard = standard_entry(index, 0);
  const bool may_have_parts = standard == nullptr || standard->code != ObjectCode::var;
  const unsigned highest = first->size() == 1 && may_have_parts ? std::to_integer<unsigned>((*first)[0]) : 0;
  const ObjectCode code = standard != nullptr ? standard->code : ObjectCode::record;
  const bool counts_what_is_valid = standard != nullptr && standard->type == Type::unsigned8 && standard->writable();
  const unsigned last = counts_what_is_valid ? 64 : std::min(highest, 0xFEU);
  for (unsigned sub = 1; sub <= last; ++sub) {
    const ObjectAddress address{index, static_cast<std::uint8_t>(sub)};
    const auto value = try_upload(objects, address);
    if (value) {
      parts.push_back(entry_that_answered(address, code, *value));
    } else if (sub == 1 || counts_what_is_valid) {
      break;  // an object without sub-indices, or the end of a mapping
    }
  }
  device.entries.push_back(entry_that_answered({index, 0}, parts.empty() ? ObjectCode::var : code, *first));
  for (FileEntry& part : parts) {
    part.object_name = device.entries.back().object_name;
    device.entries.push_back(std::move(part));
  }
}

}  // namespace

DeviceFile objects_of_table(std::span<const Entry> table) {
  DeviceFile device;
  std::string object_name;
  for (const Entry& entry : table) {
    if (entry.sub == 0) object_name = entry.name;
    if (entry.index >= 1 && entry.index <= device.dummy_usage.size()) device.dummy_usage[entry.index - 1U] = true;
    if (entry.index >= 0x1000 && !entry.local) device.entries.push_back(whole_entry_of(entry, object_name));
  }
  return device;
}

DeviceFile objects_of_slave(CoeClient& coe, const CloneProgress& progress) {
  constexpr std::uint8_t array = 8;
  constexpr std::uint8_t record = 9;
  DeviceFile device;
  const std::vector<std::uint16_t> indices = coe.list(ObjectList::all);
  for (std::size_t i = 0; i < indices.size(); ++i) {
    progress("reading the description of object", i, indices.size());
    if (indices[i] < 0x1000) continue;
    const ObjectDescription object = coe.describe(indices[i]);
    const bool has_parts = object.code == array || object.code == record;
    for (unsigned sub = 0; sub <= (has_parts ? object.highest_sub : 0U); ++sub) {
      try {
        const EntryDescription entry = coe.describe(ObjectAddress{indices[i], static_cast<std::uint8_t>(sub)});
        if (entry.bits != 0 || entry.type == static_cast<std::uint16_t>(Type::domain)) {
          device.entries.push_back(file_entry_of(entry, object, has_parts));
        }
      } catch (const CoeError& error) {
        if (!error.answered()) throw;  // otherwise a gap between sub-indices
      }
    }
  }
  return device;
}

DeviceFile objects_that_answer(ObjectClient& objects, const CloneProgress& progress) {
  DeviceFile device;
  std::size_t of = 0;
  for (const Area& area : areas) of += area.last - area.first + 1U;
  std::size_t done = 0;
  for (const Area& area : areas) {
    for (unsigned index = area.first; index <= area.last; ++index) {
      progress("searching for object", done++, of);
      find_object(objects, static_cast<std::uint16_t>(index), device);
    }
  }
  return device;
}

}  // namespace servodrome::master
