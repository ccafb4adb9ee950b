#include "line/bench/axis_view.hpp"

#include <fmt/format.h>
#include <optional>

#include "canopen/node.hpp"
#include "drive/drive.hpp"
#include "ethercat/slave/slave.hpp"

namespace servodrome::line::bench {
namespace {

const char* word(canopen::NmtState state) {
  switch (state) {
    case canopen::NmtState::initialising: return "initialising";
    case canopen::NmtState::stopped: return "stopped";
    case canopen::NmtState::operational: return "operational";
    case canopen::NmtState::pre_operational: return "pre_operational";
  }
  return "unknown";
}

const char* word(products::Light light) {
  switch (light) {
    case products::Light::off: return "off";
    case products::Light::on: return "on";
    case products::Light::blinking: return "blinking";
    case products::Light::flickering: return "flickering";
    case products::Light::flashes: return "flashes";
  }
  return "unknown";
}

Json lamps_view(products::Device& device, Time now) {
  Json lamps = Json::array();
  const products::Lamps shown = device.lamps(now);
  for (const products::Lamp& lamp : shown.all()) {
    lamps.push_back({{"name", lamp.name}, {"colour", lamp.colour}, {"light", word(lamp.light)}});
    if (lamp.light == products::Light::flashes) lamps.back()["flashes"] = lamp.flashes;
  }
  return lamps;
}

// The target of profile position as a position of the shaft. nullopt: none was given since the mode was chosen.
std::optional<std::int64_t> target_counts(const drive::Drive& drive) {
  const drive::Axis& axis = drive.axis();
  if (drive.mode() != drive::Mode::profile_position || !axis.commanded) return std::nullopt;
  std::int64_t user = *axis.commanded + axis.turn_of_demand();
  if (axis.software_limits_active()) user = axis.within_limits_of_turn(user);
  return axis.units.to_counts(user) - axis.offset;
}

}  // namespace

const char* mode_name(drive::Mode mode) {
  switch (mode) {
    case drive::Mode::pulse: return "pulse";
    case drive::Mode::immediate_velocity: return "immediate_velocity";
    case drive::Mode::none: return "none";
    case drive::Mode::profile_position: return "profile_position";
    case drive::Mode::velocity: return "velocity";
    case drive::Mode::profile_velocity: return "profile_velocity";
    case drive::Mode::profile_torque: return "profile_torque";
    case drive::Mode::homing: return "homing";
    case drive::Mode::interpolated_position: return "interpolated_position";
    case drive::Mode::cyclic_sync_position: return "cyclic_sync_position";
    case drive::Mode::cyclic_sync_velocity: return "cyclic_sync_velocity";
    case drive::Mode::cyclic_sync_torque: return "cyclic_sync_torque";
  }
  return "unknown";
}

std::vector<const drive::FaultRow*> active_faults(Axis& axis) {
  std::vector<const drive::FaultRow*> faults;
  if (!axis.powered()) return faults;
  const drive::Drive& drive = axis.device().drive();
  for (unsigned cause = 1; cause < 256; ++cause) {
    if (!drive.is_active(static_cast<drive::Cause>(cause))) continue;
    if (const drive::FaultRow* row = drive.row(static_cast<drive::Cause>(cause))) faults.push_back(row);
  }
  return faults;
}

std::vector<const drive::FaultRow*> active_warnings(Axis& axis) {
  std::vector<const drive::FaultRow*> warnings;
  if (!axis.powered()) return warnings;
  const drive::Drive& drive = axis.device().drive();
  for (unsigned cause = 1; cause < 256; ++cause) {
    if (!drive.warns(static_cast<drive::Cause>(cause))) continue;
    if (const drive::FaultRow* row = drive.row(static_cast<drive::Cause>(cause))) warnings.push_back(row);
  }
  return warnings;
}

Json view_of(const drive::FaultRow& row) {
  return Json{{"code", fmt::format("0x{:04X}", row.code)}, {"name", row.name}};
}

Json view_of(const Line& line, Axis& axis) {
  const AxisSettings& settings = axis.settings();
  products::Device& device = axis.device();
  Json view{{"name", settings.name}, {"product", settings.product->name}};
  view["bus"] = nullptr;
  if (settings.bus) view["bus"] = line.buses()[*settings.bus]->settings.name;
  if (device.can_node() != nullptr) {
    view["node_id"] = device.node_id();
    view["bit_rate"] = device.bit_rate();
  }
  if (const ethercat::Slave* slave = device.ethercat_slave(); slave != nullptr && settings.ethercat) {
    view["bus"] = line.ethercat_buses()[settings.ethercat->bus]->settings.name;
    view["position"] = axis.position();
    view["alias"] = device.ethercat_controller()->station_alias();
    view["al_state"] = ethercat::text(slave->state());
    view["al_status_code"] = static_cast<unsigned>(slave->status_code());
  }
  if (settings.serial) {
    const products::SerialPort& port = *device.serial_port();
    view["serial"] = {{"bus", line.serial_buses()[settings.serial->bus]->settings.name},
                      {"station", port.station()},
                      {"protocol", name_of(port.protocol())}};
  } else {
    view["serial"] = nullptr;
  }
  view["coupled"] = Json::array();
  if (const CoupledAxes* pair = axis.pair()) view["coupled"].push_back(pair->partner_of(axis).settings().name);
  view["powered"] = axis.powered();
  if (axis.powered()) {
    const drive::Drive& drive = device.drive();
    const drive::Mode mode = drive.mode();
    if (const canopen::Node* node = device.can_node()) view["nmt_state"] = word(node->nmt_state());
    view["state"] = drive::name(drive.state());
    view["mode"] = static_cast<int>(mode);
    view["mode_name"] = mode_name(mode);
    view["statusword"] = drive.statusword();
    view["controlword"] = device.dictionary().number(0x6040);
    view["error_code"] = device.dictionary().number(0x603F);
    view["homed"] = drive.homed();
    const std::optional<std::int64_t> target = target_counts(drive);
    view["target_counts"] = target ? Json(*target) : Json();
    if (device.dictionary().find(0x6064, 0) != nullptr) view["position_actual"] = device.dictionary().number(0x6064);
    view["in_motion"] = drive.in_motion();
    view["outputs"] = Json::object();
    for (unsigned wire = 0; wire < settings.product->output_wires; ++wire) {
      view["outputs"][fmt::format("DO{}", wire)] = (axis.actuation().outputs >> wire & 1U) != 0;
    }
    view["lamps"] = lamps_view(device, line.now());
    view["warnings"] = Json::array();
    for (const drive::FaultRow* row : active_warnings(axis)) view["warnings"].push_back(view_of(*row));
  }
  view["faults"] = Json::array();
  for (const drive::FaultRow* row : active_faults(axis)) view["faults"].push_back(view_of(*row));
  const plant::Plant& plant = axis.plant();
  view["position_counts"] = plant.position_counts();
  view["velocity_rpm"] = plant.velocity_rpm();
  view["torque_nm"] = plant.torque_nm();
  view["current_a"] = plant.current_a();
  view["temperature_c"] = plant.winding_temperature_c();
  view["stage_temperature_c"] = plant.power_stage_temperature_c();
  view["supply_v"] = plant.dc_link_v();
  view["brake_engaged"] = plant.brake_engaged();
  return view;
}

}  // namespace servodrome::line::bench
