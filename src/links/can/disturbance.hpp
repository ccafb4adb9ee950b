#pragma once

#include <cstdint>
#include <optional>

#include "canopen/frame.hpp"
#include "links/disturbance_generator.hpp"
#include "links/time.hpp"

namespace servodrome::links {

// What is wrong with a bus, by probability (0..1 each) and seed: equal seeds and equal traffic give equal disturbance.
// Each kind draws from a generator of its own, so that changing one probability leaves the others' choices alone.
struct Disturbance {
  double drop = 0;           // the frame takes its time and is acknowledged, yet no port receives it
  double delay = 0;          // the frame waits `delay_time` in its sender's queue, and what is queued behind it with it
  double corrupt = 0;        // a bit error: an error frame, counters count, and the sender repeats the frame
  Time delay_time = Time{};  // for `delay`
  std::uint64_t seed = 1;    //
  std::uint32_t id = 0;      // only frames with (frame.id & id_mask) == (id & id_mask)
  std::uint32_t id_mask = 0;                         // 0: all frames
  std::optional<std::uint16_t> port = std::nullopt;  // only frames sent by this port (index of its PortId)
  std::uint32_t limit = 0;                           // stop after so many disturbed frames; 0: no limit
};

}  // namespace servodrome::links
