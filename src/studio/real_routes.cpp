#include <array>
#include <fmt/format.h>

#include "axis/fault_report.hpp"
#include "drive/drive.hpp"
#include "line/bench/axis_view.hpp"
#include "line/bench/object_values.hpp"
#include "line/nearest_name.hpp"
#include "line/version.hpp"
#include "master/canopen/sdo_client.hpp"
#include "master/ethercat/coe_client.hpp"
#include "master/serial10/client.hpp"
#include "studio/real_drives.hpp"
#include "studio/real_server.hpp"
#include "studio/route_names.hpp"

// The API for real drives: a line reads the answers from its virtual drives, here the drives are asked over their
// buses.
namespace servodrome::studio {
namespace {

using dictionary::AbortCode;

constexpr const char* no_plant = "these are drives on a bus, and the program can only use what the bus offers";

RealDrives& drives_of(const Call& call) { return *static_cast<RealDrives*>(call.context); }

const RealDrives::Axis& axis_of_call(const Call& call) {
  const std::string_view name = call.arguments.front();
  if (const RealDrives::Axis* axis = drives_of(call).find(name)) return *axis;
  const std::vector<std::string> names = drives_of(call).names();
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), "address",
                 line::suggestion(name, {names.begin(), names.end()})};
}

// Converts an error of the master's side to the API's form, with the drive's own abort code if there is one.
template <typename Action>
auto asking(const std::string& where, const Action& action) {
  try {
    return action();
  } catch (const master::MasterError& error) {
    AbortCode abort = AbortCode::none;
    if (const auto* sdo = dynamic_cast<const master::SdoError*>(&error); sdo != nullptr && sdo->from_node()) {
      abort = sdo->code();
    } else if (const auto* coe = dynamic_cast<const master::CoeError*>(&error); coe != nullptr && coe->from_slave()) {
      abort = coe->code();
    } else if (const auto* serial = dynamic_cast<const master::Serial10Error*>(&error);
               serial != nullptr && serial->from_drive()) {
      abort = serial->code();
    }
    if (abort != AbortCode::none) line::bench::refuse_access(abort, where);
    throw ApiError{409, error.happened(), error.where(), error.remedy()};
  }
}

Json show_line(Call& call) {
  Json buses = Json::array();
  for (const auto& bus : drives_of(call).buses()) buses.push_back(bus->plan().link);
  Json missing = Json::object();
  for (const char* name : {"plant", "inputs", "power", "fault_injection", "disturbance", "geometry", "virtual_time"}) {
    missing[name] = no_plant;
  }
  Json names = Json::array();
  for (const std::string_view name : RealDrives::signal_names()) names.push_back(name);
  return Json{
      {"kind", "real"}, {"buses", std::move(buses)}, {"signals", std::move(names)}, {"missing", std::move(missing)}};
}

Json list_axes(Call& call) { return Json{{"axes", drives_of(call).views()}}; }

Json show_axis(Call& call) { return drives_of(call).view(axis_of_call(call)); }

Json show_states(Call& call) {
  const RealDrives::Axis& axis = axis_of_call(call);
  drives_of(call).require_ready(axis.name);
  const drive::PowerState state = drives_of(call).state_of(axis).status.state();
  const drive::Policy& policy = axis.device->drive().policy();
  return line::bench::states_view(state, policy, [&](const drive::Transition& transition) {
    constexpr std::uint8_t leave_quick_stop = 16;  // 605Ah decides whether a command triggers it
    if (transition.from != state) return false;
    if (transition.number == leave_quick_stop || transition.number == drive::release_quick_stop) return false;
    return transition.number != 3 || transition.command != drive::Command::enable_operation || policy.direct_enable;
  });
}

Json show_homing(Call& call) {
  const RealDrives::Axis& axis = axis_of_call(call);
  return line::bench::homing_view(axis.device->drive().policy(), false);
}

// Returns true if the object can be accessed over the drive's bus.
bool is_on_bus(const RealDrives::Axis& axis, const DriveBus& bus, const dictionary::Entry& entry) {
  if (bus.plan().type != "rs485") return !entry.local;
  if (bus.plan().link.starts_with("serial10:")) return entry.fixed_size() && dictionary::size_of(entry.type) <= 4;
  if (axis.tables->serial == nullptr) return false;
  const auto registers = axis.tables->serial->registers;
  return std::any_of(registers.begin(), registers.end(),
                     [&](const auto& row) { return row.index == entry.index && row.sub == entry.sub; });
}

Json list_objects(Call& call) {
  const RealDrives::Axis& axis = axis_of_call(call);
  const DriveBus& bus = *drives_of(call).buses()[axis.bus];
  Json objects = Json::array();
  for (const dictionary::Entry& entry : axis.device->dictionary().table()) {
    if (is_on_bus(axis, bus, entry)) {
      objects.push_back(line::bench::listed(entry, *axis.device, axis.tables->name));
    }
  }
  return Json{{"objects", std::move(objects)}};
}

struct Object {
  const RealDrives::Axis& axis;
  dictionary::Entry entry;
  std::string where;
};

// An object that no table contains is read as bytes.
Object object_argument(Call& call) {
  const RealDrives::Axis& axis = axis_of_call(call);
  const auto [index, sub] = line::bench::object_address(call.arguments[1], call.arguments[2]);
  std::string where = fmt::format("{}, {:04X}h:{:02X}", axis.name, index, sub);
  const dictionary::Entry* known = axis.device->dictionary().find(index, sub);
  if (known != nullptr) return {axis, *known, std::move(where)};
  dictionary::Entry bytes;
  bytes.index = index;
  bytes.sub = sub;
  bytes.type = dictionary::Type::domain;
  return {axis, bytes, std::move(where)};
}

Json read_object(Call& call) {
  const Object object = object_argument(call);
  drives_of(call).require_ready(object.axis.name);
  return asking(object.where, [&] {
    const auto bytes = drives_of(call).open(object.axis)->upload({object.entry.index, object.entry.sub});
    return line::bench::shown(object.entry, bytes);
  });
}

Json read_values(Call& call) {
  const RealDrives::Axis& axis = axis_of_call(call);
  const auto asked = line::bench::object_list(query_value(call, "objects").value_or(""));
  Json values = Json::object();
  for (const auto& [text, address] : asked) {
    Json& value = values[text] = nullptr;
    const dictionary::Entry* entry = axis.device->dictionary().find(address.index, address.sub);
    if (entry == nullptr || drives_of(call).state_of(axis).problem) continue;
    try {
      const auto bytes = drives_of(call).open(axis)->upload({address.index, address.sub});
      value = line::bench::shown(*entry, bytes)["value"];
    } catch (const master::MasterError&) {
      // The object does not exist, or the drive is silent; then its state shows that.
    }
  }
  return Json{{"values", std::move(values)}};
}

Json write_object(Call& call) {
  const Object object = object_argument(call);
  BodyReader body(call.body);
  const Json value = body.required("value");
  body.finish();
  const std::vector<std::byte> bytes = line::bench::bytes_of(object.entry, value, object.where);
  drives_of(call).require_ready(object.axis.name);
  asking(object.where, [&] {
    drives_of(call).open(object.axis)->download({object.entry.index, object.entry.sub}, bytes);
  });
  return nullptr;
}

Json view_of(const master::ReportedFault& fault, const RealDrives::Axis& axis) {
  const std::string text = master::text_of(fault, axis.product);
  Json view{{"code", fmt::format("0x{:04X}", fault.code)},
            {"name", fault.code == 0 ? text : text.substr(std::min(text.find(' ') + 1, text.size()))}};
  if (fault.alarm != 0) view["alarm"] = describe::alarm_name(axis.product, fault.alarm);
  if (fault.meanings.size() == 1) {
    view["text"] = fault.meanings.front()->text;
    view["cause"] = fault.meanings.front()->cause;
    view["remedy"] = fault.meanings.front()->remedy;
  }
  return view;
}

Json show_faults(Call& call) {
  const RealDrives::Axis& axis = axis_of_call(call);
  drives_of(call).require_ready(axis.name);
  return asking(axis.name, [&] {
    const auto objects = drives_of(call).open(axis);
    const master::FaultReport report = master::read_faults(*objects, master::dialect_of(axis.product));
    Json active = Json::array();
    for (const auto* list : {&report.active, &report.warnings}) {
      for (const master::ReportedFault& fault : *list) active.push_back(view_of(fault, axis));
    }
    Json history = Json::array();
    for (const auto* list : {&report.history, &report.log}) {
      for (const master::ReportedFault& fault : *list) history.push_back(view_of(fault, axis));
    }
    return Json{{"active", std::move(active)},
                {"history", std::move(history)},
                {"injected", Json::array()},
                {"injectable", {{"plant", Json::array()}, {"drive", Json::array()}}}};
  });
}

Json view_of(const RealDrives& drives, std::size_t index) {
  const DriveBus& bus = *drives.buses()[index];
  const DriveBus::State state = bus.state();
  Json axes = Json::object();
  for (const RealDrives::Axis& axis : drives.all()) {
    if (axis.bus != index) continue;
    axes[axis.name] = {{"address", axis.address}, {"answers", !state.drives[axis.drive].problem}};
  }
  Json view{{"name", bus.plan().link}, {"type", bus.plan().type}, {"connected", !state.problem}};
  if (state.problem) {
    view["problem"] = {{"what", state.problem->what}, {"where", state.problem->where}, {"hint", state.problem->hint}};
  }
  view["frames"] = state.accesses;
  view["errors"] = state.failed;
  view["lost"] = state.losses;
  view["access_ms"] = state.access_s * 1000;
  view["disturbance"] = nullptr;
  view["axes"] = std::move(axes);
  view["links"] = Json::array();
  return view;
}

Json list_buses(Call& call) {
  Json buses = Json::array();
  for (std::size_t i = 0; i < drives_of(call).buses().size(); ++i) buses.push_back(view_of(drives_of(call), i));
  return Json{{"buses", std::move(buses)}};
}

Json show_clock(Call& call) { return drives_of(call).clock(); }

Json show_version(Call&) { return Json{{"name", "servodrome"}, {"version", line::version()}, {"api", 1}}; }

Json refuse(Call&) {
  throw ApiError{409, "this is possible with simulated drives only", "address",
                 fmt::format("{}; `servodrome up` runs simulated drives", no_plant)};
}

constexpr std::array real_table{
    Route{Method::get, "/api/v1/line", show_line},
    Route{Method::get, "/api/v1/axes", list_axes},
    Route{Method::get, "/api/v1/axes/{}", show_axis},
    Route{Method::get, "/api/v1/axes/{}/states", show_states},
    Route{Method::get, "/api/v1/axes/{}/homing", show_homing},
    Route{Method::get, "/api/v1/axes/{}/objects", list_objects},
    Route{Method::get, "/api/v1/axes/{}/objects/{}/{}", read_object},
    Route{Method::put, "/api/v1/axes/{}/objects/{}/{}", write_object},
    Route{Method::get, "/api/v1/axes/{}/values", read_values},
    Route{Method::get, "/api/v1/axes/{}/faults", show_faults},
    Route{Method::get, "/api/v1/buses", list_buses},
    Route{Method::get, "/api/v1/clock", show_clock},
    Route{Method::get, "/api/v1/version", show_version},
    // Available only on a virtual line.
    Route{Method::post, "/api/v1/axes/{}/power", refuse},
    Route{Method::get, "/api/v1/axes/{}/geometry", refuse},
    Route{Method::get, "/api/v1/axes/{}/inputs", refuse},
    Route{Method::put, "/api/v1/axes/{}/inputs", refuse},
    Route{Method::get, "/api/v1/axes/{}/plant", refuse},
    Route{Method::put, "/api/v1/axes/{}/plant", refuse},
    Route{Method::post, "/api/v1/axes/{}/faults", refuse},
    Route{Method::delete_, "/api/v1/axes/{}/faults", refuse},
    Route{Method::post, "/api/v1/buses/{}/disturb", refuse},
    Route{Method::delete_, "/api/v1/buses/{}/disturb", refuse},
    Route{Method::put, "/api/v1/clock", refuse},
    Route{Method::post, "/api/v1/clock/advance", refuse},
};

}  // namespace

line::bench::RouteGroup real_routes(RealDrives& drives) { return {real_table, &drives}; }

}  // namespace servodrome::studio
