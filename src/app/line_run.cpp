#include "app/line_run.hpp"

#include <algorithm>
#include <boost/asio/signal_set.hpp>
#include <cstdio>
#include <fmt/format.h>
#include <memory>
#include <nlohmann/json.hpp>

#include "app/commands.hpp"
#include "app/process.hpp"
#include "app/project_folder.hpp"
#include "app/whole_file.hpp"
#include "described/blueprint.hpp"
#include "line/line_server.hpp"
#include "studio/line_routes.hpp"

namespace servodrome::app {
namespace {

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

// The ready file of a running line: it disappears however the line ends. It contains the token, so it is private.
class ReadyFile {
 public:
  ReadyFile(const std::string& path, const std::string& content) : path_(path) {
    if (!path_.empty()) write_private_file(path_, content);
  }
  ~ReadyFile() {
    if (!path_.empty()) std::remove(path_.c_str());
  }
  ReadyFile(const ReadyFile&) = delete;
  ReadyFile& operator=(const ReadyFile&) = delete;

 private:
  const std::string& path_;
};

}  // namespace

void run_line(const line::LineSettings& settings, const LineRun& how) {
  ignore_broken_pipes();  // if the reader of our output ends, symbolic links must not be left behind
  const std::unique_ptr<line::LineServer> opened = open_line(settings);
  line::LineServer& server = *opened;
  studio::LineRoutes routes(
      server.line(), [&server](std::uint32_t id) { return server.recording(id); },
      [&server] { return server.wall_epoch(); }, how.project);
  routes.on_event([&server](const api::Json& event) { server.publish(event); });
  for (const api::RouteGroup& group : routes.groups()) server.add_routes(group);
  boost::asio::signal_set signals(server.io());
  for (const int signal : ending_signals()) signals.add(signal);
  signals.async_wait([&server](const boost::system::error_code& code, int) {
    if (!code) server.stop();
  });
  bool log_failed = false;
  if (!how.log.empty()) {
    const auto log = [&](auto& bus) {
      const std::string path = log_path(how.log, settings, bus.settings.name);
      server.log(bus, path, [path, &log_failed] {
        log_failed = true;
        fmt::print(stderr, "servodrome: the log \"{}\" ends here: it could not be written; is the disk full?\n", path);
      });
    };
    for (const auto& bus : server.line().buses()) log(*bus);
    for (const auto& bus : server.line().ethercat_buses()) log(*bus);
    for (const auto& bus : server.line().serial_buses()) log(*bus);
  }
  std::unique_ptr<studio::ProjectKeeper> keeper;
  if (how.project != nullptr) {
    keeper = keep_project(server.io(), *how.project, routes.changes(), *server.recordings(), routes.project());
  }
  nlohmann::ordered_json ready = describe(server, settings);
  if (how.project != nullptr) ready["project"] = project_view(*how.project);
  const ReadyFile ready_file(how.ready_file, ready.dump(2) + "\n");
  std::FILE* out = how.log == "-" ? stderr : stdout;
  if (how.json) {
    fmt::print(out, "{}\n", ready.dump());
  } else {
    print_table(out, ready);
  }
  std::fflush(out);
  server.run();
  if (keeper) finish_project(*keeper, *how.project);
  if (log_failed) throw Failure::did_not_work("the log is not complete");
}

}  // namespace servodrome::app
