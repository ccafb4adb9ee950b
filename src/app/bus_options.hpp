#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "app/interrupt_guard.hpp"
#include "app/terminal.hpp"
#include "axis/axis402.hpp"
#include "axis/axis_units.hpp"
#include "links/link_scheme.hpp"
#include "links/time.hpp"
#include "master/canopen/bus.hpp"
#include "master/canopen/scan.hpp"
#include "master/canopen/sdo_client.hpp"

// Options and functions shared by the commands that talk to a bus.
namespace servodrome::app {

inline constexpr std::string_view default_bus = links::scheme::socketcand.example;

struct BusOptions {
  std::string link{default_bus};
  unsigned node_id = 0;  // 0: the only one found
  double timeout_s = 1.0;
  bool timeout_is_for_motion = false;  // `timeout_s` is for a motion, not for an answer
  bool json = false;
  // For drives that are not on a CAN bus
  unsigned bit_rate = 115200;
  std::string format = "8N1";
  std::string product{};
  // For CANopen
  bool no_watch = false;
  // For EtherCAT
  double cycle_ms = 2.0;
  bool clocks = false;
  // Not an option: callback for the traffic on the link.
  links::Heard heard{};

  master::Time timeout() const { return links::from_seconds(timeout_s); }
  master::Time answer_timeout() const {
    return timeout_is_for_motion ? master::Time(std::chrono::seconds(1)) : timeout();
  }
};

enum class BusKind : std::uint8_t { can, modbus, serial10, ethercat };

struct BusKindAndLink {
  BusKind kind;
  std::string link;  // without the prefix of the kind
};
// The prefix decides: `modbus:LINK`, `serial10:LINK`, and the EtherCAT links `udp:` and `raw:`; everything else is a
// CAN link.
BusKindAndLink bus_kind(const BusOptions& options);

// Adds --bus, --json, and --timeout with its meaning for this command; `options` holds the defaults.
void add_bus_options(CLI::App& command, BusOptions& options, const std::string& timeout_help);
void add_node_option(CLI::App& command, BusOptions& options);
// "CAN link: ...; or EtherCAT: ...", for the help of --bus.
std::string can_or_ethercat_help();
// "modbus:LINK or serial10:LINK with ...": the links of serial lines, for the help of --bus.
std::string serial_link_help();
// For commands that also work on other buses: adds --bit-rate, --format and --product, and extends the help of --bus.
void add_serial_options(CLI::App& command, BusOptions& options);
// Adds the options of add_bus_options(), add_node_option() and add_serial_options(), for a command about one drive.
void add_drive_options(CLI::App& command, BusOptions& options, const std::string& timeout_help);
// Adds --no-watch, for commands that move an axis.
void add_watch_option(CLI::App& command, BusOptions& options);
// Adds --cycle and --clocks, for commands that take EtherCAT slaves to OP.
void add_cycle_options(CLI::App& command, BusOptions& options);

// Opens --bus, which must be a CAN link. Throws Failure for another kind, MasterError if the link cannot be opened.
std::unique_ptr<master::Bus> open_bus(const BusOptions& options);

// Returns the node of --node, or the only node that answers (`drives`: the only CiA 402 drive). Throws Failure if there
// is none, or more than one.
std::uint8_t choose_node(master::Bus& bus, const BusOptions& options, bool drives);

// Progress output of a motion: shows position and velocity on a terminal.
master::Axis402::Progress motion_progress(master::Axis402& axis, bool quiet, const master::UnitScale& scale = {});
// Ends the line that motion_progress() rewrites.
void end_progress(bool quiet);

}  // namespace servodrome::app
