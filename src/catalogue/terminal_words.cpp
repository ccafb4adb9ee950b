#include "catalogue/terminal_words.hpp"

#include <algorithm>
#include <array>

#include "catalogue/product.hpp"

namespace servodrome::catalogue {
namespace {

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
    TerminalWords{0x60FD, 0, 0, terminal_sets::inputs},
    TerminalWords{0x60FE, 1, 2, terminal_sets::outputs},
    TerminalWords{0x60B8, 0, 0, terminal_sets::probes, "bits", probe_function},
    TerminalWords{0x60B9, 0, 0, terminal_sets::probes, "bits", probe_status},
    TerminalWords{0x60BA, 0, 0, terminal_sets::probes},
    TerminalWords{0x60BB, 0, 0, terminal_sets::probes},
    TerminalWords{0x60BC, 0, 0, terminal_sets::probes},
    TerminalWords{0x60BD, 0, 0, terminal_sets::probes},
    TerminalWords{0x60D0, 1, 2, terminal_sets::probes, "enumeration", probe_source},
};

}  // namespace

const TerminalWords* find_terminal(std::string_view product, std::uint16_t index, std::uint8_t sub) {
  const auto find = [index, sub](std::span<const TerminalWords> words) -> const TerminalWords* {
    const auto found = std::find_if(words.begin(), words.end(), [index, sub](const TerminalWords& one) {
      return one.index == index && sub >= one.first_sub && sub <= one.last_sub;
    });
    return found != words.end() ? &*found : nullptr;
  };
  if (const TerminalWords* found = find(standard)) return found;
  return find(product_of(product).terminal_words);
}

}  // namespace servodrome::catalogue
