#pragma once

#include <functional>

#include "api/routes.hpp"
#include "studio/project/project.hpp"

namespace servodrome::studio {

// The project over the API: docs/bench-api.md, "Project".
class ProjectRoutes {
 public:
  // Gets the events of the stream: a state of the page, or the problem of the project, has changed.
  using Publish = std::function<void(const api::Json& event)>;

  // `project` must outlive this object; nullptr: the server has no project.
  explicit ProjectRoutes(Project* project) : project_(project) {}

  void on_event(Publish publish) { publish_ = std::move(publish); }
  api::RouteGroup group();

  Project* project() { return project_; }
  void tell_state(const std::string& name, bool removed) const { tell({{"state", name}, {"removed", removed}}); }
  void tell_problem() const;

 private:
  void tell(const api::Json& what) const {
    api::Json event{{"kind", "project"}, {"axis", nullptr}};
    event.update(what);
    if (publish_) publish_(event);
  }

  Project* project_;
  Publish publish_{};
};

}  // namespace servodrome::studio
