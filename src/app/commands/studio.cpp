// `studio`: the web page and the bench API for a project, or without a plant for drives on buses.
#include <boost/asio/signal_set.hpp>
#include <fmt/format.h>
#include <memory>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_buses.hpp"
#include "app/line_files.hpp"
#include "app/line_run.hpp"
#include "app/page_folder.hpp"
#include "app/process.hpp"
#include "app/project_folder.hpp"
#include "line/config.hpp"
#include "links/link_scheme.hpp"
#include "studio/real_server.hpp"

namespace servodrome::app {
namespace studio_command {

struct Options {
  BusOptions bus{.timeout_s = 0.5};
  std::vector<std::string> buses;
  std::string api;
  std::string page;
  std::string folder;  // of a project
  bool is_new = false;
};

nlohmann::ordered_json describe(const studio::RealDrives& drives, const studio::RealServer& server,
                                const std::string& address) {
  const bool ipv6 = address.find(':') != std::string::npos;
  const std::string url = fmt::format("http://{}:{}", ipv6 ? "[" + address + "]" : address, server.port());
  nlohmann::ordered_json ready{{"event", "ready"},
                               {"clock", "real"},
                               {"api", url + "/api/v1"},
                               {"studio", server.has_page() ? url + "/" : ""},
                               {"token", server.token()}};
  ready["axes"] = nlohmann::ordered_json::array();
  for (const studio::RealDrives::Axis& axis : drives.all()) {
    ready["axes"].push_back({{"name", axis.name},
                             {"product", axis.product},
                             {"bus", drives.buses()[axis.bus]->plan().link},
                             {"address", axis.address}});
  }
  return ready;
}

void print_table(const nlohmann::ordered_json& ready) {
  fmt::print("{:<18}{:<14}{:<40}{}\n", "axis", "product", "bus", "node, station or position");
  for (const auto& axis : ready["axes"]) {
    const auto product = axis["product"].get<std::string>();
    fmt::print("{:<18}{:<14}{:<40}{}\n", axis["name"].get<std::string>(), product.empty() ? "-" : product,
               axis["bus"].get<std::string>(), axis["address"].get<unsigned>());
  }
  fmt::print("\nAPI               {}   token {}\n", ready["api"].get<std::string>(), ready["token"].get<std::string>());
  if (const auto page = ready["studio"].get<std::string>(); !page.empty()) fmt::print("studio            {}\n", page);
  fmt::print("ready; Ctrl-C stops the axes that were moved from here and ends the program\n");
}

void check(const Options& options) {
  if (options.folder.empty() && options.is_new)
    throw Failure::wrong_use("studio --new: give the folder of the project");
  if (options.folder.empty() && options.buses.empty()) {
    throw Failure::wrong_use("studio: give --bus LINK, or the folder of a project: `servodrome studio FOLDER`");
  }
  if (!options.folder.empty() && !options.is_new && !options.buses.empty()) {
    throw Failure::wrong_use(
        fmt::format("studio: a project has its own buses; leave out --bus, or change {}/project.toml", options.folder));
  }
}

std::unique_ptr<studio::Project> open_folder(const Options& options) {
  const std::vector<std::string> made =
      options.is_new ? make_project(options.folder, options.buses) : std::vector<std::string>();
  std::unique_ptr<studio::Project> project = open_project(options.folder);
  if (!options.bus.json) print_opened(*project, made);
  return project;
}

void run(const Options& options) {
  line::ApiSettings api;
  if (!options.api.empty()) {
    if (const std::string problem = line::parse_api_address(options.api, api); !problem.empty()) {
      throw Failure::wrong_use(fmt::format("--api {}: {}; write --api 127.0.0.1:8402", options.api, problem));
    }
  }
  const std::string page = page_folder(options.page);
  check(options);
  // Finds the drives before it makes a project, so that no project is made if a bus has no drives.
  std::vector<studio::BusPlan> plans;
  if (!options.buses.empty()) plans = find_drives(options.buses, options.bus);
  const std::unique_ptr<studio::Project> project = options.folder.empty() ? nullptr : open_folder(options);
  if (project && project->buses().empty()) {
    line::LineSettings settings = load_line(project->line_file().string());
    if (!options.api.empty() || !settings.api.enabled) settings.api = api;
    settings.api.enabled = true;
    settings.api.page = page;
    return run_line(settings, {.json = options.bus.json, .project = project.get()});
  }
  ignore_broken_pipes();  // if the reader of our output ends, the axes must not be left moving
  if (options.buses.empty()) plans = find_drives(project->buses(), options.bus);
  studio::RealDrives drives(std::move(plans));
  studio::RealServer server(drives, {api.address, api.port, page, project.get()});
  boost::asio::signal_set signals(server.io());
  for (const int signal : ending_signals()) signals.add(signal);
  signals.async_wait([&server](const boost::system::error_code& code, int) {
    if (!code) server.stop();
  });
  std::unique_ptr<studio::ProjectKeeper> keeper;
  if (project) {
    keeper = keep_project(server.io(), *project, drives.changes(), server.recordings(), server.project());
  }
  nlohmann::ordered_json ready = describe(drives, server, api.address);
  if (project) ready["project"] = project_view(*project);
  if (options.bus.json) {
    fmt::print("{}\n", ready.dump());
  } else {
    print_table(ready);
  }
  std::fflush(stdout);
  server.run();
  if (keeper) finish_project(*keeper, *project);
}

}  // namespace studio_command

void add_studio(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "studio", "Run the studio and its API for a project, or for the drives on one or more buses, until Ctrl-C",
      studio_command::run);
  command->add_option(
      "FOLDER", options->folder,
      "Project: a folder with a virtual line or the names of buses, and with all that the studio keeps");
  command->add_flag("--new", options->is_new,
                    "Make FOLDER a project first: with the buses of --bus, else with its file line.toml, or the "
                    "built-in line if there is none");
  add_bus_options(*command, options->bus, "Seconds to wait for each answer of a drive");
  add_serial_options(*command, options->bus);
  add_cycle_options(*command, options->bus);
  add_watch_option(*command, options->bus);
  command->remove_option(command->get_option("--bus"));
  command
      ->add_option(
          "--bus", options->buses,
          fmt::format("LINK or LINK=NODE,NODE..: a bus, and optionally the node-IDs, stations or positions of "
                      "its drives (if not given all drives found, but a Modbus serial line needs its stations); may be "
                      "given several times. CAN: {}; EtherCAT: {}; {}",
                      links::client_forms(links::can_schemes_hardware_first),
                      links::client_forms(links::ethercat_schemes), serial_link_help()))
      ->allow_extra_args(false);
  command->add_option("--api", options->api, "ADDRESS:PORT of the server (127.0.0.1:8402); port 0: the system chooses");
  command->add_option("--page", options->page,
                      "Folder with the studio's page; if not given $SERVODROME_STUDIO, or the one that was built");
}

}  // namespace servodrome::app
