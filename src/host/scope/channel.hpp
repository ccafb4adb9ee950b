#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "host/object_catalogue.hpp"
#include "host/object_client.hpp"

namespace servodrome::host::scope {

// A number that is recorded: an object of the drive.
struct Channel {
  ObjectAddress object{};
  std::optional<dictionary::Type> type{};  // nothing until complete(), if the catalogue does not know it
  unsigned bits = 0;                       // as the drive has it; 0 until complete()
  std::string name{};                      // "position_actual_value", "2105_01"
  std::string unit{};                      // "": not known
};

inline constexpr std::size_t most_channels = 16;

// An object as people write it: what ObjectCatalogue::resolve takes; a name without its " value" at the end
// (`position_actual`); or a short word (`position`, `velocity`, `torque`, `current`, `following_error`, `inputs`,
// `mode`, `voltage`). `@TYPE` behind it says what the catalogue does not (`2105:01@i16`). Throws HostError.
Channel named_channel(std::string_view text, const ObjectCatalogue& catalogue);

// Asks the drive for the object: it has it, it is a number, and so many bits long. A type that is not known is taken to
// be an UNSIGNED. Throws HostError.
void complete(Channel& channel, ObjectClient& objects);

// Where the object is among the channels, put there if it is new. Throws HostError if there is no room.
std::size_t add_channel(std::vector<Channel>& channels, Channel channel);

// The number that `bits` low bits of `raw` are.
double number_of(dictionary::Type type, std::uint64_t raw, unsigned bits);
double number_of(dictionary::Type type, std::span<const std::byte> bytes);

// Without needless digits: "131072", "0.5".
std::string text_of_number(double number);

}  // namespace servodrome::host::scope
