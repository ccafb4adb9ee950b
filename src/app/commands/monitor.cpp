// `monitor`: shows the traffic on a bus, or the state of an axis.
#include <cstdlib>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"
#include "app/object_names.hpp"
#include "app/unit_options.hpp"
#include "links/time.hpp"
#include "tools/sniff/can_decoder.hpp"

namespace servodrome::app {
namespace monitor_command {

struct Options {
  BusOptions bus;
  bool axis = false;
  std::vector<std::string> objects{};
  std::string eds{};
  double seconds = 0.0;  // 0: until Ctrl-C
  double interval_s = 0.1;
  UnitOptions units{};
};

double seconds_between(master::Time start, master::Time end) { return links::to_seconds(end - start); }

// Calls `step`, which lets the bus run for a while, until the time is over or Ctrl-C.
template <typename Clock, typename Step>
void repeat(const Clock& clock, const Options& options, const Step& step) {
  const master::Time start = clock.now();
  while (!InterruptGuard::interrupted() &&
         (options.seconds <= 0 || seconds_between(start, clock.now()) < options.seconds)) {
    step();
  }
}

// Waits until the next poll of the drive, or the end.
void wait_for_next(master::ObjectClient& objects, const Options& options, master::Time start) {
  constexpr master::Time slice = std::chrono::milliseconds(50);
  const auto duration = [](double seconds) { return links::from_seconds(seconds); };
  master::Time end = objects.now() + duration(options.interval_s);
  if (options.seconds > 0) end = std::min(end, start + duration(options.seconds));
  while (!InterruptGuard::interrupted() && objects.now() < end) objects.wait(std::min(slice, end - objects.now()));
}

void monitor_bus(const Options& options) {
  if (bus_kind(options.bus).kind != BusKind::can) {
    throw Failure::wrong_use(
        "monitor: it shows the traffic of CAN buses only; on this bus give --axis, or objects of a drive");
  }
  const auto bus = open_bus(options.bus);
  const master::Time start = bus->now();
  master::CanDecoder decoder;
  const auto listening = bus->listen([&](const master::Frame& frame) {
    const double at = seconds_between(start, bus->now());
    const master::Decoded decoded = decoder.decode(frame, bus->now());
    if (options.bus.node_id != 0 && decoded.node != options.bus.node_id) return;
    const std::string meaning = decoded.source.empty() ? decoded.text : decoded.source + " " + decoded.text;
    if (options.bus.json) {
      nlohmann::ordered_json json{
          {"seconds", at}, {"id", frame.id}, {"extended", frame.extended}, {"remote", frame.remote}};
      json["data"] = std::vector<unsigned>(frame.data.begin(), frame.data.begin() + (frame.remote ? 0 : frame.length));
      json["meaning"] = meaning;
      fmt::print("{}\n", json.dump());
    } else {
      fmt::print("{:12.6f}  {:<34} {}\n", at, decoded.raw, meaning);
    }
    std::fflush(stdout);
  });
  repeat(*bus, options, [&] { bus->run_for(std::chrono::milliseconds(50)); });
}

// In a pipe, each line is a change. The position of a controlled axis always jitters, so only a thousandth of a
// revolution counts as a change.
constexpr double moved_revolutions = 0.001;
constexpr double default_units_per_revolution = 131072.0;  // for drives that do not report it

bool is_news(const master::AxisStatus& before, const master::AxisStatus& now, double moved_units) {
  const std::int64_t moved = std::abs(std::int64_t{now.position} - before.position);
  return now.statusword != before.statusword || now.mode != before.mode || static_cast<double>(moved) > moved_units;
}

void print_axis(const Options& options, const master::UnitScale& scale, double at, const master::AxisStatus& status,
                std::string_view product, const std::string& emergency) {
  const std::string statusword = master::text_of_statusword(status.statusword, product, status.mode);
  const std::string_view mode_name = master::name(static_cast<master::OperationMode>(status.mode), product);
  const std::string mode = fmt::format("{} ({})", status.mode, mode_name);
  // Some drives have neither 606Ch nor 6077h.
  const std::string velocity = status.has_velocity ? scale.velocity(status.velocity) : "-";
  const std::string torque = status.has_torque ? fmt::format("{:.1f} %", status.torque / 10.0) : "-";
  if (options.bus.json) {
    nlohmann::ordered_json json{{"seconds", at},
                                {"state", drive::name(status.state())},
                                {"statusword", status.statusword},
                                {"mode", status.mode},
                                {"mode_name", mode_name},
                                {"position", status.position},
                                {"velocity", nullptr},
                                {"torque", nullptr},
                                {"emergency", emergency}};
    if (status.has_velocity) json["velocity"] = status.velocity;
    if (status.has_torque) json["torque"] = status.torque;
    if (scale.system != master::UnitSystem::drive) {
      json["units"] = master::names_of(scale.system).word;
      json["position_in_units"] = status.position / scale.drive.position;
      if (status.has_velocity) json["velocity_in_units"] = status.velocity / scale.drive.velocity;
    }
    fmt::print("{}\n", json.dump());
  } else if (on_terminal()) {
    fmt::print(
        "\x1B[H\x1B[Jstate       {}\nstatusword  {}\nmode        {}\nposition    {}\nvelocity    {}\n"
        "torque      {}\nlatest EMCY {}\n",
        drive::name(status.state()), statusword, mode, scale.position(status.position), velocity, torque,
        emergency.empty() ? "-" : emergency);
  } else {
    fmt::print("{:10.3f}  {}, mode {}, position {}, velocity {}, torque {}, statusword {}{}\n", at,
               drive::name(status.state()), mode, scale.position(status.position), velocity, torque, statusword,
               emergency.empty() ? "" : ", " + emergency);
  }
  std::fflush(stdout);
}

void monitor_axis(const Options& options) {
  const master::UnitChoice choice = options.units.choice();
  DriveLink link(options.bus, true);
  const auto opened = link.open_axis({});
  master::Axis402& axis = *opened;
  master::ObjectClient& objects = link.objects();
  const master::UnitScale scale = scale_of(axis, choice);
  const master::Time start = objects.now();
  const auto units = axis.units();
  const double moved_units = (units ? units->position : default_units_per_revolution) * moved_revolutions;
  std::optional<master::AxisStatus> last;
  std::string last_emergency;
  repeat(objects, options, [&] {
    const master::AxisStatus now = axis.status();
    const auto latest = axis.latest_emergency();
    const std::string emergency = latest ? master::text_of(*latest) : "";
    const bool live = on_terminal() && !options.bus.json;
    if (live || !last || is_news(*last, now, moved_units) || emergency != last_emergency) {
      print_axis(options, scale, seconds_between(start, objects.now()), now, axis.product().name, emergency);
      last = now;
      last_emergency = emergency;
    }
    wait_for_next(objects, options, start);
  });
}

struct Watched {
  master::ObjectAddress address;
  std::string name;
  std::string title;
  std::string unit;
  std::optional<dictionary::Type> type;
  std::vector<std::byte> value{};
  bool seen = false;
  bool changed = false;

  std::string text() const {
    return fmt::format("{}{}{}", master::text_of_value(value, type), unit.empty() ? "" : " ", unit);
  }
};

void note(Watched& one, std::vector<std::byte> value) {
  one.changed = !one.seen || value != one.value;
  one.seen = true;
  one.value = std::move(value);
}

// First poll: reports each object that the drive refuses, and drops it. Throws if the drive is silent, or no object is
// left.
void look_first(master::ObjectClient& objects, std::vector<Watched>& all) {
  std::string refusal;
  std::vector<Watched> readable;
  for (Watched& one : all) {
    try {
      note(one, objects.upload(one.address));
      readable.push_back(std::move(one));
    } catch (const master::ObjectError& error) {
      if (!error.answered()) throw;
      if (!refusal.empty()) warn(refusal);
      refusal = error.what();
    }
  }
  all = std::move(readable);
  if (all.empty()) throw Failure::did_not_work(refusal);
  if (!refusal.empty()) warn(refusal);
}

// Reads all objects with as few requests as the bus allows. Throws ObjectError.
void look(master::ObjectClient& objects, std::vector<Watched>& all) {
  std::vector<master::ObjectAddress> addresses;
  for (const Watched& one : all) addresses.push_back(one.address);
  for (const auto& set : objects.read_together(addresses)) {
    std::vector<master::ObjectAddress> together;
    for (const std::size_t i : set) together.push_back(addresses[i]);
    auto values = objects.upload_together(together);
    for (std::size_t k = 0; k < set.size(); ++k) note(all[set[k]], std::move(values[k]));
  }
}

void print_objects(const Options& options, double at, const std::vector<Watched>& all) {
  if (on_terminal() && !options.bus.json) {
    std::string page = "\x1B[H\x1B[J";
    for (const Watched& one : all) page += fmt::format("{:<44} {}\n", one.title, one.text());
    fmt::print("{}", page);
  } else {
    for (const Watched& one : all) {
      if (!one.changed) continue;
      if (options.bus.json) {
        nlohmann::ordered_json json{{"seconds", at}, {"object", master::text_of(one.address)}, {"name", one.name}};
        json["value"] = value_json(one.value, one.type);
        json["bytes"] = master::text_of_value(one.value, dictionary::Type::octet_string);
        json["unit"] = one.unit;
        fmt::print("{}\n", json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
      } else {
        fmt::print("{:10.3f}  {} = {}\n", at, one.title, one.text());
      }
    }
  }
  std::fflush(stdout);
}

void monitor_objects(const Options& options) {
  const ObjectNames names(options.eds);
  DriveLink link(options.bus, false);
  if (link.sdo() != nullptr) link.sdo()->cancel_when(InterruptGuard::interrupted);
  const master::ObjectCatalogue& catalogue = names.of(link);
  std::vector<Watched> all;
  for (const std::string& text : options.objects) {
    const master::ObjectAddress address = resolve(catalogue, text);
    const master::NamedObject* known = catalogue.find(address);
    Watched one{.address = address, .name = {}, .title = catalogue.title(address), .unit = {}, .type = {}};
    if (known != nullptr) {
      one.name = known->name;
      one.unit = known->unit;
      one.type = known->type;
    }
    all.push_back(std::move(one));
  }
  master::ObjectClient& objects = link.objects();
  const master::Time start = objects.now();
  look_first(objects, all);
  repeat(objects, options, [&] {
    print_objects(options, seconds_between(start, objects.now()), all);
    wait_for_next(objects, options, start);
    look(objects, all);
  });
}

void run(const Options& options) {
  if (!options.objects.empty() && options.axis) {
    throw Failure::wrong_use("monitor: it shows an axis or objects, not both; leave out --axis, or the objects");
  }
  if (!options.objects.empty() && options.units.choice().system != master::UnitSystem::drive) {
    throw Failure::wrong_use("--units: objects are shown in the drive's own units; leave out --units, or write --axis");
  }
  if (options.objects.empty() && !options.eds.empty()) {
    throw Failure::wrong_use("--eds: the file only gives names to objects; give the objects to show");
  }
  const InterruptGuard guard(InterruptGuard::Command::only_looks);
  try {
    if (!options.objects.empty()) {
      monitor_objects(options);
    } else {
      options.axis ? monitor_axis(options) : monitor_bus(options);
    }
  } catch (const master::MasterError&) {
    if (!InterruptGuard::interrupted()) throw;  // an access that Ctrl-C cut off is no failure
  }
}

}  // namespace monitor_command

void add_monitor(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "monitor",
      "Show decoded CAN traffic, or on any bus objects of a drive, or with --axis what an axis does, until Ctrl-C",
      monitor_command::run);
  command->add_option("OBJECT", options->objects, "INDEX[:SUB] in hexadecimal, or a name, e.g. 6064 or P01-02");
  add_drive_options(*command, options->bus, "Seconds to wait for each answer of the drive");
  command->add_option("--eds", options->eds, "Electronic data sheet with the drive's own objects, names and types");
  command->add_flag("--axis", options->axis, "Show state, mode, position, velocity and torque of one axis");
  add_unit_options(*command, options->units);
  add_seconds_option(*command, options->seconds, "Duration in seconds; until Ctrl-C if not given")
      ->check(number_within(0.001, 1e9));
  command->add_option("--interval", options->interval_s, "Seconds between two readings of the drive")
      ->check(number_within(0.001, 3600.0))
      ->capture_default_str();
}

}  // namespace servodrome::app
