#pragma once

#include <array>

#include "ethercat/esc/registers.hpp"

namespace servodrome::ethercat {

// Blocks of 16 register bytes whose values are computed when they are read.
inline constexpr auto live_register_blocks = [] {
  std::array<bool, reg::process_memory / 16> blocks{};
  for (const unsigned address : {reg::reset_ecat, reg::ecat_event_request, reg::al_event_request, reg::watchdog_status,
                                 reg::sii_configuration, reg::system_time, reg::system_time_difference,
                                 reg::speed_counter_start, reg::cyclic_unit_control, reg::sync_start_time}) {
    blocks[address / 16] = true;
  }
  for (unsigned address = reg::sync_manager; address < reg::sync_manager + 8 * reg::sync_managers; address += 16) {
    blocks[address / 16] = true;
  }
  return blocks;
}();

}  // namespace servodrome::ethercat
