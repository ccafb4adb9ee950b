#include "tools/parameters/values.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "dictionary/dictionary.hpp"

namespace servodrome::master {
namespace {

constexpr std::int64_t node_id_mask = 0x7F;

ParameterValue value_of(const Parameter& parameter, std::vector<std::byte> bytes, NodeId node_id) {
  ParameterValue value{.address = parameter.address,
                       .type = parameter.type,
                       .bytes = std::move(bytes),
                       .unit = parameter.unit,
                       .name = parameter.name};
  if (!parameter.adds_node_id || !node_id) return value;
  const std::int64_t number = dictionary::decode_number(value.type, value.bytes);
  if ((number & node_id_mask) != *node_id) return value;
  value.adds_node_id = true;
  value.bytes = bytes_of(number - *node_id, value.type);
  return value;
}

bool same(const ParameterValue& a, const ParameterValue& b, NodeId node_id) {
  if (a.adds_node_id == b.adds_node_id) return a.bytes == b.bytes;
  return node_id && bytes_for(a, node_id) == bytes_for(b, node_id);
}

}  // namespace

std::vector<std::byte> bytes_of(std::int64_t number, dictionary::Type type) {
  const auto bytes = dictionary::encode_number(number);
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(dictionary::size_of(type))};
}

std::optional<std::vector<std::byte>> read_parameter(ObjectClient& objects, ObjectAddress address,
                                                     dictionary::Type type) {
  std::vector<std::byte> bytes;
  try {
    bytes = objects.upload(address);
  } catch (const ObjectError& error) {
    if (error.object_is_absent()) return std::nullopt;
    throw;
  }
  const std::size_t size = dictionary::size_of(type);
  if (size == 0) {
    if (type != dictionary::Type::visible_string) return bytes;
    while (!bytes.empty() && bytes.back() == std::byte{0}) bytes.pop_back();
    return bytes;
  }
  if (bytes.size() > size) {
    throw MasterError(fmt::format("{} bytes were received for a value of type {}", bytes.size(), short_word(type)),
                      fmt::format("{}, {}", objects.where(), text_of(address)),
                      "the data sheet belongs to another drive: give the right one with --eds");
  }
  const bool negative =
      dictionary::is_signed(type) && !bytes.empty() && std::to_integer<unsigned>(bytes.back()) >= 0x80;
  bytes.resize(size, negative ? std::byte{0xFF} : std::byte{0});
  return bytes;
}

ReadParameters read_parameters(ObjectClient& objects, const ParameterList& list, NodeId node_id,
                               const ParameterProgress& progress) {
  ReadParameters result;
  std::size_t done = 0;
  for (const Parameter& parameter : list.all()) {
    if (progress) progress("reading", done++, list.all().size());
    if (auto bytes = read_parameter(objects, parameter.address, parameter.type)) {
      result.values.push_back(value_of(parameter, std::move(*bytes), node_id));
    } else {
      result.absent.push_back(parameter.address);
    }
  }
  return result;
}

std::vector<ParameterValue> factory_parameters(const ParameterList& list) {
  std::vector<ParameterValue> values;
  for (const Parameter& parameter : list.all()) {
    if (!parameter.factory) continue;
    ParameterValue value = value_of(parameter, bytes_of(*parameter.factory, parameter.type), std::nullopt);
    value.adds_node_id = parameter.adds_node_id;
    values.push_back(std::move(value));
  }
  return values;
}

std::vector<ParameterDifference> compare(std::span<const ParameterValue> left, std::span<const ParameterValue> right,
                                         NodeId node_id, bool only_common) {
  std::vector<ParameterDifference> differences;
  auto a = left.begin();
  auto b = right.begin();
  while (a != left.end() || b != right.end()) {
    const bool has_left = b == right.end() || (a != left.end() && !(b->address < a->address));
    const bool has_right = a == left.end() || (b != right.end() && !(a->address < b->address));
    const ParameterDifference one{has_left ? a->address : b->address, has_left ? &*a : nullptr,
                                  has_right ? &*b : nullptr};
    const bool differs = has_left && has_right ? !same(*a, *b, node_id) : !only_common;
    if (differs) differences.push_back(one);
    if (has_left) ++a;
    if (has_right) ++b;
  }
  return differences;
}

}  // namespace servodrome::master
