#include "master/canopen/scan.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"
#include "app/recognition.hpp"
#include "links/link_scheme.hpp"
#include "links/local_buses.hpp"
#include "links/time.hpp"
#include "master/ethercat/scan.hpp"
#include "master/modbus/scan.hpp"

namespace servodrome::app {
namespace scan_command {

struct Options {
  BusOptions bus{.timeout_s = 0.0};  // 0: depends on the kind of bus
  double listen_s = 0.0;
  unsigned first = 1;
  unsigned last = 0;  // 0: the highest possible
  bool buses = false;
  std::vector<std::string> eds;
  std::vector<std::string> esi;
};

constexpr double can_timeout_s = 0.25;
// A station on a serial line answers at once, and most addresses are empty.
constexpr double serial_timeout_s = 0.05;

// The product of a drive and how it was found: by "identity", "description" (a given file) or "objects".
struct Recognised {
  std::string as;
  const char* by = nullptr;
  const line::Product* product = nullptr;

  std::string text() const {
    return as.empty() ? "-" : as + (product != nullptr && by == by_objects ? ", by its objects" : "");
  }
  void add_to(nlohmann::ordered_json& json) const {
    json["product"] = product != nullptr ? nlohmann::ordered_json(product->name) : nullptr;
    json["recognised_as"] = as.empty() ? nlohmann::ordered_json(nullptr) : nlohmann::ordered_json(as);
    json["recognised_by"] = by != nullptr ? nlohmann::ordered_json(by) : nlohmann::ordered_json(nullptr);
  }

  static constexpr const char* by_identity = "identity";
  static constexpr const char* by_description = "description";
  static constexpr const char* by_objects = "objects";
};

Recognised recognise(const line::Product* by_identity, std::uint32_t vendor_id, std::uint32_t product_code,
                     const Descriptions& descriptions) {
  if (std::string name = descriptions.name_of(vendor_id, product_code); !name.empty()) {
    return {std::move(name), Recognised::by_description, by_identity};
  }
  if (by_identity != nullptr) return {std::string(by_identity->name), Recognised::by_identity, by_identity};
  return {};
}

Recognised by_objects(const line::Product* product) {
  if (product == nullptr) return {};
  return {std::string(product->name), Recognised::by_objects, product};
}

// If the identity of a drive is unknown, looks for objects that only one product has.
Recognised recognise(master::Bus& bus, const master::FoundNode& node, const Descriptions& descriptions) {
  const auto identity = node.identity.value_or(master::LssAddress{});
  Recognised recognised = recognise(product_of(node), identity.vendor_id, identity.product_code, descriptions);
  if (recognised.by != nullptr || !node.is_drive()) return recognised;
  try {
    master::SdoClient objects(bus, node.node_id);
    return by_objects(product_by_objects(objects, line::Fieldbus::can));
  } catch (const master::ObjectError&) {
    return {};  // the drive has left the bus meanwhile
  }
}

nlohmann::ordered_json json_of(const master::FoundNode& node, const Recognised& recognised) {
  nlohmann::ordered_json json{{"node", node.node_id}, {"name", node.name}, {"kind", master::kind_of(node)}};
  recognised.add_to(json);
  json["device_type"] = node.device_type ? nlohmann::ordered_json(*node.device_type) : nullptr;
  if (node.identity) {
    json["vendor_id"] = node.identity->vendor_id;
    json["product_code"] = node.identity->product_code;
    json["revision_number"] = node.identity->revision_number;
    json["serial_number"] = node.identity->serial_number;
  }
  json["software_version"] = node.software_version;
  json["state"] = node.state ? nlohmann::ordered_json(master::name(*node.state)) : nullptr;
  return json;
}

void print(const master::FoundNode& node, int width, const Recognised& recognised) {
  const auto identity = node.identity.value_or(master::LssAddress{});
  fmt::print("{:<6}{:<{}}{:<26}{:08X}h  {:08X}h  {:08X}h  {:<11}{:<17}{}\n", node.node_id, name_of(node), width,
             node.device_type ? master::kind_of(node) : "answers no SDO", identity.vendor_id, identity.product_code,
             identity.revision_number, identity.serial_number, node.state ? master::name(*node.state) : "",
             recognised.text());
}

struct Station {
  unsigned address;
  std::string name;
  std::string kind;
  Recognised recognised{};
};

void check_range(const Options& options) {
  if (options.last != 0 && options.first > options.last) {
    throw Failure::wrong_use(
        fmt::format("--first {} is greater than --last {}; exchange them", options.first, options.last));
  }
}

std::vector<Station> scan_modbus(const Options& options, const std::string& link) {
  master::ModbusClient client = open_modbus_client(options.bus, link, {.timeout = options.bus.timeout(), .retries = 0});
  const auto last = static_cast<std::uint8_t>(options.last != 0 ? options.last : modbus::highest_station);
  std::vector<Station> stations;
  for (const master::FoundStation& found :
       master::scan_stations(client, static_cast<std::uint8_t>(options.first), last)) {
    constexpr std::uint8_t vendor_name = 0;
    constexpr std::uint8_t product_code = 1;
    const std::string name = found.text(product_code);
    if (name.empty()) {
      stations.push_back({found.unit, name, "Modbus station without identification",
                          by_objects(product_by_registers(client, found.unit))});
      continue;
    }
    const line::Product* const product = line::find_product(line::all_products(), name);
    stations.push_back({found.unit, name, fmt::format("Modbus station of {}", found.text(vendor_name)),
                        product != nullptr ? Recognised{name, Recognised::by_identity, product} : Recognised{}});
  }
  return stations;
}

std::vector<Station> scan_serial10(const Options& options, const std::string& link) {
  constexpr unsigned highest = serial10::universal_id - 1U;
  if (options.first > highest || options.last > highest) {
    throw Failure::wrong_use(
        fmt::format("--first and --last: with the 10-byte protocol they are 1..{}; each drive "
                    "answers to {}",
                    highest, serial10::universal_id));
  }
  const unsigned last = options.last != 0 ? options.last : highest;
  master::Serial10Client client =
      open_serial10_client(options.bus, link, {.timeout = options.bus.timeout(), .retries = 0});
  std::vector<Station> stations;
  for (unsigned id = options.first; id <= last; ++id) {
    try {
      client.upload(static_cast<std::uint8_t>(id), {0x6041, 0});
    } catch (const master::Serial10Error& error) {
      if (!error.from_drive()) continue;
    }
    stations.push_back({id, "", "drive with the 10-byte protocol",
                        by_objects(product_that_speaks(products::SerialProtocol::serial10))});
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
      nlohmann::ordered_json json{{"node", station.address}, {"name", station.name}, {"kind", station.kind}};
      station.recognised.add_to(json);
      list.push_back(std::move(json));
    }
    fmt::print("{}\n", nlohmann::ordered_json{{"bus", options.bus.link}, {"nodes", std::move(list)}}.dump(2));
  } else {
    if (!stations.empty()) fmt::print("{:<9}{:<18}{:<40}{}\n", "station", "product", "kind", "recognised as");
    for (const Station& station : stations) {
      fmt::print("{:<9}{:<18}{:<40}{}\n", station.address, station.name.empty() ? "-" : station.name, station.kind,
                 station.recognised.text());
    }
  }
  if (stations.empty()) {
    throw Failure::did_not_work(fmt::format(
        "{}: no station answers; check bit rate, format, protocol, wiring and power, or give a longer --timeout",
        options.bus.link));
  }
}

Recognised recognise(const master::FoundSlave& slave, const Descriptions& descriptions) {
  const master::EthercatIdentity& identity = slave.sii.identity;
  return recognise(product_of(slave), identity.vendor_id, identity.product_code, descriptions);
}

nlohmann::ordered_json json_of(const master::FoundSlave& slave, const Recognised& recognised) {
  nlohmann::ordered_json json{{"node", slave.position}, {"alias", slave.alias}, {"name", slave.sii.name}};
  recognised.add_to(json);
  json["vendor_id"] = slave.sii.identity.vendor_id;
  json["product_code"] = slave.sii.identity.product_code;
  json["revision_number"] = slave.sii.identity.revision_number;
  json["serial_number"] = slave.sii.identity.serial_number;
  json["state"] = master::short_name(slave.status.state());
  json["error"] = slave.status.error();
  json["al_status_code"] = static_cast<unsigned>(slave.status.code);
  json["al_status_text"] = text(slave.status.code);
  json["links"] = nlohmann::ordered_json::array();
  for (unsigned port = 0; port < 4; ++port) {
    if (slave.link(port)) json["links"].push_back(port);
  }
  json["distributed_clock"] = slave.has_clock();
  json["coe"] = slave.sii.has(master::mailbox_protocol::coe);
  json["foe"] = slave.sii.has(master::mailbox_protocol::foe);
  json["sii_checksum_right"] = slave.sii.checksum_right;
  return json;
}

void scan_ethercat(const Options& options) {
  const Descriptions descriptions(options.eds, options.esi);
  const auto master = open_ethercat_master(options.bus);
  const std::vector<master::FoundSlave> slaves = scan_segment(*master);
  if (options.bus.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const master::FoundSlave& slave : slaves) list.push_back(json_of(slave, recognise(slave, descriptions)));
    fmt::print("{}\n", nlohmann::ordered_json{{"bus", options.bus.link}, {"nodes", std::move(list)}}.dump(2));
    return;
  }
  std::vector<Recognised> recognised;
  std::size_t width = std::string_view("name").size();
  std::size_t product_width = std::string_view("recognised as").size();
  for (const master::FoundSlave& slave : slaves) {
    recognised.push_back(recognise(slave, descriptions));
    width = std::max(width, slave.sii.name.size());
    product_width = std::max(product_width, recognised.back().text().size());
  }
  width += 2;
  product_width += 2;
  fmt::print("{:<10}{:<7}{:<{}}{:<{}}{:<11}{:<11}{:<11}{:<11}{:<7}{}\n", "position", "alias", "name", width,
             "recognised as", product_width, "vendor", "code", "revision", "serial", "links", "state");
  for (std::size_t i = 0; i < slaves.size(); ++i) {
    const master::FoundSlave& slave = slaves[i];
    const master::EthercatIdentity& identity = slave.sii.identity;
    fmt::print("{:<10}{:<7}{:<{}}{:<{}}{:08X}h  {:08X}h  {:08X}h  {:08X}h  {:<7}{}{}\n", slave.position,
               slave.alias != 0 ? std::to_string(slave.alias) : "-", slave.sii.name, width, recognised[i].text(),
               product_width, identity.vendor_id, identity.product_code, identity.revision_number,
               identity.serial_number, text_of_links(slave), text_of(slave.status),
               slave.sii.checksum_right ? "" : ", SII checksum wrong");
  }
}

// ---- Buses of this computer ----

struct Bus {
  std::string link;
  std::string kind;
  std::string state;
  std::string note;
};

// The default links of a running `servodrome up` on this computer.
std::vector<Bus> buses_of_default_line() {
  std::vector<Bus> buses;
  try {
    master::Bus::open(default_bus);
    buses.push_back({std::string(default_bus), "CANopen", "answers", "socketcand"});
  } catch (const master::MasterError&) {
  }
  const std::string ethercat(links::scheme::udp.example);
  try {
    const auto master = master::EthercatMaster::open(ethercat, {});
    if (const unsigned count = master::count_slaves(*master); count != 0) {
      buses.push_back({ethercat, "EtherCAT", "answers", fmt::format("{} {}", count, count == 1 ? "slave" : "slaves")});
    }
  } catch (const master::MasterError&) {
  }
  constexpr const char* modbus = "tcp:127.0.0.1:1502";
  try {
    master::ModbusClient::open(modbus, {});
    buses.push_back({fmt::format("modbus:{}", modbus), "Modbus TCP", "answers", ""});
  } catch (const master::MasterError&) {
  }
  return buses;
}

void list_buses(const Options& options) {
  std::vector<Bus> buses = buses_of_default_line();
  for (const links::LocalBus& local : links::local_buses()) {
    switch (local.kind) {
      case links::LocalBus::Kind::can: buses.push_back({local.link, "CANopen", local.state, local.hardware}); break;
      case links::LocalBus::Kind::ethernet:
        buses.push_back({local.link, "EtherCAT", local.state, "needs CAP_NET_RAW"});
        break;
      case links::LocalBus::Kind::serial:
        buses.push_back({"modbus:" + local.link, "Modbus RTU", local.state, local.hardware});
        buses.push_back({"serial10:" + local.link, "10-byte protocol", local.state, local.hardware});
        break;
    }
  }
  if (options.bus.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Bus& bus : buses) {
      list.push_back({{"bus", bus.link}, {"kind", bus.kind}, {"state", bus.state}, {"note", bus.note}});
    }
    fmt::print("{}\n", nlohmann::ordered_json{{"buses", std::move(list)}}.dump(2));
  } else {
    std::size_t width = std::string_view("bus").size();
    for (const Bus& bus : buses) width = std::max(width, bus.link.size());
    if (!buses.empty()) fmt::print("{:<{}}  {:<18}{:<10}{}\n", "bus", width, "kind", "state", "note");
    for (const Bus& bus : buses) fmt::print("{:<{}}  {:<18}{:<10}{}\n", bus.link, width, bus.kind, bus.state, bus.note);
  }
  if (buses.empty()) {
    throw Failure::did_not_work(
        "this computer has no CAN interface, network card or serial port, and no line runs at the default addresses; "
        "`servodrome up` starts one");
  }
}

void run(const Options& given) {
  Options options = given;
  check_range(options);
  if (options.buses) return list_buses(options);
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
  const Descriptions descriptions(options.eds, options.esi);
  const auto bus = open_bus(options.bus);
  const auto listen = links::from_seconds(options.listen_s);
  const auto nodes = master::scan(*bus, {.timeout = options.bus.timeout(), .listen = listen});
  if (options.bus.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const master::FoundNode& node : nodes) list.push_back(json_of(node, recognise(*bus, node, descriptions)));
    fmt::print("{}\n", nlohmann::ordered_json{{"bus", options.bus.link}, {"nodes", std::move(list)}}.dump(2));
  } else if (!nodes.empty()) {
    const int width = name_width(nodes);
    fmt::print("{:<6}{:<{}}{:<26}{:<11}{:<11}{:<11}{:<11}{:<17}{}\n", "node", "name", width, "kind", "vendor",
               "product", "revision", "serial", "NMT state", "recognised as");
    for (const master::FoundNode& node : nodes) print(node, width, recognise(*bus, node, descriptions));
  }
  if (nodes.empty()) {
    throw Failure::did_not_work(
        fmt::format("{}: no node answers; check bit rate, wiring and power, or give a longer --timeout", bus->name()));
  }
}

}  // namespace scan_command

void add_scan(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "scan",
      "List the nodes of a CANopen bus, the slaves of an EtherCAT segment, or the stations of a serial line",
      scan_command::run);
  add_bus_options(*command, options->bus,
                  "Seconds to wait for each answer; 0.25 on CAN, 0.05 on a serial line if not given");
  command->get_option("--timeout")->default_str("");
  add_serial_options(*command, options->bus);
  command->remove_option(command->get_option("--product"));
  command->add_flag("--buses", options->buses,
                    "List the buses of this computer, and those of a line that runs on it at the default addresses");
  command
      ->add_option(
          "--eds", options->eds,
          "Electronic data sheet or DCF to recognise nodes by vendor and product code; may be given several times")
      ->allow_extra_args(false);
  command
      ->add_option("--esi", options->esi,
                   "Slave information file (ESI) to recognise EtherCAT slaves by vendor and product code; may be given "
                   "several times")
      ->allow_extra_args(false);
  command->add_option("--first", options->first, "Lowest station of a serial line to ask")
      ->check(CLI::Range(1, 247).description(""))
      ->capture_default_str();
  command->add_option("--last", options->last, "Highest station of a serial line to ask; 247, or 126 with serial10")
      ->check(CLI::Range(1, 247).description(""));
  command->add_option("--listen", options->listen_s, "Seconds to listen for heartbeats of nodes that answer no SDO")
      ->check(number_within(0.0, 1e6))
      ->capture_default_str();
}

}  // namespace servodrome::app
