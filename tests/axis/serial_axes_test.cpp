// The master's axis over an RS485 line, and drives that share it and a CAN bus, in virtual time.
#include <gtest/gtest.h>

#include "axis/axis402.hpp"
#include "catalogue/product.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "master/canopen/sdo_client.hpp"
#include "master/modbus/objects.hpp"
#include "master/modbus/scan.hpp"
#include "master/serial10/objects.hpp"

namespace servodrome::master {
namespace serial_axes_test {
namespace {

using namespace std::chrono_literals;

constexpr const char* four_drives = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[bus]]
name = "rs"
type = "rs485"
[[axis]]
name = "one"
product = "generic402"
bus = "can0"
serial = "rs"
node = 1
[[axis]]
name = "two"
product = "ismk"
bus = "can0"
serial = "rs"
serial_protocol = "modbus"
node = 2
[[axis]]
name = "three"
product = "generic402"
bus = "can0"
serial = "rs"
node = 3
[[axis]]
name = "four"
product = "ismk"
bus = "can0"
serial = "rs"
serial_protocol = "modbus"
node = 4
)";

// An iSMK reports target reached within 327 increments (6067h); the motion continues after that.
constexpr Time settling = 1s;

RegisterList list_of(std::string_view product) {
  const line::Product& found = *line::find_product(line::all_products(), product);
  return {found.serial->registers, found.describe().service_table, found.serial->profile->word_order};
}

class SerialAxes : public testing::Test {
 protected:
  SerialAxes() { line.run_until(100ms); }

  ModbusClient master() {
    const ModbusOptions options{.format = {.bit_rate = 115200, .parity = modbus::Parity::none}, .timeout = 20ms};
    return {std::make_unique<links::MemoryByteClient>(rs485.line, line), ModbusClient::Framing::rtu, "mem:", options};
  }
  std::int64_t shaft(std::string_view name) { return line.find_axis(name)->plant().position_counts(); }

  line::Line line{line::test::settings_of(four_drives)};
  line::NamedSerialBus& rs485 = *line.find_serial_bus("rs");
  Bus bus{std::make_unique<links::MemoryCanClient>(line.buses()[0]->bus, line), "mem:", &line};
};

TEST_F(SerialAxes, ScanFindsTheStations) {
  ModbusClient client = master();
  const std::vector<FoundStation> found = scan_stations(client, 1, 6);
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0].text(1), "generic402");
  EXPECT_EQ(found[1].unit, 2);
  EXPECT_TRUE(found[1].identification.empty()) << "the iSMK does not say what it is";
}

TEST_F(SerialAxes, TheReferenceDriveHomesAndMovesOverModbus) {
  ModbusClient client = master();
  const RegisterList list = list_of("generic402");
  ModbusObjects objects(client, 1, list);
  Axis402 axis(objects);
  axis.enable();
  axis.home({.method = 35}, 2s);
  EXPECT_EQ(axis.status().mode, 6);
  int looks = 0;
  axis.move_to(-200000, {.velocity = 655360, .acceleration = 6553600, .deceleration = 6553600}, 5s,
               [&looks](const AxisStatus&) { ++looks; });
  EXPECT_GT(looks, 10);
  EXPECT_NEAR(static_cast<double>(shaft("one")), -200000, 20);
  EXPECT_NEAR(axis.position(), -200000, 20);
  axis.disable();
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
  try {
    objects.read<std::uint32_t>(0x5FFF);
    FAIL() << "there is no such object";
  } catch (const ObjectError& error) {
    EXPECT_TRUE(error.object_is_absent());
  }
  EXPECT_EQ(objects.read_if_present<std::uint32_t>(0x5FFF), std::nullopt);
  EXPECT_THROW(objects.write<std::uint16_t>(0x6041, 0, 1), ObjectError) << "read only";
}

// The iSMK has no registers for 6061h and 6064h: 6060h and 6063h are used instead.
TEST_F(SerialAxes, AnIsmkMovesOverModbus) {
  ModbusClient client = master();
  ModbusObjects objects(client, 2, list_of("ismk"));
  Axis402 axis(objects, {.product = &catalogue::product_of("ismk")});
  axis.enable();
  axis.move_to(100000, {.velocity = 53687091}, 5s);
  objects.wait(settling);
  EXPECT_NEAR(static_cast<double>(shaft("two")), 100000, 50);
  EXPECT_NEAR(axis.position(), 100000, 50);
  EXPECT_EQ(axis.status().mode, 1);
  EXPECT_EQ(objects.read<std::int8_t>(0x6060), 1);
}

TEST_F(SerialAxes, AnIsmkMovesWithTheTenByteProtocol) {
  line::LineSettings settings = line::test::settings_of(four_drives);
  settings.axes = {settings.axes[1]};
  settings.axes[0].serial->protocol = std::nullopt;  // factory setting
  line::Line single(settings);
  single.run_until(100ms);
  Serial10Client client(std::make_unique<links::MemoryByteClient>(single.find_serial_bus("rs")->line, single), "mem:");
  Serial10Objects objects(client, serial10::universal_id);
  Axis402 axis(objects, {.product = &catalogue::product_of("ismk")});
  axis.enable();
  axis.move_by(-50000, {.velocity = 53687091}, 5s);
  objects.wait(settling);
  EXPECT_NEAR(static_cast<double>(single.find_axis("two")->plant().position_counts()), -50000, 50);
  EXPECT_EQ(objects.read<std::uint16_t>(0x100B), 2);
  EXPECT_EQ(objects.read_if_present<std::uint32_t>(0x5FFF), std::nullopt);
  EXPECT_THROW(objects.read_text(0x1008), ObjectError) << "no string can be sent";
}

// All four drives move at the same time, two commanded by RS485 and two by CAN, and each is read over the other bus;
// the nodes' heartbeats continue at one per millisecond. There must be no interference: no collision, no error frame,
// no missing answer, and each shaft at its own target.
TEST_F(SerialAxes, FourDrivesShareOneCanBusAndOneRs485Line) {
  struct Drive {
    std::uint8_t number;
    const char* name;
    const char* product;
    bool commanded_by_rs485;
    std::int32_t target;
  };
  const Drive drives[] = {{1, "one", "generic402", true, 400000},
                          {2, "two", "ismk", true, -150000},
                          {3, "three", "generic402", false, -300000},
                          {4, "four", "ismk", false, 250000}};
  ModbusClient client = master();
  std::vector<std::unique_ptr<ModbusObjects>> serial;
  std::vector<std::unique_ptr<SdoClient>> can;
  line::test::Recorder recorder(line.buses()[0]->bus);
  for (const Drive& drive : drives) {
    serial.push_back(std::make_unique<ModbusObjects>(client, drive.number, list_of(drive.product)));
    can.push_back(std::make_unique<SdoClient>(bus, drive.number));
    can.back()->write<std::uint16_t>(0x1017, 0, 1);
  }
  const auto commander = [&](std::size_t i) -> ObjectClient& {
    return drives[i].commanded_by_rs485 ? static_cast<ObjectClient&>(*serial[i]) : *can[i];
  };
  const auto watcher = [&](std::size_t i) -> ObjectClient& {
    return drives[i].commanded_by_rs485 ? static_cast<ObjectClient&>(*can[i]) : *serial[i];
  };
  for (std::size_t i = 0; i < 4; ++i) {
    ObjectClient& objects = commander(i);
    Axis402(objects).enable();
    objects.write<std::int8_t>(0x6060, 0, 1);
    const bool ismk = std::string_view(drives[i].product) == "ismk";
    objects.write<std::uint32_t>(0x6081, 0, ismk ? 1789570 * 10U : 131072U * 2);
    objects.write<std::int32_t>(0x607A, 0, drives[i].target);
  }
  for (std::size_t i = 0; i < 4; ++i) commander(i).write<std::uint16_t>(0x6040, 0, 0x1F);
  std::array<int, 4> looks_in_motion{};
  std::array<std::int64_t, 4> position{};
  const Time deadline = line.now() + 10s;
  const auto is_there = [&](std::size_t i) { return std::abs(position[i] - drives[i].target) < 20; };
  while (!(is_there(0) && is_there(1) && is_there(2) && is_there(3))) {
    ASSERT_LT(line.now(), deadline);
    for (std::size_t i = 0; i < 4; ++i) {
      position[i] = watcher(i).read<std::int32_t>(0x6063);
      if (!is_there(i)) ++looks_in_motion[i];
    }
  }
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_GT(looks_in_motion[i], 20) << drives[i].name;
    EXPECT_NEAR(static_cast<double>(shaft(drives[i].name)), drives[i].target, 20);
  }
  EXPECT_EQ(rs485.line.counters().collisions, 0U);
  EXPECT_GT(rs485.line.counters().characters, 1000U);
  EXPECT_EQ(line.buses()[0]->bus.counters().errors, 0U);
  for (const Drive& drive : drives) {
    // Heartbeats wait for SDOs, whose identifiers have priority. A heartbeat that still waits when the next is due is
    // replaced by it.
    Time first = links::never;
    Time last{};
    unsigned count = 0;
    for (const links::BusEvent& event : recorder.events) {
      if (event.frame.id != 0x700U + drive.number) continue;
      first = std::min(first, event.start);
      last = event.start;
      ++count;
    }
    const double due = static_cast<double>((last - first) / 1ms) + 1.0;
    EXPECT_NEAR(count, due, 2.0 + 0.005 * due) << drive.name;
    EXPECT_GT(count, 500U) << drive.name;
  }
}

}  // namespace
}  // namespace serial_axes_test
}  // namespace servodrome::master
