#include "app/drive_link.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "app/commands.hpp"
#include "app/recognition.hpp"
#include "catalogue/product.hpp"
#include "describe/words.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/link_error.hpp"
#include "links/nearest_name.hpp"
#include "links/serial/format_text.hpp"
#include "modbus/tcp_connection.hpp"

namespace servodrome::app {
namespace {

using modbus::Exception;

modbus::CharacterFormat format_of(const BusOptions& options) {
  const auto format = links::parse_character_format(options.format, options.bit_rate);
  if (format) return *format;
  throw Failure::wrong_use(fmt::format("--format {}: write 8N1, 8E1, 8O1, 8N2 and the like", options.format));
}

void check_link(const BusOptions& options, const std::string& link) {
  try {
    if (std::holds_alternative<links::MemName>(links::parse_serial_link(link))) {
      throw Failure::wrong_use(fmt::format("--bus {}: mem: is for a master within the line's process", options.link));
    }
  } catch (const links::LinkError& error) {
    throw Failure::wrong_use(fmt::format("--bus: {}", error.what()));
  }
}

bool is_tcp(const std::string& link) {
  return std::holds_alternative<links::ModbusTcpName>(links::parse_serial_link(link));
}

}  // namespace

// Variants of a product have the same port.
const line::Product* product_that_speaks(products::SerialProtocol protocol) {
  const line::Product* found = nullptr;
  for (const line::Product& product : line::all_products()) {
    if (product.serial == nullptr) continue;
    const auto& protocols = product.serial->protocols;
    if (std::find(protocols.begin(), protocols.end(), protocol) == protocols.end()) continue;
    if (found == nullptr) {
      found = &product;
    } else if (found->serial->registers.data() != product.serial->registers.data()) {
      return nullptr;
    }
  }
  return found;
}

const line::Product* named_product(const BusOptions& options) {
  if (options.product.empty()) return nullptr;
  const line::Product* product = line::find_product(line::all_products(), options.product);
  if (product != nullptr) return product;
  std::vector<std::string_view> names;
  for (const line::Product& known : line::all_products()) names.push_back(known.name);
  throw Failure::wrong_use(fmt::format("--product {}: there is no such product; {}", options.product,
                                       links::suggestion(options.product, names)));
}

const line::Product* product_of(std::optional<std::uint32_t> vendor_id, std::optional<std::uint32_t> product_code) {
  for (const line::Product& product : line::all_products()) {
    const describe::Description description = product.describe();
    const auto is_it = [&](std::uint32_t vendor, std::uint32_t code) {
      return vendor_id == vendor && product_code == code;
    };
    if (is_it(describe::identity(description.table, 1), describe::identity(description.table, 2))) return &product;
    if (!description.ethercat) continue;
    const auto& [profile, sii, sii_bytes, other_models] = *description.ethercat;
    if (is_it(sii.vendor_id, sii.product_code)) return &product;
    for (const ethercat::SiiDescription& model : other_models) {
      if (is_it(model.vendor_id, model.product_code)) return &product;
    }
  }
  return nullptr;
}

const line::Product* product_of(const master::FoundNode& node) {
  return node.identity ? product_of(node.identity->vendor_id, node.identity->product_code) : nullptr;
}

const line::Product* product_of(const master::FoundSlave& slave) {
  return product_of(slave.sii.identity.vendor_id, slave.sii.identity.product_code);
}

std::string name_of(const master::FoundNode& node) {
  if (!node.name.empty()) return node.name;
  const line::Product* product = product_of(node);
  return product != nullptr ? std::string(product->name) : "-";
}

int name_width(const std::vector<master::FoundNode>& nodes) {
  std::size_t longest = std::string_view("product").size();
  for (const master::FoundNode& node : nodes) longest = std::max(longest, name_of(node).size());
  return static_cast<int>(longest) + 2;
}

master::ModbusClient open_modbus_client(const BusOptions& options, const std::string& link,
                                        const master::ModbusOptions& modbus_options) {
  check_link(options, link);
  master::ModbusOptions complete = modbus_options;
  complete.format = format_of(options);
  complete.heard = options.heard;
  return master::ModbusClient::open(link, complete);
}

master::Serial10Client open_serial10_client(const BusOptions& options, const std::string& link,
                                            const master::Serial10Options& serial10_options) {
  check_link(options, link);
  if (is_tcp(link)) throw Failure::wrong_use(fmt::format("--bus {}: this protocol is for serial lines", options.link));
  master::Serial10Options complete = serial10_options;
  complete.format = format_of(options);
  complete.heard = options.heard;
  return master::Serial10Client::open(link, complete);
}

DriveLink::DriveLink(const BusOptions& options, bool drives) : product_(named_product(options)) {
  const auto [kind, link] = bus_kind(options);
  switch (kind) {
    case BusKind::can: open(bus_.emplace<Can>(), options, drives); break;
    case BusKind::modbus: open(bus_.emplace<Modbus>(), options, link); break;
    case BusKind::serial10: open(bus_.emplace<Serial10>(), options, link); break;
    case BusKind::ethercat: open(bus_.emplace<Ethercat>(), options, drives); break;
  }
}

void DriveLink::open(Can& can, const BusOptions& options, bool drives) {
  can.bus = open_bus(options);
  auto sdo = std::make_unique<master::SdoClient>(*can.bus, choose_node(*can.bus, options, drives),
                                                 master::SdoOptions{.timeout = options.answer_timeout()});
  can.sdo = sdo.get();
  objects_ = std::move(sdo);
}

void DriveLink::open(Modbus& modbus, const BusOptions& options, const std::string& link) {
  const master::ModbusOptions modbus_options{.timeout = options.answer_timeout()};
  modbus.client = std::make_unique<master::ModbusClient>(open_modbus_client(options, link, modbus_options));
  const std::uint8_t unit = modbus_unit(options, link);
  if (product_ == nullptr) product_ = &modbus_product(*modbus.client, unit);
  objects_ = std::make_unique<master::ModbusObjects>(*modbus.client, unit, register_list_of(*product_));
}

std::uint8_t modbus_unit(const BusOptions& options, const std::string& link) {
  if (options.node_id > modbus::highest_station) {
    throw Failure::wrong_use(fmt::format("node {}: stations are 1..{}", options.node_id, modbus::highest_station));
  }
  auto unit = static_cast<std::uint8_t>(options.node_id);
  if (unit == 0) {
    if (!is_tcp(link)) {
      throw Failure::wrong_use(
          fmt::format("--bus {}: choose a station with --node (for `studio`: --bus LINK=STATION); `servodrome scan` "
                      "lists the stations",
                      options.link));
    }
    unit = modbus::unspecified_unit;
  }
  return unit;
}

master::RegisterList register_list_of(const line::Product& product) {
  if (product.serial == nullptr) {
    throw Failure::wrong_use(fmt::format("--product {}: it has no Modbus registers", product.name));
  }
  return {.registers = product.serial->registers,
          .table = product.describe().service_table,
          .word_order = product.serial->profile->word_order};
}

// A station without identification may be any product, and register addresses differ between products.
const line::Product& modbus_product(master::ModbusClient& client, std::uint8_t unit) {
  std::string name;
  try {
    constexpr std::uint8_t product_code = 1;
    name = client.read_device_identification(unit)[product_code];
  } catch (const master::ModbusError& error) {
    const bool gateway = error.exception() == Exception::gateway_path_unavailable ||
                         error.exception() == Exception::gateway_target_failed_to_respond;
    if (error.kind() != master::ModbusError::Kind::refused || gateway) throw;
  }
  const line::Product* product = line::find_product(line::all_products(), name);
  if (product != nullptr && product->serial != nullptr) return *product;
  std::string known;
  for (const line::Product& candidate : line::all_products()) {
    if (candidate.serial != nullptr) known += fmt::format("{}{}", known.empty() ? "" : ", ", candidate.name);
  }
  const std::string said = name.empty() ? "it does not identify itself" : fmt::format("\"{}\" is not known", name);
  if (const line::Product* similar = product_by_registers(client, unit); similar != nullptr) {
    throw Failure::wrong_use(fmt::format("{}, unit {}: {}; it has the registers of {}: give --product {} if it is one",
                                         client.name(), unit, said, similar->name, similar->name));
  }
  throw Failure::wrong_use(
      fmt::format("{}, unit {}: {}; give its product with --product ({})", client.name(), unit, said, known));
}

void DriveLink::open(Serial10& serial10, const BusOptions& options, const std::string& link) {
  const master::Serial10Options serial10_options{.timeout = options.answer_timeout()};
  serial10.client = std::make_unique<master::Serial10Client>(open_serial10_client(options, link, serial10_options));
  if (options.node_id > 127) throw Failure::wrong_use(fmt::format("node {}: ids are 1..127", options.node_id));
  const auto id =
      static_cast<std::uint8_t>(options.node_id != 0 ? options.node_id : servodrome::serial10::universal_id);
  if (product_ == nullptr) product_ = product_that_speaks(products::SerialProtocol::serial10);
  objects_ = std::make_unique<master::Serial10Objects>(*serial10.client, id);
}

// ---- EtherCAT ----

std::unique_ptr<master::EthercatMaster> open_ethercat_master(const BusOptions& options) {
  try {
    links::parse_ethercat_link(options.link);
  } catch (const links::LinkError& error) {
    throw Failure::wrong_use(fmt::format("--bus: {}", error.what()));
  }
  return master::EthercatMaster::open(options.link, {.heard = options.heard});
}

std::vector<master::FoundSlave> scan_segment(master::EthercatMaster& master) {
  auto slaves = master::scan_slaves(master);
  if (!slaves.empty()) return slaves;
  throw Failure::did_not_work(
      fmt::format("{}: no slave answers; check that `servodrome up` runs there, or cable and "
                  "power",
                  master.name()));
}

const master::FoundSlave& choose_slave(const master::EthercatMaster& master,
                                       const std::vector<master::FoundSlave>& slaves, const BusOptions& options) {
  if (options.node_id == 0 && slaves.size() == 1) return slaves.front();
  std::string list;
  for (const master::FoundSlave& slave : slaves) {
    const bool by_position = slave.position == options.node_id;
    const bool by_alias = options.node_id > slaves.size() && slave.alias == options.node_id;
    if (by_position || by_alias) return slave;
    list += fmt::format("{}{} ({}{})", list.empty() ? "" : ", ", slave.position, slave.sii.name,
                        slave.alias != 0 ? fmt::format(", alias {}", slave.alias) : "");
  }
  if (options.node_id == 0) {
    throw Failure::wrong_use(fmt::format("{}: several slaves answer: {}; choose one with --node", master.name(), list));
  }
  throw Failure::wrong_use(fmt::format("{}: no slave has position or alias {}; choose one of these: {}", master.name(),
                                       options.node_id, list));
}

bool is_drive(master::EthercatSlave& slave) {
  constexpr std::uint32_t drive_profile = 402;
  if (!slave.has_coe()) return false;
  return (slave.coe().read<std::uint32_t>(0x1000) & 0xFFFF) == drive_profile;
}

master::OperationOptions operation_options(const BusOptions& options) {
  const auto period =
      std::chrono::duration_cast<master::Time>(std::chrono::duration<double, std::milli>(options.cycle_ms));
  // Between two computers or under load a frame may take longer than a cycle, so check() tolerates 50 such cycles in
  // succession.
  constexpr std::uint16_t any = 0;  // no limit in the slaves: check() counts, since this is no real-time computer
  return {.cyclic = {.period = period, .tolerated_losses = 50},
          .distributed_clocks = options.clocks,
          .sync_error_limit = any};
}

void DriveLink::open(Ethercat& ethercat, const BusOptions& options, bool drives) {
  ethercat.master = open_ethercat_master(options);
  ethercat.line = scan_segment(*ethercat.master);
  const master::FoundSlave& found = choose_slave(*ethercat.master, ethercat.line, options);
  if (found.status.state() == master::AlState::operational) {
    warn(
        fmt::format("{}, slave {}: it is in OP, so another master is active: two masters read each other's answers "
                    "from its one mailbox; stop the other master first",
                    ethercat.master->name(), found.position));
  }
  ethercat.slave = std::make_unique<master::EthercatSlave>(*ethercat.master, found, options.answer_timeout());
  if (product_ == nullptr) product_ = product_of(found);
  if (drives && !is_drive(*ethercat.slave)) {
    throw Failure::wrong_use(
        fmt::format("{}: it is not a CiA 402 drive; choose another slave with --node", ethercat.slave->where()));
  }
  objects_ = std::make_unique<master::CoeObjects>(*ethercat.slave);
}

void DriveLink::be_watched(const BusOptions& options) {
  const Can* can = on<Can>();
  if (can == nullptr || options.no_watch) return;
  master::ObjectClient* const drives[] = {objects_.get()};
  watch_.emplace(*can->bus, drives, [this](const std::string& sentence) {
    watch_is_left_ = true;
    warn(sentence);
  });
}

bool DriveLink::end_watch() {
  watch_.reset();
  Ethercat* const ethercat = on<Ethercat>();
  const bool is_restored = ethercat == nullptr || !ethercat->reaction || ethercat->reaction->end();
  return is_restored && !watch_is_left_;
}

void DriveLink::operate(const BusOptions& options) {
  be_watched(options);
  Ethercat* ethercat = on<Ethercat>();
  if (ethercat == nullptr) return;
  master::EthercatSlave* const slaves[] = {ethercat->slave.get()};
  ethercat->reaction.emplace(*ethercat->slave);
  ethercat->operation.emplace(*ethercat->master, ethercat->line, slaves, operation_options(options));
  objects_ = std::make_unique<master::CoeObjects>(*ethercat->slave, ethercat->operation->exchange(), 0);
}

std::unique_ptr<master::CyclicBus> DriveLink::open_cyclic(const master::CanDrive& on_can, const BusOptions& options) {
  if (operates()) {
    return std::make_unique<master::EthercatCyclicBus>(
        *on<Ethercat>()->master, *on<Ethercat>()->operation,
        master::EthercatCyclicOptions{.brake_delay = open_axis({})->brake_delay()});
  }
  if (on<Can>() == nullptr) throw Failure::wrong_use(fmt::format("--bus {}: it has no process data", options.link));
  // Some drives answer a SYNC in their next tick, which may be more than half a period later.
  return std::make_unique<master::CanCyclicBus>(
      *on<Can>()->bus, std::vector{on_can},
      master::CanCyclicOptions{.period = operation_options(options).cyclic.period, .waits_whole_period = true});
}

const line::Product* DriveLink::product() {
  if (product_ != nullptr || asked_product_) return product_;
  asked_product_ = true;
  product_ = product_of(objects_->read_if_present<std::uint32_t>(0x1018, 1),
                        objects_->read_if_present<std::uint32_t>(0x1018, 2));
  return product_;
}

const master::ObjectCatalogue& DriveLink::catalogue() {
  if (product() == nullptr) return master::ObjectCatalogue::standard();
  if (!catalogue_) {
    const describe::Description description = product()->describe();
    const bool service = on<Modbus>() != nullptr || on<Serial10>() != nullptr;
    catalogue_ = master::ObjectCatalogue::of(service ? description.service_table : description.table, product()->name);
  }
  return *catalogue_;
}

std::unique_ptr<master::sampling::Sampler> DriveLink::open_sampler(std::vector<master::sampling::Channel> channels,
                                                                   const master::sampling::SamplerOptions& options) {
  if (Can* can = on<Can>()) {
    return master::sampling::open_can_sampler(*can->bus, *can->sdo, std::move(channels), options);
  }
  if (Ethercat* on_it = on<Ethercat>()) {
    return master::sampling::open_ethercat_sampler(*on_it->master, on_it->line, *on_it->slave, std::move(channels),
                                                   options);
  }
  return master::sampling::open_polled_sampler(
      *objects_, std::move(channels), options,
      on<Modbus>() != nullptr ? "Modbus requests" : "requests of the 10-byte protocol");
}

void check_that_it_moves(const line::Product& product, const std::string& where) {
  const master::RegisterList list = register_list_of(product);
  const bool has_statusword = std::any_of(list.registers.begin(), list.registers.end(),
                                          [](const auto& row) { return row.index == 0x6041 && row.sub == 0; });
  if (has_statusword) return;
  throw Failure::wrong_use(
      fmt::format("{}: this port of {} has parameters and monitoring items, and neither controlword nor statusword; "
                  "`get`, `set`, `params`, `scope` and `monitor OBJECT` work here, commands to the axis on its {}",
                  where, product.name, product.fieldbus == line::Fieldbus::ethercat ? "EtherCAT" : "CAN bus"));
}

std::unique_ptr<master::Axis402> DriveLink::open_axis(master::ObjectClient& objects, master::AxisOptions options) {
  if (product() != nullptr) options.product = &catalogue::product_of(product()->name);
  if (on<Modbus>() != nullptr) check_that_it_moves(*product_, objects_->where());
  if (!options.cancelled) options.cancelled = InterruptGuard::interrupted;
  return std::make_unique<master::Axis402>(objects, options);
}

std::unique_ptr<master::conform::Subject> DriveLink::open_subject(const master::conform::SubjectSettings& settings,
                                                                  const BusOptions& options) {
  using master::conform::Subject;
  if (Can* can = on<Can>()) {
    return std::make_unique<Subject>(master::conform::CanAccess{*can->bus, *can->sdo}, settings);
  }
  if (Ethercat* on_it = on<Ethercat>()) {
    return std::make_unique<Subject>(
        master::conform::EthercatAccess{*on_it->master, on_it->line, *on_it->slave, operation_options(options)},
        settings);
  }
  if (Modbus* modbus = on<Modbus>()) {
    check_that_it_moves(*product_, objects_->where());
    return std::make_unique<Subject>(
        master::conform::ModbusAccess{*modbus->client, static_cast<std::uint8_t>(objects_->address()),
                                      register_list_of(*product_)},
        settings);
  }
  throw Failure::wrong_use(
      fmt::format("--bus {}: there is no standard for this protocol; give CAN, EtherCAT or modbus:LINK", options.link));
}

}  // namespace servodrome::app
