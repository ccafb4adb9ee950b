#include <gtest/gtest.h>

#include "jmc_rig.hpp"
#include "rs485.hpp"

// The service port of the JMC EC drives: Modbus RTU on RS232, parameters at group << 8 | number, items at 0D00h
// (ch. 6; readings in service_port.hpp).
namespace servodrome {
namespace jmc_service_port_test {
namespace {

using products::JmcEc;
using test::FactoryJmcRig;
using test::Rs485Master;

struct Port {
  explicit Port(products::Settings settings = test::jmc_settings()) : rig(test::jmc_plant(), with_memory(settings)) {
    rig.run_ms(5);
  }
  products::Settings with_memory(products::Settings settings) {
    settings.store = &medium;
    return settings;
  }
  void power_cycle() {
    rig.device.power_off();
    rig.device.power_on(rig.feedback, rig.now());
    rig.run_ms(5);
  }
  std::array<std::byte, 16384> bytes{};
  dictionary::RamMedium medium{bytes};
  FactoryJmcRig rig;
  Rs485Master<FactoryJmcRig> master{rig};
};

TEST(JmcServicePort, IsEightNOneAtTheRateOfP0021) {
  const std::array<std::uint32_t, 4> rates{9600, 19200, 57600, 115200};
  for (int code = 0; code < 4; ++code) {
    Port port;
    EXPECT_EQ(port.rig.device.serial_port()->format().bit_rate, 57600U) << "factory value 2 (Table 65, P00-21)";
    port.rig.set_panel(0, 21, code);
    EXPECT_EQ(port.rig.device.serial_port()->format().bit_rate, 57600U) << "from power-on";
    port.power_cycle();
    const modbus::CharacterFormat& format = port.rig.device.serial_port()->format();
    EXPECT_EQ(format.bit_rate, rates[static_cast<std::size_t>(code)]);
    EXPECT_EQ(format.bits(), 10U);
    EXPECT_TRUE(JmcEc::supports(format));
  }
  EXPECT_FALSE(JmcEc::supports({.bit_rate = 38400, .parity = modbus::Parity::none}));
  EXPECT_FALSE(JmcEc::supports({.bit_rate = 9600, .parity = modbus::Parity::even}));
}

// The procedure of the PC software: upload, modify, download, upload (ch. 6).
TEST(JmcServicePort, UploadsAndDownloads) {
  Port port;
  // A read of P00-01 to P00-05 would find no parameter at 0002h in the screen's list, but P00-02 exists (Table 65).
  EXPECT_EQ(port.master.ask_modbus("01 03 00 01 00 02"), "01 03 04 0B B8 00 39");  // 3000 rpm, 0.57 Nm
  EXPECT_EQ(port.master.ask_modbus("01 03 00 06 00 01"), "01 83 02") << "no P00-06";
  EXPECT_EQ(port.master.ask_modbus("01 03 02 00 00 01"), "01 03 02 01 E0");  // P02-00 48.0
  EXPECT_EQ(port.master.ask_modbus("01 06 01 02 00 00"), "01 06 01 02 00 00");
  EXPECT_EQ(port.master.ask_modbus("01 06 02 00 03 E8"), "01 06 02 00 03 E8");
  EXPECT_EQ(port.rig.panel(2, 0), 1000);
  EXPECT_FLOAT_EQ(port.rig.device.drive().configuration().gains.position_kp, 100.0F);
  EXPECT_EQ(port.master.ask_modbus("01 10 02 32 00 03 06 00 64 FF 9C 00 00"), "01 10 02 32 00 03");  // P02-50 to 52
  EXPECT_EQ(port.rig.panel(2, 51), -100);
  EXPECT_EQ(port.master.ask_modbus("01 03 02 32 00 03"), "01 03 06 00 64 FF 9C 00 00");
  // Stored.
  port.power_cycle();
  EXPECT_EQ(port.master.ask_modbus("01 03 02 00 00 01"), "01 03 02 03 E8");
}

TEST(JmcServicePort, Refusals) {
  Port port;
  EXPECT_EQ(port.master.ask_modbus("01 06 01 03 00 20"), "01 86 03") << "level 32";
  EXPECT_EQ(port.master.ask_modbus("01 06 0D 10 00 00"), "01 86 02") << "items are read only";
  EXPECT_EQ(port.master.ask_modbus("01 03 60 40 00 01"), "01 83 02") << "no objects of the bus";
  EXPECT_EQ(port.master.ask_modbus("01 04 02 00 00 01"), "01 84 01");
  EXPECT_EQ(port.master.ask_modbus("01 17 02 00 00 01 02 00 00 01 02 00 00"), "01 97 01");
  EXPECT_EQ(port.master.ask_modbus("02 03 02 00 00 01"), "") << "another station";
  ASSERT_TRUE(port.rig.enable());
  EXPECT_EQ(port.master.ask_modbus("01 06 00 17 00 05"), "01 86 04") << "P00-23 while the motor works";
}

// P00-23, also from the settings of a line.
TEST(JmcServicePort, Station) {
  products::Settings settings = test::jmc_settings();
  settings.serial.station = 9;
  settings.serial.format = modbus::CharacterFormat{.bit_rate = 9600, .parity = modbus::Parity::none};
  Port port(settings);
  EXPECT_EQ(port.rig.device.serial_port()->station(), 9);
  EXPECT_EQ(port.rig.device.serial_port()->format().bit_rate, 9600U);
  EXPECT_EQ(port.master.ask_modbus("09 03 00 17 00 01"), "09 03 02 00 09");
  EXPECT_EQ(port.master.ask_modbus("09 06 00 17 00 05"), "09 06 00 17 00 05");
  EXPECT_EQ(port.master.ask_modbus("09 03 00 17 00 01"), "09 03 02 00 05") << "still the old station";
  port.power_cycle();
  EXPECT_EQ(port.master.ask_modbus("05 03 00 17 00 01"), "05 03 02 00 05");
}

// P00-26: a delay before the answer.
TEST(JmcServicePort, ResponseDelay) {
  for (const int delay_ms : {0, 40}) {
    Port port;
    port.rig.set_panel(0, 26, delay_ms);
    port.power_cycle();
    products::SerialPort& serial = *port.rig.device.serial_port();
    std::vector<std::uint8_t> request = test::bytes_of("01 03 00 15 00 01 00 00");
    modbus::seal_rtu_frame(request, 6);
    modbus::Time at = port.rig.now();
    for (const std::uint8_t byte : request) serial.receive(byte, true, at += serial.format().character_time());
    EXPECT_EQ(serial.next_deadline() - at, serial.format().half_characters(7) + std::chrono::milliseconds(delay_ms));
  }
}

// Items are two registers, high word first.
TEST(JmcServicePort, Items) {
  Port port;
  ASSERT_TRUE(port.rig.enable());
  port.rig.set(0x6060, 0, 9);
  port.rig.run_ms(120);
  port.rig.set(0x60FF, 0, -10000);
  port.rig.run_ms(600);
  EXPECT_NEAR(static_cast<double>(port.rig.monitor(8)), -150.0, 2.0);
  const std::string speed = port.master.ask_modbus("01 03 0D 10 00 02");  // d08
  EXPECT_EQ(speed.substr(0, 17), "01 03 04 FF FF FF") << speed;
  const std::string voltage = port.master.ask_modbus("01 03 0D 2E 00 02");  // d23: 36 V
  EXPECT_EQ(voltage, "01 03 04 00 00 00 24");
}

}  // namespace
}  // namespace jmc_service_port_test
}  // namespace servodrome
