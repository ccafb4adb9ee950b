#pragma once

#include <functional>
#include <vector>

#include "scenario/routes.hpp"
#include "studio/bode_routes.hpp"
#include "studio/change_routes.hpp"
#include "studio/commissioning.hpp"
#include "studio/jobs.hpp"
#include "studio/line_changes.hpp"
#include "studio/project/routes.hpp"
#include "studio/traffic.hpp"
#include "studio/trial_routes.hpp"

namespace servodrome::studio {

// All routes of this library for a line: jobs, parameters, PDO mappings, changes, traffic, frequency responses,
// scenarios, and the project.
class LineRoutes {
 public:
  // `line` and `project` must outlive this object; nullptr: there is no project. `epoch` returns the wall-clock time of
  // the line's time 0.
  LineRoutes(line::Line& line, const api::FindRecording& find, const std::function<line::Time()>& epoch,
             Project* project = nullptr)
      : changes_(line),
        jobs_(line),
        subjects_(line),
        change_routes_(changes_.log(), subjects_),
        project_(project),
        bode_plots_(find),
        scenario_(line),
        trial_(line, scenario_),
        traffic_([&line](const api::Call& call) { return find_line_traffic(line, call); }, epoch) {}

  Jobs& jobs() { return jobs_.jobs(); }
  api::ChangeLog& changes() { return changes_.log(); }
  const ProjectRoutes& project() const { return project_; }
  // `publish` gets the events for the stream.
  void on_event(const std::function<void(const api::Json& event)>& publish) {
    jobs().on_event(publish);
    project_.on_event(publish);
  }
  // The groups refer to this object.
  std::vector<api::RouteGroup> groups();

 private:
  LineChanges changes_;
  LineJobs jobs_;
  LineSubjects subjects_;
  ChangeRoutes change_routes_;
  ProjectRoutes project_;
  BodePlots bode_plots_;
  scenario::Routes scenario_;
  TrialRoutes trial_;
  Traffic traffic_;
};

}  // namespace servodrome::studio
