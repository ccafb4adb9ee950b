#pragma once

#include <array>

#include "catalogue/terminal_words.hpp"

namespace servodrome::catalogue::ismk {

// Function words of the inputs (manual, ch. 7.9).
inline constexpr auto input_functions = std::to_array<NamedNumber>({
    {0, "none"},
    {0x0001, "Enable"},
    {0x0002, "Reset errors"},
    {0x0004, "Operate mode control"},
    {0x0008, "Kvi off"},
    {0x0010, "Positive limit"},
    {0x0020, "Negative limit"},
    {0x0040, "Home signal"},
    {0x0080, "Invert direction"},
    {0x0100, "Din speed index 0"},
    {0x0200, "Din speed index 1"},
    {0x0400, "Din position index 0"},
    {0x0800, "Din position index 1"},
    {0x1000, "Quick stop"},
    {0x2000, "Start homing"},
    {0x4000, "Activate command"},
    {0x8001, "Din speed index 2"},
    {0x8002, "Din position index 2"},
    {0x8004, "Multi-function input 0"},
    {0x8008, "Multi-function input 1"},
    {0x8010, "Multi-function input 2"},
    {0x8020, "Gain switching 0"},
    {0x8040, "Gain switching 1"},
    {0x8080, "Maximum current switch"},
    {0x8100, "Motor error"},
    {0x8200, "Pre-enable"},
    {0x8400, "Fast capture 1"},
    {0x8800, "Fast capture 2"},
});
// Function words of the outputs (manual, ch. 7.9).
inline constexpr auto output_functions = std::to_array<NamedNumber>({
    {0, "none"},
    {0x0001, "Ready"},
    {0x0002, "Error"},
    {0x0004, "Motor position reached"},
    {0x0008, "Motor zero speed"},
    {0x0010, "Motor brake"},
    {0x0020, "Motor speed reached"},
    {0x0040, "Index signal appears"},
    {0x0080, "Speed limit"},
    {0x0100, "Driver enabled"},
    {0x0200, "Position limit"},
    {0x0400, "Home found"},
    {0x0800, "Torque reached limit"},
    {0x1000, "Multi-function signal 0"},
    {0x2000, "Multi-function signal 1"},
    {0x4000, "Multi-function signal 2"},
    {0x8001, "STO active"},
});
inline constexpr auto input_words = std::to_array<NamedNumber>({{0, "DI1 is on"},
                                                                {1, "DI2 is on"},
                                                                {2, "DI3 is on"},
                                                                {3, "DI4 is on"},
                                                                {4, "DI5 is on"},
                                                                {5, "DI6 is on"},
                                                                {6, "DI7 is on"},
                                                                {7, "DI8 is on"}});
inline constexpr auto input_polarity = std::to_array<NamedNumber>({{0, "DI1 as it is wired, not inverted"},
                                                                   {1, "DI2 as it is wired, not inverted"},
                                                                   {2, "DI3 as it is wired, not inverted"},
                                                                   {3, "DI4 as it is wired, not inverted"},
                                                                   {4, "DI5 as it is wired, not inverted"},
                                                                   {5, "DI6 as it is wired, not inverted"},
                                                                   {6, "DI7 as it is wired, not inverted"},
                                                                   {7, "DI8 as it is wired, not inverted"}});
inline constexpr auto input_simulation = std::to_array<NamedNumber>({{0, "DI1 is simulated"},
                                                                     {1, "DI2 is simulated"},
                                                                     {2, "DI3 is simulated"},
                                                                     {3, "DI4 is simulated"},
                                                                     {4, "DI5 is simulated"},
                                                                     {5, "DI6 is simulated"},
                                                                     {6, "DI7 is simulated"},
                                                                     {7, "DI8 is simulated"}});
inline constexpr auto output_words = std::to_array<NamedNumber>(
    {{0, "OUT1 is on"}, {1, "OUT2 is on"}, {2, "OUT3 is on"}, {3, "OUT4 is on"}, {4, "OUT5 is on"}});
inline constexpr auto output_polarity = std::to_array<NamedNumber>({{0, "OUT1 not inverted"},
                                                                    {1, "OUT2 not inverted"},
                                                                    {2, "OUT3 not inverted"},
                                                                    {3, "OUT4 not inverted"},
                                                                    {4, "OUT5 not inverted"}});
inline constexpr auto output_simulation = std::to_array<NamedNumber>({{0, "OUT1 is simulated"},
                                                                      {1, "OUT2 is simulated"},
                                                                      {2, "OUT3 is simulated"},
                                                                      {3, "OUT4 is simulated"},
                                                                      {4, "OUT5 is simulated"}});
inline constexpr std::array terminal_words{
    TerminalWords{0x2010, 0x0A, 0x0A, terminal_sets::inputs, "bits", input_words},
    TerminalWords{0x2010, 0x03, 0x07, terminal_sets::input_functions, "enumeration", input_functions},
    TerminalWords{0x2010, 0x01, 0x01, terminal_sets::input_functions, "bits", input_polarity},
    TerminalWords{0x2010, 0x02, 0x02, terminal_sets::input_functions, "bits", input_simulation},
    TerminalWords{0x2010, 0x14, 0x14, terminal_sets::outputs, "bits", output_words},
    TerminalWords{0x2010, 0x0F, 0x10, terminal_sets::output_functions, "enumeration", output_functions},
    TerminalWords{0x2010, 0x0D, 0x0D, terminal_sets::output_functions, "bits", output_polarity},
    TerminalWords{0x2010, 0x0E, 0x0E, terminal_sets::output_functions, "bits", output_simulation},
};

}  // namespace servodrome::catalogue::ismk
