#include "drive/io/input_functions.hpp"

namespace servodrome::drive {

void InputFunctions::assign(std::span<const InputFunctionRow> rows, std::span<const std::uint16_t> codes,
                            std::uint16_t polarity, std::uint16_t simulation, std::size_t count) {
  exists_ = static_cast<std::uint16_t>((1u << count) - 1u);
  polarity_ = polarity;
  simulation_ = simulation;
  assigned_ = 0;
  map_ = {};
  actions_ = {};
  for (std::size_t i = 0; i < codes.size() && i < count; ++i) {
    const InputFunctionRow* row = find_function(rows, codes[i]);
    if (row == nullptr) continue;
    map_[i] = {.signal = row->signal,
               .inverted = (polarity >> i & 1) == 0,
               .forced = (simulation >> i & 1) != 0,
               .normally_closed = row->normally_closed};
    actions_[i] = row->action;
    if (row->action != InputAction::none) assigned_ |= bit(row->action);
  }
}

std::uint16_t InputFunctions::update(std::uint32_t wires) {
  const auto on = static_cast<std::uint16_t>((~(wires ^ polarity_) | simulation_) & exists_);
  active_ = 0;
  if (assigned_ == 0) return on;
  for (std::size_t i = 0; i < max_inputs; ++i) {
    if ((on >> i & 1) != 0 && actions_[i] != InputAction::none) active_ |= bit(actions_[i]);
  }
  return on;
}

}  // namespace servodrome::drive
