#pragma once

#include <cstdint>
#include <optional>

#include "links/time.hpp"

namespace servodrome::links {

// What is wrong with an EtherCAT segment, by probability (0..1 each) and seed: equal seeds and equal traffic give equal
// disturbance. Each kind draws from a generator of its own, so that changing one probability leaves the others' choices
// alone. Cables are unplugged with EthercatBus::set_cable.
struct EthercatDisturbance {
  double drop = 0;         // the frame is lost on its way to the first slave: no slave sees it
  double drop_answer = 0;  // the frame is lost on its way back: every slave has seen it
  double corrupt = 0;  // bit errors: the frame comes to a slave with a wrong FCS, which it and those behind it count
  double delay = 0;    // the frame comes back `delay_time` later; frames sent after it may overtake it
  Time delay_time = Time{};                            // for `delay`
  std::uint64_t seed = 1;                              //
  std::optional<std::size_t> position = std::nullopt;  // `corrupt`: at this slave; otherwise at one that is drawn
  std::uint32_t limit = 0;                             // stop after so many disturbed frames; 0: no limit
};

}  // namespace servodrome::links
