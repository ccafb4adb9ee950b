#include "app/object_names.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/commands.hpp"
#include "describe/words.hpp"
#include "master/error.hpp"

namespace servodrome::app {

using dictionary::Type;

std::optional<master::ObjectCatalogue> data_sheet(const std::string& eds) {
  if (eds.empty()) return std::nullopt;
  std::ifstream file(eds);
  if (!file) throw Failure::wrong_use(fmt::format("--eds {}: cannot be read; check the path", eds));
  return master::ObjectCatalogue::read_eds(file, eds);
}

ObjectNames::ObjectNames(const std::string& eds) : sheet_(data_sheet(eds)) {}

const master::ObjectCatalogue& ObjectNames::of(DriveLink& link) const {
  return has_eds() || link.product() == nullptr ? without_drive() : link.catalogue();
}

master::ObjectAddress resolve(const master::ObjectCatalogue& catalogue, const std::string& text) {
  try {
    return catalogue.resolve(text);
  } catch (const master::MasterError& error) {
    throw Failure::wrong_use(error.what());
  }
}

bool knows(const master::ObjectCatalogue& catalogue, const std::string& text) {
  try {
    return catalogue.find(catalogue.resolve(text)) != nullptr;
  } catch (const master::MasterError&) {
    return false;
  }
}

nlohmann::ordered_json value_json(std::span<const std::byte> bytes, std::optional<Type> type) {
  if (!type) return nullptr;
  if (*type == Type::real32 && bytes.size() == 4) {
    float number = 0;
    std::memcpy(&number, bytes.data(), sizeof number);
    return number;
  }
  if (*type == Type::boolean && !bytes.empty()) return bytes[0] != std::byte{0};
  if (dictionary::size_of(*type) != 0 && !bytes.empty() && bytes.size() <= 8) {
    // Uses the size of the received bytes, as in text: the drive's size may differ from the known one.
    std::uint64_t raw = 0;
    std::memcpy(&raw, bytes.data(), bytes.size());
    if (!dictionary::is_signed(*type)) return raw;
    const auto shift = static_cast<unsigned>(64 - 8 * bytes.size());
    return static_cast<std::int64_t>(raw << shift) >> shift;
  }
  if (*type == Type::visible_string) {
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    return text.substr(0, text.find_last_not_of('\0') + 1);
  }
  return nullptr;
}

nlohmann::ordered_json object_json(const master::ObjectCatalogue& catalogue, unsigned node_id,
                                   master::ObjectAddress object, std::span<const std::byte> bytes,
                                   std::optional<Type> type) {
  const master::NamedObject* known = catalogue.find(object);
  nlohmann::ordered_json json{
      {"node", node_id}, {"object", text_of(object)}, {"index", object.index}, {"sub", object.sub}};
  json["name"] = known == nullptr ? "" : known->name;
  json["type"] = type ? nlohmann::ordered_json(describe::word(*type)) : nullptr;
  if (auto value = value_json(bytes, type); !value.is_null()) json["value"] = std::move(value);
  json["bytes"] = master::text_of_value(bytes, Type::octet_string);
  return json;
}

}  // namespace servodrome::app
