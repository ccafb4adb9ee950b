#include "tools/sniff/summary.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/number_text.hpp"
#include "master/error.hpp"

namespace servodrome::master {

void SniffSummary::count(const Decoded& decoded) {
  ++kinds[static_cast<std::size_t>(decoded.kind)];
  if (!decoded.source.empty()) ++sources[decoded.source];
  if (decoded.error) ++errors;
}

void SniffSummary::count_frame(Time time, unsigned bits) {
  ++frames;
  wire_bits += bits;
  if (!first) first = time;
  last = std::max(last, time);
}

std::optional<double> SniffSummary::bus_load(std::uint32_t bit_rate) const {
  if (seconds() <= 0) return std::nullopt;
  return 100.0 * static_cast<double>(wire_bits) / (seconds() * bit_rate);
}

void SniffFilter::add(std::string_view word, const ObjectCatalogue& catalogue) {
  const std::string where = fmt::format("filter \"{}\"", word);
  const std::size_t equals = word.find('=');
  const std::string_view key = word.substr(0, equals);
  if (equals == std::string_view::npos || (key != "node" && key != "kind" && key != "object")) {
    throw MasterError("this is not a filter", where,
                      "write node=N, kind=KIND or object=OBJECT; several values with commas");
  }
  std::string_view rest = word.substr(equals + 1);
  for (bool more = true; more;) {
    const std::size_t comma = rest.find(',');
    const std::string_view one = rest.substr(0, comma);
    more = comma != std::string_view::npos;
    rest = more ? rest.substr(comma + 1) : std::string_view{};
    if (key == "node") {
      const auto node = links::number_of_text<unsigned>(one);
      if (!node) {
        throw MasterError(fmt::format("\"{}\" is not a node-ID or position", one), where, "write a decimal number");
      }
      nodes.push_back(*node);
    } else if (key == "kind") {
      const auto kind = parse_frame_kind(one);
      if (!kind) {
        std::string known;
        for (std::size_t i = 0; i < frame_kinds; ++i) {
          known += fmt::format("{}{}", i == 0 ? "" : ", ", name(static_cast<FrameKind>(i)));
        }
        throw MasterError(fmt::format("there is no kind \"{}\"", one), where, "write one of " + known);
      }
      kinds.push_back(*kind);
    } else {
      objects.push_back({catalogue.resolve(one), one.find(':') == std::string_view::npos});
    }
  }
}

bool SniffFilter::passes(const Decoded& decoded) const {
  if (!nodes.empty() && (!decoded.node || std::find(nodes.begin(), nodes.end(), *decoded.node) == nodes.end())) {
    return false;
  }
  if (!kinds.empty() && std::find(kinds.begin(), kinds.end(), decoded.kind) == kinds.end()) return false;
  return objects.empty() || std::any_of(objects.begin(), objects.end(), [&](const Object& object) {
           return decoded.names(object.address, object.whole);
         });
}

}  // namespace servodrome::master
