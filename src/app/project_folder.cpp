#include "app/project_folder.hpp"

#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "app/commands.hpp"
#include "app/line_files.hpp"
#include "line/line_file.hpp"

namespace servodrome::app {

namespace {

template <typename Open>
auto opened(Open open) {
  try {
    return open();
  } catch (const studio::ProjectError& error) {
    throw Failure::wrong_use(fmt::format("the project cannot be opened:\n{}", error.what()));
  }
}

}  // namespace

std::vector<std::string> make_project(const std::string& folder, const std::vector<std::string>& buses) {
  if (const std::string line = folder + "/line.toml"; buses.empty() && std::filesystem::exists(line)) load_line(line);
  return opened([&] { return studio::Project::make(folder, buses, line::default_line_text()); });
}

std::unique_ptr<studio::Project> open_project(const std::string& folder) {
  return opened([&] {
    auto project = std::make_unique<studio::Project>(folder);
    if (!project->unlocked().empty()) {
      warn(fmt::format("{}; take care that no other server opens it", project->unlocked()));
    }
    return project;
  });
}

std::unique_ptr<studio::ProjectKeeper> keep_project(boost::asio::io_context& io, studio::Project& project,
                                                    api::ChangeLog& log, api::Recordings& recordings,
                                                    const studio::ProjectRoutes& routes) {
  const auto changed = [&project, &routes] {
    if (const auto& problem = project.problem()) warn("the project is not saved: " + to_string(*problem));
    routes.tell_problem();
  };
  return opened([&] { return std::make_unique<studio::ProjectKeeper>(io, project, log, recordings, changed); });
}

void finish_project(studio::ProjectKeeper& keeper, const studio::Project& project) {
  keeper.finish();
  if (const auto& problem = project.problem()) {
    throw Failure::did_not_work("the project is not complete: " + to_string(*problem));
  }
}

void print_opened(const studio::Project& project, const std::vector<std::string>& made) {
  if (!made.empty()) fmt::print("made              {}\n", fmt::join(made, "  "));
  fmt::print("project           {}   in {}\n\n", project.name(), project.folder().string());
}

nlohmann::ordered_json project_view(const studio::Project& project) {
  return {{"name", project.name()}, {"folder", project.folder().string()}};
}

}  // namespace servodrome::app
