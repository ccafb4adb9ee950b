#include "describe/esi_dictionary.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <iterator>
#include <set>

#include "describe/words.hpp"
#include "ethercat/slave/entry_description.hpp"

namespace servodrome::describe::etg2000 {

using dictionary::Access;
using dictionary::Entry;
using dictionary::ObjectCode;
using dictionary::Pdo;
using dictionary::Type;

std::string hex(std::uint32_t value, int digits) { return fmt::format("#x{:0{}X}", value, digits); }
std::string index_text(std::uint16_t index) { return hex(index, 4); }
std::string decimal(std::int64_t value) { return fmt::format("{}", value); }
std::string flag(bool value) { return value ? "1" : "0"; }

std::string hex_bytes(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format("{:02X}", byte);
  return text;
}

std::string data_of(const Entry& entry, std::int64_t value) {
  std::array<std::uint8_t, 8> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(value >> 8 * i);
  return hex_bytes(std::span(bytes).first(dictionary::size_of(entry.type)));
}

void put_name(Xml& xml, std::string_view name) { xml.leaf("Name", name, {{"LcId", std::string(english_lcid)}}); }

std::string type_name(const Entry& entry) {
  switch (entry.type) {
    case Type::boolean: return "BOOL";
    case Type::integer8: return "SINT";
    case Type::integer16: return "INT";
    case Type::integer32: return "DINT";
    case Type::integer64: return "LINT";
    case Type::unsigned8: return "USINT";
    case Type::unsigned16: return "UINT";
    case Type::unsigned32: return "UDINT";
    case Type::unsigned64: return "ULINT";
    case Type::real32: return "REAL";
    case Type::visible_string: return fmt::format("STRING({})", ethercat::size_in_object(entry));
    case Type::octet_string:
    case Type::domain:
      return fmt::format("ARRAY [0..{}] OF BYTE", std::max<std::uint32_t>(ethercat::size_in_object(entry), 1) - 1);
  }
  return "";
}

namespace {

// ---- Data types ----

// An object of the dictionary with all its sub-indices.
struct Object {
  std::span<const Entry> entries;

  const Entry& first() const { return entries.front(); }
  bool single() const { return first().code == ObjectCode::var || first().code == ObjectCode::domain; }
  std::string type() const { return single() ? type_name(first()) : fmt::format("DT{:04X}", first().index); }
  std::string array_type() const { return type() + "ARR"; }

  // Equal elements without gaps from 1 upwards need only one description.
  bool is_array() const {
    if (first().code != ObjectCode::array || entries.size() < 2) return false;
    const Entry& model = entries[1];
    for (std::size_t i = 1; i < entries.size(); ++i) {
      const Entry& one = entries[i];
      if (one.sub != i || type_name(one) != type_name(model) || one.access != model.access || one.pdo != model.pdo ||
          one.saved != model.saved || one.type == Type::boolean) {
        return false;
      }
    }
    return true;
  }
  std::uint32_t bits() const {
    if (single()) return ethercat::bit_length(first());
    ethercat::ObjectLayout layout;
    for (const Entry& entry : entries) layout.place(entry, ethercat::size_in_object(entry));
    return layout.bit;
  }
};

template <typename Visit>
void for_each_object(std::span<const Entry> table, Visit visit) {
  for (std::size_t i = 0; i < table.size();) {
    const std::size_t count = entries_of_object(table, i);
    if (table[i].index >= 0x1000) visit(Object{table.subspan(i, count)});
    i += count;
  }
}

// Names of an object's entries for its data type and its values, without duplicates.
std::vector<std::string> sub_item_names(const Object& object) {
  std::vector<std::string> names;
  for (const Entry& entry : object.entries) {
    std::string name = entry.sub == 0 ? "SubIndex 000" : entry.name;
    const bool taken = std::find(names.begin(), names.end(), name) != names.end();
    if (object.is_array() && entry.sub != 0)
      name = fmt::format("SubIndex {:03}", entry.sub);
    else if (taken || name.empty())
      name = fmt::format("{} (SubIndex {:03})", name, entry.sub);
    names.push_back(name);
  }
  return names;
}

// CoE requires 1000h, 1018h and 1C00h (ETG.1000.6 clause 5.6.7.4), the profile controlword and statusword (ETG.6010).
bool is_mandatory(std::uint16_t index) {
  constexpr std::uint16_t mandatory[] = {0x1000, 0x1018, 0x1C00, 0x6040, 0x6041};
  return std::find(std::begin(mandatory), std::end(mandatory), index) != std::end(mandatory);
}

void put_flags(Xml& xml, const ethercat::Profile& profile, const Entry& entry) {
  xml.node("Flags", [&] {
    const std::string_view access = entry.access == Access::constant ? "ro" : word(entry.access);
    if (entry.writable() && ethercat::written_only_in_pre_operational(entry)) {
      xml.leaf("Access", access, {{"WriteRestrictions", "PreOP"}});
    } else {
      xml.leaf("Access", access);
    }
    xml.leaf("Category", is_mandatory(entry.index) ? "m" : "o");
    switch (entry.pdo) {
      case Pdo::none: break;
      case Pdo::rpdo: xml.leaf("PdoMapping", "R"); break;
      case Pdo::tpdo: xml.leaf("PdoMapping", "T"); break;
      case Pdo::both: xml.leaf("PdoMapping", "RT"); break;
    }
    if (entry.saved) xml.leaf("Backup", "1");
    if (ethercat::is_start_up_parameter(profile, entry)) xml.leaf("Setting", "1");
  });
}

struct SubItem {
  std::string_view name;
  std::string_view type;
  std::uint32_t bits;
  std::uint32_t offset;
};

void put_sub_item(Xml& xml, const ethercat::Profile& profile, const Entry& entry, const SubItem& item) {
  const bool elements = item.name == "Elements";
  xml.node("SubItem", [&] {
    if (!elements) xml.leaf("SubIdx", decimal(entry.sub));
    xml.leaf("Name", item.name);
    xml.leaf("Type", item.type);
    xml.leaf("BitSize", decimal(item.bits));
    xml.leaf("BitOffs", decimal(item.offset));
    put_flags(xml, profile, entry);
  });
}

void put_array_type(Xml& xml, const ethercat::Profile& profile, const Object& object) {
  const Entry& model = object.entries[1];
  const auto count = static_cast<std::uint32_t>(object.entries.size() - 1);
  const std::uint32_t bits = count * ethercat::bit_length(model);
  xml.node("DataType", [&] {
    xml.leaf("Name", object.array_type());
    xml.leaf("BaseType", type_name(model));
    xml.leaf("BitSize", decimal(bits));
    xml.node("ArrayInfo", [&] {
      xml.leaf("LBound", "1");
      xml.leaf("Elements", decimal(count));
    });
  });
  xml.node("DataType", [&] {
    xml.leaf("Name", object.type());
    xml.leaf("BitSize", decimal(object.bits()));
    put_sub_item(xml, profile, object.first(), {"SubIndex 000", type_name(object.first()), 8, 0});
    put_sub_item(xml, profile, model, {"Elements", object.array_type(), bits, 16});
  });
}

void put_record_type(Xml& xml, const ethercat::Profile& profile, const Object& object) {
  const std::vector<std::string> names = sub_item_names(object);
  xml.node("DataType", [&] {
    xml.leaf("Name", object.type());
    xml.leaf("BitSize", decimal(object.bits()));
    ethercat::ObjectLayout layout;
    for (std::size_t i = 0; i < object.entries.size(); ++i) {
      const Entry& entry = object.entries[i];
      const std::uint32_t offset = layout.place(entry, ethercat::size_in_object(entry));
      put_sub_item(xml, profile, entry, {names[i], type_name(entry), ethercat::bit_length(entry), offset});
    }
  });
}

void put_data_types(Xml& xml, const ethercat::Profile& profile, std::span<const Entry> table) {
  xml.node("DataTypes", [&] {
    std::set<std::string> known;
    for (const Entry& entry : table) {
      if (entry.index < 0x1000 || !known.insert(type_name(entry)).second) continue;
      xml.node("DataType", [&] {
        xml.leaf("Name", type_name(entry));
        xml.leaf("BitSize", decimal(ethercat::bit_length(entry)));
      });
    }
    for_each_object(table, [&](const Object& object) {
      if (object.single()) return;
      object.is_array() ? put_array_type(xml, profile, object) : put_record_type(xml, profile, object);
    });
  });
}

// ---- Objects ----

// A number in the form of ETG.2000 (HexDecValue).
std::string value_text(const Entry& entry, std::int64_t value) {
  std::string text = number_text(entry, value);
  if (text.starts_with("0x")) text.replace(0, 2, "#x");
  return text;
}

// Factory value, limits and unit.
void put_value(Xml& xml, const Entry& entry) {
  if (entry.type == Type::visible_string) {
    xml.leaf("DefaultString", default_text(entry));
  } else if (entry.type == Type::real32) {
    xml.leaf("DefaultData", data_of(entry, entry.default_value));
  } else if (entry.fixed_size()) {
    if (entry.has_range) {
      xml.leaf("MinValue", value_text(entry, entry.minimum));
      xml.leaf("MaxValue", value_text(entry, entry.maximum));
    }
    xml.leaf("DefaultValue", value_text(entry, entry.default_value));
  }
}

void put_unit(Xml& xml, const Entry& entry) {
  if (const std::uint32_t unit = ethercat::unit_code(entry.unit); unit != 0) xml.leaf("Unit", hex(unit, 8));
}

void put_object(Xml& xml, const ethercat::Profile& profile, const Object& object) {
  const Entry& first = object.first();
  xml.node("Object", [&] {
    xml.leaf("Index", index_text(first.index));
    put_name(xml, first.name);
    xml.leaf("Type", object.type());
    xml.leaf("BitSize", decimal(object.bits()));
    xml.node("Info", [&] {
      if (object.single()) {
        put_value(xml, first);
        put_unit(xml, first);
        return;
      }
      const std::vector<std::string> names = sub_item_names(object);
      for (std::size_t i = 0; i < object.entries.size(); ++i) {
        const Entry& entry = object.entries[i];
        xml.node("SubItem", [&] {
          xml.leaf("Name", names[i]);
          xml.node("Info", [&] {
            put_value(xml, entry);
            if (entry.sub != 0 && names[i] != entry.name) xml.leaf("DisplayName", entry.name);
            put_unit(xml, entry);
          });
        });
      }
    });
    if (object.single()) {
      put_flags(xml, profile, first);
    } else {
      xml.node("Flags", [&] { xml.leaf("Category", is_mandatory(first.index) ? "m" : "o"); });
    }
  });
}

}  // namespace

void put_profile(Xml& xml, const Description& device, const ethercat::Profile& profile,
                 const ethercat::Defaults& defaults) {
  const std::uint32_t device_type = defaults.value(0x1000, 0);
  xml.node("Profile", [&] {
    xml.leaf("ProfileNo", decimal(device_type & 0xFFFF));
    xml.leaf("AddInfo", decimal(device_type >> 16));
    xml.node("Dictionary", [&] {
      put_data_types(xml, profile, device.table);
      xml.node("Objects",
               [&] { for_each_object(device.table, [&](const Object& object) { put_object(xml, profile, object); }); });
    });
  });
}

}  // namespace servodrome::describe::etg2000
