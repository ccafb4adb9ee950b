#include <algorithm>
#include <boost/asio/signal_set.hpp>
#include <cstdio>
#include <fmt/format.h>
#include <memory>
#include <nlohmann/json.hpp>

#include "app/bus_links.hpp"
#include "app/commands.hpp"
#include "app/line_files.hpp"
#include "app/page_folder.hpp"
#include "app/process.hpp"
#include "app/whole_file.hpp"
#include "described/blueprint.hpp"
#include "line/line_server.hpp"
#include "line/registry.hpp"
#include "links/link_scheme.hpp"
#include "studio/line_routes.hpp"

namespace servodrome::app {
namespace up_command {

struct Options {
  std::string file;
  DescriptionFiles descriptions;  // --eds, --esi
  std::vector<std::string> buses;
  std::string log;
  std::string api;
  std::string studio;
  std::string ready_file;
  bool virtual_time = false;
  bool json = false;
};

line::LineSettings load(const Options& options) {
  if (options.descriptions.empty()) return load_line(options.file);
  if (!options.file.empty()) {
    throw Failure::wrong_use(
        "--eds and --esi make a line of their own; in a line file write description = \"FILE\" in an axis");
  }
  return line_of_descriptions(options.descriptions);
}

line::LineSettings settings_of(const Options& options) {
  line::LineSettings settings = load(options);
  override_links(settings, options.buses);
  if (options.virtual_time) settings.clock = line::ClockMode::virtual_time;
  if (!options.api.empty()) {
    settings.api.enabled = true;
    const std::string problem = line::parse_api_address(options.api, settings.api);
    if (!problem.empty()) {
      throw Failure::wrong_use(fmt::format("--api {}: {}; write --api 127.0.0.1:8402", options.api, problem));
    }
  }
  settings.api.page = page_folder(options.studio);
  return settings;
}

// If the line has several buses, each has its own file: trace.log becomes trace.can0.log.
std::string log_path(const std::string& path, const line::LineSettings& settings, const std::string& bus) {
  if (path == "-" || settings.buses.size() + settings.ethercat_buses.size() + settings.serial_buses.size() == 1)
    return path;
  const std::size_t folder = path.rfind('/');
  const std::size_t dot = path.rfind('.');
  const bool has_extension = dot != std::string::npos && (folder == std::string::npos || dot > folder);
  const std::size_t place = has_extension ? dot : path.size();
  return fmt::format("{}.{}{}", path.substr(0, place), bus, path.substr(place));
}

std::string url(const line::LineServer& server, const line::LineSettings& settings, std::string_view path) {
  const bool ipv6 = settings.api.address.find(':') != std::string::npos;
  return fmt::format("http://{}:{}{}", ipv6 ? "[" + settings.api.address + "]" : settings.api.address,
                     server.api_port(), path);
}

constexpr int ethercat_bit_rate = 100'000'000;

nlohmann::ordered_json describe(line::LineServer& server, const line::LineSettings& settings) {
  nlohmann::ordered_json description{{"event", "ready"},
                                     {"clock", settings.clock == line::ClockMode::real ? "real" : "virtual"},
                                     {"api", server.api_port() != 0 ? url(server, settings, "/api/v1") : ""},
                                     {"studio", server.has_page() ? url(server, settings, "/") : ""},
                                     {"token", server.token()}};
  description["axes"] = nlohmann::ordered_json::array();
  for (const auto& axis : server.line().axes()) {
    const line::AxisSettings& its = axis->settings();
    nlohmann::ordered_json entry{{"name", its.name}, {"product", its.product->name}};
    if (const described::Blueprint* blueprint = its.product->blueprint) {
      entry["not_simulated"] = blueprint->not_simulated;
      entry["notes"] = blueprint->device.notes;
      for (const std::string& note : blueprint->notes) entry["notes"].push_back(note);
    }
    entry["bus"] = nullptr;
    if (its.bus) entry["bus"] = settings.buses[*its.bus].name;
    if (its.ethercat) {
      entry["bus"] = settings.ethercat_buses[its.ethercat->bus].name;
      entry["position"] = axis->position();
      entry["alias"] = its.ethercat->alias;
    } else {
      entry["node_id"] = axis->device().node_id();
    }
    if (its.serial) {
      entry["serial"] = settings.serial_buses[its.serial->bus].name;
      entry["station"] = axis->device().serial_port()->station();
    }
    description["axes"].push_back(std::move(entry));
  }
  description["buses"] = nlohmann::ordered_json::array();
  for (const auto& bus : server.line().buses()) {
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    for (const auto& link : bus->links) names.push_back(link->name());
    description["buses"].push_back(
        {{"name", bus->settings.name}, {"type", "can"}, {"bit_rate", bus->bus.bit_rate()}, {"links", names}});
  }
  for (const auto& bus : server.line().ethercat_buses()) {
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    for (const auto& link : bus->links) names.push_back(link->name());
    description["buses"].push_back(
        {{"name", bus->settings.name}, {"type", "ethercat"}, {"bit_rate", ethercat_bit_rate}, {"links", names}});
  }
  for (const auto& bus : server.line().serial_buses()) {
    nlohmann::ordered_json names = nlohmann::ordered_json::array();
    for (const auto& link : bus->links) names.push_back(link->name());
    description["buses"].push_back(
        {{"name", bus->settings.name}, {"type", "rs485"}, {"bit_rate", bus->line.format().bit_rate}, {"links", names}});
  }
  return description;
}

void print_table(std::FILE* out, const nlohmann::ordered_json& ready) {
  fmt::print(out, "{:<17} {:<13} {:<17} {}\n", "axis", "product", "bus", "node, station or position");
  for (const auto& axis : ready["axes"]) {
    const auto name = axis["name"].get<std::string>();
    const auto product = axis["product"].get<std::string>();
    const auto print_row = [&](const std::string& bus, int address) {
      fmt::print(out, "{:<17} {:<13} {:<17} {}\n", name, product, bus, address);
    };
    const char* address = axis.contains("position") ? "position" : "node_id";
    if (!axis["bus"].is_null()) print_row(axis["bus"].get<std::string>(), axis[address].get<int>());
    if (axis.contains("serial")) print_row(axis["serial"].get<std::string>(), axis["station"].get<int>());
  }
  fmt::print(out, "\n{:<17} {:<13} {}\n", "bus", "kbit/s", "reach it with");
  for (const auto& bus : ready["buses"]) {
    const auto links = bus["links"].get<std::vector<std::string>>();
    fmt::print(out, "{:<17} {:<13} {}\n", bus["name"].get<std::string>(), bus["bit_rate"].get<int>() / 1000.0,
               links.empty() ? "-" : fmt::format("{}", fmt::join(links, "  ")));
  }
  for (const auto& axis : ready["axes"]) {
    if (!axis.contains("not_simulated")) continue;
    const auto name = axis["name"].get<std::string>();
    for (const auto& what : axis["not_simulated"]) {
      fmt::print(out, "{}{}: not simulated: {}\n", &axis == &ready["axes"].front() ? "\n" : "", name,
                 what.get<std::string>());
    }
    if (const std::size_t notes = axis["notes"].size(); notes != 0) {
      fmt::print(out, "{}: the description could not be used as written in {} places; --json lists them\n", name,
                 notes);
    }
  }
  const auto api = ready["api"].get<std::string>();
  if (!api.empty()) fmt::print(out, "\nbench API         {}   token {}\n", api, ready["token"].get<std::string>());
  if (const auto studio = ready["studio"].get<std::string>(); !studio.empty()) {
    fmt::print(out, "studio            {}\n", studio);
  }
  fmt::print(out, "ready, {} time; Ctrl-C ends it\n", ready["clock"].get<std::string>());
}

// A port in use, or a missing interface or parameter file, counts as wrong use, because nothing has been started.
std::unique_ptr<line::LineServer> open_line(const line::LineSettings& settings) {
  try {
    return std::make_unique<line::LineServer>(settings);
  } catch (const std::runtime_error& error) {
    throw Failure::wrong_use(error.what());
  }
}

void run(const Options& options) {
  const line::LineSettings settings = settings_of(options);
  ignore_broken_pipes();  // if the reader of our output ends, symbolic links must not be left behind
  const std::unique_ptr<line::LineServer> opened = open_line(settings);
  line::LineServer& server = *opened;
  studio::LineRoutes routes(
      server.line(), [&server](std::uint32_t id) { return server.recording(id); },
      [&server] { return server.wall_epoch(); });
  routes.jobs().on_event([&server](const api::Json& event) { server.publish(event); });
  for (const api::RouteGroup& group : routes.groups()) server.add_routes(group);
  boost::asio::signal_set signals(server.io());
  for (const int signal : ending_signals()) signals.add(signal);
  signals.async_wait([&server](const boost::system::error_code& code, int) {
    if (!code) server.stop();
  });
  bool log_failed = false;
  if (!options.log.empty()) {
    const auto log = [&](auto& bus) {
      const std::string path = log_path(options.log, settings, bus.settings.name);
      server.log(bus, path, [path, &log_failed] {
        log_failed = true;
        fmt::print(stderr, "servodrome: the log \"{}\" ends here: it could not be written; is the disk full?\n", path);
      });
    };
    for (const auto& bus : server.line().buses()) log(*bus);
    for (const auto& bus : server.line().ethercat_buses()) log(*bus);
    for (const auto& bus : server.line().serial_buses()) log(*bus);
  }
  const nlohmann::ordered_json ready = describe(server, settings);
  if (!options.ready_file.empty())
    write_private_file(options.ready_file,  // it contains the token
                       ready.dump(2) + "\n");
  std::FILE* out = options.log == "-" ? stderr : stdout;
  if (options.json) {
    fmt::print(out, "{}\n", ready.dump());
  } else {
    print_table(out, ready);
  }
  std::fflush(out);
  server.run();
  if (!options.ready_file.empty()) std::remove(options.ready_file.c_str());
  if (log_failed) throw Failure::did_not_work("the log is not complete");
}

}  // namespace up_command

void add_up(CLI::App& app) {
  using namespace up_command;  // NOLINT(google-build-using-namespace)
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("up", "Run a line of drives until Ctrl-C");
  command->add_option("LINE", options->file, "Line file (TOML); the built-in line with five drives if not given");
  command
      ->add_option("--eds", options->descriptions.data_sheets,
                   "Run a drive of this electronic data sheet (EDS, DCF) instead of a line file; may be given several "
                   "times, once per axis")
      ->allow_extra_args(false);
  command
      ->add_option("--esi", options->descriptions.slaves,
                   "Run a drive of this EtherCAT slave information (ESI) instead of a line file; may be given several "
                   "times, once per axis")
      ->allow_extra_args(false);
  command->add_option("--device", options->descriptions.device,
                      "Type, name or product code of the device, if the ESI file has several");
  command
      ->add_option("--bus", options->buses,
                   fmt::format("NAME=LINK or LINK: link of a bus, instead of the one in the line file ({}; {} for "
                               "EtherCAT; {} for an RS485 line)",
                               links::forms(links::can_schemes), links::forms(links::ethercat_schemes_easiest_first),
                               links::forms(links::serial_schemes)))
      ->allow_extra_args(false);
  command->add_option(
      "--log", options->log,
      "Log each CAN bus in candump format (FILE.pcap: pcap), each EtherCAT segment as pcap, each RS485 line as text "
      "(FILE.pcap: pcapng); - is standard output");
  command->add_flag("--virtual", options->virtual_time, "Time passes only when the bench API advances it");
  command->add_option("--api", options->api, "ADDRESS:PORT of the bench API; port 0 lets the system choose");
  command->add_option("--studio", options->studio,
                      "Folder with the studio's page; if not given $SERVODROME_STUDIO, or the one that was built");
  command->add_option("--ready-file", options->ready_file, "Write this file (JSON) when the line is ready");
  command->add_flag("--json", options->json, "Print one JSON object when the line is ready, instead of a table");
  command->callback([options] { run(*options); });
}

}  // namespace servodrome::app
