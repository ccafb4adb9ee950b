#include "studio/line_routes.hpp"

#include "studio/commissioning.hpp"

namespace servodrome::studio {

std::vector<line::bench::RouteGroup> LineRoutes::groups() {
  std::vector<line::bench::RouteGroup> groups = commissioning_routes();
  groups.insert(groups.end(), {jobs_.routes(), bode_plots_.routes(), recording_export_.routes(), traffic_.routes()});
  return groups;
}

}  // namespace servodrome::studio
