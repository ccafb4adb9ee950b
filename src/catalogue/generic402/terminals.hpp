#pragma once

#include <array>

#include "catalogue/terminal_words.hpp"

namespace servodrome::catalogue::generic402 {

// 2030h and 2031h of src/products/generic402/README.md.
inline constexpr auto reference_functions = std::to_array<NamedNumber>({{0, "none"},
                                                                        {1, "negative limit switch"},
                                                                        {2, "positive limit switch"},
                                                                        {3, "home switch"},
                                                                        {4, "index"},
                                                                        {5, "touch probe 1"},
                                                                        {6, "touch probe 2"},
                                                                        {7, "external fault"},
                                                                        {8, "motor temperature contact"},
                                                                        {9, "quick stop"},
                                                                        {10, "interlock"}});
inline constexpr auto eight_inverted = std::to_array<NamedNumber>({{0, "DI0 is inverted"},
                                                                   {1, "DI1 is inverted"},
                                                                   {2, "DI2 is inverted"},
                                                                   {3, "DI3 is inverted"},
                                                                   {4, "DI4 is inverted"},
                                                                   {5, "DI5 is inverted"},
                                                                   {6, "DI6 is inverted"},
                                                                   {7, "DI7 is inverted"}});
inline constexpr std::array terminal_words{
    TerminalWords{0x2030, 1, 8, terminal_sets::input_functions, "enumeration", reference_functions},
    TerminalWords{0x2031, 0, 0, terminal_sets::input_functions, "bits", eight_inverted},
};

}  // namespace servodrome::catalogue::generic402
