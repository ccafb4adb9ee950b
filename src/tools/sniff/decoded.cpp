#include "tools/sniff/decoded.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "axis/axis402.hpp"
#include "drive/power/power_state.hpp"
#include "master/emergency.hpp"

namespace servodrome::master {
namespace {

constexpr std::array<std::string_view, frame_kinds> kind_names{
    "nmt", "sync",  "time",     "emcy",    "pdo",          "sdo",    "heartbeat", "guarding", "lss",
    "can", "state", "register", "mailbox", "process-data", "modbus", "serial10",  "error",    "garbage"};

std::int64_t number_of(std::span<const std::byte> bytes) {
  std::uint64_t raw = 0;
  if (!bytes.empty()) std::memcpy(&raw, bytes.data(), std::min(bytes.size(), sizeof raw));
  return static_cast<std::int64_t>(raw);
}

// The meaning of an object's value by CiA 301 or 402, or by the product; empty if it is a plain number.
std::string meaning(ObjectAddress object, std::span<const std::byte> bytes, std::string_view product) {
  const std::int64_t number = number_of(bytes);
  if (object == ObjectAddress{0x6041, 0} && bytes.size() == 2) {
    return drive::name(state_of(static_cast<std::uint16_t>(number)));
  }
  if ((object == ObjectAddress{0x6060, 0} || object == ObjectAddress{0x6061, 0}) && bytes.size() == 1) {
    return std::string(name(static_cast<OperationMode>(number), product));
  }
  if (object == ObjectAddress{0x603F, 0} && number != 0) return text_of_error_code(static_cast<std::uint16_t>(number));
  return {};
}

}  // namespace

std::string_view name(FrameKind kind) { return kind_names[static_cast<std::size_t>(kind)]; }

std::optional<FrameKind> parse_frame_kind(std::string_view word) {
  const auto found = std::find(kind_names.begin(), kind_names.end(), word);
  if (found == kind_names.end()) return std::nullopt;
  return static_cast<FrameKind>(found - kind_names.begin());
}

bool Decoded::names(ObjectAddress object, bool whole_object) const {
  return std::any_of(objects.begin(), objects.end(), [&](ObjectAddress one) {
    return one.index == object.index && (whole_object || one.sub == object.sub);
  });
}

std::string value_text(ObjectAddress object, std::span<const std::byte> bytes, const ObjectCatalogue& catalogue) {
  const NamedObject* known = catalogue.find(object);
  std::optional<dictionary::Type> type = known != nullptr ? known->type : std::nullopt;
  const std::size_t size = type ? dictionary::size_of(*type) : 0;
  if (size != 0 && bytes.size() > size) type = std::nullopt;  // the known type does not fit
  std::string text = text_of_value(bytes, type);
  if (const std::string words = meaning(object, bytes, catalogue.product()); !words.empty()) text += " " + words;
  return text;
}

DecodedValue decoded_value(ObjectAddress object, std::span<const std::byte> bytes, const ObjectCatalogue& catalogue) {
  return {object, catalogue.title(object), value_text(object, bytes, catalogue)};
}

std::string text_of(const DecodedValue& value) { return value.name + " = " + value.text; }

std::string hex_text(std::span<const std::uint8_t> bytes, std::size_t at_most) {
  std::string text;
  for (std::size_t i = 0; i < std::min(bytes.size(), at_most); ++i) {
    text += fmt::format("{}{:02X}", i == 0 ? "" : " ", bytes[i]);
  }
  if (bytes.size() > at_most) text += fmt::format(" ... ({} bytes)", bytes.size());
  return text;
}

}  // namespace servodrome::master
