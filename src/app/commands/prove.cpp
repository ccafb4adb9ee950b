// `prove`: homes and moves every drive of a bus, and reports the results.
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"
#include "catalogue/product.hpp"
#include "line/registry.hpp"
#include "links/nearest_name.hpp"
#include "links/time.hpp"

namespace servodrome::app {
namespace prove_command {

struct Options {
  BusOptions bus{.timeout_s = 30.0};
  std::vector<std::string> methods;
  std::vector<std::string> expected;  // products, in the order of their addresses; empty: any
  double revolutions = 3.0;
  double speed_rps = 5.0;
  double acceleration_rps2 = 50.0;
  double units_per_revolution = 0.0;
};

// For drives that do not report the size of a revolution (6092h, 608Fh).
constexpr double usual_units_per_revolution = 131072.0;
// Homing searches for edges at this fraction of the speed.
constexpr double homing_speed_factor = 0.5;
constexpr double zero_speed_factor = 0.1;
// The axis must be within this fraction of a revolution of its target, at most `settling_time` after target reached.
constexpr double tolerance_revolutions = 0.001;
// Target reached may refer to the demand position, which the shaft follows later.
constexpr master::Time settling_time = std::chrono::milliseconds(500);
// A halt on the ramp of a low --acceleration takes longer, and becomes a quick stop.
constexpr master::Time longest_halt = std::chrono::seconds(1);

// A drive to test, on any kind of bus.
struct Drive {
  unsigned node = 0;
  std::string name{};
  const line::Product* product = nullptr;
};

struct Outcome {
  Drive drive{};
  int method = 0;
  double homing_seconds = 0.0;
  double moving_seconds = 0.0;
  std::int64_t distance = 0;
  std::int32_t final_position = 0;
  std::string problem{};  // empty: passed
};

// A part of the option --method: a number from `least` to `most`.
int read_part(const std::string& option, const std::string& text, int least, int most) {
  std::size_t end = 0;
  int number = 0;
  try {
    number = std::stoi(text, &end);
  } catch (const std::logic_error&) {
    end = 0;
  }
  if (end == 0 || end != text.size() || number < least || number > most) {
    throw Failure::wrong_use(fmt::format("--method {}: write METHOD, or NODE=METHOD for one node", option));
  }
  return number;
}

// Methods by node-ID; 0 is the default for all others.
std::map<unsigned, std::int8_t> methods_of(const Options& options) {
  std::map<unsigned, std::int8_t> methods;
  for (const std::string& option : options.methods) {
    const std::size_t equals = option.find('=');
    const bool for_one = equals != std::string::npos;
    const int node = for_one ? read_part(option, option.substr(0, equals), 1, 0xFFFF) : 0;
    const int method = read_part(option, for_one ? option.substr(equals + 1) : option, -128, 127);
    methods[static_cast<unsigned>(node)] = static_cast<std::int8_t>(method);
  }
  return methods;
}

void move_and_check(master::Axis402& axis, std::int32_t target, const master::MotionProfile& profile,
                    std::int32_t tolerance, const Options& options) {
  axis.move_to(target, profile, options.bus.timeout(), motion_progress(axis, options.bus.json));
  master::ObjectClient& objects = axis.objects();
  const master::Time deadline = objects.now() + settling_time;
  std::int32_t position = axis.position();
  while (std::abs(std::int64_t{position} - target) > tolerance) {
    if (objects.now() >= deadline) {
      throw Failure::did_not_work(
          fmt::format("target reached is set, but the position is {} and not {}", position, target));
    }
    objects.wait(std::chrono::milliseconds(5));
    position = axis.position();
  }
}

void prove(master::Axis402& axis, Outcome& outcome, const Options& options) {
  const bool given = options.units_per_revolution > 0;
  const auto told = axis.units(given ? std::optional(options.units_per_revolution) : std::nullopt);
  const catalogue::AxisUnits units = told ? *told : axis.units(usual_units_per_revolution).value();
  const auto speed = [&](double factor) {
    return whole_units<std::uint32_t>(options.speed_rps * factor * units.velocity, "--speed", options.speed_rps);
  };
  const auto acceleration = whole_units<std::uint32_t>(options.acceleration_rps2 * units.acceleration, "--acceleration",
                                                       options.acceleration_rps2);
  const master::HomingRequest homing{.method = static_cast<std::int8_t>(outcome.method),
                                     .switch_speed = speed(homing_speed_factor),
                                     .zero_speed = speed(zero_speed_factor),
                                     .acceleration = acceleration};
  // 607Fh may be lower, and some drives then go to fault instead of clipping the velocity.
  const auto greatest = axis.objects().read_if_present<std::uint32_t>(0x607F).value_or(0);
  const std::uint32_t velocity = greatest != 0 ? std::min(speed(1.0), greatest) : speed(1.0);
  const master::MotionProfile profile{.velocity = velocity, .acceleration = acceleration, .deceleration = acceleration};
  const auto farthest =
      whole_units<std::int32_t>(options.revolutions * units.position, "--revolutions", options.revolutions);
  const auto tolerance = static_cast<std::int32_t>(std::lround(units.position * tolerance_revolutions));
  axis.reset_fault();
  axis.enable();
  master::ObjectClient& objects = axis.objects();
  const auto seconds_since = [&](master::Time since) { return links::to_seconds(objects.now() - since); };

  master::Time start = objects.now();
  axis.home(homing, options.bus.timeout(), motion_progress(axis, options.bus.json));
  outcome.homing_seconds = seconds_since(start);

  start = objects.now();
  for (const std::int32_t target : {0, farthest, 0}) {
    move_and_check(axis, target, profile, tolerance, options);
    outcome.distance += target;
  }
  outcome.distance *= 2;  // forward and back
  outcome.moving_seconds = seconds_since(start);
  outcome.final_position = axis.position();
}

// `open` creates the drive's objects; an exception from it also counts as the drive's problem.
template <typename Open>
Outcome outcome_of(const Drive& drive, const std::map<unsigned, std::int8_t>& methods, const Options& options,
                   const Open& open) {
  const catalogue::Product& product = catalogue::product_of(drive.product != nullptr ? drive.product->name : "");
  auto method = methods.find(drive.node);
  if (method == methods.end()) method = methods.find(0);
  Outcome outcome{.drive = drive,
                  .method = method != methods.end() ? method->second : product.dialect.cautious_homing_method};
  const auto note = [&](const auto& action) {
    try {
      action();
    } catch (const std::exception& error) {
      if (outcome.problem.empty()) outcome.problem = error.what();
    }
  };
  note([&] {
    const auto opened = open();
    master::Axis402 axis(opened->objects(),
                         {.product = &product, .longest_halt = longest_halt, .cancelled = InterruptGuard::interrupted});
    note([&] {
      prove(axis, outcome, options);
      axis.disable();
    });
    if (outcome.problem.empty()) return;
    if (const std::string why = axis.try_to_switch_off(); !why.empty()) {
      outcome.problem += "; the axis could not be disabled: " + why;
    }
  });
  end_progress(options.bus.json);
  return outcome;
}

// The name that the drive reports, or its product.
std::string shown_name(const Drive& drive) {
  if (!drive.name.empty()) return drive.name;
  return drive.product != nullptr ? std::string(drive.product->name) : "-";
}

void print(const Outcome& outcome, int width) {
  const std::string homed =
      outcome.homing_seconds > 0 ? fmt::format("method {}, {:.2f} s", outcome.method, outcome.homing_seconds) : "no";
  const std::string moved =
      outcome.moving_seconds > 0 ? fmt::format("{} units, {:.2f} s", outcome.distance, outcome.moving_seconds) : "no";
  fmt::print("{:<6}{:<{}}{:<22}{:<26}{:>14}  {}\n", outcome.drive.node, shown_name(outcome.drive), width, homed, moved,
             outcome.final_position, outcome.problem.empty() ? "passed" : "FAILED");
  if (!outcome.problem.empty()) fmt::print("      {}\n", outcome.problem);
  std::fflush(stdout);
}

nlohmann::ordered_json json_of(const Outcome& outcome) {
  return {{"node", outcome.drive.node},
          {"name", outcome.drive.name},
          {"method", outcome.method},
          {"homing_seconds", outcome.homing_seconds},
          {"distance", outcome.distance},
          {"moving_seconds", outcome.moving_seconds},
          {"final_position", outcome.final_position},
          {"passed", outcome.problem.empty()},
          {"problem", outcome.problem}};
}

std::string product_name(const Drive& drive) {
  return drive.product != nullptr ? std::string(drive.product->name) : "an unknown product";
}

void require_known_products(const std::vector<std::string>& names) {
  std::vector<std::string_view> known;
  for (const line::Product& product : line::all_products()) known.push_back(product.name);
  for (const std::string& name : names) {
    if (line::find_product(line::all_products(), name) != nullptr) continue;
    throw Failure::wrong_use(
        fmt::format("--expect: there is no product \"{}\"; {}", name, links::suggestion(name, known)));
  }
}

// Throws Failure if the drives of the bus are not those that --expect names. Then no drive moves.
void require_expected(const Options& options, const std::vector<Drive>& drives) {
  if (options.expected.empty()) return;
  std::vector<std::string> found;
  for (const Drive& drive : drives) found.push_back(product_name(drive));
  if (found == options.expected) return;
  if (found.empty()) found.emplace_back("no drive");
  throw Failure::did_not_work(fmt::format("{}: the bus has {}, and --expect is {}; nothing has moved", options.bus.link,
                                          fmt::join(found, ", "), fmt::join(options.expected, ", ")));
}

// Retries with a longer timeout, so that a slow bit rate or a busy computer hides no drive: the requests to 127 nodes
// take 1.4 s at 10 kbit/s.
std::vector<master::FoundNode> drives_on(master::Bus& bus) {
  std::vector<master::FoundNode> nodes;
  for (const master::Time answer_time : {std::chrono::seconds(1), std::chrono::seconds(5)}) {
    nodes = master::scan(bus, {.timeout = answer_time});
    if (std::any_of(nodes.begin(), nodes.end(), [](const master::FoundNode& node) { return node.is_drive(); })) break;
  }
  return nodes;
}

// Prints the table or the list of outcomes as they arrive.
class Report {
 public:
  Report(const Options& options, const std::vector<Drive>& drives) : options_(options), drives_(drives.size()) {
    std::size_t longest = std::string_view("product").size();
    for (const Drive& drive : drives) longest = std::max(longest, shown_name(drive).size());
    width_ = static_cast<int>(longest) + 2;
    if (drives.empty() || options.bus.json) return;
    fmt::print("{:<6}{:<{}}{:<22}{:<26}{:>14}  {}\n", "node", "product", width_, "homed", "moved", "final position",
               "result");
    std::fflush(stdout);
  }
  void add(const Outcome& outcome) {
    if (!outcome.problem.empty()) ++failed_;
    options_.bus.json ? list_.push_back(json_of(outcome)) : print(outcome, width_);
  }
  void end() const {
    if (options_.bus.json) {
      fmt::print("{}\n", nlohmann::ordered_json{{"bus", options_.bus.link}, {"axes", list_}}.dump(2));
    }
    if (InterruptGuard::interrupted()) throw Failure::did_not_work("interrupted");
    if (drives_ == 0) {
      throw Failure::did_not_work(
          fmt::format("{}: no CiA 402 drive answers; check bit rate, cable and power", options_.bus.link));
    }
    if (failed_ != 0) throw Failure::did_not_work(fmt::format("{} of {} axes failed, see above", failed_, drives_));
  }

 private:
  const Options& options_;
  nlohmann::ordered_json list_ = nlohmann::ordered_json::array();
  std::size_t drives_;
  int width_ = 0;
  unsigned failed_ = 0;
};

void prove_can(const Options& options, const std::map<unsigned, std::int8_t>& methods) {
  const auto bus = open_bus(options.bus);
  std::vector<Drive> drives;
  for (const master::FoundNode& node : drives_on(*bus)) {
    if (node.is_drive()) drives.push_back({node.node_id, node.name, product_of(node)});
  }
  require_expected(options, drives);
  Report report(options, drives);
  struct Node {
    Node(master::Bus& bus, const Drive& drive, const Options& options)
        : client(bus, static_cast<std::uint8_t>(drive.node)) {
      master::ObjectClient* const drives[] = {&client};
      if (!options.bus.no_watch) watch.emplace(bus, drives, warn);
    }
    master::ObjectClient& objects() { return client; }

    master::SdoClient client;
    std::optional<master::MasterWatch> watch;
  };
  for (const Drive& drive : drives) {
    if (InterruptGuard::interrupted()) break;
    report.add(outcome_of(drive, methods, options, [&] { return std::make_unique<Node>(*bus, drive, options); }));
  }
  report.end();
}

// Each drive goes to OP only for its own test.
void prove_ethercat(const Options& options, const std::map<unsigned, std::int8_t>& methods) {
  const auto master = open_ethercat_master(options.bus);
  const std::vector<master::FoundSlave> line = scan_segment(*master);
  std::vector<Drive> drives;
  for (const master::FoundSlave& found : line) {
    master::EthercatSlave slave(*master, found);
    if (is_drive(slave)) drives.push_back({found.position, found.sii.name, product_of(found)});
  }
  require_expected(options, drives);
  Report report(options, drives);
  struct Operated {
    Operated(master::EthercatMaster& master, const std::vector<master::FoundSlave>& line, const Drive& drive,
             const Options& options)
        : slave(master, line[drive.node - 1]),
          reaction(slave),
          operation(master, line, slaves, operation_options(options.bus)),
          client(slave, operation.exchange(), 0) {}
    master::ObjectClient& objects() { return client; }

    master::EthercatSlave slave;
    std::array<master::EthercatSlave*, 1> slaves{&slave};
    master::LostMasterReaction reaction;
    master::EthercatOperation operation;
    master::CoeObjects client;
  };
  for (const Drive& drive : drives) {
    if (InterruptGuard::interrupted()) break;
    report.add(
        outcome_of(drive, methods, options, [&] { return std::make_unique<Operated>(*master, line, drive, options); }));
  }
  report.end();
}

void run(const Options& options) {
  const auto methods = methods_of(options);
  require_known_products(options.expected);
  const InterruptGuard guard;
  const BusKind kind = bus_kind(options.bus).kind;
  if (kind != BusKind::can && kind != BusKind::ethercat) {
    throw Failure::wrong_use(
        "prove: it tests all drives of a CAN bus or an EtherCAT segment; over this protocol use `servodrome home` and "
        "`servodrome move`");
  }
  if (kind == BusKind::ethercat) {
    prove_ethercat(options, methods);
  } else {
    prove_can(options, methods);
  }
}

}  // namespace prove_command

void add_prove(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "prove", "Home every drive of a bus, move it there and back, and print the results", prove_command::run);
  add_bus_options(*command, options->bus, "Seconds to wait until each motion is complete");
  command->get_option("--bus")->description(can_or_ethercat_help());
  add_watch_option(*command, options->bus);
  add_cycle_options(*command, options->bus);
  command
      ->add_option("--method", options->methods,
                   "Homing method, or NODE=METHOD for one node; if not given, a method without switches that moves one "
                   "revolution at most: 34, or the drive's equivalent")
      ->allow_extra_args(false);
  command
      ->add_option("--expect", options->expected,
                   "Products that are on the bus, in the order of their addresses; if others are there, nothing moves")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--revolutions", options->revolutions, "How far to move from home, in motor revolutions")
      ->check(number_within(-16384.0, 16384.0))
      ->capture_default_str();
  command->add_option("--speed", options->speed_rps, "Speed in motor revolutions per second")
      ->check(number_within(0.001, 1e4))
      ->capture_default_str();
  command
      ->add_option("--acceleration", options->acceleration_rps2, "Acceleration in motor revolutions per second squared")
      ->check(number_within(0.001, 1e6))
      ->capture_default_str();
  command
      ->add_option("--units-per-revolution", options->units_per_revolution,
                   "Position units per motor revolution; if not given from 6091h and 6092h, or 608Fh, else 131072")
      ->check(number_within(1e-3, 1e9));
}

}  // namespace servodrome::app
