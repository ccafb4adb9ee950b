#include "scenario/held_states.hpp"

#include <algorithm>

namespace servodrome::scenario {

std::string HeldStates::hold(const RuleRun& rule, MachineState state) {
  const MachineState::Value value = state.held;
  const auto [place, is_first] = states_.try_emplace(state.name);
  Held& held = place->second;
  if (is_first) {
    held.before = state.read();
    held.state = std::move(state);
  }
  held.holders.push_back({&rule, value});
  return held.state.write(value);
}

void HeldStates::release(const RuleRun& rule) {
  for (auto place = states_.begin(); place != states_.end();) {
    Held& held = place->second;
    auto& holders = held.holders;
    const auto mine =
        std::find_if(holders.begin(), holders.end(), [&](const Holder& each) { return each.rule == &rule; });
    if (mine == holders.end()) {
      ++place;
      continue;
    }
    const bool decides = mine + 1 == holders.end();
    const MachineState::Value value = mine->value;
    holders.erase(mine);
    if (decides && held.state.read() == value) held.state.write(holders.empty() ? held.before : holders.back().value);
    place = holders.empty() ? states_.erase(place) : std::next(place);
  }
}

}  // namespace servodrome::scenario
