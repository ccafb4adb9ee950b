// `studio`: the web page, and the bench API without a plant, for drives on buses.
#include <boost/asio/signal_set.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_buses.hpp"
#include "app/page_folder.hpp"
#include "app/process.hpp"
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

void run(const Options& options) {
  line::ApiSettings api;
  if (!options.api.empty()) {
    if (const std::string problem = line::parse_api_address(options.api, api); !problem.empty()) {
      throw Failure::wrong_use(fmt::format("--api {}: {}; write --api 127.0.0.1:8402", options.api, problem));
    }
  }
  const std::string page = page_folder(options.page);
  ignore_broken_pipes();  // if the reader of our output ends, the axes must not be left moving
  studio::RealDrives drives(find_drives(options.buses, options.bus));
  studio::RealServer server(drives, {api.address, api.port, page});
  boost::asio::signal_set signals(server.io());
  for (const int signal : ending_signals()) signals.add(signal);
  signals.async_wait([&server](const boost::system::error_code& code, int) {
    if (!code) server.stop();
  });
  const nlohmann::ordered_json ready = describe(drives, server, api.address);
  if (options.bus.json) {
    fmt::print("{}\n", ready.dump());
  } else {
    print_table(ready);
  }
  std::fflush(stdout);
  server.run();
}

}  // namespace studio_command

void add_studio(CLI::App& app) {
  using namespace studio_command;  // NOLINT(google-build-using-namespace)
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("studio", "Run the studio and its API for the drives on one or more buses until Ctrl-C");
  add_bus_options(*command, options->bus, "Seconds to wait for each answer of a drive");
  add_serial_options(*command, options->bus);
  add_cycle_options(*command, options->bus);
  add_watch_option(*command, options->bus);
  command->remove_option(command->get_option("--bus"));
  command
      ->add_option("--bus", options->buses,
                   fmt::format("LINK or LINK=NODE,NODE..: a bus, and optionally the node-IDs, stations or positions of "
                               "its drives (all drives found if not given); may be given several times. CAN: {}; "
                               "EtherCAT: {}; {}",
                               links::client_forms(links::can_schemes_hardware_first),
                               links::client_forms(links::ethercat_schemes), serial_link_help()))
      ->required()
      ->allow_extra_args(false);
  command->add_option("--api", options->api, "ADDRESS:PORT of the server (127.0.0.1:8402); port 0: the system chooses");
  command->add_option("--page", options->page,
                      "Folder with the studio's page; if not given $SERVODROME_STUDIO, or the one that was built");
  command->callback([options] { run(*options); });
}

}  // namespace servodrome::app
