#include "tools/sampling/channel.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fmt/format.h>

namespace servodrome::master::sampling {

namespace {

using dictionary::Type;

struct ShortName {
  std::string_view word;
  ObjectAddress object;
};
constexpr std::array short_names{
    ShortName{"position", {0x6064, 0}}, ShortName{"velocity", {0x606C, 0}},        ShortName{"torque", {0x6077, 0}},
    ShortName{"current", {0x6078, 0}},  ShortName{"following_error", {0x60F4, 0}}, ShortName{"inputs", {0x60FD, 0}},
    ShortName{"mode", {0x6061, 0}},     ShortName{"voltage", {0x6079, 0}},
};

ObjectAddress object_named(std::string_view text, const ObjectCatalogue& catalogue) {
  for (const auto& [word, object] : short_names) {
    if (word == text) return object;
  }
  try {
    return catalogue.resolve(text);
  } catch (const MasterError&) {
    try {
      return catalogue.resolve(std::string(text) + " value");
    } catch (const MasterError&) {
      // The error message refers to the name as entered.
    }
    throw;
  }
}

// Letters and digits of a name in lower case; other characters become "_".
std::string column_name(std::string_view name) {
  std::string column;
  for (const char c : name) {
    const bool is_upper = c >= 'A' && c <= 'Z';
    const bool is_word = is_upper || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9');
    if (is_word) {
      column += is_upper ? static_cast<char>(c - 'A' + 'a') : c;
    } else if (!column.empty() && column.back() != '_') {
      column += '_';
    }
  }
  while (!column.empty() && column.back() == '_') column.pop_back();
  return column;
}

Type unsigned_type(std::size_t bytes) {
  switch (bytes) {
    case 1: return Type::unsigned8;
    case 2: return Type::unsigned16;
    case 3:
    case 4: return Type::unsigned32;
    default: return Type::unsigned64;
  }
}

}  // namespace

Channel named_channel(std::string_view text, const ObjectCatalogue& catalogue) {
  const std::size_t at = text.rfind('@');
  Channel channel{.object = object_named(text.substr(0, at), catalogue)};
  const NamedObject* known = catalogue.find(channel.object);
  if (known != nullptr) {
    channel.type = known->type;
    channel.unit = known->unit;
    channel.name =
        column_name(known->name == known->object_name ? known->name : known->object_name + " " + known->name);
  }
  if (channel.name.empty()) channel.name = fmt::format("{:04X}_{:02X}", channel.object.index, channel.object.sub);
  if (at != std::string_view::npos) {
    channel.type = parse_type(text.substr(at + 1));
    if (!channel.type || (dictionary::size_of(*channel.type) == 0)) {
      throw MasterError(fmt::format("\"{}\" is not a numeric type", text.substr(at + 1)),
                        fmt::format("channel \"{}\"", text), "write @i8 to @i64, @u8 to @u64, @bool or @f32");
    }
  }
  return channel;
}

void complete(Channel& channel, ObjectClient& objects) {
  const std::size_t bytes = objects.upload(channel.object).size();
  const bool is_number = bytes >= 1 && bytes <= 8 && (!channel.type || dictionary::size_of(*channel.type) != 0);
  if (!is_number) {
    throw MasterError(fmt::format("\"{}\" is not a number", channel.name),
                      fmt::format("{}, {}", objects.where(), text_of(channel.object)), "record something else");
  }
  channel.bits = static_cast<unsigned>(8 * bytes);
  if (!channel.type) channel.type = unsigned_type(bytes);
}

std::size_t add_channel(std::vector<Channel>& channels, Channel channel) {
  const auto there =
      std::find_if(channels.begin(), channels.end(), [&](const Channel& one) { return one.object == channel.object; });
  if (there != channels.end()) return static_cast<std::size_t>(there - channels.begin());
  if (channels.size() == most_channels) {
    throw MasterError(fmt::format("more than {} channels", most_channels), fmt::format("channel \"{}\"", channel.name),
                      "record fewer channels; the trigger's object counts as one");
  }
  const auto same_name = [&](const Channel& one) { return one.name == channel.name; };
  if (std::any_of(channels.begin(), channels.end(), same_name)) {
    channel.name += fmt::format("_{:04x}_{:02x}", channel.object.index, channel.object.sub);
  }
  channels.push_back(std::move(channel));
  return channels.size() - 1;
}

double number_of(Type type, std::uint64_t raw, unsigned bits) {
  if (bits < 64) raw &= (std::uint64_t{1} << bits) - 1;
  if (type == Type::real32 && bits == 32) return std::bit_cast<float>(static_cast<std::uint32_t>(raw));
  if (!dictionary::is_signed(type)) return static_cast<double>(raw);
  if (bits < 64 && bits != 0 && (raw >> (bits - 1) & 1) != 0) raw |= ~std::uint64_t{0} << bits;
  return static_cast<double>(static_cast<std::int64_t>(raw));
}

double number_of(Type type, std::span<const std::byte> bytes) {
  std::uint64_t raw = 0;
  const std::size_t count = std::min(bytes.size(), sizeof raw);
  for (std::size_t i = 0; i < count; ++i) raw |= std::to_integer<std::uint64_t>(bytes[i]) << (8 * i);
  return number_of(type, raw, static_cast<unsigned>(8 * count));
}

}  // namespace servodrome::master::sampling
