#include "host/canopen/scan.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/number_options.hpp"

namespace servodrome::app {
namespace {

struct Options {
  BusOptions bus{.timeout_s = 0.25};
  double listen_s = 0.0;
};

nlohmann::ordered_json json_of(const host::FoundNode& node) {
  nlohmann::ordered_json json{{"node", node.node_id}, {"name", node.name}, {"kind", host::kind_of(node)}};
  json["device_type"] = node.device_type ? nlohmann::ordered_json(*node.device_type) : nullptr;
  if (node.identity) {
    json["vendor_id"] = node.identity->vendor_id;
    json["product_code"] = node.identity->product_code;
    json["revision_number"] = node.identity->revision_number;
    json["serial_number"] = node.identity->serial_number;
  }
  json["software_version"] = node.software_version;
  json["state"] = node.state ? nlohmann::ordered_json(host::name(*node.state)) : nullptr;
  return json;
}

void print(const host::FoundNode& node, int width) {
  const auto identity = node.identity.value_or(host::LssAddress{});
  fmt::print("{:<6}{:<{}}{:<26}{:08X}h  {:08X}h  {:08X}h  {:<11}{}\n", node.node_id,
             node.name.empty() ? "-" : node.name, width, node.device_type ? host::kind_of(node) : "answers no SDO",
             identity.vendor_id, identity.product_code, identity.revision_number, identity.serial_number,
             node.state ? host::name(*node.state) : "");
}

void run(const Options& options) {
  const auto bus = open_bus(options.bus);
  const auto listen = std::chrono::duration_cast<host::Time>(std::chrono::duration<double>(options.listen_s));
  const auto nodes = host::scan(*bus, {.timeout = options.bus.timeout(), .listen = listen});
  if (options.bus.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const host::FoundNode& node : nodes) list.push_back(json_of(node));
    fmt::print("{}\n", nlohmann::ordered_json{{"bus", options.bus.link}, {"nodes", std::move(list)}}.dump(2));
  } else if (!nodes.empty()) {
    const int width = name_width(nodes);
    fmt::print("{:<6}{:<{}}{:<26}{:<11}{:<11}{:<11}{:<11}{}\n", "node", "name", width, "kind", "vendor", "product",
               "revision", "serial", "NMT state");
    for (const host::FoundNode& node : nodes) print(node, width);
  }
  if (nodes.empty()) {
    throw Failure::did_not_work(
        fmt::format("{}: no node answers; check bit rate, wiring and power, or give a longer --timeout", bus->name()));
  }
}

}  // namespace

void add_scan(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("scan", "List the nodes of a CANopen bus");
  add_bus_options(*command, options->bus, "Seconds to wait for an answer to each question");
  command->add_option("--listen", options->listen_s, "Seconds to listen for heartbeats of nodes that answer no SDO")
      ->check(number_within(0.0, 1e6))
      ->capture_default_str();
  command->callback([options] { run(*options); });
}

}  // namespace servodrome::app
