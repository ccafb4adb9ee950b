#pragma once

#include <array>

#include "catalogue/terminal_words.hpp"

namespace servodrome::catalogue::jmc_ec {

// P06 of the JMC manual (Table 65, ch. 8.2.7), at the service port.
inline constexpr auto levels = std::to_array<NamedNumber>({{0, "active while low"}, {1, "active while high"}});
inline constexpr std::array terminal_words{
    TerminalWords{0x2006, 1, 1, terminal_sets::input_functions},
    TerminalWords{0x2006, 21, 21, terminal_sets::output_functions, "enumeration", levels},
    TerminalWords{0x2006, 23, 23, terminal_sets::output_functions, "enumeration", levels},
};

}  // namespace servodrome::catalogue::jmc_ec
