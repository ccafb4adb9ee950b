#pragma once

#include <array>

#include "catalogue/terminal_words.hpp"

namespace servodrome::catalogue::ismc {

// 2F12h of src/products/ismc/README.md.
inline constexpr auto ismc_functions = std::to_array<NamedNumber>({{0, "none"},
                                                                   {1, "negative limit switch"},
                                                                   {2, "positive limit switch"},
                                                                   {3, "home switch"},
                                                                   {4, "external alarm"},
                                                                   {5, "motor temperature contact"}});
inline constexpr auto four_outputs = std::to_array<NamedNumber>(
    {{0, "DO0 is set by 60FEh"}, {1, "DO1 is set by 60FEh"}, {2, "DO2 is set by 60FEh"}, {3, "DO3 is set by 60FEh"}});
inline constexpr std::array terminal_words{
    TerminalWords{0x2F12, 1, 6, terminal_sets::input_functions, "enumeration", ismc_functions},
    TerminalWords{0x2F13, 0, 0, terminal_sets::output_functions, "bits", four_outputs},
};

}  // namespace servodrome::catalogue::ismc
