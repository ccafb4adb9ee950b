#include "tools/parameters/list.hpp"

#include <algorithm>

#include "catalogue/product.hpp"
#include "dictionary/dictionary.hpp"

namespace servodrome::master {
namespace {

using dictionary::Access;
using dictionary::Type;

std::string full_name(const std::string& object_name, const std::string& name) {
  return object_name == name || object_name.empty() ? name : object_name + "." + name;
}

std::optional<std::int64_t> number_of(std::span<const std::uint8_t> bytes, Type type) {
  if (bytes.size() != dictionary::size_of(type) || bytes.empty()) return std::nullopt;
  return dictionary::decode_number(type, std::as_bytes(bytes));
}

// Sub-index 0 of an ARRAY or RECORD is a count and no parameter, except in PDO mappings and assignments.
bool is_pdo_count(std::uint16_t index) {
  return (index >= 0x1600 && index < 0x1800) || (index >= 0x1A00 && index < 0x1C00) || index == 0x1C12 ||
         index == 0x1C13;
}

bool has_limits(Type type) { return dictionary::size_of(type) != 0 && type != Type::real32; }

}  // namespace

void ParameterList::add(Parameter parameter, bool with_connection) {
  if (!with_connection && rules_->is_connection(parameter.address)) return;
  if (!has_limits(parameter.type)) parameter.minimum = parameter.maximum = std::nullopt;
  parameters_.push_back(std::move(parameter));
}

ParameterList ParameterList::of_dictionary(std::span<const dictionary::Entry> table,
                                           const catalogue::ParameterRules& rules, bool with_connection) {
  ParameterList list(rules);
  std::string object_name;
  for (const dictionary::Entry& entry : table) {
    if (entry.sub == 0) object_name = entry.name;
    const ObjectAddress address{entry.index, entry.sub};
    if (entry.access != Access::rw || rules.is_command(address)) continue;
    const bool has_factory = entry.fixed_size() && !rules.differs_by_model(address);
    list.add({.address = address,
              .type = entry.type,
              .name = full_name(object_name, entry.name),
              .unit = entry.unit,
              .minimum = entry.has_range ? std::optional(entry.minimum) : std::nullopt,
              .maximum = entry.has_range ? std::optional(entry.maximum) : std::nullopt,
              .factory = has_factory ? std::optional(entry.default_value) : std::nullopt,
              .adds_node_id = entry.default_adds_node_id,
              .retained = entry.saved},
             with_connection);
  }
  return list;
}

ParameterList ParameterList::of_data_sheet(const ObjectCatalogue& sheet, const catalogue::ParameterRules& rules,
                                           bool with_connection) {
  ParameterList list(rules);
  for (const NamedObject& object : sheet.objects()) {
    const bool writable = object.access == Access::rw;
    if (!writable || !object.type || rules.is_command(object.address)) continue;
    list.add({.address = object.address,
              .type = *object.type,
              .name = full_name(object.object_name, object.name),
              .minimum = object.minimum,
              .maximum = object.maximum,
              .factory = object.default_value,
              .adds_node_id = object.default_adds_node_id},
             with_connection);
  }
  return list;
}

ParameterList ParameterList::of_slave(CoeClient& coe, const catalogue::ParameterRules& rules, bool with_connection) {
  constexpr std::uint8_t array = 8;
  constexpr std::uint8_t record = 9;
  ParameterList list(rules);
  for (const std::uint16_t index : coe.list(ObjectList::all)) {
    const ObjectDescription object = coe.describe(index);
    const bool has_parts = object.code == array || object.code == record;
    for (unsigned sub = 0; sub <= object.highest_sub; ++sub) {
      const ObjectAddress address{index, static_cast<std::uint8_t>(sub)};
      if (rules.is_command(address) || (sub == 0 && has_parts && !is_pdo_count(index))) continue;
      EntryDescription entry;
      try {
        entry = coe.describe(address);
      } catch (const CoeError& error) {
        if (!error.answered()) throw;
        continue;  // a gap between sub-indices
      }
      const bool writable = (entry.access & entry_access::read) != 0 && (entry.access & entry_access::write) != 0 &&
                            (entry.bits != 0 || entry.type == static_cast<std::uint16_t>(Type::domain));
      const auto type = static_cast<Type>(entry.type);
      const bool is_known = parse_type(short_word(type)) == type || type == Type::domain;
      if (!writable || !is_known) continue;
      list.add({.address = address,
                .type = type,
                .name = full_name(object.name, has_parts ? entry.name : object.name),
                .minimum = number_of(entry.minimum, type),
                .maximum = number_of(entry.maximum, type),
                .factory = number_of(entry.default_value, type),
                .retained = (entry.access & entry_access::stored) != 0},
               with_connection);
    }
  }
  return list;
}

const Parameter* ParameterList::find(ObjectAddress address) const {
  const auto found =
      std::lower_bound(parameters_.begin(), parameters_.end(), address,
                       [](const Parameter& parameter, ObjectAddress wanted) { return parameter.address < wanted; });
  return found != parameters_.end() && found->address == address ? &*found : nullptr;
}

}  // namespace servodrome::master
