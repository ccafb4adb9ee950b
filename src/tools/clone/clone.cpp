#include "tools/clone/clone.hpp"

#include <algorithm>
#include <bit>
#include <deque>
#include <fmt/format.h>

#include "describe/description.hpp"
#include "dictionary/dictionary.hpp"
#include "drive/cia402_section.hpp"

namespace servodrome::master {

using describe::FileEntry;
using dictionary::Access;
using dictionary::Entry;
using dictionary::Type;

namespace {

bool is_writable(const FileEntry& entry) { return entry.access == Access::rw || entry.access == Access::wo; }

// False for objects that show the drive's state or command it, rather than configure it.
bool is_parameter(const FileEntry& entry) {
  if (entry.access == Access::wo || entry.type == Type::domain) return false;
  switch (entry.index) {
    case 0x1001:
    case 0x1002:
    case 0x1003: return false;
    case 0x1010:
    case 0x1011: return entry.sub == 0;
    case 0x1C32:
    case 0x1C33: return is_writable(entry) || entry.sub == 0;
    default: break;
  }
  const bool is_measured = !is_writable(entry) && (static_cast<unsigned>(entry.pdo) & 2U) != 0 && entry.index != 0x6502;
  if (is_measured) return false;
  const auto& section = drive::cia402_section;
  const auto standard = std::find_if(section.begin(), section.end(), [&entry](const Entry& one) {
    return one.index == entry.index && one.sub == entry.sub;
  });
  const bool is_count = entry.sub == 0 && entry.code != dictionary::ObjectCode::var;
  return standard == section.end() || standard->saved || !standard->writable() || is_count;
}

// COB-IDs that depend on the node-ID (CiA 301 table 40).
bool is_cob_id(const FileEntry& entry) {
  const std::uint16_t block = entry.index & 0xFE00;
  return entry.index == 0x1014 || (entry.index == 0x1200 && entry.sub > 0) ||
         ((block == 0x1400 || block == 0x1800) && entry.sub == 1);
}

void take_value(FileEntry& entry, std::span<const std::byte> bytes, std::uint8_t node_id) {
  const std::size_t size = dictionary::size_of(entry.type);
  if (size == 0) {
    entry.content.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (entry.type == Type::visible_string) entry.content.erase(entry.content.find_last_not_of('\0') + 1);
    return;
  }
  std::array<std::byte, 8> number{};
  std::copy_n(bytes.begin(), std::min(bytes.size(), size), number.begin());
  entry.default_value = dictionary::decode_number(entry.type, std::span(number).first(size));
  entry.default_adds_node_id = false;
  if (node_id != 0 && is_cob_id(entry) && (*entry.default_value & 0x7F) == node_id &&
      (*entry.default_value & 0x780) != 0) {
    *entry.default_value -= node_id;
    entry.default_adds_node_id = true;
  }
}

// Object table for the document writers; refers to the strings of the clone and to its own.
class CloneTable {
 public:
  explicit CloneTable(const describe::DeviceFile& device) {
    for (const FileEntry& from : device.entries) add(from);
  }
  std::span<const Entry> entries() const { return entries_; }

 private:
  void add(const FileEntry& from) {
    Entry entry = describe::entry_of(from);
    entry.saved = from.saved.value_or(false);
    entry.capacity = from.capacity;
    entry.default_value = from.default_value.value_or(0);
    entry.default_adds_node_id = from.default_adds_node_id;
    entry.has_range = from.minimum || from.maximum;
    entry.minimum = from.minimum.value_or(dictionary::minimum_of(from.type));
    entry.maximum = from.maximum.value_or(dictionary::maximum_of(from.type));
    if (dictionary::size_of(from.type) == 0) {
      texts_.push_back(from.type == Type::octet_string ? hexadecimal(from.content) : from.content);
      entry.text = texts_.back().c_str();
      // A writable string may use the whole capacity; a constant one has a fixed length.
      if (!is_writable(from)) entry.capacity = static_cast<std::uint32_t>(from.content.size());
    }
    entries_.push_back(entry);
  }

  static std::string hexadecimal(const std::string& bytes) {
    std::string text;
    for (const char byte : bytes)
      text += fmt::format("{}{:02X}", text.empty() ? "" : " ", static_cast<unsigned char>(byte));
    return text;
  }

  std::deque<std::string> texts_;
  std::vector<Entry> entries_;
};

describe::Description description_of(const Clone& clone, const CloneTable& table) {
  describe::Description description = describe::description_of(clone.device);
  description.table = table.entries();
  description.file.description = "Configuration of one device, read from it";
  description.file.created_by = "servodrome clone";
  description.file.modified_by = "servodrome clone";
  return description;
}

}  // namespace

Clone read_clone(ObjectClient& objects, describe::DeviceFile device, std::uint8_t node_id,
                 const CloneProgress& progress) {
  Clone clone{.device = std::move(device), .unread = {}};
  describe::settle(clone.device);
  std::vector<FileEntry>& entries = clone.device.entries;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    FileEntry& entry = entries[i];
    entry.default_value.reset();
    if (dictionary::size_of(entry.type) == 0) entry.content.clear();
    if (!is_parameter(entry)) continue;
    progress("reading value", i, entries.size());
    try {
      take_value(entry, objects.upload({entry.index, entry.sub}), node_id);
      ++clone.values;
    } catch (const ObjectError& error) {
      if (!error.answered()) throw;
      clone.unread.push_back({{entry.index, entry.sub}, error.happened()});
    }
  }
  const FileEntry* called = clone.device.find(0x1008, 0);
  if (clone.device.product_name.empty() && called != nullptr) clone.device.product_name = called->content;
  return clone;
}

std::string configuration_file(const Clone& clone, const std::string& name, std::uint8_t node_id) {
  const CloneTable table(clone.device);
  describe::Description description = description_of(clone, table);
  description.file.name = name;
  return describe::eds(description) + fmt::format("\r\n[DeviceComissioning]\r\nNodeID={}\r\n", node_id);
}

std::string slave_information(const Clone& clone, const SiiContent& sii) {
  const CloneTable table(clone.device);
  describe::Description description = description_of(clone, table);
  ethercat::Profile profile;
  profile.complete_access = sii.complete_access();
  profile.file_access = sii.has(mailbox_protocol::foe);
  const auto mailbox = [](const MailboxArea& area) {
    constexpr std::uint16_t least = 34;
    return ethercat::AreaRule{area.start, std::min(least, area.length), area.length};
  };
  profile.mailbox_out = mailbox(sii.mailbox.out);
  profile.mailbox_in = mailbox(sii.mailbox.in);
  for (const SiiSyncManager& channel : sii.sync_managers) {
    if (channel.type == 3) profile.outputs_start = channel.start;
    if (channel.type == 4) profile.inputs_start = channel.start;
  }
  profile.fit_process_data();
  std::vector<ethercat::DcMode> modes;
  for (const SiiDcMode& mode : sii.dc_modes) {
    modes.push_back({.name = mode.name.c_str(),
                     .description = mode.name.c_str(),
                     .sync0_cycle_ns = mode.sync0_cycle_ns,
                     .sync0_shift_ns = static_cast<std::uint32_t>(mode.sync0_shift_ns),
                     .sync1_shift_ns = static_cast<std::uint32_t>(mode.sync1_shift_ns),
                     .sync1_factor = mode.sync1_factor,
                     .assign_activate = mode.assign_activate,
                     .sync0_factor = mode.sync0_factor});
  }
  const ethercat::SiiDescription its{.vendor_id = sii.identity.vendor_id,
                                     .product_code = sii.identity.product_code,
                                     .revision_number = sii.identity.revision_number,
                                     .group = sii.group.c_str(),
                                     .order = sii.order.c_str(),
                                     .name = sii.name.c_str(),
                                     .dc_modes = modes};
  description.ethercat = {&profile, its, 16384};
  return describe::esi(description);
}

}  // namespace servodrome::master
