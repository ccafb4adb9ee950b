#include "studio/real_bench.hpp"

#include <fmt/format.h>

#include "api/change_log.hpp"
#include "api/query.hpp"
#include "axis/fault_report.hpp"
#include "catalogue/product.hpp"
#include "drive/drive.hpp"
#include "line/bench/axis_view.hpp"
#include "line/bench/object_values.hpp"
#include "links/nearest_name.hpp"
#include "master/canopen/sdo_client.hpp"
#include "master/ethercat/coe_client.hpp"
#include "master/serial10/client.hpp"
#include "studio/route_names.hpp"

namespace servodrome::studio {
namespace {

using dictionary::AbortCode;

const RealDrives::Axis& axis_argument(const RealDrives& drives, const Call& call) {
  const std::string_view name = call.arguments.front();
  if (const RealDrives::Axis* axis = drives.find(name)) return *axis;
  const std::vector<std::string> names = drives.names();
  throw ApiError{404, fmt::format("there is no axis \"{}\"", name.substr(0, 40)), "address",
                 links::suggestion(name, {names.begin(), names.end()})};
}

// Converts an error of the master's side to the API's form, with the drive's own abort code if there is one.
// `if_absent`: the status if the drive answers without an abort code that it does not have the object.
template <typename Action>
auto asking(const std::string& where, const Action& action, unsigned if_absent = 404) {
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
    const auto* access = dynamic_cast<const master::ObjectError*>(&error);
    const bool absent = access != nullptr && access->object_is_absent();
    throw ApiError{absent ? if_absent : 409U, error.happened(), error.where(), error.remedy()};
  }
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

struct Object {
  const RealDrives::Axis& axis;
  dictionary::Entry entry;
  std::string where;
  bool is_known;  // the tables of the product contain it
};

// An object that no table contains is read as bytes.
Object object_argument(const RealDrives& drives, const Call& call) {
  const RealDrives::Axis& axis = axis_argument(drives, call);
  const auto [index, sub] = line::bench::object_address(call.arguments[1], call.arguments[2]);
  std::string where = fmt::format("{}, {:04X}h:{:02X}", axis.name, index, sub);
  const dictionary::Entry* known = axis.device->dictionary().find(index, sub);
  if (known != nullptr) return {axis, *known, std::move(where), true};
  dictionary::Entry bytes;
  bytes.index = index;
  bytes.sub = sub;
  bytes.type = dictionary::Type::domain;
  return {axis, bytes, std::move(where), false};
}

Json view_of(const master::ReportedFault& fault, const RealDrives::Axis& axis) {
  const std::string text = master::text_of(fault, axis.product);
  Json view{{"code", fmt::format("0x{:04X}", fault.code)},
            {"name", fault.code == 0 ? text : text.substr(std::min(text.find(' ') + 1, text.size()))}};
  if (fault.alarm != 0) view["alarm"] = catalogue::alarm_name(axis.product, fault.alarm);
  if (fault.meanings.size() == 1) {
    view["text"] = fault.meanings.front()->text;
    view["cause"] = fault.meanings.front()->cause;
    view["remedy"] = fault.meanings.front()->remedy;
  }
  return view;
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
  if (bus.plan().type == "ethercat") view["cycles"] = bus.cycle().count();
  view["sampling_hz"] = drives.most_sampling_hz(index);
  view["disturbance"] = nullptr;
  view["axes"] = std::move(axes);
  view["links"] = Json::array();
  return view;
}

// The bytes of the object's value: an answer that does not tell its size has four.
std::vector<std::byte> value_of(master::ObjectClient& objects, const dictionary::Entry& entry) {
  std::vector<std::byte> bytes = objects.upload({entry.index, entry.sub});
  const std::size_t size = dictionary::size_of(entry.type);
  if (!objects.size_is_known() && size > 0 && bytes.size() > size) bytes.resize(size);
  return bytes;
}

// Throws ApiError if the drive does not have the object, or does not answer.
void require_in_drive(RealDrives& drives, const Object& object) {
  asking(object.where, [&] {
    try {
      drives.open(object.axis)->upload({object.entry.index, object.entry.sub});
    } catch (const master::ObjectError& error) {
      if (error.object_is_absent() || !error.answered()) throw;
      // It may be write-only.
    }
  });
}

}  // namespace

std::size_t bus_argument(const RealDrives& drives, const Call& call) {
  const std::string name = api::unescaped(call.arguments.front());
  std::vector<std::string_view> known;
  for (std::size_t i = 0; i < drives.buses().size(); ++i) {
    if (drives.buses()[i]->plan().link == name) return i;
    known.emplace_back(drives.buses()[i]->plan().link);
  }
  throw ApiError{404, fmt::format("there is no bus \"{}\"", name.substr(0, 80)), "address",
                 links::suggestion(name, known)};
}

Json RealBench::show_line(Call&) {
  Json buses = Json::array();
  for (const auto& bus : drives_.buses()) buses.push_back(bus->plan().link);
  Json missing = Json::object();
  for (const char* name :
       {"plant", "inputs", "power", "fault_injection", "disturbance", "geometry", "virtual_time", "scenario"}) {
    missing[name] = no_plant;
  }
  Json names = Json::array();
  for (const std::string_view name : RealDrives::signal_names()) names.push_back(name);
  return Json{
      {"kind", "real"}, {"buses", std::move(buses)}, {"signals", std::move(names)}, {"missing", std::move(missing)}};
}

Json RealBench::list_axes(Call&) { return Json{{"axes", drives_.views()}}; }

Json RealBench::show_axis(Call& call) { return drives_.view(axis_argument(drives_, call)); }

Json RealBench::show_states(Call& call) {
  const RealDrives::Axis& axis = axis_argument(drives_, call);
  drives_.require_ready(axis.name);
  const drive::PowerState state = drives_.state_of(axis).status.state();
  const drive::Policy& policy = axis.device->drive().policy();
  return line::bench::states_view(state, policy, [&](const drive::Transition& transition) {
    constexpr std::uint8_t leave_quick_stop = 16;  // 605Ah decides whether a command triggers it
    if (transition.from != state) return false;
    if (transition.number == leave_quick_stop || transition.number == drive::release_quick_stop) return false;
    return transition.number != 3 || transition.command != drive::Command::enable_operation ||
           policy.power.direct_enable;
  });
}

Json RealBench::show_homing(Call& call) {
  const RealDrives::Axis& axis = axis_argument(drives_, call);
  const drive::Policy& policy = axis.device->drive().policy();
  Json view = line::bench::homing_view(policy, false);
  // Null: the product is unknown, or has several encoders.
  const bool one_encoder = !axis.product.empty() && !catalogue::product_of(axis.product).dialect.encoder_counts;
  view["index_available"] = one_encoder ? Json(axis.device->drive().axis().configuration.index_available) : Json();
  view["selected"] = nullptr;
  if (drives_.state_of(axis).problem) return view;
  try {
    const auto method = drives_.open(axis)->read_if_present<std::int8_t>(0x6098);
    if (method && drive::find_method(policy.homing.methods, *method) != nullptr) view["selected"] = *method;
  } catch (const master::MasterError&) {
    // The state of the drive shows that it is silent.
  }
  return view;
}

Json RealBench::list_objects(Call& call) {
  const RealDrives::Axis& axis = axis_argument(drives_, call);
  const DriveBus& bus = *drives_.buses()[axis.bus];
  Json objects = Json::array();
  for (const dictionary::Entry& entry : axis.device->dictionary().table()) {
    if (is_on_bus(axis, bus, entry)) {
      objects.push_back(line::bench::listed(entry, *axis.device, axis.tables->name));
    }
  }
  return Json{{"objects", std::move(objects)}};
}

Json RealBench::read_object(Call& call) {
  const Object object = object_argument(drives_, call);
  drives_.require_ready(object.axis.name);
  return asking(object.where,
                [&] { return line::bench::shown(object.entry, value_of(*drives_.open(object.axis), object.entry)); });
}

Json RealBench::read_values(Call& call) {
  const RealDrives::Axis& axis = axis_argument(drives_, call);
  const auto asked = line::bench::object_list(query_value(call, "objects").value_or(""));
  Json values = Json::object();
  for (const auto& [text, address] : asked) {
    Json& value = values[text] = nullptr;
    const dictionary::Entry* entry = axis.device->dictionary().find(address.index, address.sub);
    if (entry == nullptr || drives_.state_of(axis).problem) continue;
    try {
      value = line::bench::shown(*entry, value_of(*drives_.open(axis), *entry))["value"];
    } catch (const master::MasterError&) {
      // The object does not exist, or the drive is silent; then its state shows that.
    }
  }
  return Json{{"values", std::move(values)}};
}

Json RealBench::write_object(Call& call) {
  const Object object = object_argument(drives_, call);
  BodyReader body(call.body);
  const Json value = body.required("value");
  body.finish();
  drives_.require_ready(object.axis.name);
  if (!object.is_known) require_in_drive(drives_, object);
  const std::vector<std::byte> bytes = line::bench::bytes_of(object.entry, value, object.where);
  if (object.entry.index == 0x6040) drives_.note_command(object.axis);
  if (api::ChangeLog::is_motion(object.entry.index)) drives_.note_motion(object.axis.name);
  // The answer of a Modbus drive is the same for a register that can only be read.
  const auto write = [&] { drives_.open(object.axis)->download({object.entry.index, object.entry.sub}, bytes); };
  asking(object.where, write, 409);
  return nullptr;
}

Json RealBench::show_faults(Call& call) {
  const RealDrives::Axis& axis = axis_argument(drives_, call);
  drives_.require_ready(axis.name);
  return asking(axis.name, [&] {
    const auto objects = drives_.open(axis);
    const master::FaultReport report = master::read_faults(*objects, catalogue::product_of(axis.product));
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

Json RealBench::list_buses(Call&) {
  Json buses = Json::array();
  for (std::size_t i = 0; i < drives_.buses().size(); ++i) buses.push_back(view_of(drives_, i));
  return Json{{"buses", std::move(buses)}};
}

Json RealBench::show_bus(Call& call) { return view_of(drives_, bus_argument(drives_, call)); }

Json RealBench::scan_bus(Call& call) {
  const std::size_t bus = bus_argument(drives_, call);
  BodyReader(call.body, true).finish();
  Json found = Json::array();
  asking(drives_.buses()[bus]->plan().link, [&] {
    for (const OpenBus::Found& device : drives_.scan(bus)) {
      Json axis = nullptr;
      for (const RealDrives::Axis& known : drives_.all()) {
        if (known.bus == bus && known.address == device.address) axis = known.name;
      }
      found.push_back({{"address", device.address},
                       {"name", device.name},
                       {"kind", device.kind},
                       {"product", device.product},
                       {"axis", std::move(axis)}});
    }
  });
  return Json{{"found", std::move(found)}};
}

Json RealBench::show_clock(Call&) { return drives_.clock(); }

}  // namespace servodrome::studio
