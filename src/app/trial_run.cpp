#include "app/trial_run.hpp"

#include <algorithm>
#include <boost/asio/steady_timer.hpp>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>

#include "app/bus_links.hpp"
#include "app/child_process.hpp"
#include "app/commands.hpp"
#include "app/interrupt_guard.hpp"
#include "line/line_file.hpp"
#include "line/line_server.hpp"
#include "links/time.hpp"
#include "scenario/director.hpp"
#include "scenario/parse.hpp"
#include "scenario/standard.hpp"
#include "studio/line_routes.hpp"
#include "studio/trial_record.hpp"

namespace servodrome::app {
namespace {

using scenario::TrialResult;

constexpr auto look_period = std::chrono::milliseconds(5);
constexpr auto time_to_terminate = std::chrono::seconds(2);
// A trial is an error if it takes this many times its longest time, and `least_limit` more.
constexpr int slowest = 10;
constexpr auto least_limit = std::chrono::seconds(60);
constexpr std::streamoff most_output = 4000;

// The names under which the master finds the line.
struct Places {
  std::string link, products, host, port, api, token, scenario, job;
  std::vector<std::pair<std::string, std::string>> links;  // by bus
};

void replace_all(std::string& text, std::string_view from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
}

// Ports are chosen by the system, and ptys are in the folder of the run, so that trials run side by side.
void make_private(line::LineSettings& settings, const std::filesystem::path& folder) {
  settings.clock = line::ClockMode::real;
  settings.api.address = "127.0.0.1";
  settings.api.port = 0;
  settings.api.enabled = true;
  for (line::AxisSettings& axis : settings.axes) axis.store.clear();
  for (line::SerialBusSettings& bus : settings.serial_buses) {
    for (std::string& link : bus.links) {
      if (link.starts_with("pty:"))
        link = "pty:" + (folder / std::filesystem::path(link.substr(4)).filename()).string();
    }
  }
}

// The products on the first bus, in the order of their addresses: "generic402,ismc".
std::string products_of(const line::Line& line) {
  std::vector<std::pair<unsigned, std::string_view>> found;
  for (const auto& axis : line.axes()) {
    const line::AxisSettings& settings = axis->settings();
    const bool is_there = line.buses().empty() ? settings.ethercat && settings.ethercat->bus == 0 : settings.bus == 0U;
    if (!is_there) continue;
    const unsigned node = settings.node_id != 0 ? settings.node_id : settings.product->factory_node_id;
    found.emplace_back(line.buses().empty() ? 0U : node, settings.product->name);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::string names;
  for (const auto& [node, name] : found) names.append(names.empty() ? "" : ",").append(name);
  return names;
}

Places places_of(line::LineServer& server, const TrialRun& trial, const std::string& scenario_path) {
  Places places;
  places.scenario = scenario_path;
  places.job = std::to_string(trial.job);
  places.api = fmt::format("http://127.0.0.1:{}", server.api_port());
  places.token = server.token();
  places.products = products_of(server.line());
  const auto add = [&places](const auto& buses) {
    for (const auto& bus : buses) {
      for (const auto& link : bus->links) places.links.emplace_back(bus->settings.name, link->name());
    }
  };
  add(server.line().buses());
  add(server.line().ethercat_buses());
  add(server.line().serial_buses());
  if (places.links.empty()) return places;
  places.link = places.links.front().second;
  // "socketcand:127.0.0.1:29536/can0", "udp:127.0.0.1:34980"
  const std::size_t scheme = places.link.find(':');
  const std::size_t colon = places.link.find(':', scheme + 1);
  if (colon != std::string::npos) {
    places.host = places.link.substr(scheme + 1, colon - scheme - 1);
    places.port = places.link.substr(colon + 1, places.link.find('/', colon) - colon - 1);
  }
  return places;
}

std::vector<std::string> command_of(std::vector<std::string> command, const Places& places) {
  for (std::string& word : command) {
    replace_all(word, "{link}", places.link);
    replace_all(word, "{products}", places.products);
    replace_all(word, "{host}", places.host);
    replace_all(word, "{port}", places.port);
    replace_all(word, "{api}", places.api);
    replace_all(word, "{scenario}", places.scenario);
    replace_all(word, "{job}", places.job);
  }
  return command;
}

std::vector<std::pair<std::string, std::string>> environment_of(const Places& places) {
  std::vector<std::pair<std::string, std::string>> variables{
      {"SERVODROME_LINK", places.link}, {"SERVODROME_PRODUCTS", places.products}, {"SERVODROME_HOST", places.host},
      {"SERVODROME_PORT", places.port}, {"SERVODROME_API", places.api},           {"SERVODROME_TOKEN", places.token},
      {"SERVODROME_JOB", places.job},   {"SERVODROME_SCENARIO", places.scenario}};
  for (const auto& [bus, link] : places.links) {
    std::string name = "SERVODROME_LINK_" + bus;
    for (char& c : name)
      c = std::isalnum(static_cast<unsigned char>(c)) != 0 ? static_cast<char>(std::toupper(c)) : '_';
    variables.emplace_back(name, link);
  }
  return variables;
}

std::string end_of_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = file.tellg();
  if (size <= 0) return {};
  const auto length = std::min<std::streamoff>(size, most_output);
  std::string text(static_cast<std::size_t>(length), '\0');
  file.seekg(size - length);
  file.read(text.data(), length);
  if (length == size) return text;
  std::size_t begin = 0;
  while (begin < text.size() && (static_cast<unsigned char>(text[begin]) & 0xC0U) == 0x80U)
    ++begin;  // a whole character
  return "...\n" + text.substr(begin);
}

// Bytes that are not UTF-8 become U+FFFD, because the reports are texts.
std::string as_utf8(const std::string& bytes) {
  const std::string text = nlohmann::json(bytes).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  return nlohmann::json::parse(text).get<std::string>();
}

// The name of the file with the traffic of a bus: "canopen-boot-up-late.can0.log".
std::string capture_path(const std::filesystem::path& folder, const std::string& scenario_path, const std::string& bus,
                         std::string_view extension) {
  return (folder / fmt::format("{}.{}.{}", capture_name(scenario_path), bus, extension)).string();
}

void keep_traffic(line::LineServer& server, const TrialRun& trial, TrialResult& result) {
  if (trial.keep.empty()) return;
  const auto log = [&](const auto& buses, std::string_view extension) {
    for (const auto& bus : buses) {
      result.captures.push_back(capture_path(trial.keep, result.path, bus->settings.name, extension));
      server.log(*bus, result.captures.back());
    }
  };
  log(server.line().buses(), "log");
  log(server.line().ethercat_buses(), "pcap");
  log(server.line().serial_buses(), "log");
}

// Polls the master every few milliseconds while the line runs, ends it when its time is over, and stops the line some
// time after its end. All times are those of the line, which on a busy machine is slower than the clock on the wall.
class Supervisor {
 public:
  Supervisor(line::LineServer& server, scenario::Director& director, ChildProcess& master, TrialResult& result,
             links::Time after)
      : server_(server), director_(director), master_(master), result_(result), after_(after), timer_(server.io()) {
    look();
  }

 private:
  using Clock = std::chrono::steady_clock;

  void look() {
    const links::Time now = server_.line().now();
    const links::Time duration = result_.scenario.duration;
    if (InterruptGuard::interrupted()) {
      result_.interrupted = true;
      return server_.stop();
    }
    if (Clock::now() >= begun_ + slowest * (duration + time_to_terminate + after_) + least_limit) {
      result_.reason = fmt::format("the machine is too busy: the line has run for {:.1f} s in {:.0f} s",
                                   links::to_seconds(now), links::to_seconds(Clock::now() - begun_));
      return server_.stop();
    }
    if (!director_.master_end()) {
      if (const auto status = master_.poll()) {
        result_.exit_status = *status;
        director_.master_ended(*status == 0 && !result_.was_ended);
      } else if (now >= duration) {
        if (!result_.was_ended) master_.terminate();
        if (now >= duration + time_to_terminate) master_.kill();
        result_.was_ended = true;
      }
    } else if (now >= *director_.master_end() + after_) {
      return server_.stop();
    }
    timer_.expires_after(look_period);
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) look();
    });
  }

  line::LineServer& server_;
  scenario::Director& director_;
  ChildProcess& master_;
  TrialResult& result_;
  links::Time after_;
  boost::asio::steady_timer timer_;
  Clock::time_point begun_ = Clock::now();
};

void run(const TrialRun& trial, TrialResult& result, line::LineSettings settings) {
  make_private(settings, trial.folder);
  std::vector<std::string> links = trial.links;
  for (std::string& link : links) replace_all(link, "{job}", std::to_string(trial.job));
  override_links(settings, links);
  line::LineServer server(settings);
  studio::LineRoutes routes(
      server.line(), [&server](std::uint32_t id) { return server.recording(id); },
      [&server] { return server.wall_epoch(); });
  for (const api::RouteGroup& group : routes.groups()) server.add_routes(group);
  scenario::Scenario scenario = result.scenario;
  std::vector<std::string> axes;
  for (const line::AxisSettings& axis : settings.axes) axes.push_back(axis.name);
  for (scenario::Expectation& standard : scenario::standard_expectations(scenario, axes)) {
    scenario.expectations.push_back(std::move(standard));
  }
  scenario::Director director(server.line(), std::move(scenario));
  keep_traffic(server, trial, result);
  studio::TrialRecord record(server.line(), result.scenario.duration + trial.after + time_to_terminate);
  director.begin();
  const Places places = places_of(server, trial, result.path);
  const std::filesystem::path output = trial.folder / "master.log";
  {
    ChildProcess master(command_of(trial.master, places), environment_of(places), output);
    const Supervisor supervisor(server, director, master, result, trial.after);
    server.run();
  }
  if (result.interrupted) {
    result.reason = "interrupted";
    return;
  }
  director.finish();
  result.uses_buses = true;
  result.master_output = as_utf8(end_of_file(output));
  const std::string reason = result.reason;
  record.complete(result, director);
  if (!reason.empty()) {
    result.outcome = TrialResult::Outcome::error;
    result.reason = reason;
  }
}

// Loads the scenario and its line, and tries both. The result has a reason if one of them has an error.
line::LineSettings load(const std::string& scenario_path, TrialResult& result) {
  result.path = scenario_path;
  scenario::ScenarioFile file = scenario::load_scenario(scenario_path);
  result.scenario = std::move(file.scenario);
  if (!file.diagnostics.empty()) {
    result.reason = to_string(file.diagnostics.front());
    return {};
  }
  for (const scenario::Expectation& expectation : result.scenario.expectations) {
    if (expectation.within.value_or(links::Time{}) <= result.scenario.duration) continue;
    result.reason =
        fmt::format("{}: {}: within_ms is longer than `duration_s`, so it is never judged; give a shorter time",
                    scenario_path, expectation.name);
    return {};
  }
  const line::LineFile line = line::load_line_file(result.scenario.line, line::all_products());
  if (!line.diagnostics.empty()) {
    result.reason = to_string(line.diagnostics.front());
  } else if (const auto problems = scenario::rehearse(line.settings, result.scenario); !problems.empty()) {
    result.reason = fmt::format("{}: {}", scenario_path, problems.front());
  }
  return line.settings;
}

}  // namespace

std::string capture_name(const std::string& scenario_path) {
  const std::filesystem::path path(scenario_path);
  const std::string folder = path.parent_path().filename().string();
  return folder.empty() ? path.stem().string() : fmt::format("{}-{}", folder, path.stem().string());
}

TrialResult check_trial(const std::string& scenario_path) {
  TrialResult result;
  try {
    load(scenario_path, result);
  } catch (const std::exception& error) {
    result.reason = fmt::format("{}: {}", scenario_path, error.what());
  }
  return result;
}

TrialResult run_trial(const TrialRun& trial, const std::string& scenario_path) {
  TrialResult result;
  try {
    std::filesystem::create_directories(trial.folder);
    const line::LineSettings settings = load(scenario_path, result);
    if (result.reason.empty()) run(trial, result, settings);
  } catch (const std::exception& error) {
    result.outcome = TrialResult::Outcome::error;
    result.reason = error.what();
  }
  return result;
}

}  // namespace servodrome::app
