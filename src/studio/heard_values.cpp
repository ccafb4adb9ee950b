#include "studio/heard_values.hpp"

namespace servodrome::studio {
namespace {

constexpr std::uint16_t first_of_profile = 0x6000;  // CiA 301 table 35: below are communication and the maker's objects

}  // namespace

void HeardValues::set(master::ObjectAddress object, std::span<const std::byte> value) {
  if (rules_.is_command(object)) return;  // a command has no value
  const auto found = values_.find(object);
  if (found != values_.end()) {
    found->second = {api::KeptValue(value)};
  } else if (values_.size() < most_objects) {
    values_[object] = {api::KeptValue(value)};
  }
}

void HeardValues::note_request(master::ObjectAddress object) {
  const auto found = values_.find(object);
  if (found == values_.end()) return;
  if (found->second.is_in_doubt) {
    values_.erase(found);
  } else {
    found->second.is_in_doubt = true;
  }
}

void HeardValues::note_refusal(master::ObjectAddress object) {
  const auto found = values_.find(object);
  if (found != values_.end()) found->second.is_in_doubt = false;
}

api::KeptValue HeardValues::note_write(master::ObjectAddress object, std::span<const std::byte> value) {
  api::KeptValue before;
  if (const auto found = values_.find(object); found != values_.end()) before = found->second.value;
  if (rules_.is_command(object) && object.index < first_of_profile) forget();
  set(object, value);
  return before;
}

}  // namespace servodrome::studio
