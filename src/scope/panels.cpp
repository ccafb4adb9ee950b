#include <algorithm>
#include <cmath>

#include "scope/files.hpp"

namespace servodrome::scope {

std::vector<std::vector<std::size_t>> panels_of(const std::vector<Channel>& channels) {
  std::vector<std::vector<std::size_t>> panels;
  for (std::size_t i = 0; i < channels.size(); ++i) {
    const auto same_unit = [&](const std::vector<std::size_t>& panel) {
      return !channels[i].unit.empty() && channels[panel.front()].unit == channels[i].unit;
    };
    const auto panel = std::find_if(panels.begin(), panels.end(), same_unit);
    if (panel != panels.end()) {
      panel->push_back(i);
    } else {
      panels.push_back({i});
    }
  }
  return panels;
}

Ticks round_ticks(double least, double greatest, unsigned wanted) {
  const double span = greatest - least;
  if (!(span > 0) || wanted == 0) return {.step = 1, .at = {least}};
  const double raw = span / wanted;
  const double decade = std::pow(10.0, std::floor(std::log10(raw)));
  Ticks ticks{.step = 10 * decade};
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * decade >= raw * (1 - 1e-9)) {
      ticks.step = factor * decade;
      break;
    }
  }
  const auto first = static_cast<std::int64_t>(std::ceil(least / ticks.step - 1e-9));
  const auto last = static_cast<std::int64_t>(std::floor(greatest / ticks.step + 1e-9));
  for (std::int64_t i = first; i <= last; ++i) ticks.at.push_back(static_cast<double>(i) * ticks.step);
  return ticks;
}

}  // namespace servodrome::scope
