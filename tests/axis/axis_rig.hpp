#pragma once

#include <algorithm>
#include <array>
#include <gtest/gtest.h>

#include "axis/axis402.hpp"
#include "catalogue/product.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/canopen/sdo_client.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "master/modbus/objects.hpp"
#include "master/problem_of.hpp"
#include "master/serial10/objects.hpp"

// A drive with its motor and a master on its bus, in virtual time, for every product and bus.
namespace servodrome::master::test {

using namespace std::chrono_literals;

struct RigCase {
  const char* product;
  enum class BusKind : std::uint8_t { can, ethercat, modbus, serial10 } bus = BusKind::can;
  const char* axis_text = "";  // additional lines of each axis in the line file
  Time ethercat_period = std::chrono::milliseconds(2);

  std::string name() const {
    std::string text = product;
    std::replace(text.begin(), text.end(), '-', '_');
    constexpr std::array names{"_can", "_ethercat", "_modbus", "_serial10"};
    return text + names[static_cast<std::size_t>(bus)];
  }
};

// Every product on every bus it has.
inline const RigCase every_product[] = {{"ismc"},
                                        {"pronet"},
                                        {"ismk"},
                                        {"generic402"},
                                        {"ismk", RigCase::BusKind::modbus},
                                        {"ismk", RigCase::BusKind::serial10},
                                        {"generic402", RigCase::BusKind::modbus},
                                        {"jmc_ec", RigCase::BusKind::ethercat},
                                        {"ismk-ea", RigCase::BusKind::ethercat},
                                        {"generic402-ec", RigCase::BusKind::ethercat}};

class AxisRig {
 public:
  explicit AxisRig(const RigCase& its_case, unsigned axes = 1) : rig_case(its_case), line(line_of(its_case, axes)) {
    // Attaches the master first, because a node that is alone on a CAN bus gets no acknowledge for its frames.
    if (rig_case.bus != RigCase::BusKind::ethercat) open_can();
    line.run_until(100ms);
    switch (rig_case.bus) {
      case RigCase::BusKind::can: open_nodes(); break;
      case RigCase::BusKind::modbus: open_modbus(); break;
      case RigCase::BusKind::serial10: open_serial10(); break;
      case RigCase::BusKind::ethercat: open_ethercat(); break;
    }
  }

  AxisOptions options() const { return {.product = &catalogue::product_of(rig_case.product)}; }
  ObjectClient& objects(std::size_t number = 0) { return *clients[number]; }
  line::Axis& drive(std::size_t number = 0) { return *line.axes()[number]; }
  double shaft_counts(std::size_t number = 0) { return static_cast<double>(drive(number).plant().position_counts()); }
  // Interrupts the bus: no frame arrives.
  void cut() {
    switch (rig_case.bus) {
      case RigCase::BusKind::can: line.buses()[0]->bus.cut_bus(true); break;
      case RigCase::BusKind::modbus:
      case RigCase::BusKind::serial10: line.serial_buses()[0]->line.disturb({.cut = true}); break;
      case RigCase::BusKind::ethercat: line.ethercat_buses()[0]->bus.disturb({.drop = 1.0}); break;
    }
  }
  void power_off(std::size_t number = 0) { drive(number).power_off(line.now()); }

  RigCase rig_case;
  line::Line line;
  // Clients of the bus of this case; the CAN bus also exists if the drives are commanded over Modbus.
  std::unique_ptr<Bus> can;
  std::unique_ptr<ModbusClient> modbus;
  std::unique_ptr<Serial10Client> serial10;
  std::unique_ptr<EthercatMaster> ethercat;
  std::vector<FoundSlave> found;
  std::vector<std::unique_ptr<EthercatSlave>> slaves;
  std::optional<EthercatOperation> operation;
  std::vector<std::unique_ptr<ObjectClient>> clients;

 private:
  static line::LineSettings line_of(const RigCase& rig_case, unsigned axes) {
    const bool ethercat = rig_case.bus == RigCase::BusKind::ethercat;
    const bool modbus = rig_case.bus == RigCase::BusKind::modbus;
    std::string text =
        fmt::format("clock = \"virtual\"\n[[bus]]\nname = \"field\"\n{}", ethercat ? "type = \"ethercat\"\n" : "");
    const bool serial = modbus || rig_case.bus == RigCase::BusKind::serial10;
    if (serial) text += "[[bus]]\nname = \"rs\"\ntype = \"rs485\"\n";
    for (unsigned i = 0; i < axes; ++i) {
      text += fmt::format("[[axis]]\nname = \"axis{}\"\nproduct = \"{}\"\nbus = \"field\"\n", i + 1, rig_case.product);
      if (!ethercat) text += fmt::format("node = {}\n", i + 1);
      if (serial) text += "serial = \"rs\"\n";
      if (modbus) text += "serial_protocol = \"modbus\"\n";
      text += rig_case.axis_text;
    }
    return line::test::settings_of(text);
  }
  void open_can() {
    can = std::make_unique<Bus>(std::make_unique<links::MemoryCanClient>(line.buses()[0]->bus, line), "mem:", &line);
  }
  void open_nodes() {
    for (std::size_t i = 0; i < line.axes().size(); ++i) {
      clients.push_back(std::make_unique<SdoClient>(*can, static_cast<std::uint8_t>(i + 1)));
    }
  }
  void open_modbus() {
    const ModbusOptions modbus_options{.format = {.bit_rate = 115200, .parity = modbus::Parity::none}, .timeout = 20ms};
    modbus =
        std::make_unique<ModbusClient>(std::make_unique<links::MemoryByteClient>(line.serial_buses()[0]->line, line),
                                       ModbusClient::Framing::rtu, "mem:", modbus_options);
    const line::Product& product = *line::find_product(line::all_products(), rig_case.product);
    for (std::size_t i = 0; i < line.axes().size(); ++i) {
      clients.push_back(
          std::make_unique<ModbusObjects>(*modbus, static_cast<std::uint8_t>(i + 1),
                                          RegisterList{product.serial->registers, product.describe().service_table,
                                                       product.serial->profile->word_order}));
    }
  }
  // There is one drive only, so the universal id addresses it.
  void open_serial10() {
    serial10 = std::make_unique<Serial10Client>(
        std::make_unique<links::MemoryByteClient>(line.serial_buses()[0]->line, line), "mem:");
    clients.push_back(std::make_unique<Serial10Objects>(*serial10, servodrome::serial10::universal_id));
  }
  void open_ethercat() {
    ethercat = std::make_unique<EthercatMaster>(
        std::make_unique<links::MemoryEthercatClient>(line.ethercat_buses()[0]->bus, line));
    found = scan_slaves(*ethercat);
    std::vector<EthercatSlave*> all;
    for (const FoundSlave& one : found) {
      slaves.push_back(std::make_unique<EthercatSlave>(*ethercat, one));
      all.push_back(slaves.back().get());
    }
    operation.emplace(*ethercat, found, all,
                      OperationOptions{.cyclic = {.period = rig_case.ethercat_period, .tolerated_losses = 50},
                                       .sync_error_limit = 0});
    for (std::size_t i = 0; i < all.size(); ++i) {
      clients.push_back(std::make_unique<CoeObjects>(*all[i], operation->exchange(), i));
    }
  }
};

}  // namespace servodrome::master::test
