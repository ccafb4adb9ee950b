#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <csignal>
#include <memory>
#include <string>

#include "host/axis402.hpp"
#include "host/axis_units.hpp"
#include "host/canopen/bus.hpp"
#include "host/canopen/scan.hpp"
#include "host/canopen/sdo_client.hpp"

// What the commands that talk to a bus share.
namespace servodrome::app {

inline constexpr const char* default_bus = "socketcand:127.0.0.1:29536/can0";

struct BusOptions {
  std::string link = default_bus;
  unsigned node_id = 0;  // 0: the only one found
  double timeout_s = 1.0;
  bool timeout_is_for_motion = false;  // and not for each answer
  bool json = false;
  // Of drives that are not on a CAN bus
  unsigned bit_rate = 115200;
  std::string format = "8N1";
  std::string product{};
  // Of CANopen
  bool no_watch = false;
  // Of EtherCAT
  double cycle_ms = 2.0;
  bool clocks = false;
  // No option: hears what passes the link.
  links::Heard heard{};

  host::Time timeout() const {
    return std::chrono::duration_cast<host::Time>(std::chrono::duration<double>(timeout_s));
  }
  host::Time answer_timeout() const { return timeout_is_for_motion ? host::Time(std::chrono::seconds(1)) : timeout(); }
};

enum class BusKind : std::uint8_t { can, modbus, serial10, ethercat };

struct BusKindAndLink {
  BusKind kind;
  std::string link;  // without the kind
};
// `modbus:LINK`, `serial10:LINK`, and the EtherCAT links `udp:` and `raw:` are told by their beginning; everything else
// is a CAN link.
BusKindAndLink bus_kind(const BusOptions& options);

// --bus, --json, and --timeout with its meaning for this command; `options` holds the defaults.
void add_bus_options(CLI::App& command, BusOptions& options, const std::string& timeout_help);
void add_node_option(CLI::App& command, BusOptions& options);
// For commands that work on other buses as well: --bit-rate, --format and --product, and what --bus takes.
void add_serial_options(CLI::App& command, BusOptions& options);
// --no-watch, for commands that move an axis.
void add_watch_option(CLI::App& command, BusOptions& options);
// --cycle and --clocks, for commands that take EtherCAT slaves to OP.
void add_cycle_options(CLI::App& command, BusOptions& options);

// Opens --bus, which must be a CAN link. Throws Failure if it is none, HostError if the link cannot be opened.
std::unique_ptr<host::Bus> open_bus(const BusOptions& options);

// The node of --node, or the only node of the bus that answers (`drives`: the only CiA 402 drive). Throws Failure if
// there is none, or several.
std::uint8_t choose_node(host::Bus& bus, const BusOptions& options, bool drives);

// Standard output is a terminal: something may be rewritten in place.
bool on_terminal();

// Ctrl-C, SIGTERM and a terminal that goes away (SIGHUP, unless nohup has it ignored) end a command by its own will as
// long as one of these lives: interrupted() is true from then on. A reader of its output that goes away (SIGPIPE) does
// not end it, because an axis might be moving; unless it only looks.
class InterruptGuard {
 public:
  enum class Command : std::uint8_t { acts, only_looks };

  explicit InterruptGuard(Command command = Command::acts);
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  static bool interrupted();

 private:
  std::array<struct sigaction, 4> before_{};
};

// For motions: shows position and velocity on a terminal.
host::Axis402::Progress motion_progress(host::Axis402& axis, bool quiet, const host::UnitScale& scale = {});
// Ends the line that motion_progress() rewrites.
void end_progress(bool quiet);

}  // namespace servodrome::app
