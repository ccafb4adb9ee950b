#include "line/bench/terminal_words.hpp"

#include <algorithm>
#include <array>

#include "products/ismk/terminals.hpp"

namespace servodrome::line::bench {
namespace {

constexpr std::string_view inputs = "Inputs";
constexpr std::string_view input_functions = "Functions of the inputs";
constexpr std::string_view outputs = "Outputs";
constexpr std::string_view output_functions = "Functions of the outputs";
constexpr std::string_view probes = "Touch probes";

// CiA 402-2, clause 12.
constexpr auto probe_function = std::to_array<NamedNumber>({{0, "probe 1 on"},
                                                            {1, "probe 1: each event, not the first only"},
                                                            {2, "probe 1: at the index, not at its input"},
                                                            {4, "probe 1: positive edge"},
                                                            {5, "probe 1: negative edge"},
                                                            {8, "probe 2 on"},
                                                            {9, "probe 2: each event, not the first only"},
                                                            {10, "probe 2: at the index, not at its input"},
                                                            {12, "probe 2: positive edge"},
                                                            {13, "probe 2: negative edge"}});
constexpr auto probe_status = std::to_array<NamedNumber>({{0, "probe 1 is on"},
                                                          {1, "probe 1 has a positive edge's position"},
                                                          {2, "probe 1 has a negative edge's position"},
                                                          {8, "probe 2 is on"},
                                                          {9, "probe 2 has a positive edge's position"},
                                                          {10, "probe 2 has a negative edge's position"}});
constexpr auto probe_source = std::to_array<NamedNumber>(
    {{1, "input of probe 1"}, {2, "input of probe 2"}, {5, "index, by hardware"}, {6, "index, by software"}});
constexpr std::array standard{
    TerminalWords{0x60FD, 0, 0, inputs},
    TerminalWords{0x60FE, 1, 2, outputs},
    TerminalWords{0x60B8, 0, 0, probes, "bits", probe_function},
    TerminalWords{0x60B9, 0, 0, probes, "bits", probe_status},
    TerminalWords{0x60BA, 0, 0, probes},
    TerminalWords{0x60BB, 0, 0, probes},
    TerminalWords{0x60BC, 0, 0, probes},
    TerminalWords{0x60BD, 0, 0, probes},
    TerminalWords{0x60D0, 1, 2, probes, "enumeration", probe_source},
};

// 2F12h of src/products/ismc/README.md.
constexpr auto ismc_functions = std::to_array<NamedNumber>({{0, "none"},
                                                            {1, "negative limit switch"},
                                                            {2, "positive limit switch"},
                                                            {3, "home switch"},
                                                            {4, "external alarm"},
                                                            {5, "motor temperature contact"}});
constexpr auto four_outputs = std::to_array<NamedNumber>(
    {{0, "DO0 is set by 60FEh"}, {1, "DO1 is set by 60FEh"}, {2, "DO2 is set by 60FEh"}, {3, "DO3 is set by 60FEh"}});
constexpr std::array ismc{
    TerminalWords{0x2F12, 1, 6, input_functions, "enumeration", ismc_functions},
    TerminalWords{0x2F13, 0, 0, output_functions, "bits", four_outputs},
};

// Pn509 to Pn517 of src/products/pronet/README.md: a hexadecimal digit for each terminal.
constexpr std::array pronet{
    TerminalWords{0x3081, 0, 0, input_functions}, TerminalWords{0x3082, 0, 0, input_functions},
    TerminalWords{0x3084, 0, 0, input_functions}, TerminalWords{0x3085, 0, 0, input_functions},
    TerminalWords{0x3086, 0, 0, input_functions}, TerminalWords{0x3088, 0, 0, input_functions},
    TerminalWords{0x3089, 0, 0, input_functions},
};

// 2030h and 2031h of src/products/generic402/README.md.
constexpr auto reference_functions = std::to_array<NamedNumber>({{0, "none"},
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
constexpr auto eight_inverted = std::to_array<NamedNumber>({{0, "DI0 is inverted"},
                                                            {1, "DI1 is inverted"},
                                                            {2, "DI2 is inverted"},
                                                            {3, "DI3 is inverted"},
                                                            {4, "DI4 is inverted"},
                                                            {5, "DI5 is inverted"},
                                                            {6, "DI6 is inverted"},
                                                            {7, "DI7 is inverted"}});
constexpr std::array reference{
    TerminalWords{0x2030, 1, 8, input_functions, "enumeration", reference_functions},
    TerminalWords{0x2031, 0, 0, input_functions, "bits", eight_inverted},
};

// Ch. 7.9 of the iSMK manual; the names come from the drive's own table.
template <typename Rows>
constexpr auto named(const Rows& rows) {
  std::array<NamedNumber, std::tuple_size_v<Rows> + 1> words{};
  words[0] = {0, "none"};
  for (std::size_t i = 0; i < rows.size(); ++i) words[i + 1] = {rows[i].code, rows[i].name};
  return words;
}
constexpr auto ismk_inputs = named(products::ismk::input_functions);
constexpr auto ismk_outputs = named(products::ismk::output_functions);
constexpr auto ismk_input_words = std::to_array<NamedNumber>({{0, "DI1 is on"},
                                                              {1, "DI2 is on"},
                                                              {2, "DI3 is on"},
                                                              {3, "DI4 is on"},
                                                              {4, "DI5 is on"},
                                                              {5, "DI6 is on"},
                                                              {6, "DI7 is on"},
                                                              {7, "DI8 is on"}});
constexpr auto ismk_input_polarity = std::to_array<NamedNumber>({{0, "DI1 as it is wired, not inverted"},
                                                                 {1, "DI2 as it is wired, not inverted"},
                                                                 {2, "DI3 as it is wired, not inverted"},
                                                                 {3, "DI4 as it is wired, not inverted"},
                                                                 {4, "DI5 as it is wired, not inverted"},
                                                                 {5, "DI6 as it is wired, not inverted"},
                                                                 {6, "DI7 as it is wired, not inverted"},
                                                                 {7, "DI8 as it is wired, not inverted"}});
constexpr auto ismk_input_simulation = std::to_array<NamedNumber>({{0, "DI1 is simulated"},
                                                                   {1, "DI2 is simulated"},
                                                                   {2, "DI3 is simulated"},
                                                                   {3, "DI4 is simulated"},
                                                                   {4, "DI5 is simulated"},
                                                                   {5, "DI6 is simulated"},
                                                                   {6, "DI7 is simulated"},
                                                                   {7, "DI8 is simulated"}});
constexpr auto ismk_output_words = std::to_array<NamedNumber>(
    {{0, "OUT1 is on"}, {1, "OUT2 is on"}, {2, "OUT3 is on"}, {3, "OUT4 is on"}, {4, "OUT5 is on"}});
constexpr auto ismk_output_polarity = std::to_array<NamedNumber>({{0, "OUT1 not inverted"},
                                                                  {1, "OUT2 not inverted"},
                                                                  {2, "OUT3 not inverted"},
                                                                  {3, "OUT4 not inverted"},
                                                                  {4, "OUT5 not inverted"}});
constexpr auto ismk_output_simulation = std::to_array<NamedNumber>({{0, "OUT1 is simulated"},
                                                                    {1, "OUT2 is simulated"},
                                                                    {2, "OUT3 is simulated"},
                                                                    {3, "OUT4 is simulated"},
                                                                    {4, "OUT5 is simulated"}});
constexpr std::array ismk{
    TerminalWords{0x2010, 0x0A, 0x0A, inputs, "bits", ismk_input_words},
    TerminalWords{0x2010, 0x03, 0x07, input_functions, "enumeration", ismk_inputs},
    TerminalWords{0x2010, 0x01, 0x01, input_functions, "bits", ismk_input_polarity},
    TerminalWords{0x2010, 0x02, 0x02, input_functions, "bits", ismk_input_simulation},
    TerminalWords{0x2010, 0x14, 0x14, outputs, "bits", ismk_output_words},
    TerminalWords{0x2010, 0x0F, 0x10, output_functions, "enumeration", ismk_outputs},
    TerminalWords{0x2010, 0x0D, 0x0D, output_functions, "bits", ismk_output_polarity},
    TerminalWords{0x2010, 0x0E, 0x0E, output_functions, "bits", ismk_output_simulation},
};

// P06 of the JMC manual (Table 65, ch. 8.2.7), at the service port.
constexpr auto levels = std::to_array<NamedNumber>({{0, "active while low"}, {1, "active while high"}});
constexpr std::array jmc{
    TerminalWords{0x2006, 1, 1, input_functions},
    TerminalWords{0x2006, 21, 21, output_functions, "enumeration", levels},
    TerminalWords{0x2006, 23, 23, output_functions, "enumeration", levels},
};

struct OfProduct {
  std::string_view product;
  std::span<const TerminalWords> words;
};
constexpr std::array products_words{OfProduct{"ismc", ismc},
                                    OfProduct{"pronet", pronet},
                                    OfProduct{"generic402", reference},
                                    OfProduct{"generic402-ec", reference},
                                    OfProduct{"ismk", ismk},
                                    OfProduct{"ismk-ea", ismk},
                                    OfProduct{"jmc_ec", jmc}};

}  // namespace

const TerminalWords* find_terminal(std::string_view product, std::uint16_t index, std::uint8_t sub) {
  const auto find = [index, sub](std::span<const TerminalWords> words) -> const TerminalWords* {
    const auto found = std::find_if(words.begin(), words.end(), [index, sub](const TerminalWords& one) {
      return one.index == index && sub >= one.first_sub && sub <= one.last_sub;
    });
    return found != words.end() ? &*found : nullptr;
  };
  if (const TerminalWords* found = find(standard)) return found;
  for (const OfProduct& row : products_words) {
    if (row.product == product) return find(row.words);
  }
  return nullptr;
}

}  // namespace servodrome::line::bench
