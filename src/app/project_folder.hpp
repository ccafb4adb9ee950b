#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "studio/project/keeper.hpp"
#include "studio/project/routes.hpp"

namespace servodrome::app {

// Makes a project in `folder`: for `buses`, in the form of --bus, or without buses for a virtual line. A line.toml that
// is in the folder already is checked first. Returns what it made. Throws Failure.
std::vector<std::string> make_project(const std::string& folder, const std::vector<std::string>& buses);

// Throws Failure that names the errors in the project's files with file, line and column.
std::unique_ptr<studio::Project> open_project(const std::string& folder);

// Loads the project's recordings. As long as the result lives, it saves new data of the server in the project; if that
// fails, a warning tells why. All arguments must outlive the result. Throws Failure as open_project does.
std::unique_ptr<studio::ProjectKeeper> keep_project(boost::asio::io_context& io, studio::Project& project,
                                                    api::ChangeLog& log, api::Recordings& recordings,
                                                    const studio::ProjectRoutes& routes);

// Writes what is left after the end of the server. Throws Failure if that fails.
void finish_project(studio::ProjectKeeper& keeper, const studio::Project& project);

// Prints which project is open, and what was made.
void print_opened(const studio::Project& project, const std::vector<std::string>& made);

// Name and folder, for --json.
nlohmann::ordered_json project_view(const studio::Project& project);

}  // namespace servodrome::app
