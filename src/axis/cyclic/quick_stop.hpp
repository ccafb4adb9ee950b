#pragma once

#include <optional>

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"
#include "master/process_image.hpp"

namespace servodrome::master {

// The power state in the drive's process data; nullopt: the statusword is not mapped.
inline std::optional<PowerState> shown_state(ProcessImage& image) {
  const auto status = image.input({0x6041, 0});
  if (!status) return std::nullopt;
  return state_of(status->get<std::uint16_t>());
}

// Sets the controlword to quick stop if the drive is operation enabled, or if the present controlword enables it (the
// drive is about to become enabled, or its statusword is not mapped). Returns true if it did. 605Ah selects how the
// drive brakes; with 0 it coasts.
inline bool request_quick_stop(ProcessImage& image) {
  auto command = image.output({0x6040, 0});
  if (!command) return false;
  const bool is_enabled = shown_state(image) == PowerState::operation_enabled;
  if (!is_enabled && !commands_operation(command->get<std::uint16_t>())) return false;
  command->set(command_word::quick_stop);
  return true;
}

// True if the controlword of the image commands a quick stop, perhaps since an earlier call of request_quick_stop().
inline bool commands_quick_stop(ProcessImage& image) {
  const auto command = image.output({0x6040, 0});
  return command && command->get<std::uint16_t>() == command_word::quick_stop;
}

}  // namespace servodrome::master
