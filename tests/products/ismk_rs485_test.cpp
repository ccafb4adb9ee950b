// The RS485 port of the iSMK: both protocols frame by frame as in the manual, and the change between them.
#include <gtest/gtest.h>

#include "csv.hpp"
#include "ismk_rig.hpp"
#include "modbus/ismk_examples.hpp"
#include "rs485.hpp"
#include "serial10/ismk_examples.hpp"

namespace servodrome {
namespace ismk_rs485_test {
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

// Section 16.1. The status replies show the drive's state; the tests with motion check them.
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
  port.rig.run_ms(60);  // the previous frame is discarded
  EXPECT_EQ(port.master.ask("01 40 F0 2F 09 00 00 00 00 97"), "01 4B F0 2F 09 00 00 00 00 8C");
}

// Bit 1 is 0: immediately, and the answer still uses the old protocol (ch. 8.1 and 8.2).
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

// 2FE2h and 100Bh: stored, effective after the next restart (ch. 8.1 and 8.2).
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
  EXPECT_EQ(port.master.ask_modbus("01 03 12 34 00 01"), "01 81 02") << "the printed code of function 03 (ch. 8.3.1)";
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

// 6060h, 8 bits, and 6041h, 16 bits: each read as two registers, with sign extension.
TEST(IsmkRs485, EveryObjectReadsAsTwoRegisters) {
  Port port(SerialProtocol::modbus_rtu);
  EXPECT_EQ(port.master.ask_modbus("01 03 35 00 00 01"), "01 03 02 FF FC");
  EXPECT_EQ(port.master.ask_modbus("01 03 35 00 00 02"), "01 03 04 FF FC FF FF");
  EXPECT_EQ(port.master.ask_modbus("01 03 29 90 00 02"), "01 03 04 00 00 00 00");
  // 2FF0.11 at the printed address and at that of the rule (ch. 3.7).
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
  // A request to the universal id is answered with the drive's own id.
  EXPECT_EQ(port.master.ask_serial10(Frame::make(127, Command::read, 0x100B, 0, 0)),
            Frame::make(1, Command::read_2, 0x100B, 0, 1));
  // A wrong checksum.
  EXPECT_EQ(port.master.ask("01 40 F0 2F 09 00 00 00 00 98"), "");
}

// The word of a status reply whose two words are its value and its sign extension. Ignores bit 9, which the manual
// prints as 0 although the bus has control (C7 in the README).
unsigned modbus_word(Port& port) {
  const std::vector<std::uint8_t> reply = bytes_of(port.master.ask(modbus_status));
  if (reply.size() != 9) return 0;
  EXPECT_EQ(modbus::read_u16(&reply[5]), (reply[3] & 0x80) != 0 ? 0xFFFF : 0);
  return modbus::read_u16(&reply[3]) & ~0x200U;
}
unsigned serial10_word(Port& port) {
  const Frame reply = port.master.ask_serial10(Frame::make(1, Command::read, 0x6041, 0, 0));
  EXPECT_EQ(reply.command(), Command::read_2);
  return reply.data() & 0xFDFF;
}
template <typename Word>
bool wait_for_word(Port& port, const Word& word, unsigned wanted) {
  for (int i = 0; i < 1500 && word(port) != wanted; ++i) port.rig.run_ms(8);
  return word(port) == wanted;
}

// The manual's procedure frame by frame (Table 8-1): homing, a move to 50000, one by 50000, running at 150 rpm.
TEST(IsmkRs485, TheModbusProcedureMovesTheShaft) {
  Port port(SerialProtocol::modbus_rtu);
  const auto ask = [&port](const char* request) { EXPECT_NE(port.master.ask(request), "") << request; };
  ask("01 06 35 00 00 06 06 04");                 // mode 6
  ask("01 06 4D 00 00 21 5E BE");                 // method 33
  ask("01 10 50 10 00 02 04 9D 03 00 36 51 1A");  // 200 rpm
  ask("01 10 50 20 00 02 04 F5 C3 00 28 CE 5A");  // 150 rpm
  ask("01 06 31 00 00 0F C7 32");                 // enable
  ask("01 06 31 00 00 1F C6 FE");                 // start
  EXPECT_TRUE(wait_for_word(port, modbus_word, 0xC037)) << std::hex << modbus_word(port);
  port.rig.run_ms(200);
  EXPECT_NEAR(static_cast<double>(port.rig.get(0x6063)), 0.0, 100.0);
  ask("01 06 35 00 00 01 47 C6");                 // mode 1
  ask("01 10 40 00 00 02 04 C3 50 00 00 FE 39");  // 50000
  ask("01 10 4A 00 00 02 04 55 55 00 08 BC D6");  // 30 rpm
  ask("01 06 31 00 00 2F C6 EA");
  ask("01 06 31 00 00 3F C7 26");
  EXPECT_TRUE(wait_for_word(port, modbus_word, 0xD437)) << std::hex << modbus_word(port);
  EXPECT_NEAR(static_cast<double>(port.rig.get(0x6063)), 50000.0, 400.0);
  ask("01 06 31 00 00 4F C6 C2");
  ask("01 06 31 00 00 5F C7 0E");
  EXPECT_TRUE(wait_for_word(port, modbus_word, 0xD437)) << std::hex << modbus_word(port);
  EXPECT_NEAR(static_cast<double>(port.rig.get(0x6063)), 100000.0, 400.0);
  ask("01 06 31 00 00 06 07 34");
  ask("01 06 35 00 00 03 C6 07");                 // mode 3
  ask("01 10 6F 00 00 02 04 F5 C3 00 28 D9 B3");  // 150 rpm
  ask("01 06 31 00 00 0F C7 32");
  port.rig.run_ms(500);
  EXPECT_NEAR(port.rig.plant.velocity_rpm(), 150.0, 2.0);
}

// The same with the 10-byte protocol (Table 8-3). C031h after 06h, C437h once bit 4 is 0.
TEST(IsmkRs485, TheTenByteProcedureMovesTheShaft) {
  Port port;
  const auto ask = [&port](const char* request) { EXPECT_NE(port.master.ask(request), "") << request; };
  ask("01 2B 40 60 00 0F 00 00 00 25");
  ask("01 2F 60 60 00 06 00 00 00 0A");
  ask("01 2F 98 60 00 21 00 00 00 B7");
  ask("01 23 99 60 01 03 9D 36 00 0C");
  ask("01 23 99 60 02 82 4E 1B 00 F6");
  ask("01 2B 40 60 00 1F 00 00 00 15");
  EXPECT_TRUE(wait_for_word(port, serial10_word, 0xC037)) << std::hex << serial10_word(port);
  port.rig.run_ms(200);
  ask("01 2B 40 60 00 06 00 00 00 2E");
  EXPECT_TRUE(wait_for_word(port, serial10_word, 0xC031)) << std::hex << serial10_word(port);
  ask("01 2F 60 60 00 01 00 00 00 0F");
  ask("01 23 7A 60 00 50 C3 00 00 EF");
  ask("01 23 81 60 00 03 9D 36 00 25");
  ask("01 23 83 60 00 6E A3 01 00 E7");
  ask("01 23 84 60 00 6E A3 01 00 E6");
  ask("01 2B 40 60 00 2F 00 00 00 05");
  ask("01 2B 40 60 00 3F 00 00 00 F5");
  EXPECT_TRUE(wait_for_word(port, serial10_word, 0xD437)) << std::hex << serial10_word(port);
  EXPECT_NEAR(static_cast<double>(port.rig.get(0x6063)), 50000.0, 400.0);
  ask("01 2B 40 60 00 2F 00 00 00 05");
  EXPECT_TRUE(wait_for_word(port, serial10_word, 0xC437)) << std::hex << serial10_word(port);
  ask("01 2F 60 60 00 03 00 00 00 0D");
  ask("01 23 FF 60 00 7E B1 E4 FF 6B");
  port.rig.run_ms(500);
  EXPECT_NEAR(port.rig.plant.velocity_rpm(), -100.0, 2.0);
}

// The addresses by rule, compared with the manual's list (tests/data/ismk_params.csv): no register is missing or at
// another address, and its value is that of its object.
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
}  // namespace ismk_rs485_test
}  // namespace servodrome
