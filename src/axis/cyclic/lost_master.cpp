#include "axis/cyclic/lost_master.hpp"

#include "axis/axis402.hpp"

namespace servodrome::master {
namespace {

constexpr std::uint16_t abort_connection_option = 0x6007;
constexpr std::int16_t no_action = 0;
constexpr std::int16_t malfunction = 1;

bool has_power(PowerState state) {
  return state == PowerState::operation_enabled || state == PowerState::quick_stop_active ||
         state == PowerState::fault_reaction_active;
}

}  // namespace

bool react_to_lost_master(EthercatSlave& slave) {
  try {
    if (slave.coe().read<std::int16_t>(abort_connection_option) != no_action) return false;
    slave.coe().write<std::int16_t>(abort_connection_option, 0, malfunction);
    return true;
  } catch (const CoeError& error) {
    if (!error.from_slave()) throw;
    return false;
  }
}

void LostMasterReaction::begin() {
  if (react_to_lost_master(slave_)) changed_ = true;
}

bool LostMasterReaction::end() noexcept {
  if (!changed_) return true;
  try {
    if (has_power(state_of(slave_.coe().read<std::uint16_t>(0x6041)))) return false;
    slave_.coe().write<std::int16_t>(abort_connection_option, 0, no_action);
    changed_ = false;
    return true;
  } catch (...) {
    return false;  // the drive does not answer
  }
}

}  // namespace servodrome::master
