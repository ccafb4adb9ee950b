#include "axis/cyclic/lost_master.hpp"

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"

namespace servodrome::master {
bool react_to_lost_master(EthercatSlave& slave) {
  try {
    if (slave.coe().read<std::int16_t>(abort_connection_option) != no_action_at_abort) return false;
    slave.coe().write<std::int16_t>(abort_connection_option, 0, malfunction_at_abort);
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
    if (operates(state_of(slave_.coe().read<std::uint16_t>(0x6041)))) return false;
    slave_.coe().write<std::int16_t>(abort_connection_option, 0, no_action_at_abort);
    changed_ = false;
    return true;
  } catch (...) {
    return false;  // the drive does not answer
  }
}

}  // namespace servodrome::master
