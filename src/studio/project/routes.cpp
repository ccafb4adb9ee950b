#include "studio/project/routes.hpp"

#include <array>
#include <fmt/format.h>

#include "api/query.hpp"
#include "studio/route_names.hpp"

namespace servodrome::studio {
namespace {

ProjectRoutes& project_routes_of(const Call& call) { return *static_cast<ProjectRoutes*>(call.context); }

Project& project_of(const Call& call) {
  if (Project* project = project_routes_of(call).project()) return *project;
  throw ApiError{409, "the server has no project", "project", "start it with `servodrome studio FOLDER`"};
}

std::string state_argument(const Call& call) {
  std::string name = api::unescaped(call.arguments.front());
  if (Project::is_state_name(name)) return name;
  throw ApiError{422, fmt::format("\"{}\" is no name of a state", name.substr(0, 80)), "address",
                 "take letters, digits, \".\", \"-\" and \"_\", at most 64, a letter or digit first"};
}

Json view_of(const std::optional<line::Diagnostic>& problem) {
  if (!problem) return nullptr;
  return {{"what", problem->what}, {"where", problem->file}, {"hint", problem->hint}};
}

Json show_project(Call& call) {
  const Project* project = project_routes_of(call).project();
  if (project == nullptr) return Json{{"project", nullptr}};
  return Json{{"project",
               {{"name", project->name()},
                {"folder", project->folder().string()},
                {"schema", Project::schema},
                {"problem", view_of(project->problem())},
                {"unsaved", project->unsaved_states()}}}};
}

Json show_states(Call& call) {
  Json states = Json::object();
  for (const auto& [name, state] : project_of(call).states()) {
    if (state.text) states[name] = Json::parse(*state.text);
  }
  return Json{{"state", std::move(states)}};
}

Json show_state(Call& call) {
  const auto& states = project_of(call).states();
  const std::string name = state_argument(call);
  const auto found = states.find(name);
  if (found != states.end() && found->second.text) return Json{{"value", Json::parse(*found->second.text)}};
  throw ApiError{404, fmt::format("the project has no state \"{}\"", name), "address",
                 "GET /api/v1/project/state lists them"};
}

Json set_state(Call& call) {
  Project& project = project_of(call);
  const std::string name = state_argument(call);
  BodyReader body(call.body);
  const nlohmann::json value = body.required("value");
  body.finish();
  if (value.is_null()) throw ApiError{422, "the value is null", "value", "DELETE removes a state"};
  try {
    project.set_state(name, value);
  } catch (const ProjectError& error) {
    throw ApiError{422, error.first().what, error.first().file, error.first().hint};
  }
  project_routes_of(call).tell_state(name, false);
  return nullptr;
}

Json remove_state(Call& call) {
  Project& project = project_of(call);
  const std::string name = state_argument(call);
  project.remove_state(name);
  project_routes_of(call).tell_state(name, true);
  return nullptr;
}

Json show_earlier_changes(Call& call) {
  const Project& project = project_of(call);
  const auto axis = query_value(call, "axis");
  Json rows = Json::array();
  for (const nlohmann::json& change : project.earlier_changes()) {
    if (!axis || change["axis"] == *axis) rows.push_back(Json(change));
  }
  return Json{{"changes", std::move(rows)}, {"most", Project::most_earlier_changes}};
}

constexpr std::array project_table{
    Route{Method::get, "/api/v1/project", show_project},
    Route{Method::get, "/api/v1/project/changes?axis", show_earlier_changes},
    Route{Method::get, "/api/v1/project/state", show_states},
    Route{Method::get, "/api/v1/project/state/{}", show_state},
    Route{Method::put, "/api/v1/project/state/{}", set_state},
    Route{Method::delete_, "/api/v1/project/state/{}", remove_state},
};

}  // namespace

void ProjectRoutes::tell_problem() const { tell({{"problem", view_of(project_->problem())}}); }

api::RouteGroup ProjectRoutes::group() { return {project_table, this}; }

}  // namespace servodrome::studio
