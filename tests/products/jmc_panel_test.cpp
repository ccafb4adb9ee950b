#include <cmath>
#include <gtest/gtest.h>

#include "csv.hpp"
#include "jmc_rig.hpp"

// The panel parameters P00 to P08 of the JMC EC drives, compared with the list (tests/data/jmc_params.csv); how they
// are written, stored and hidden from the fieldbus.
namespace servodrome {
namespace jmc_panel_test {
namespace {

using dictionary::AbortCode;
using dictionary::Entry;
using products::JmcEc;
using products::jmc_ec::acts_from_power_on;
using products::jmc_ec::ParameterId;
using products::jmc_ec::set_while_stopped;
using test::FactoryJmcRig;

const Entry* entry_of(ParameterId id) {
  for (const Entry& entry : JmcEc::table) {
    if (entry.index == id.index() && entry.sub == id.sub()) return &entry;
  }
  return nullptr;
}

// Values are in steps of the unit's number.
double step_of(const Entry& entry) {
  const std::string unit = entry.unit;
  return unit.rfind("0.01", 0) == 0 ? 0.01 : unit.rfind("0.1", 0) == 0 ? 0.1 : 1.0;
}

TEST(JmcPanel, IsTheList) {
  std::size_t parameters = 0;
  std::size_t items = 0;
  for (const test::CsvRow& row : test::read_csv("jmc_params.csv")) {
    SCOPED_TRACE(row.at("group") + "-" + row.at("number"));
    const auto number = static_cast<std::uint8_t>(std::stoi(row.at("number")));
    if (row.at("group") == "d") {
      ++items;
      const auto sub = static_cast<std::uint8_t>(number + 1);
      const Entry* item = nullptr;
      for (const Entry& entry : JmcEc::table) {
        if (entry.index == products::jmc_ec::monitor_index && entry.sub == sub) item = &entry;
      }
      ASSERT_NE(item, nullptr);
      const std::string number_and_sign = "d" + row.at("number") + " " + row.at("name").substr(0, 4);
      EXPECT_EQ(std::string(item->name).substr(0, number_and_sign.size()), number_and_sign);
      EXPECT_FALSE(item->writable());
      continue;
    }
    const ParameterId id{static_cast<std::uint8_t>(row.at("group")[2] - '0'), number};
    if (row.at("min").empty()) {  // only named in the alarm chapter; of these the drive uses only P03-68
      EXPECT_EQ(entry_of(id) != nullptr, (id == ParameterId{3, 68}));
      continue;
    }
    ++parameters;
    const Entry* entry = entry_of(id);
    ASSERT_NE(entry, nullptr);
    const std::string printed = row.at("group") + "-" + row.at("number") + " ";
    EXPECT_EQ(std::string(entry->name).substr(0, printed.size()), printed);
    const double step = step_of(*entry);
    EXPECT_NEAR(static_cast<double>(entry->minimum) * step, std::stod(row.at("min")), 1e-9);
    const double most = id == ParameterId{0, 5} ? 50.0 : std::stod(row.at("max"));  // the steppers' pole pairs
    EXPECT_NEAR(static_cast<double>(entry->maximum) * step, most, 1e-9);
    if (id.group != 0 || id.number >= 21) {
      EXPECT_NEAR(static_cast<double>(entry->default_value) * step, std::stod(row.at("default")), 1e-9);
    }
    EXPECT_EQ(acts_from_power_on(id), row.at("effective") == "power-on");
    EXPECT_EQ(set_while_stopped(id), row.at("access") == "rw, set while stopped");
    EXPECT_TRUE(entry->saved && entry->local);
    // The printed addresses (ch. 6), and the others by the same rule.
    const std::uint16_t address = products::jmc_ec::register_of(id);
    if (!row.at("modbus").empty()) {
      EXPECT_EQ(address, std::stoi(row.at("modbus"), nullptr, 16));
    }
    bool found = false;
    for (const modbus::Register& one : JmcEc::registers) {
      found |= one.address == address && one.index == id.index() && one.sub == id.sub();
    }
    EXPECT_TRUE(found);
  }
  EXPECT_EQ(parameters, 77U);
  EXPECT_EQ(items, 29U);
  std::size_t all = 0;
  for (const Entry& entry : JmcEc::table) all += products::jmc_ec::is_panel(entry.index) && entry.sub != 0;
  EXPECT_EQ(all, parameters + 1) << "and P03-68";
}

TEST(JmcPanel, FactoryValuesOfTheRating) {
  FactoryJmcRig rig("ihsv60-400");
  EXPECT_EQ(rig.panel(0, 1), 3000);
  EXPECT_EQ(rig.panel(0, 2), 127);  // 400 W at 3000 rpm
  EXPECT_EQ(rig.panel(0, 4), 58);
  EXPECT_EQ(rig.panel(0, 5), 5);
  EXPECT_EQ(rig.panel(0, 10), 1000);
  FactoryJmcRig stepper("2hss458-ec");
  EXPECT_EQ(stepper.panel(0, 3), 600);
  EXPECT_EQ(stepper.panel(0, 5), 50);
}

// Table 219 does not have them: no SDO, no list, no PDO. The dictionary of the service port has all of them.
TEST(JmcPanel, TheBusDoesNotSeeThem) {
  FactoryJmcRig rig;
  rig.to_pre_operational();
  AbortCode abort{};
  for (const std::uint16_t index : std::to_array<std::uint16_t>({0x2000, 0x2001, 0x2008, 0x200D, 0x200E})) {
    rig.upload(index, 1, &abort);
    EXPECT_EQ(abort, AbortCode::object_does_not_exist) << std::hex << index;
    EXPECT_EQ(rig.download(index, 1, 0, 2), AbortCode::object_does_not_exist);
    EXPECT_NE(rig.device.dictionary().find(index, 0), nullptr);
    EXPECT_EQ(rig.device.bus_dictionary().find(index, 0), nullptr);
  }
  EXPECT_EQ(rig.download(0x1600, 0, 0, 1), AbortCode::none);
  EXPECT_NE(rig.download(0x1600, 1, 0x20020110, 4), AbortCode::none);
}

struct MemoryRig {
  std::array<std::byte, 16384> bytes{};
  dictionary::RamMedium medium{bytes};
  FactoryJmcRig rig{test::jmc_plant(), settings()};

  products::Settings settings() {
    products::Settings made = test::jmc_settings();
    made.store = &medium;
    return made;
  }
  void power_cycle() {
    rig.device.power_off();
    rig.device.power_on(rig.feedback, rig.now());
    rig.run_ms(5);
  }
};

TEST(JmcPanel, IsKeptAtOnce) {
  MemoryRig memory;
  FactoryJmcRig& rig = memory.rig;
  EXPECT_EQ(rig.set_panel(1, 2, 0), AbortCode::none);
  EXPECT_EQ(rig.set_panel(2, 0, 654), AbortCode::none);
  EXPECT_EQ(rig.set_panel(2, 50, -123), AbortCode::none);
  EXPECT_EQ(rig.set(0x6081, 0, 777), AbortCode::none);
  memory.power_cycle();
  EXPECT_EQ(rig.panel(2, 0), 654);
  EXPECT_EQ(rig.panel(2, 50), -123);
  EXPECT_EQ(rig.panel(2, 1), 570);
  EXPECT_EQ(rig.get(0x6081), 2400) << "objects of the table are not stored";
  EXPECT_FLOAT_EQ(rig.device.drive().configuration().gains.position_kp, 65.4F);
}

TEST(JmcPanel, RangesAndTheRunningMotor) {
  FactoryJmcRig rig;
  EXPECT_EQ(rig.set_panel(1, 3, 32), AbortCode::value_too_high);
  EXPECT_EQ(rig.set_panel(2, 10, 9), AbortCode::value_too_low);
  EXPECT_EQ(rig.set_panel(4, 7, 1), AbortCode::value_too_high);
  ASSERT_TRUE(rig.enable());
  EXPECT_EQ(rig.set_panel(0, 23, 7), AbortCode::device_state) << "stop and set";
  EXPECT_EQ(rig.set_panel(1, 1, 1), AbortCode::device_state);
  EXPECT_EQ(rig.set_panel(0, 26, 7), AbortCode::none) << "may be set while it runs (ch. 6)";
  EXPECT_EQ(rig.set_panel(2, 0, 500), AbortCode::none);
}

// A value that takes effect after power-on: AL.941, a warning with 13 flashes; AL.110 if the drive is enabled with it
// (ch. 9.2).
TEST(JmcPanel, WaitsForPowerOn) {
  MemoryRig memory;
  FactoryJmcRig& rig = memory.rig;
  rig.run_ms(5);
  EXPECT_EQ(rig.set_panel(0, 42, 60), AbortCode::none);
  rig.run_ms(2);
  EXPECT_EQ(rig.status() & 0x88, 0x80);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.941");
  EXPECT_EQ(rig.device.leds(rig.now()).alarm_flashes, 13);
  EXPECT_EQ(rig.device.panel().active().over_voltage_v, 0);
  // After the old value is restored, no value is pending.
  EXPECT_EQ(rig.set_panel(0, 42, 0), AbortCode::none);
  rig.run_ms(2);
  EXPECT_EQ(rig.status() & 0x88, 0);
  EXPECT_EQ(rig.set_panel(0, 42, 60), AbortCode::none);
  EXPECT_FALSE(rig.enable());
  rig.run_ms(300);
  EXPECT_EQ(rig.status() & 0x4F, 0x08);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.110");
  rig.control(0x80);
  rig.run_ms(5);
  EXPECT_EQ(rig.status() & 0x4F, 0x08) << "only a power cycle helps";
  memory.power_cycle();
  EXPECT_EQ(rig.status() & 0x88, 0);
  EXPECT_FLOAT_EQ(rig.device.drive().configuration().monitors.over_voltage_v, 60.0F);
  EXPECT_TRUE(rig.enable());
}

// P00-42 = 0 selects the threshold of the rating.
TEST(JmcPanel, OverVoltageThreshold) {
  MemoryRig memory;
  FactoryJmcRig& rig = memory.rig;
  rig.set_panel(0, 42, 40);
  memory.power_cycle();
  rig.plant.set_supply_v(39.0);
  rig.run_ms(200);
  EXPECT_EQ(rig.status() & 0x4F, 0x40);
  rig.plant.set_supply_v(42.0);
  rig.run_ms(200);
  EXPECT_STREQ(rig.device.alarm().data(), "AL.402");
}

// P00-01 to P00-10: a motor that differs from the nameplate.
TEST(JmcPanel, MotorOfTheParameters) {
  MemoryRig memory;
  FactoryJmcRig& rig = memory.rig;
  const drive::MotorData before = rig.device.drive().configuration().motor;
  rig.set_panel(0, 4, 52);
  rig.set_panel(0, 10, 2500);
  memory.power_cycle();
  const drive::MotorData& motor = rig.device.drive().configuration().motor;
  EXPECT_EQ(motor.counts_per_revolution, 10000U);
  EXPECT_NEAR(static_cast<double>(motor.inertia_kgm2), 2.0 * 0.52e-4, 1e-9) << "with the load of P01-04";
  EXPECT_FLOAT_EQ(motor.rated_torque_nm, before.rated_torque_nm);
}

// P00-00: "0: P0-01 to P0-17 is available" (ch. 8.2.1); with a motor number they have no effect.
TEST(JmcPanel, MotorNumberSetsTheParametersAside) {
  MemoryRig memory;
  FactoryJmcRig& rig = memory.rig;
  const drive::MotorData before = rig.device.drive().configuration().motor;
  rig.set_panel(0, 0, 11);
  rig.set_panel(0, 4, 52);
  rig.set_panel(0, 10, 2500);
  memory.power_cycle();
  EXPECT_EQ(rig.device.drive().configuration().motor.counts_per_revolution, before.counts_per_revolution);
  EXPECT_EQ(rig.device.drive().configuration().motor.inertia_kgm2, before.inertia_kgm2);
  rig.set_panel(0, 0, 0);
  memory.power_cycle();
  EXPECT_EQ(rig.device.drive().configuration().motor.counts_per_revolution, 10000U);
}

// --- P01-02, P01-03

TEST(JmcRigidity, LevelThirteenIsPrinted) {  // Table 65
  FactoryJmcRig rig;
  EXPECT_EQ(rig.panel(1, 2), 1);
  EXPECT_EQ(rig.panel(1, 3), 13);
  const std::array<std::int64_t, 7> printed{480, 570, 270, 100, 270, 10000, 84};
  const std::array<std::int64_t, 7> values{rig.panel(2, 0),  rig.panel(2, 1),  rig.panel(2, 10), rig.panel(2, 11),
                                           rig.panel(2, 13), rig.panel(2, 14), rig.panel(8, 20)};
  EXPECT_EQ(values, printed);
}

TEST(JmcRigidity, EveryLevelIsStifferThanTheOneBefore) {
  const auto& levels = products::jmc_ec::rigidity_levels;
  for (std::size_t i = 1; i < levels.size(); ++i) {
    EXPECT_GT(levels[i].velocity_gain_1, levels[i - 1].velocity_gain_1) << i;
    EXPECT_GT(levels[i].position_gain_1, levels[i - 1].position_gain_1) << i;
    EXPECT_GT(levels[i].position_gain_2, levels[i].position_gain_1) << i;
    EXPECT_LT(levels[i].integral_time_1, levels[i - 1].integral_time_1) << i;
    EXPECT_LE(levels[i].torque_filter, levels[i - 1].torque_filter) << i;
    EXPECT_EQ(levels[i].integral_time_2, 10000) << i;
  }
  EXPECT_LE(levels.back().position_gain_2, 30000);
  EXPECT_LE(levels.front().torque_filter, 2500);
}

TEST(JmcRigidity, ModesOfAdjustment) {
  FactoryJmcRig rig;
  // Standard: values that the level sets cannot be changed, feed-forwards can (ch. 7, P01-02).
  rig.set_panel(2, 10, 1234);
  rig.set_panel(8, 20, 1);
  rig.set_panel(2, 3, 555);
  rig.set_panel(2, 4, 222);
  EXPECT_EQ(rig.panel(2, 10), 270);
  EXPECT_EQ(rig.panel(8, 20), 84);
  EXPECT_EQ(rig.panel(2, 3), 555);
  EXPECT_EQ(rig.panel(2, 4), 222);
  rig.set_panel(1, 3, 20);
  EXPECT_EQ(rig.panel(2, 10), products::jmc_ec::rigidity_levels[20].velocity_gain_1);
  // Positioning: feed-forwards cannot be changed either, 30.0 % and 0.50 ms (ch. 8.2.2, P01-02).
  rig.set_panel(1, 2, 2);
  EXPECT_EQ(rig.panel(2, 3), 300);
  EXPECT_EQ(rig.panel(2, 4), 50);
  rig.set_panel(2, 3, 555);
  EXPECT_EQ(rig.panel(2, 3), 300);
  // Manual: all values can be changed; it starts with the present values.
  rig.set_panel(1, 2, 0);
  EXPECT_EQ(rig.panel(2, 10), products::jmc_ec::rigidity_levels[20].velocity_gain_1);
  rig.set_panel(2, 10, 1234);
  rig.set_panel(2, 3, 555);
  EXPECT_EQ(rig.panel(2, 10), 1234);
  EXPECT_EQ(rig.panel(2, 3), 555);
}

}  // namespace
}  // namespace jmc_panel_test
}  // namespace servodrome
