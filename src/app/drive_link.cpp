#include "app/drive_link.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "app/commands.hpp"
#include "describe/words.hpp"
#include "line/nearest_name.hpp"
#include "links/link_error.hpp"
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

const line::Product* named_product(const BusOptions& options) {
  if (options.product.empty()) return nullptr;
  const line::Product* product = line::find_product(line::all_products(), options.product);
  if (product != nullptr) return product;
  std::vector<std::string_view> names;
  for (const line::Product& known : line::all_products()) names.push_back(known.name);
  throw Failure::wrong_use(fmt::format("--product {}: there is no such product; {}", options.product,
                                       line::suggestion(options.product, names)));
}

// Of a protocol that only one product has, its drives need not be named.
const line::Product* product_that_speaks(products::SerialProtocol protocol) {
  const line::Product* found = nullptr;
  for (const line::Product& product : line::all_products()) {
    if (product.serial == nullptr) continue;
    const auto& protocols = product.serial->protocols;
    if (std::find(protocols.begin(), protocols.end(), protocol) == protocols.end()) continue;
    if (found != nullptr) return nullptr;
    found = &product;
  }
  return found;
}

bool is_tcp(const std::string& link) {
  return std::holds_alternative<links::ModbusTcpName>(links::parse_serial_link(link));
}

}  // namespace

const line::Product* product_of(std::optional<std::uint32_t> vendor_id, std::optional<std::uint32_t> product_code) {
  for (const line::Product& product : line::all_products()) {
    const auto table = product.describe().table;
    if (vendor_id == describe::identity(table, 1) && product_code == describe::identity(table, 2)) return &product;
  }
  return nullptr;
}

const line::Product* product_of(const host::FoundNode& node) {
  return node.identity ? product_of(node.identity->vendor_id, node.identity->product_code) : nullptr;
}

std::string name_of(const host::FoundNode& node) {
  if (!node.name.empty()) return node.name;
  const line::Product* product = product_of(node);
  return product != nullptr ? std::string(product->name) : "-";
}

int name_width(const std::vector<host::FoundNode>& nodes) {
  std::size_t longest = std::string_view("product").size();
  for (const host::FoundNode& node : nodes) longest = std::max(longest, name_of(node).size());
  return static_cast<int>(longest) + 2;
}

host::ModbusClient open_modbus_client(const BusOptions& options, const std::string& link,
                                      const host::ModbusOptions& modbus_options) {
  check_link(options, link);
  host::ModbusOptions complete = modbus_options;
  complete.format = format_of(options);
  return host::ModbusClient::open(link, complete);
}

host::Serial10Client open_serial10_client(const BusOptions& options, const std::string& link,
                                          const host::Serial10Options& serial10_options) {
  check_link(options, link);
  if (is_tcp(link)) throw Failure::wrong_use(fmt::format("--bus {}: this protocol is for serial lines", options.link));
  host::Serial10Options complete = serial10_options;
  complete.format = format_of(options);
  return host::Serial10Client::open(link, complete);
}

DriveLink::DriveLink(const BusOptions& options, bool drives) : product_(named_product(options)) {
  const auto [kind, link] = bus_kind(options);
  switch (kind) {
    case BusKind::can: open_can(options, drives); break;
    case BusKind::modbus: open_modbus(options, link); break;
    case BusKind::serial10: open_serial10(options, link); break;
  }
}

void DriveLink::open_can(const BusOptions& options, bool drives) {
  bus_ = open_bus(options);
  auto sdo = std::make_unique<host::SdoClient>(*bus_, choose_node(*bus_, options, drives),
                                               host::SdoOptions{.timeout = options.answer_timeout()});
  sdo_ = sdo.get();
  objects_ = std::move(sdo);
}

void DriveLink::open_modbus(const BusOptions& options, const std::string& link) {
  const host::ModbusOptions modbus_options{.timeout = options.answer_timeout()};
  modbus_ = std::make_unique<host::ModbusClient>(open_modbus_client(options, link, modbus_options));
  auto unit = static_cast<std::uint8_t>(options.node_id);
  if (unit == 0) {
    if (!is_tcp(link)) {
      throw Failure::wrong_use(fmt::format(
          "--bus {}: say which station with --node; `servodrome scan` lists those there are", options.link));
    }
    unit = modbus::unspecified_unit;
  }
  if (product_ == nullptr) product_ = &modbus_product(unit);
  if (product_->serial == nullptr) {
    throw Failure::wrong_use(fmt::format("--product {}: it has no Modbus registers", product_->name));
  }
  objects_ =
      std::make_unique<host::ModbusObjects>(*modbus_, unit,
                                            host::RegisterList{.registers = product_->serial->registers,
                                                               .table = product_->describe().table,
                                                               .word_order = product_->serial->profile->word_order});
}

// A station without identification may be anything, and addresses mean something else for each product.
const line::Product& DriveLink::modbus_product(std::uint8_t unit) const {
  std::string name;
  try {
    constexpr std::uint8_t product_code = 1;
    name = modbus_->read_device_identification(unit)[product_code];
  } catch (const host::ModbusError& error) {
    const bool gateway = error.exception() == Exception::gateway_path_unavailable ||
                         error.exception() == Exception::gateway_target_failed_to_respond;
    if (error.kind() != host::ModbusError::Kind::refused || gateway) throw;
  }
  const line::Product* product = line::find_product(line::all_products(), name);
  if (product != nullptr && product->serial != nullptr) return *product;
  std::string known;
  for (const line::Product& candidate : line::all_products()) {
    if (candidate.serial != nullptr) known += fmt::format("{}{}", known.empty() ? "" : ", ", candidate.name);
  }
  throw Failure::wrong_use(
      fmt::format("{}, unit {}: {}; give --product with the one whose registers it has ({})", modbus_->name(), unit,
                  name.empty() ? "it does not say what it is" : fmt::format("\"{}\" is not known", name), known));
}

void DriveLink::open_serial10(const BusOptions& options, const std::string& link) {
  const host::Serial10Options serial10_options{.timeout = options.answer_timeout()};
  serial10_ = std::make_unique<host::Serial10Client>(open_serial10_client(options, link, serial10_options));
  if (options.node_id > 127) throw Failure::wrong_use(fmt::format("--node {}: ids are 1..127", options.node_id));
  const auto id = static_cast<std::uint8_t>(options.node_id != 0 ? options.node_id : serial10::universal_id);
  if (product_ == nullptr) product_ = product_that_speaks(products::SerialProtocol::serial10);
  objects_ = std::make_unique<host::Serial10Objects>(*serial10_, id);
}

const line::Product* DriveLink::product() {
  if (product_ != nullptr || asked_product_) return product_;
  asked_product_ = true;
  product_ = product_of(objects_->read_if_present<std::uint32_t>(0x1018, 1),
                        objects_->read_if_present<std::uint32_t>(0x1018, 2));
  return product_;
}

std::unique_ptr<host::Axis402> DriveLink::open_axis(host::AxisOptions options) {
  if (product() != nullptr) options.dialect = host::dialect_of(product()->name);
  return std::make_unique<host::Axis402>(*objects_, options);
}

}  // namespace servodrome::app
