#include "tools/sniff/pdo_mapping.hpp"

#include <algorithm>
#include <cstring>

#include "describe/device_file.hpp"

namespace servodrome::master {
namespace {

constexpr unsigned most_entries = 254;

}  // namespace

unsigned bits_of(std::span<const MappedField> mapping) {
  unsigned bits = 0;
  for (const MappedField& one : mapping) bits += one.bits;
  return bits;
}

std::vector<DecodedValue> values_of(std::span<const MappedField> mapping, std::span<const std::uint8_t> data,
                                    unsigned first_bit, const ObjectCatalogue& catalogue) {
  std::vector<DecodedValue> values;
  unsigned bit = first_bit;
  for (const MappedField& one : mapping) {
    const unsigned begin = bit;
    bit += one.bits;
    if (bit > data.size() * 8) break;
    if (one.is_gap() || one.bits == 0) continue;
    std::vector<std::byte> bytes((one.bits + 7) / 8);
    for (unsigned i = 0; i < one.bits; ++i) {
      const unsigned at = begin + i;
      if ((data[at / 8] >> at % 8 & 1U) != 0) bytes[i / 8] |= static_cast<std::byte>(1U << i % 8);
    }
    values.push_back(decoded_value(one.object, bytes, catalogue));
  }
  return values;
}

std::string text_of(std::span<const DecodedValue> values) {
  std::string text;
  for (const DecodedValue& value : values) text += (text.empty() ? "" : ", ") + text_of(value);
  return text;
}

void PdoObjects::set(ObjectAddress object, std::span<const std::byte> bytes) {
  std::uint32_t value = 0;
  if (!bytes.empty()) std::memcpy(&value, bytes.data(), std::min(bytes.size(), sizeof value));
  set(object, value);
}

void PdoObjects::set_all(ObjectAddress first, std::span<const std::byte> bytes) {
  const std::size_t width = first.index == output_assignment || first.index == output_assignment + 1 ? 2 : 4;
  if (first.sub == 0) {
    if (bytes.size() < 2) return;
    set(first, bytes.first(1));
    bytes = bytes.subspan(2);
  }
  for (std::uint8_t sub = 1; bytes.size() >= width; ++sub) {
    set({first.index, sub}, bytes.first(width));
    bytes = bytes.subspan(width);
  }
}

std::optional<std::uint32_t> PdoObjects::get(std::uint16_t index, std::uint8_t sub) const {
  const auto found = values_.find({index, sub});
  return found != values_.end() ? std::optional(found->second) : std::nullopt;
}

std::optional<std::vector<MappedField>> PdoObjects::mapping(std::uint16_t index) const {
  const auto count = get(index, 0);
  if (!count || *count > most_entries) return std::nullopt;
  std::vector<MappedField> mapping;
  for (unsigned sub = 1; sub <= *count; ++sub) {
    const auto entry = get(index, static_cast<std::uint8_t>(sub));
    if (!entry) return std::nullopt;
    mapping.push_back(MappedField::of(*entry));
  }
  return mapping;
}

std::optional<std::vector<MappedField>> PdoObjects::assigned(std::uint16_t assignment) const {
  const auto count = get(assignment, 0);
  if (!count || *count > most_entries) return std::nullopt;
  std::vector<MappedField> all;
  for (unsigned sub = 1; sub <= *count; ++sub) {
    const auto pdo = get(assignment, static_cast<std::uint8_t>(sub));
    if (!pdo) return std::nullopt;
    if (*pdo == 0) continue;
    const auto one = mapping(static_cast<std::uint16_t>(*pdo));
    if (!one) return std::nullopt;
    all.insert(all.end(), one->begin(), one->end());
  }
  return all;
}

const std::shared_ptr<const DeviceModel>& DeviceModel::standard() {
  static const auto model = std::make_shared<const DeviceModel>(DeviceModel{ObjectCatalogue::standard(), {}});
  return model;
}

DeviceModel DeviceModel::of(const describe::DeviceFile& device) {
  DeviceModel model{ObjectCatalogue::of(device), {}};
  for (const describe::FileEntry& entry : device.entries) {
    if (!PdoObjects::concerns(entry.index) || !entry.default_value) continue;
    model.pdo_defaults.push_back(
        {{entry.index, entry.sub}, static_cast<std::uint32_t>(*entry.default_value), entry.default_adds_node_id});
  }
  return model;
}

DeviceModel DeviceModel::of(std::span<const dictionary::Entry> table, std::string_view product) {
  DeviceModel model{ObjectCatalogue::of(table, product), {}};
  for (const dictionary::Entry& entry : table) {
    if (!PdoObjects::concerns(entry.index) || !entry.fixed_size()) continue;
    model.pdo_defaults.push_back(
        {{entry.index, entry.sub}, static_cast<std::uint32_t>(entry.default_value), entry.default_adds_node_id});
  }
  return model;
}

PdoObjects DeviceModel::pdo_objects(std::uint8_t node_id) const {
  PdoObjects objects;
  for (const Default& one : pdo_defaults) objects.set(one.object, one.value + (one.adds_node_id ? node_id : 0U));
  return objects;
}

}  // namespace servodrome::master
