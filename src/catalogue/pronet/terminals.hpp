#pragma once

#include <array>

#include "catalogue/terminal_words.hpp"

namespace servodrome::catalogue::pronet {

// Pn509 to Pn517 of src/products/pronet/README.md: a hexadecimal digit for each terminal.
inline constexpr std::array terminal_words{
    TerminalWords{0x3081, 0, 0, terminal_sets::input_functions},
    TerminalWords{0x3082, 0, 0, terminal_sets::input_functions},
    TerminalWords{0x3084, 0, 0, terminal_sets::input_functions},
    TerminalWords{0x3085, 0, 0, terminal_sets::input_functions},
    TerminalWords{0x3086, 0, 0, terminal_sets::input_functions},
    TerminalWords{0x3088, 0, 0, terminal_sets::input_functions},
    TerminalWords{0x3089, 0, 0, terminal_sets::input_functions},
};

}  // namespace servodrome::catalogue::pronet
