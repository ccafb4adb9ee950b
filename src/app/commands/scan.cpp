#include "host/canopen/scan.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"
#include "host/modbus/scan.hpp"

namespace servodrome::app {
namespace {

struct Options {
  BusOptions bus{.timeout_s = 0.0};  // 0: by the kind of bus
  double listen_s = 0.0;
  unsigned first = 1;
  unsigned last = 0;  // 0: the highest there can be
};

constexpr double can_timeout_s = 0.25;
// What answers on a serial line does so at once, and most addresses are empty.
constexpr double serial_timeout_s = 0.05;

nlohmann::ordered_json json_of(const host::FoundNode& node) {
  nlohmann::ordered_json json{{"node", node.node_id}, {"name", node.name}, {"kind", host::kind_of(node)}};
  const line::Product* product = product_of(node);
  json["product"] = product != nullptr ? nlohmann::ordered_json(product->name) : nullptr;
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
  fmt::print("{:<6}{:<{}}{:<26}{:08X}h  {:08X}h  {:08X}h  {:<11}{}\n", node.node_id, name_of(node), width,
             node.device_type ? host::kind_of(node) : "answers no SDO", identity.vendor_id, identity.product_code,
             identity.revision_number, identity.serial_number, node.state ? host::name(*node.state) : "");
}

struct Station {
  unsigned address;
  std::string name;
  std::string kind;
};

void check_range(const Options& options) {
  if (options.last != 0 && options.first > options.last) {
    throw Failure::wrong_use(
        fmt::format("--first {} lies behind --last {}; give the lower number first", options.first, options.last));
  }
}

std::vector<Station> scan_modbus(const Options& options, const std::string& link) {
  host::ModbusClient client = open_modbus_client(options.bus, link, {.timeout = options.bus.timeout(), .retries = 0});
  const auto last = static_cast<std::uint8_t>(options.last != 0 ? options.last : modbus::highest_station);
  std::vector<Station> stations;
  for (const host::FoundStation& found : host::scan_stations(client, static_cast<std::uint8_t>(options.first), last)) {
    constexpr std::uint8_t vendor_name = 0;
    constexpr std::uint8_t product_code = 1;
    const std::string name = found.text(product_code);
    stations.push_back({found.unit, name,
                        name.empty() ? "Modbus station without identification"
                                     : fmt::format("Modbus station of {}", found.text(vendor_name))});
  }
  return stations;
}

std::vector<Station> scan_serial10(const Options& options, const std::string& link) {
  host::Serial10Client client =
      open_serial10_client(options.bus, link, {.timeout = options.bus.timeout(), .retries = 0});
  const unsigned last = options.last != 0 ? options.last : serial10::universal_id - 1U;
  std::vector<Station> stations;
  for (unsigned id = options.first; id <= last; ++id) {
    try {
      client.upload(static_cast<std::uint8_t>(id), {0x6041, 0});
    } catch (const host::Serial10Error& error) {
      if (!error.from_drive()) continue;
    }
    stations.push_back({id, "", "drive with the 10-byte protocol"});
  }
  return stations;
}

void scan_serial(Options options, BusKind kind, const std::string& link) {
  if (options.bus.timeout_s <= 0) options.bus.timeout_s = serial_timeout_s;
  const std::vector<Station> stations =
      kind == BusKind::modbus ? scan_modbus(options, link) : scan_serial10(options, link);
  if (options.bus.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Station& station : stations) {
      list.push_back({{"node", station.address}, {"name", station.name}, {"kind", station.kind}});
    }
    fmt::print("{}\n", nlohmann::ordered_json{{"bus", options.bus.link}, {"nodes", std::move(list)}}.dump(2));
  } else {
    if (!stations.empty()) fmt::print("{:<9}{:<18}{}\n", "station", "product", "kind");
    for (const Station& station : stations) {
      fmt::print("{:<9}{:<18}{}\n", station.address, station.name.empty() ? "-" : station.name, station.kind);
    }
  }
  if (stations.empty()) {
    throw Failure::did_not_work(fmt::format(
        "{}: no station answers; check bit rate, format, protocol, wiring and power, or give a longer --timeout",
        options.bus.link));
  }
}

nlohmann::ordered_json json_of(const host::FoundSlave& slave) {
  const line::Product* product = product_of(slave);
  nlohmann::ordered_json json{{"node", slave.position}, {"alias", slave.alias}, {"name", slave.sii.name}};
  json["product"] = product != nullptr ? nlohmann::ordered_json(product->name) : nullptr;
  json["vendor_id"] = slave.sii.identity.vendor_id;
  json["product_code"] = slave.sii.identity.product_code;
  json["revision_number"] = slave.sii.identity.revision_number;
  json["serial_number"] = slave.sii.identity.serial_number;
  json["state"] = host::short_name(slave.status.state());
  json["error"] = slave.status.error();
  json["al_status_code"] = static_cast<unsigned>(slave.status.code);
  json["al_status_text"] = text(slave.status.code);
  json["links"] = nlohmann::ordered_json::array();
  for (unsigned port = 0; port < 4; ++port) {
    if (slave.link(port)) json["links"].push_back(port);
  }
  json["distributed_clock"] = slave.has_clock();
  json["coe"] = slave.sii.has(host::mailbox_protocol::coe);
  json["foe"] = slave.sii.has(host::mailbox_protocol::foe);
  json["sii_checksum_right"] = slave.sii.checksum_right;
  return json;
}

void scan_ethercat(const Options& options) {
  const auto master = open_ethercat_master(options.bus);
  const std::vector<host::FoundSlave> slaves = scan_segment(*master);
  if (options.bus.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const host::FoundSlave& slave : slaves) list.push_back(json_of(slave));
    fmt::print("{}\n", nlohmann::ordered_json{{"bus", options.bus.link}, {"nodes", std::move(list)}}.dump(2));
    return;
  }
  std::size_t width = std::string_view("name").size();
  for (const host::FoundSlave& slave : slaves) width = std::max(width, slave.sii.name.size());
  width += 2;
  fmt::print("{:<10}{:<7}{:<{}}{:<15}{:<11}{:<11}{:<11}{:<11}{:<7}{}\n", "position", "alias", "name", width, "product",
             "vendor", "code", "revision", "serial", "links", "state");
  for (const host::FoundSlave& slave : slaves) {
    const line::Product* product = product_of(slave);
    const host::EthercatIdentity& identity = slave.sii.identity;
    fmt::print("{:<10}{:<7}{:<{}}{:<15}{:08X}h  {:08X}h  {:08X}h  {:08X}h  {:<7}{}{}\n", slave.position,
               slave.alias != 0 ? std::to_string(slave.alias) : "-", slave.sii.name, width,
               product != nullptr ? product->name : "-", identity.vendor_id, identity.product_code,
               identity.revision_number, identity.serial_number, text_of_links(slave), text_of(slave.status),
               slave.sii.checksum_right ? "" : ", SII checksum wrong");
  }
}

void run(const Options& given) {
  Options options = given;
  check_range(options);
  const auto [kind, link] = bus_kind(options.bus);
  if (kind == BusKind::ethercat) {
    scan_ethercat(options);
    return;
  }
  if (kind != BusKind::can) {
    scan_serial(options, kind, link);
    return;
  }
  if (options.bus.timeout_s <= 0) options.bus.timeout_s = can_timeout_s;
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
  CLI::App* command = app.add_subcommand(
      "scan", "List the nodes of a CANopen bus, the slaves of an EtherCAT segment, or the stations of a serial line");
  add_bus_options(*command, options->bus,
                  "Seconds to wait for an answer to each question; 0.25 on CAN, 0.05 on a serial line if not given");
  command->get_option("--timeout")->default_str("");
  add_serial_options(*command, options->bus);
  command->add_option("--first", options->first, "Lowest station of a serial line to ask")
      ->check(CLI::Range(1, 247).description(""))
      ->capture_default_str();
  command->add_option("--last", options->last, "Highest station of a serial line to ask; 247, or 126 with serial10")
      ->check(CLI::Range(1, 247).description(""));
  command->add_option("--listen", options->listen_s, "Seconds to listen for heartbeats of nodes that answer no SDO")
      ->check(number_within(0.0, 1e6))
      ->capture_default_str();
  command->callback([options] { run(*options); });
}

}  // namespace servodrome::app
