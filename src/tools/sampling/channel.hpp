#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "axis/object_catalogue.hpp"
#include "master/object_client.hpp"

namespace servodrome::master::sampling {

// A sampled number: an object of the drive.
struct Channel {
  ObjectAddress object{};
  std::optional<dictionary::Type> type{};  // nullopt if the catalogue does not know it; set by complete()
  unsigned bits = 0;                       // size in the drive; 0 until complete()
  std::string name{};                      // for example "position_actual_value", "2105_01"
  std::string unit{};                      // "": unknown
};

inline constexpr std::size_t most_channels = 16;

// Parses a channel: anything that ObjectCatalogue::resolve accepts; a name without its " value" at the end
// (`position_actual`); or a short name (`position`, `velocity`, `torque`, `current`, `following_error`, `inputs`,
// `mode`, `voltage`). A suffix `@TYPE` gives the type if the catalogue does not know it (`2105:01@i16`). Throws
// MasterError.
Channel named_channel(std::string_view text, const ObjectCatalogue& catalogue);

// Reads the object to check that it exists and is a number, and to set its size. An unknown type becomes UNSIGNED.
// Throws MasterError.
void complete(Channel& channel, ObjectClient& objects);

// Returns the position of the object among the channels, and adds it if it is missing. Throws MasterError if there is
// no room.
std::size_t add_channel(std::vector<Channel>& channels, Channel channel);

// The number in the low `bits` bits of `raw`.
double number_of(dictionary::Type type, std::uint64_t raw, unsigned bits);
double number_of(dictionary::Type type, std::span<const std::byte> bytes);

}  // namespace servodrome::master::sampling
