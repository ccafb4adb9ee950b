#pragma once

#include <array>
#include <span>

#include "tools/conform/check.hpp"

// One table for each subject of the standards, each in its own file.
namespace servodrome::master::conform {

std::span<const Check> identity_checks();
std::span<const Check> abort_checks();
std::span<const Check> sdo_checks();
std::span<const Check> block_checks();
std::span<const Check> power_checks();
std::span<const Check> mode_checks();
std::span<const Check> profile_position_checks();
std::span<const Check> velocity_checks();
std::span<const Check> cyclic_checks();
std::span<const Check> touch_probe_checks();
std::span<const Check> homing_checks();
std::span<const Check> fault_checks();
std::span<const Check> pdo_checks();
std::span<const Check> time_checks();
std::span<const Check> nmt_checks();
std::span<const Check> lss_checks();
std::span<const Check> al_state_checks();
std::span<const Check> mailbox_checks();
std::span<const Check> coe_checks();
std::span<const Check> foe_checks();
std::span<const Check> modbus_checks();

// In the order of execution.
inline constexpr std::array check_tables{identity_checks,
                                         abort_checks,
                                         sdo_checks,
                                         block_checks,
                                         power_checks,
                                         mode_checks,
                                         profile_position_checks,
                                         velocity_checks,
                                         cyclic_checks,
                                         touch_probe_checks,
                                         homing_checks,
                                         fault_checks,
                                         pdo_checks,
                                         time_checks,
                                         nmt_checks,
                                         lss_checks,
                                         al_state_checks,
                                         mailbox_checks,
                                         coe_checks,
                                         foe_checks,
                                         modbus_checks};

}  // namespace servodrome::master::conform
