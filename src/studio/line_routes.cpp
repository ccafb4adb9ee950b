#include "studio/line_routes.hpp"

namespace servodrome::studio {

std::vector<api::RouteGroup> LineRoutes::groups() {
  return {jobs_.routes(),       parameter_routes(subjects_), pdo_routes(subjects_), change_routes_.group(),
          bode_plots_.routes(), traffic_.routes(),           scenario_.group(),     trial_.group(),
          project_.group()};
}

}  // namespace servodrome::studio
