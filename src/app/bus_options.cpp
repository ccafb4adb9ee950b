#include "app/bus_options.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "app/commands.hpp"
#include "app/number_options.hpp"
#include "links/can/link_name.hpp"
#include "links/link_error.hpp"
#include "links/link_scheme.hpp"

namespace servodrome::app {
namespace {

constexpr master::Time progress_period = std::chrono::milliseconds(100);

}  // namespace

void add_bus_options(CLI::App& command, BusOptions& options, const std::string& timeout_help) {
  command.add_option("--bus", options.link, "CAN link: " + links::client_forms(links::can_schemes, " or "))
      ->capture_default_str();
  command.add_option("--timeout", options.timeout_s, timeout_help)
      ->check(number_within(0.001, 1e6))
      ->capture_default_str();
  command.add_flag("--json", options.json, "Print JSON");
}

void add_node_option(CLI::App& command, BusOptions& options) {
  command.add_option("--node", options.node_id, "Node-ID, 1..127; the only node found if not given")
      ->check(CLI::Range(1, 65535).description(""));
}

std::string can_or_ethercat_help() {
  return fmt::format("CAN link: {}; or EtherCAT: {}", links::client_forms(links::can_schemes, " or "),
                     links::client_forms(links::ethercat_schemes_easiest_first, " or "));
}

std::string serial_link_help() {
  return "modbus:LINK or serial10:LINK with " + links::client_forms(links::serial_schemes, " or (modbus) ");
}

void add_serial_options(CLI::App& command, BusOptions& options) {
  command.get_option("--bus")->description(
      fmt::format("CAN link: {}; EtherCAT: {}; or {}", links::client_forms(links::can_schemes, " or "),
                  links::client_forms(links::ethercat_schemes_easiest_first, " or "), serial_link_help()));
  if (CLI::Option* node = command.get_option_no_throw("--node")) {
    node->description(
        "Node-ID, 1..127, or Modbus station, 1..247, or on EtherCAT position behind the master, 1.., or (a number "
        "above the count of slaves) station alias; if not given, the only one found on CAN or EtherCAT, the unit alone "
        "behind a TCP address, any drive (id 127) with serial10");
  }
  command.add_option("--bit-rate", options.bit_rate, "Bit rate of a serial line in bit/s")
      ->check(CLI::Range(1200, 2'000'000).description(""))
      ->capture_default_str();
  command.add_option("--format", options.format, "Format of a serial line: data bits, parity, stop bits")
      ->capture_default_str();
  command.add_option("--product", options.product,
                     "Product of the drive (Modbus registers, manufacturer-specific behaviour), if the drive does not "
                     "identify itself");
}

void add_drive_options(CLI::App& command, BusOptions& options, const std::string& timeout_help) {
  add_bus_options(command, options, timeout_help);
  add_node_option(command, options);
  add_serial_options(command, options);
}

void add_watch_option(CLI::App& command, BusOptions& options) {
  command.add_flag("--no-watch", options.no_watch,
                   "CANopen: do not let the drive monitor this program's heartbeat (1016h, 6007h); if the cable is "
                   "pulled, the drive then continues with its last command");
}

void add_cycle_options(CLI::App& command, BusOptions& options) {
  command.add_option("--cycle", options.cycle_ms, "EtherCAT: cycle time of the process data in milliseconds")
      ->check(number_within(0.25, 100.0))
      ->capture_default_str();
  command.add_flag("--clocks", options.clocks, "EtherCAT: distributed clocks with SYNC0, instead of free run");
}

BusKindAndLink bus_kind(const BusOptions& options) {
  constexpr std::string_view modbus = "modbus:";
  constexpr std::string_view serial10 = "serial10:";
  if (options.link.starts_with(modbus)) return {BusKind::modbus, options.link.substr(modbus.size())};
  if (links::is_any_of(links::ethercat_schemes, options.link)) return {BusKind::ethercat, options.link};
  if (options.link.starts_with(serial10)) return {BusKind::serial10, options.link.substr(serial10.size())};
  return {BusKind::can, options.link};
}

std::unique_ptr<master::Bus> open_bus(const BusOptions& options) {
  if (bus_kind(options).kind != BusKind::can) {
    throw Failure::wrong_use(fmt::format("--bus {}: this needs a CAN bus", options.link));
  }
  if (options.node_id > 127) throw Failure::wrong_use(fmt::format("--node {}: node-IDs are 1..127", options.node_id));
  try {
    links::parse_can_link(options.link);
  } catch (const links::LinkError& error) {
    throw Failure::wrong_use(fmt::format("--bus: {}", error.what()));
  }
  return master::Bus::open(options.link, options.heard);
}

std::uint8_t choose_node(master::Bus& bus, const BusOptions& options, bool drives) {
  if (options.node_id != 0) return static_cast<std::uint8_t>(options.node_id);
  std::string list;
  std::uint8_t chosen = 0;
  unsigned count = 0;
  for (const master::FoundNode& node : master::scan(bus)) {
    if (drives && !node.is_drive()) continue;
    ++count;
    chosen = node.node_id;
    list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", node.node_id, node.name);
  }
  if (count == 1) return chosen;
  const char* what = drives ? "CiA 402 drive" : "node";
  if (count == 0) {
    throw Failure::did_not_work(
        fmt::format("{}: no {} answers; check bit rate and power, or give --node", bus.name(), what));
  }
  throw Failure::wrong_use(fmt::format("{}: several {}s answer: {}; choose one with --node", bus.name(), what, list));
}

master::Axis402::Progress motion_progress(master::Axis402& axis, bool quiet, const master::UnitScale& scale) {
  const bool shown = !quiet && on_terminal();
  return [&axis, shown, scale, next = master::Time{}](const master::AxisStatus& status) mutable {
    const master::Time now = axis.objects().now();
    if (!shown || now < next) return;
    next = now + progress_period;
    if (!output_is_ready()) return;  // to wait for the terminal would delay the end of the motion
    fmt::print("\r  position {:>12}  velocity {:>10}\x1B[K", scale.position(status.position),
               scale.velocity(status.velocity));
    std::fflush(stdout);
  };
}

void end_progress(bool quiet) {
  if (!quiet && on_terminal()) fmt::print("\r\x1B[K");
}

}  // namespace servodrome::app
