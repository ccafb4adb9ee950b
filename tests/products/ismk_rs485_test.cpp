// The RS485 port of the iSMK: both protocols frame by frame as the manual prints them, and the switch between them.
#include <gtest/gtest.h>

#include "csv.hpp"
#include "ismk_rig.hpp"
#include "modbus/ismk_examples.hpp"
#include "rs485.hpp"
#include "serial10/ismk_examples.hpp"

namespace servodrome {
namespace {

using dictionary::AbortCode;
using products::Ismk;
using products::SerialProtocol;
using serial10::Command;
using serial10::Frame;
using test::bytes_of;
using test::hex_of;
using test::IsmkRig;
using test::Rs485Master;

struct Port {
  explicit Port(std::optional<SerialProtocol> protocol = std::nullopt) : Port(protocol, test::ismk_settings()) {}
  Port(std::optional<SerialProtocol> protocol, products::Settings settings)
      : rig(test::ismk_plant(), with_protocol(settings, protocol)) {
    rig.run_ms(50);
  }
  static products::Settings with_protocol(products::Settings settings, std::optional<SerialProtocol> protocol) {
    settings.serial.protocol = protocol;
    return settings;
  }
  void power_cycle() {
    rig.device.power_off();
    rig.device.power_on(rig.feedback, rig.now());
    rig.run_ms(50);
  }

  IsmkRig rig;
  Rs485Master<IsmkRig> master{rig};
};

constexpr const char* modbus_status = "01 03 32 00 00 02 CA B3";

// Section 16.1. The status replies show the drive's state and are looked at where it moves.
TEST(IsmkRs485, ModbusExamplesByteByByte) {
  for (const modbus::test::IsmkExample& example : modbus::test::ismk_examples) {
    Port port(SerialProtocol::modbus_rtu);
    const std::string expected = example.response != nullptr ? example.response : example.request;
    const std::string answer = port.master.ask(example.request);
    if (example.index == 0x6041) {
      const std::uint16_t word = port.rig.status();
      std::vector<std::uint8_t> reply{1, 3, 4, static_cast<std::uint8_t>(word >> 8), static_cast<std::uint8_t>(word)};
      reply.resize(9, word >= 0x8000 ? 0xFF : 0);
      modbus::seal_rtu_frame(reply, 7);
      EXPECT_EQ(answer, hex_of(reply)) << example.what;
    } else {
      EXPECT_EQ(answer, expected) << example.what;
      if (example.index != 0x2FF0) {
        EXPECT_EQ(port.rig.get(example.index, example.sub), example.value) << example.what;
      }
    }
  }
}

// Section 16.2.
TEST(IsmkRs485, Serial10ExamplesByteByByte) {
  for (const serial10::IsmkExample& example : serial10::ismk_examples) {
    Port port;
    Frame request;
    std::ranges::copy(bytes_of(example.request), request.bytes.begin());
    if (request.index() == 0x2FF0) {
      ASSERT_EQ(port.rig.set(0x2FF0, 9, 600), AbortCode::none);
    }
    const std::string answer = port.master.ask(example.request);
    if (request.index() == 0x6041) {
      const auto word = static_cast<std::int16_t>(port.rig.status());
      const Frame reply = Frame::make(1, Command::read_2, 0x6041, 0, static_cast<std::uint32_t>(word));
      EXPECT_EQ(answer, hex_of(reply.bytes)) << example.what;
    } else {
      EXPECT_EQ(answer, example.answer) << example.what;
      EXPECT_EQ(port.rig.get(request.index(), request.sub()), example.value) << example.what;
    }
  }
}

TEST(IsmkRs485, TheFrameWithTheWrongCrcIsIgnored) {
  Port port(SerialProtocol::modbus_rtu);
  const std::int64_t before = port.rig.get(0x6099, 1);
  EXPECT_EQ(port.master.ask(modbus::test::ismk_wrong_crc), "");
  EXPECT_EQ(port.rig.get(0x6099, 1), before);
  EXPECT_EQ(port.master.ask("01 10 50 10 00 02 04 9D 03 00 36 51 1A"), "01 10 50 10 00 02 51 0D");
  EXPECT_EQ(port.rig.get(0x6099, 1), 0x369D03);
}

TEST(IsmkRs485, TheFactorySettingIsTheTenByteProtocol) {
  Port port;
  EXPECT_EQ(port.rig.get(0x6510, 0x0C), 1);
  EXPECT_EQ(port.rig.device.serial_port()->format().bit_rate, 115200U);
  EXPECT_EQ(port.rig.device.serial_port()->format().bits(), 10U);
  EXPECT_EQ(port.master.ask(modbus_status), "") << "no Modbus until 6510.0C says so";
  EXPECT_EQ(port.rig.device.serial_port()->modbus(), nullptr);
  port.rig.run_ms(60);  // the frame before is forgotten
  EXPECT_EQ(port.master.ask("01 40 F0 2F 09 00 00 00 00 97"), "01 4B F0 2F 09 00 00 00 00 8C");
}

// Bit 1 clear: at once, and the answer still goes out in the old protocol (L2277, L2286).
TEST(IsmkRs485, TheProtocolChangesAtOnce) {
  Port port;
  EXPECT_EQ(port.master.ask_serial10(Frame::make(1, Command::write_1, 0x6510, 0x0C, 0)),
            Frame::make(1, Command::written, 0x6510, 0x0C, 0));
  EXPECT_EQ(port.master.ask_modbus("01 03 86 C0 00 01"), "01 03 02 00 00");
  EXPECT_NE(port.rig.device.serial_port()->modbus(), nullptr);
  EXPECT_EQ(port.master.ask("01 06 86 C0 00 01 61 7E"), "01 06 86 C0 00 01 61 7E");
  EXPECT_EQ(port.master.ask_serial10(Frame::make(1, Command::read, 0x6510, 0x0C, 0)),
            Frame::make(1, Command::read_1, 0x6510, 0x0C, 1));
}

// Bit 1 set: after storing and restarting.
TEST(IsmkRs485, TheProtocolChangesAfterARestart) {
  std::array<std::byte, 32 * 1024> memory{};
  dictionary::RamMedium medium(memory);
  products::Settings settings = test::ismk_settings();
  settings.store = &medium;
  Port port(SerialProtocol::modbus_rtu, settings);
  EXPECT_EQ(port.master.ask("01 06 86 C0 00 03 E0 BF"), "01 06 86 C0 00 03 E0 BF");
  EXPECT_EQ(port.master.ask_modbus("01 03 86 C0 00 01"), "01 03 02 00 03") << "still Modbus";
  port.power_cycle();
  EXPECT_EQ(port.master.ask_modbus("01 03 86 C0 00 01"), "01 03 02 00 00") << "not stored";
  ASSERT_EQ(port.rig.set(0x6510, 0x0C, 3), AbortCode::none);
  ASSERT_EQ(dictionary::Store(medium).save(port.rig.device.dictionary(), dictionary::Area::all), AbortCode::none);
  port.power_cycle();
  EXPECT_EQ(port.master.ask_serial10(Frame::make(1, Command::read, 0x6510, 0x0C, 0)),
            Frame::make(1, Command::read_1, 0x6510, 0x0C, 3));
}

// 2FE2h and 100Bh: saved, from the next restart on (L2275, L2285).
TEST(IsmkRs485, BitRateAndStationAfterARestart) {
  std::array<std::byte, 32 * 1024> memory{};
  dictionary::RamMedium medium(memory);
  products::Settings settings = test::ismk_settings();
  settings.store = &medium;
  Port port(std::nullopt, settings);
  const auto& format = port.rig.device.serial_port()->format();
  constexpr std::pair<int, std::uint32_t> rates[] = {{1080, 9600}, {540, 19200}, {270, 38400}, {90, 115200}};
  for (const auto& [code, bit_rate] : rates) {
    const std::uint32_t before = format.bit_rate;
    ASSERT_EQ(port.rig.set(0x2FE2, 0, code), AbortCode::none);
    ASSERT_EQ(port.rig.set(0x100B, 0, 2), AbortCode::none);
    EXPECT_EQ(format.bit_rate, before);
    ASSERT_EQ(dictionary::Store(medium).save(port.rig.device.dictionary(), dictionary::Area::all), AbortCode::none);
    port.power_cycle();
    EXPECT_EQ(format.bit_rate, bit_rate);
    EXPECT_EQ(port.rig.device.serial_port()->station(), 2);
    EXPECT_EQ(port.rig.device.node_id(), 2) << "one number for all buses";
  }
  for (int code = 90; code <= 1080; ++code) {
    const bool there =
        std::any_of(std::begin(rates), std::end(rates), [code](const auto& row) { return row.first == code; });
    EXPECT_EQ(port.rig.set(0x2FE2, 0, code), there ? AbortCode::none : AbortCode::value_invalid) << code;
  }
}

TEST(IsmkRs485, ModbusErrors) {
  Port port(SerialProtocol::modbus_rtu);
  EXPECT_EQ(port.master.ask_modbus("01 03 12 34 00 01"), "01 81 02") << "the printed code of function 03 (L2317)";
  EXPECT_EQ(port.master.ask_modbus("01 06 12 34 00 01"), "01 86 02");
  EXPECT_EQ(port.master.ask_modbus("01 10 12 34 00 01 02 00 01"), "01 90 02");
  EXPECT_EQ(port.master.ask_modbus("01 06 35 00 00 08"), "01 86 03") << "no mode 8";
  EXPECT_EQ(port.master.ask_modbus("01 06 32 00 00 01"), "01 86 02") << "the statusword is read only";
  EXPECT_EQ(port.master.ask_modbus("01 06 40 00 00 01"), "01 86 03") << "half of the target position";
  EXPECT_EQ(port.master.ask_modbus("01 04 32 00 00 01"), "01 84 01");
  EXPECT_EQ(port.master.ask_modbus("01 2B 0E 01 00"), "01 AB 01");
  EXPECT_EQ(port.master.ask_modbus("02 03 32 00 00 01"), "") << "another station";
  EXPECT_EQ(port.master.ask_modbus("00 06 35 00 00 03"), "") << "a broadcast";
  EXPECT_EQ(port.rig.get(0x6060), 3);
}

// 6060h, 8 bits, and 6041h, 16 bits: read as two registers each, lengthened by their top bit.
TEST(IsmkRs485, EveryObjectReadsAsTwoRegisters) {
  Port port(SerialProtocol::modbus_rtu);
  EXPECT_EQ(port.master.ask_modbus("01 03 35 00 00 01"), "01 03 02 FF FC");
  EXPECT_EQ(port.master.ask_modbus("01 03 35 00 00 02"), "01 03 04 FF FC FF FF");
  EXPECT_EQ(port.master.ask_modbus("01 03 29 90 00 02"), "01 03 04 00 00 00 00");
  // 2FF0.11 at the printed address and at that of the rule (L791).
  EXPECT_EQ(port.master.ask_modbus("01 03 2A 01 00 01"), port.master.ask_modbus("01 03 2A 10 00 01"));
  EXPECT_EQ(port.master.ask_modbus("01 03 2A 01 00 01").substr(0, 8), "01 03 02");
}

TEST(IsmkRs485, Serial10Errors) {
  Port port;
  const auto refused = [](std::uint16_t index, std::uint8_t sub, AbortCode abort) {
    return Frame::make(1, Command::error, index, sub, static_cast<std::uint32_t>(abort));
  };
  EXPECT_EQ(port.master.ask_serial10(Frame::make(1, Command::read, 0x5555, 0, 0)),
            refused(0x5555, 0, AbortCode::object_does_not_exist));
  EXPECT_EQ(port.master.ask_serial10(Frame::make(1, Command::write_2, 0x6041, 0, 0)),
            refused(0x6041, 0, AbortCode::read_only));
  EXPECT_EQ(port.master.ask_serial10(Frame::make(1, Command::write_1, 0x6060, 0, 8)),
            refused(0x6060, 0, AbortCode::value_too_high));
  EXPECT_EQ(port.master.ask_serial10(Frame::make(2, Command::read, 0x6041, 0, 0)), Frame{}) << "another drive";
  // The universal id is answered with the drive's own.
  EXPECT_EQ(port.master.ask_serial10(Frame::make(127, Command::read, 0x100B, 0, 0)),
            Frame::make(1, Command::read_2, 0x100B, 0, 1));
  // A wrong checksum.
  EXPECT_EQ(port.master.ask("01 40 F0 2F 09 00 00 00 00 98"), "");
}

// The rule of the addresses against the manual's list (tests/data/ismk_params.csv): no register is missing, none is
// elsewhere, and a value in it is that of its object.
TEST(IsmkRs485, RegistersAreThoseOfTheManual) {
  unsigned checked = 0;
  for (const test::CsvRow& row : test::read_csv("ismk_params.csv")) {
    if (row.at("od_index").empty()) continue;
    const auto index = static_cast<std::uint16_t>(std::stoul(row.at("od_index"), nullptr, 16));
    const auto sub = static_cast<std::uint8_t>(std::stoul(row.at("od_sub"), nullptr, 16));
    const auto find = [&](std::uint16_t address) {
      return std::any_of(Ismk::registers.begin(), Ismk::registers.end(), [&](const modbus::Register& found) {
        return found.address == address && found.index == index && found.sub == sub;
      });
    };
    const std::string& address = row.at("modbus");
    if (address.empty()) {
      EXPECT_TRUE(std::none_of(Ismk::registers.begin(), Ismk::registers.end(),
                               [&](const modbus::Register& found) { return found.index == index && found.sub == sub; }))
          << row.at("name") << " has no address";
    } else {
      EXPECT_TRUE(find(static_cast<std::uint16_t>(std::stoul(address, nullptr, 16))))
          << row.at("name") << " " << address;
    }
    ++checked;
  }
  EXPECT_EQ(checked, 124U);
}

}  // namespace
}  // namespace servodrome
