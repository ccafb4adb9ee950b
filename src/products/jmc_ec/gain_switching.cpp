#include "products/jmc_ec/gain_switching.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::products::jmc_ec {

double GainSwitching::change_of(double speed_command) {
  const double change = std::abs(speed_command - speed_commands_[next_]);
  speed_commands_[next_] = speed_command;
  next_ = next_ + 1 == change_cycles ? 0 : next_ + 1;
  return change;
}

// Becomes true above level + hysteresis, and false below level - hysteresis.
bool GainSwitching::wants_second(const Settings& settings, const Inputs& inputs) const {
  const double hysteresis = std::min(settings.hysteresis, settings.level);
  const auto large = [&](double value) {
    return set_ == 0 ? value > settings.level + hysteresis : value > settings.level - hysteresis;
  };
  switch (settings.mode) {
    case SwitchingMode::first: return false;
    case SwitchingMode::second: return true;
    case SwitchingMode::input: return inputs.input;
    case SwitchingMode::torque_command: return large(inputs.torque_command);
    case SwitchingMode::speed_command_change: return large(change_);
    case SwitchingMode::speed_command: return large(std::abs(inputs.speed_command));
    case SwitchingMode::position_deviation: return large(inputs.position_deviation);
    case SwitchingMode::position_command: return inputs.position_command;
    case SwitchingMode::positioning_incomplete: return !inputs.positioned;
    case SwitchingMode::actual_speed: return large(inputs.actual_speed);
    case SwitchingMode::command_and_speed: return inputs.position_command || (set_ == 1 && large(inputs.actual_speed));
  }
  return false;
}

bool GainSwitching::update(const Settings& settings, const Inputs& inputs) {
  change_ = change_of(inputs.speed_command);
  const std::size_t set_before = set_;
  const double blend_before = blend_;
  if (wants_second(settings, inputs)) {
    set_ = 1;
    waited_ = 0;
  } else if (set_ == 1) {
    // The delay applies only to modes that measure a condition, not to modes that name the set or use an input.
    const bool found = settings.mode >= SwitchingMode::torque_command;
    if (!found || waited_++ >= settings.delay_cycles) set_ = 0;
  }
  const double end = set_ == 1 ? 1.0 : 0.0;
  const double step = settings.blend_cycles == 0 ? 1.0 : 1.0 / settings.blend_cycles;
  blend_ = end > blend_ ? std::min(blend_ + step, end) : std::max(blend_ - step, end);
  return set_ != set_before || blend_ != blend_before;
}

}  // namespace servodrome::products::jmc_ec
