#pragma once

#include <cstdint>
#include <optional>

#include "links/time.hpp"

namespace servodrome::links {

// The disturbances of an EtherCAT segment. Each kind has a probability (0..1); equal seeds and equal traffic give equal
// disturbances. Each kind has its own random generator, so that changing one probability does not change the draws of
// the others. EthercatBus::set_cable unplugs cables.
struct EthercatDisturbance {
  double drop = 0;           // the frame is lost on its way to the first slave: no slave sees it
  double drop_answer = 0;    // the frame is lost on its way back: every slave has seen it
  double corrupt = 0;        // bit errors: a slave receives a wrong FCS; it and the slaves behind it count that
  double delay = 0;          // the frame comes back `delay_time` later; frames sent after it may overtake it
  Time delay_time = Time{};  // delay of each such frame
  std::uint64_t seed = 1;    // of the random generators
  std::optional<std::size_t> position = std::nullopt;  // slave at which `corrupt` acts; none: a random one
  std::uint32_t limit = 0;                             // stop after this number of disturbed frames; 0: no limit
};

}  // namespace servodrome::links
