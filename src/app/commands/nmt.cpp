#include <fmt/format.h>
#include <map>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "master/canopen/master.hpp"

namespace servodrome::app {
namespace nmt_command {

struct Options {
  BusOptions bus{.timeout_s = 2.0};
  std::string command;
  bool all = false;
  bool wait = false;
};

const std::map<std::string, master::NmtCommand> words{{"start", master::NmtCommand::start},
                                                      {"stop", master::NmtCommand::stop},
                                                      {"pre-operational", master::NmtCommand::enter_pre_operational},
                                                      {"reset-node", master::NmtCommand::reset_node},
                                                      {"reset-communication", master::NmtCommand::reset_communication}};

void run(const Options& options) {
  if (options.all == (options.bus.node_id != 0)) throw Failure::wrong_use("nmt: give --node N or --all, one of them");
  if (options.all && options.wait) throw Failure::wrong_use("nmt: --wait is for one node; give --node N");
  const auto bus = open_bus(options.bus);
  master::Master master(*bus);
  const auto node_id = static_cast<std::uint8_t>(options.bus.node_id);
  if (options.wait) {
    master.command_and_wait(words.at(options.command), node_id, options.bus.timeout());
  } else {
    master.command(words.at(options.command), node_id);
  }
  if (options.bus.json) {
    nlohmann::ordered_json json{{"node", nullptr}, {"command", options.command}, {"confirmed", options.wait}};
    if (!options.all) json["node"] = node_id;
    fmt::print("{}\n", json.dump(2));
  }
}

}  // namespace nmt_command

void add_nmt(CLI::App& app) {
  const auto [command, options] = add_command(app, "nmt", "Send an NMT command", nmt_command::run);
  command->add_option("COMMAND", options->command, "start, stop, pre-operational, reset-node or reset-communication")
      ->required()
      ->check(CLI::IsMember(nmt_command::words).description(""));
  add_bus_options(*command, options->bus, "Seconds to wait for the confirmation");
  add_node_option(*command, options->bus);
  command->get_option("--node")->description("Node-ID, 1..127");
  command->add_flag("--all", options->all, "To all nodes");
  command->add_flag("--wait", options->wait, "Wait until heartbeat or boot-up confirms it");
}

}  // namespace servodrome::app
