// The samples, views and events of RealDrives.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fmt/format.h>
#include <limits>

#include "axis/fault_report.hpp"
#include "drive/drive.hpp"
#include "line/axis.hpp"
#include "line/bench/axis_view.hpp"
#include "links/nearest_name.hpp"
#include "studio/real_drives.hpp"

namespace servodrome::studio {
namespace {

using api::ApiError;
using api::Json;
using api::NamedChannel;

constexpr double no_value = std::numeric_limits<double>::quiet_NaN();

double number_of(dictionary::Type type, std::span<const std::byte> bytes) {
  if (bytes.empty()) return no_value;
  const std::size_t size =
      std::min<std::size_t>(bytes.size(), dictionary::size_of(type));  // an answer may have more: size_is_known()
  const std::int64_t raw = dictionary::decode_number(type, bytes.first(size));
  switch (type) {
    case dictionary::Type::real32: return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
    case dictionary::Type::unsigned64: return static_cast<double>(static_cast<std::uint64_t>(raw));
    default: return static_cast<double>(raw);
  }
}

// Equivalents of a line's signals for a drive that only has its objects.
struct Signal {
  const char* name;
  const char* unit;
  std::uint16_t index;
  dictionary::Type type;
  double (*of)(double number);
  double (*present)(const DriveBus::DriveState& state);  // the last polled value, without an access
};
using State = DriveBus::DriveState;
double as_it_is(double number) { return number; }
double state_of_word(double word) { return static_cast<double>(master::state_of(static_cast<std::uint16_t>(word))); }
constexpr std::array signals{
    Signal{"position_counts", "units", 0x6064, dictionary::Type::integer32, as_it_is,
           [](const State& state) { return static_cast<double>(state.status.position); }},
    Signal{"velocity", "units/s", 0x606C, dictionary::Type::integer32, as_it_is,
           [](const State& state) { return static_cast<double>(state.status.velocity); }},
    Signal{"following_error", "units", 0x60F4, dictionary::Type::integer32, as_it_is,
           [](const State&) { return no_value; }},
    Signal{"torque_percent", "%", 0x6077, dictionary::Type::integer16, [](double permille) { return permille / 10; },
           [](const State& state) { return state.status.torque / 10.0; }},
    Signal{"statusword", "", 0x6041, dictionary::Type::unsigned16, as_it_is,
           [](const State& state) { return static_cast<double>(state.status.statusword); }},
    Signal{"state", "", 0x6041, dictionary::Type::unsigned16, state_of_word,
           [](const State& state) { return static_cast<double>(state.status.state()); }},
    Signal{"fault_code", "", 0x603F, dictionary::Type::unsigned16, as_it_is,
           [](const State& state) { return static_cast<double>(state.error_code); }},
};

}  // namespace

std::int64_t RealDrives::tick() const { return (now() - master::Time(latency)) / line::tick_length; }

std::vector<std::string_view> RealDrives::signal_names() {
  std::vector<std::string_view> names;
  for (const Signal& row : signals) names.emplace_back(row.name);
  return names;
}

NamedChannel RealDrives::signal(const std::string& name, std::string_view signal) {
  const Axis& axis = axis_of(name);
  for (const Signal& row : signals) {
    if (row.name != signal) continue;
    return channel({&axis, {row.index, 0}, [&row](auto bytes) { return row.of(number_of(row.type, bytes)); }},
                   {{"axis", name}, {"signal", signal}, {"name", row.name}, {"unit", row.unit}},
                   [this, &axis, &row] { return row.present(state_of(axis)); });
  }
  throw ApiError{422, fmt::format("a drive on a bus has no signal \"{}\"", signal.substr(0, 40)), name,
                 links::suggestion(signal, signal_names()) + "; or give an object"};
}

NamedChannel RealDrives::object(const std::string& name, std::uint16_t index, std::uint8_t sub) {
  const Axis& axis = axis_of(name);
  const std::string text = fmt::format("{:04X}:{:02X}", index, sub);
  const dictionary::Entry* entry = axis.device->dictionary().find(index, sub);
  if (entry == nullptr || !entry->readable() || !entry->fixed_size()) {
    throw ApiError{422, fmt::format("{} {}", text, entry == nullptr ? "is not known" : "is not a readable number"),
                   name, fmt::format("GET /api/v1/axes/{}/objects lists the objects", name)};
  }
  return channel({&axis, {index, sub}, [type = entry->type](auto bytes) { return number_of(type, bytes); }},
                 {{"axis", name}, {"object", text}, {"name", entry->name}, {"unit", entry->unit}},
                 [] { return no_value; });
}

Json RealDrives::clock() {
  return {{"mode", "real"},
          {"time_ns", now().count()},
          {"time_ms", std::chrono::duration<double, std::milli>(now()).count()},
          {"ticks", now() / line::tick_length},
          {"speed", 1.0},
          {"lag_ms", 0.0},
          {"lag_count", 0}};
}

Json RealDrives::view(const Axis& axis) const {
  const DriveBus& bus = *buses_[axis.bus];
  const DriveBus::DriveState state = state_of(axis);
  Json view{{"name", axis.name},
            {"product", axis.product.empty() ? "CiA 402 drive" : axis.product},
            {"bus", bus.plan().link}};
  if (bus.plan().type == "can") view["node_id"] = axis.address;
  if (bus.plan().type == "ethercat") view["position"] = axis.address;
  view["serial"] = nullptr;
  if (bus.plan().type == "rs485") {
    view["serial"] = {{"bus", bus.plan().link}, {"station", axis.address}, {"protocol", "modbus"}};
    if (bus.plan().link.starts_with("serial10:")) view["serial"]["protocol"] = "serial10";
  }
  view["powered"] = !state.problem;
  if (state.problem) {
    view["problem"] = {{"what", state.problem->what}, {"where", state.problem->where}, {"hint", state.problem->hint}};
  } else {
    view["state"] = drive::name(state.status.state());
    view["mode"] = state.status.mode;
    view["mode_name"] = line::bench::mode_name(static_cast<drive::Mode>(state.status.mode));
    view["statusword"] = state.status.statusword;
    view["controlword"] = state.controlword;
    view["error_code"] = state.error_code;
    view["watch"] = nullptr;
    if (state.watch) view["watch"] = {{"by", state.watch->by}, {"within_s", state.watch->within_s}};
  }
  view["faults"] = Json::array();
  if (!state.problem && state.error_code != 0) {
    const master::ReportedFault fault = master::fault_of_code(state.error_code, {0x603F, 0}, axis.product);
    const std::string text = master::text_of(fault, axis.product);
    view["faults"].push_back({{"code", fmt::format("0x{:04X}", state.error_code)},
                              {"name", text.substr(std::min(text.find(' ') + 1, text.size()))}});
  }
  view["position_counts"] = state.status.position;
  view["velocity"] = state.status.velocity;
  view["torque_percent"] = state.status.torque / 10.0;
  for (const char* unknown :
       {"velocity_rpm", "torque_nm", "current_a", "temperature_c", "stage_temperature_c", "supply_v"}) {
    view[unknown] = nullptr;
  }
  return view;
}

std::vector<Json> RealDrives::views() {
  std::vector<Json> views;
  for (const Axis& axis : axes_) views.push_back(view(axis));
  return views;
}

// Notes the writes of other masters. A controlword of theirs counts as a command, too.
void RealDrives::note_foreign_writes() {
  std::size_t first = 0;  // axis of the bus's first drive
  for (const auto& bus : buses_) {
    for (const ForeignWrites::Write& write : bus->take_foreign_writes()) {
      if (write.object.index == 0x6040) note_command(axes_[first + write.drive]);
      changes_->note(first + write.drive, write.object, write.before, write.value, "SDO on " + bus->plan().link);
    }
    first += bus->plan().drives.size();
  }
}

std::vector<Json> RealDrives::events() {
  const std::int64_t now = tick();
  std::vector<Json> events;
  const auto tell = [&](const char* kind, const Json& axis, Json details) {
    Json event{{"kind", kind}, {"axis", axis}, {"tick", now}};
    event.update(details);
    events.push_back(std::move(event));
  };
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    const auto problem = buses_[i]->state().problem;
    if (problem.has_value() == !told_of_buses_[i].there) continue;
    told_of_buses_[i].there = !problem;
    Json details{{"bus", buses_[i]->plan().link}, {"connected", !problem}};
    if (problem) details["problem"] = {{"what", problem->what}, {"where", problem->where}, {"hint", problem->hint}};
    tell("bus", nullptr, std::move(details));
  }
  changes_->collect();  // those of other masters, too
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const DriveBus::DriveState state = state_of(axes_[i]);
    Told& told = told_[i];
    if (state.problem.has_value() == told.there) tell("power", axes_[i].name, {{"powered", !state.problem}});
    told.there = !state.problem;
    if (state.problem) continue;
    const std::string name = drive::name(state.status.state());
    if (name != told.state) tell("state", axes_[i].name, {{"state", name}});
    told.state = name;
    if (state.error_code == told.error_code) continue;
    const std::uint16_t code = state.error_code != 0 ? state.error_code : told.error_code;
    tell(state.error_code != 0 ? "fault" : "fault_gone", axes_[i].name, {{"code", fmt::format("0x{:04X}", code)}});
    told.error_code = state.error_code;
  }
  return events;
}

}  // namespace servodrome::studio
