#include "capi/open_line.hpp"

#include <algorithm>

namespace servodrome::capi {

OpenLine::OpenLine(const line::LineSettings& settings, std::string its_warnings)
    : warnings(std::move(its_warnings)),
      line(settings),
      routes(
          line, [this](std::uint32_t id) { return scope.scope().recordings().find(id); }, [] { return Time{}; }),
      groups(routes.groups()) {
  groups.push_back({api::recording_routes(), &scope.scope()});
}

std::size_t OpenLine::run_until_ready(Time end, const std::vector<Port*>& ports) {
  for (;;) {
    Time latest = end;
    for (std::size_t i = 0; i < ports.size(); ++i) {
      if (ports[i]->ready(line.now())) return i;
      latest = std::min(latest, ports[i]->arrival());
    }
    if (line.now() >= end) return ports.size();
    line.step(latest);
  }
}

}  // namespace servodrome::capi
