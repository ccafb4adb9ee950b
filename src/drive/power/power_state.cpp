#include "drive/power/power_state.hpp"

namespace servodrome::drive {

const char* name(PowerState state) {
  switch (state) {
    case PowerState::not_ready_to_switch_on: return "not ready to switch on";
    case PowerState::switch_on_disabled: return "switch on disabled";
    case PowerState::ready_to_switch_on: return "ready to switch on";
    case PowerState::switched_on: return "switched on";
    case PowerState::operation_enabled: return "operation enabled";
    case PowerState::quick_stop_active: return "quick stop active";
    case PowerState::fault_reaction_active: return "fault reaction active";
    case PowerState::fault: return "fault";
  }
  return "unknown";
}

}  // namespace servodrome::drive
