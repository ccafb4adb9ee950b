#pragma once

#include <cstdint>
#include <optional>

#include "canopen/frame.hpp"
#include "links/disturbance_generator.hpp"
#include "links/time.hpp"

namespace servodrome::links {

// The disturbances of a CAN bus. Each kind has a probability (0..1); equal seeds and equal traffic give equal
// disturbances. Each kind has its own random generator, so that changing one probability does not change the draws of
// the others.
struct Disturbance {
  double drop = 0;           // the frame is sent and acknowledged, but no port receives it
  double delay = 0;          // the frame, and those queued behind it, wait `delay_time` in the sender's queue
  double corrupt = 0;        // a bit error causes an error frame, error counters rise, and the sender repeats the frame
  Time delay_time = Time{};  // of `delay`
  std::uint64_t seed = 1;    // of the random generators
  std::uint32_t id = 0;      // only frames with (frame.id & id_mask) == (id & id_mask)
  std::uint32_t id_mask = 0;                         // 0: all frames
  std::optional<std::uint16_t> port = std::nullopt;  // only frames sent by this port (index of its PortId)
  std::uint32_t limit = 0;                           // stop after this number of disturbed frames; 0: no limit
};

}  // namespace servodrome::links
