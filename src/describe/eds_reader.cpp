// Reads electronic data sheets and device configuration files of makers (CiA 306-1).
#include <algorithm>
#include <bit>
#include <charconv>
#include <fmt/format.h>
#include <map>

#include "describe/device_file.hpp"
#include "describe/eds_sections.hpp"
#include "describe/eds_values.hpp"

namespace servodrome::describe::eds_file {
namespace {

using dictionary::Access;
using dictionary::ObjectCode;
using dictionary::Pdo;
using dictionary::Type;

constexpr std::size_t most_notes = 1000;

class EdsReader {
 public:
  EdsReader(std::istream& in, const std::string& file) {
    device_.file = file;
    sections_ =
        read_sections(read_text(in, file), file, [this](unsigned line, const std::string& what) { note(line, what); });
  }

  DeviceFile read() {
    read_device();
    for (const auto& [name, section] : sections_) {
      if (const auto index = index_of(name)) read_object(*index, section);
    }
    for (const auto& [name, section] : sections_) read_lone_sub(name, section);
    check_lists();
    settle(device_);
    if (device_.entries.empty()) {
      throw DeviceFileError(device_.file, 0, "", "no object is described there", "give an EDS or DCF file");
    }
    read_identity();
    return std::move(device_);
  }

 private:
  [[noreturn]] void refuse(const Section& section, unsigned line, const char* key, const std::string& problem,
                           const std::string& remedy) const {
    throw DeviceFileError(device_.file, line, fmt::format("[{}] {}", section.name, key), problem, remedy);
  }
  void add(FileEntry&& entry) { adder_.add(std::move(entry)); }
  void note(unsigned line, const std::string& what) {
    if (device_.notes.size() == most_notes) {
      device_.notes.push_back(fmt::format("{}:{}: further messages like this are not shown", device_.file, line));
    }
    if (device_.notes.size() > most_notes) return;
    device_.notes.push_back(fmt::format("{}:{}: {}", device_.file, line, what));
  }

  const Section* section(const std::string& name) const {
    const auto found = sections_.find(name);
    return found == sections_.end() ? nullptr : &found->second;
  }

  std::string text_of(const Section* section, const std::string& key) const {
    const Value* value = section != nullptr ? section->find(key) : nullptr;
    return value != nullptr ? value->text : std::string();
  }

  std::optional<std::int64_t> number_of(const Section& section, const char* key) const {
    const Value* value = section.find(lower(key));
    if (value == nullptr) return std::nullopt;
    const auto number = parse_file_number(before_comment(value->text));
    if (!number) {
      refuse(section, value->line, key, fmt::format("\"{}\" is not a number", value->text),
             "write a decimal number, 0x and hexadecimal digits, or 0 and octal ones");
    }
    return number;
  }

  void read_device() {
    const Section* info = section("deviceinfo");
    if (info != nullptr) {
      device_.vendor_name = text_of(info, "vendorname");
      device_.product_name = text_of(info, "productname");
      device_.order_code = text_of(info, "ordercode");
      const auto id = [&](const char* key) -> std::optional<std::uint32_t> {
        const auto number = number_of(*info, key);
        return number ? std::optional(static_cast<std::uint32_t>(*number)) : std::nullopt;
      };
      device_.vendor_id = id("VendorNumber");
      device_.product_code = id("ProductNumber");
      device_.revision_number = id("RevisionNumber");
      for (const unsigned rate : {10U, 20U, 50U, 125U, 250U, 500U, 800U, 1000U}) {
        if (number_of(*info, fmt::format("BaudRate_{}", rate).c_str()).value_or(0) != 0) {
          device_.bit_rates_kbit.push_back(rate);
        }
      }
      device_.lss_supported = number_of(*info, "LSS_Supported").value_or(0) != 0;
    } else {
      note(1, "there is no [DeviceInfo]");
    }
    device_.is_configuration = section("devicecomissioning") != nullptr || section("devicecommissioning") != nullptr;
    if (const Section* dummies = section("dummyusage")) {
      for (unsigned type = 1; type <= device_.dummy_usage.size(); ++type) {
        const auto used = number_of(*dummies, fmt::format("Dummy{:04d}", type).c_str());
        device_.dummy_usage[type - 1] = used.value_or(0) != 0;
      }
    }
  }

  // The factory values of 1018h have priority over the identity in the header, except a value of 0.
  void read_identity() {
    const auto take = [this](std::optional<std::uint32_t>& number, std::uint8_t sub) {
      const FileEntry* entry = device_.find(0x1018, sub);
      if (entry == nullptr || !entry->default_value) return;
      const auto value = static_cast<std::uint32_t>(*entry->default_value);
      if (value != 0 || !number) number = value;
    };
    take(device_.vendor_id, 1);
    take(device_.product_code, 2);
    take(device_.revision_number, 3);
  }

  static std::optional<std::uint16_t> hex(std::string_view text) {
    std::uint16_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
    if (text.empty() || error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
    return value;
  }
  static std::optional<std::uint16_t> index_of(std::string_view name) {
    return name.size() == 4 ? hex(name) : std::nullopt;
  }

  bool has_own_type(const Section& section) const { return section.find("datatype") != nullptr; }

  void read_object(std::uint16_t index, const Section& section) {
    const std::string name = text_of(&section, "parametername");
    const auto object_type = number_of(section, "ObjectType").value_or(7);
    const auto compact = number_of(section, "CompactSubObj").value_or(0);
    FileEntry common;
    common.index = index;
    common.object_name = name;
    common.line = section.line;
    switch (object_type) {
      case 0x0:
      case 0x5:
      case 0x6: return;  // NULL, DEFTYPE, DEFSTRUCT: no values
      case 0x2: common.code = ObjectCode::domain; break;
      case 0x7: common.code = ObjectCode::var; break;
      case 0x8: common.code = ObjectCode::array; break;
      case 0x9: common.code = ObjectCode::record; break;
      default:
        refuse(section, section.values.at("objecttype").line, "ObjectType",
               fmt::format("there is no object code {}", object_type), "write 0x2, 0x7, 0x8 or 0x9");
    }
    if (compact != 0) return read_compact(common, section, compact);
    unsigned subs = 0;
    for (const auto& [sub, element] : sub_sections(section)) {
      ++subs;
      FileEntry entry = common;
      entry.sub = static_cast<std::uint8_t>(sub);
      entry.line = element->line;
      read_values(entry, *element, sub == 0);
      add(std::move(entry));
    }
    const auto promised = number_of(section, "SubNumber");
    if (subs > 0) {
      if (promised && *promised != subs) {
        note(section.line,
             fmt::format("[{}]: SubNumber is {}, but {} sub-indices are described", section.name, *promised, subs));
      }
      return;
    }
    if (common.code == ObjectCode::array || common.code == ObjectCode::record) {
      if (!has_own_type(section)) {
        note(section.line, fmt::format("[{}]: none of its sub-indices is described; ignored", section.name));
        return;
      }
    }
    read_values(common, section, false);
    add(std::move(common));
  }

  // The sections of an object's sub-indices; "6099sub1" and "6099Sub01" are the same.
  std::map<unsigned, const Section*> sub_sections(const Section& object) const {
    const std::string prefix = lower(object.name) + "sub";
    std::map<unsigned, const Section*> found;
    for (auto at = sections_.lower_bound(prefix); at != sections_.end() && at->first.starts_with(prefix); ++at) {
      const auto sub = hex(std::string_view(at->first).substr(prefix.size()));
      if (sub && *sub <= 0xFF) found.try_emplace(*sub, &at->second);
    }
    return found;
  }

  // Reads [6099sub1] if there is no [6099].
  void read_lone_sub(const std::string& name, const Section& section) {
    if (name.size() < 8 || name.compare(4, 3, "sub") != 0) return;
    const auto index = index_of(std::string_view(name).substr(0, 4));
    const auto sub = hex(std::string_view(name).substr(7));
    if (!index || !sub || *sub > 0xFF || sections_.contains(name.substr(0, 4))) return;
    note(section.line, fmt::format("[{}]: there is no section [{}]", section.name, section.name.substr(0, 4)));
    FileEntry entry;
    entry.index = *index;
    entry.sub = static_cast<std::uint8_t>(*sub);
    entry.code = ObjectCode::record;
    entry.line = section.line;
    read_values(entry, section, *sub == 0);
    add(std::move(entry));
  }

  // CiA 306-1 clause 4.6.4.2: one description for all sub-indices; names and values of some are in separate sections.
  void read_compact(const FileEntry& common, const Section& section, std::int64_t count) {
    if (count < 0 || count > 0xFE) {
      refuse(section, section.values.at("compactsubobj").line, "CompactSubObj",
             fmt::format("{} sub-indices are not possible", count), "write 1 to 254");
    }
    FileEntry highest = common;
    highest.type = Type::unsigned8;
    highest.access = Access::ro;
    highest.name = "NrOfObjects";
    highest.default_value = count;
    add(std::move(highest));
    FileEntry element = common;
    read_values(element, section, false);
    const std::string index = lower(section.name);
    const Section* names = this->section(index + "name");
    const Section* values = this->section(index + "value");
    for (unsigned sub = 1; sub <= static_cast<unsigned>(count); ++sub) {
      FileEntry entry = element;
      entry.sub = static_cast<std::uint8_t>(sub);
      const std::string own = text_of(names, fmt::format("{}", sub));
      entry.name = own.empty() ? fmt::format("{}{}", common.object_name, sub) : own;
      if (const Value* value = values != nullptr ? values->find(fmt::format("{}", sub)) : nullptr) {
        read_default(entry, *values, *value, fmt::format("{}", sub));
      }
      add(std::move(entry));
    }
    // Sub-indices with their own description have priority.
    const auto own_begin = device_.entries.end() - (count + 1);
    for (const auto& [sub, own] : sub_sections(section)) {
      if (sub > static_cast<unsigned>(count)) continue;
      FileEntry entry = common;
      entry.sub = static_cast<std::uint8_t>(sub);
      entry.line = own->line;
      read_values(entry, *own, sub == 0);
      *(own_begin + sub) = std::move(entry);
    }
  }

  void read_type(FileEntry& entry, const Section& section, bool is_count) {
    const auto number = number_of(section, "DataType");
    if (!number) {
      if (is_count) {
        entry.type = Type::unsigned8;
      } else if (entry.code == ObjectCode::domain) {
        entry.type = Type::domain;
      } else {
        refuse(section, section.line, "DataType", "the object has no data type",
               "add DataType=, 0x0005 for UNSIGNED8 and so on (CiA 301 table 44)");
      }
      return;
    }
    if (const auto type = type_of(*number)) {
      entry.type = *type;
    } else if (const auto bytes = bytes_of_other_type(*number)) {
      entry.type = Type::octet_string;
      entry.capacity = *bytes;
    } else {
      note(section.values.at("datatype").line,
           fmt::format("[{}]: data type {:04X}h is not known; kept as bytes", section.name, *number));
      entry.type = Type::octet_string;
    }
  }

  void read_access(FileEntry& entry, const Section& section) {
    const Value* access = section.find("accesstype");
    const std::string word = access != nullptr ? lower(before_comment(access->text)) : "rw";
    const bool mappable = number_of(section, "PDOMapping").value_or(0) != 0;
    Pdo pdo = Pdo::both;
    if (word == "ro" || word == "const") {
      entry.access = word == "ro" ? Access::ro : Access::constant;
      pdo = Pdo::tpdo;
    } else if (word == "wo") {
      entry.access = Access::wo;
      pdo = Pdo::rpdo;
    } else if (word == "rw" || word == "rwr" || word == "rww") {
      entry.access = Access::rw;
      pdo = word == "rwr" ? Pdo::tpdo : word == "rww" ? Pdo::rpdo : Pdo::both;
    } else {
      refuse(section, access->line, "AccessType", fmt::format("\"{}\" is not an access type", access->text),
             "write ro, wo, rw, rwr, rww or const");
    }
    entry.pdo = mappable ? pdo : Pdo::none;
  }

  std::optional<std::int64_t> limit(const FileEntry& entry, const Section& section, const char* key) {
    const Value* value = section.find(lower(key));
    if (value == nullptr || dictionary::size_of(entry.type) == 0 || entry.type == Type::real32) return std::nullopt;
    const std::string_view text = before_comment(value->text);
    if (text.empty() || lower(text).find("$nodeid") != std::string::npos) return std::nullopt;
    const auto number = parse_file_number(text);
    if (number) return of_type(entry.type, *number);
    note(value->line,
         fmt::format("[{}] {}: \"{}\" is not a number; the limit of the type is used", section.name, key, value->text));
    return std::nullopt;
  }

  void read_default(FileEntry& entry, const Section& section, const Value& value, const std::string& key) {
    if (dictionary::size_of(entry.type) == 0) {
      entry.content = value.text;
      if (entry.type == Type::octet_string) entry.content = octets(value.text);
      if (entry.type == Type::domain) entry.content.clear();
      return;
    }
    std::string text = lower(before_comment(value.text));
    text.erase(std::remove_if(text.begin(), text.end(), [](char c) { return c == ' ' || c == '\t'; }), text.end());
    constexpr std::string_view node_id = "$nodeid";
    if (const std::size_t at = text.find(node_id); at != std::string::npos) {
      entry.default_adds_node_id = true;
      text.erase(at, node_id.size());
      if (text.starts_with('+')) text.erase(0, 1);
      if (text.ends_with('+')) text.pop_back();
      if (text.empty()) text = "0";
    }
    if (entry.type == Type::real32 && !text.starts_with("0x")) {
      float number = 0;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
      if (error == std::errc{} && end == text.data() + text.size()) {
        entry.default_value = std::bit_cast<std::uint32_t>(number);
        return;
      }
    }
    const auto number = parse_file_number(text);
    if (!number) {
      note(value.line,
           fmt::format("[{}] {}: \"{}\" is not a value of its type; 0 is used", section.name, key, value.text));
      return;
    }
    entry.default_value = of_type(entry.type, *number);
  }

  void read_values(FileEntry& entry, const Section& section, bool is_count) {
    entry.name = text_of(&section, "parametername");
    if (entry.object_name.empty()) entry.object_name = entry.name;
    read_type(entry, section, is_count);
    read_access(entry, section);
    entry.minimum = limit(entry, section, "LowLimit");
    entry.maximum = limit(entry, section, "HighLimit");
    if (const Value* value = section.find("defaultvalue")) read_default(entry, section, *value, "DefaultValue");
    if (const Value* value = section.find("parametervalue")) read_default(entry, section, *value, "ParameterValue");
  }

  // Reports objects that are listed but have no section.
  void check_lists() {
    for (const char* name : {"mandatoryobjects", "optionalobjects", "manufacturerobjects"}) {
      const Section* list = section(name);
      if (list == nullptr) continue;
      for (const auto& [key, value] : list->values) {
        if (key == "supportedobjects") continue;
        const auto index = parse_file_number(before_comment(value.text));
        if (index && sections_.contains(fmt::format("{:04x}", *index))) continue;
        note(value.line, fmt::format("[{}]: {} is listed, but not described", list->name, value.text));
      }
    }
  }

  DeviceFile device_;
  EntryAdder adder_{device_};
  Sections sections_;
};

}  // namespace
}  // namespace servodrome::describe::eds_file

namespace servodrome::describe {

DeviceFile read_eds(std::istream& in, const std::string& file) { return eds_file::EdsReader(in, file).read(); }

}  // namespace servodrome::describe
