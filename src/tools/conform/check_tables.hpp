#pragma once

#include <array>
#include <span>

#include "tools/conform/check.hpp"

// One table for each subject of the standards, each in its own file, together with its functions in a namespace of its
// own.
namespace servodrome::master::conform {

namespace identity_group {
std::span<const Check> checks();
}
namespace abort_group {
std::span<const Check> checks();
}
namespace sdo_group {
std::span<const Check> checks();
}
namespace block_group {
std::span<const Check> checks();
}
namespace power_group {
std::span<const Check> checks();
}
namespace mode_group {
std::span<const Check> checks();
}
namespace profile_position_group {
std::span<const Check> checks();
}
namespace velocity_group {
std::span<const Check> checks();
}
namespace cyclic_group {
std::span<const Check> checks();
}
namespace touch_probe_group {
std::span<const Check> checks();
}
namespace homing_group {
std::span<const Check> checks();
}
namespace fault_group {
std::span<const Check> checks();
}
namespace pdo_group {
std::span<const Check> checks();
}
namespace time_group {
std::span<const Check> checks();
}
namespace nmt_group {
std::span<const Check> checks();
}
namespace lss_group {
std::span<const Check> checks();
}
namespace al_state_group {
std::span<const Check> checks();
}
namespace mailbox_group {
std::span<const Check> checks();
}
namespace coe_group {
std::span<const Check> checks();
}
namespace foe_group {
std::span<const Check> checks();
}
namespace modbus_group {
std::span<const Check> checks();
}

// In the order of execution.
inline constexpr std::array check_tables{identity_group::checks,
                                         abort_group::checks,
                                         sdo_group::checks,
                                         block_group::checks,
                                         power_group::checks,
                                         mode_group::checks,
                                         profile_position_group::checks,
                                         velocity_group::checks,
                                         cyclic_group::checks,
                                         touch_probe_group::checks,
                                         homing_group::checks,
                                         fault_group::checks,
                                         pdo_group::checks,
                                         time_group::checks,
                                         nmt_group::checks,
                                         lss_group::checks,
                                         al_state_group::checks,
                                         mailbox_group::checks,
                                         coe_group::checks,
                                         foe_group::checks,
                                         modbus_group::checks};

}  // namespace servodrome::master::conform
