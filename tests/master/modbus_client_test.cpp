// The Modbus master against this project's servers (their bytes are tested elsewhere), and against invalid answers.
#include <filesystem>
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "master/modbus/client.hpp"
#include "master/serial_master_line.hpp"

namespace servodrome::master::test {
namespace modbus_client_test {
namespace {

using modbus::Exception;
using servodrome::test::bytes_of;
using testing::ElementsAre;
using testing::HasSubstr;
using Kind = ModbusError::Kind;

const ModbusOptions ismk_options{.format = SerialMasterLine::format, .word_order = modbus::WordOrder::low_word_first};

template <typename Action>
void expect_error(Kind kind, Exception exception, const char* words, const Action& action) {
  try {
    action();
    FAIL() << "no error";
  } catch (const ModbusError& error) {
    EXPECT_EQ(error.kind(), kind) << error.what();
    EXPECT_EQ(error.exception(), exception) << error.what();
    EXPECT_THAT(error.what(), HasSubstr(words));
  }
}

struct RtuClient : testing::Test {
  SerialMasterLine line;
  links::test::SerialRig::Drive& drive = line.add_rtu(3);
  servodrome::test::IsmkObjects& objects = drive.device.objects;
  ModbusClient master{line.client(), ModbusClient::Framing::rtu, "mem:", ismk_options};
};

TEST_F(RtuClient, ReadsAndWritesNumbers) {
  master.write<std::int32_t>(3, 0x4000, -50000);
  EXPECT_EQ(objects.target_position, -50000);
  master.write<std::int8_t>(3, 0x3500, -3);
  EXPECT_EQ(objects.mode, -3);
  EXPECT_EQ(master.read<std::int8_t>(3, 0x3500), -3);
  master.write<std::uint16_t>(3, 0x3100, 0x900F);
  EXPECT_EQ(master.read<std::uint16_t>(3, 0x3100), 0x900F);
  objects.position = -2;
  EXPECT_EQ(master.read<std::int32_t>(3, 0x3700), -2);
  objects.position = 0x12345678;
  EXPECT_EQ(master.read<std::uint32_t>(3, 0x3700), 0x12345678U);
  EXPECT_THAT(master.read_holding_registers(3, 0x3700, 2), ElementsAre(0x5678, 0x1234));
}

TEST_F(RtuClient, ErrorsSayWhatAndWhy) {
  expect_error(Kind::refused, Exception::illegal_data_address, "mem:, unit 3: function 03h was refused: exception 02h",
               [&] { master.read_holding_registers(3, 0, 1); });
  expect_error(Kind::refused, Exception::illegal_data_value, "illegal data value",
               [&] { master.write_single_register(3, 0x3500, 100); });
  expect_error(Kind::refused, Exception::illegal_function, "illegal function",
               [&] { master.read_input_registers(3, 0x3100, 1); });
  const auto before = line.line.now();
  expect_error(Kind::no_answer, Exception::none, "check address", [&] { master.read<std::uint16_t>(4, 0x3100); });
  EXPECT_GE(line.line.now() - before, 2 * ismk_options.timeout) << "asked twice";
  EXPECT_LT(line.line.now() - before, 2 * ismk_options.timeout + 100ms);
  EXPECT_EQ(master.read<std::uint16_t>(3, 0x3100), 6) << "and goes on";
  EXPECT_THROW(master.read_holding_registers(3, 0, 126), MasterError);
  EXPECT_THROW(master.write_multiple_registers(3, 0, std::vector<std::uint16_t>(124)), MasterError);
  EXPECT_THROW(master.write_multiple_registers(3, 0, {}), MasterError);
}

TEST_F(RtuClient, BroadcastsReachAllAndWaitForNone) {
  auto& other = line.add_rtu(4);
  master.write_single_register(0, 0x3100, 0x0F);
  EXPECT_EQ(objects.controlword, 0x0F);
  EXPECT_EQ(other.device.objects.controlword, 0x0F);
}

TEST(ModbusRtuClient, FunctionsOfTheStandard) {
  static constexpr auto identification =
      std::to_array<modbus::Identification>({{0, "Servodrome"}, {1, "REF402"}, {2, "1.0"}, {0x80, "more"}});
  static constexpr modbus::Profile standard{.identification = identification};
  SerialMasterLine line;
  auto& drive = line.add_rtu(1, standard);
  ModbusClient master(line.client(), ModbusClient::Framing::rtu, "mem:", {.format = SerialMasterLine::format});
  drive.device.objects.position = 0x12345678;
  EXPECT_THAT(master.read_input_registers(1, 0x3700, 2), ElementsAre(0x1234, 0x5678));
  EXPECT_EQ(master.read<std::int32_t>(1, 0x3700), 0x12345678);
  EXPECT_THAT(master.read_write_multiple_registers(1, 0x3100, 1, 0x3100, std::array<std::uint16_t, 1>{0x1F}),
              ElementsAre(0x1F));
  const auto objects = master.read_device_identification(1);
  EXPECT_EQ(objects,
            (std::map<std::uint8_t, std::string>{{0, "Servodrome"}, {1, "REF402"}, {2, "1.0"}, {0x80, "more"}}));
}

ModbusClient scripted(const std::vector<std::string>& answers, ModbusClient::Framing framing) {
  std::vector<ScriptedClient::Bytes> bytes;
  for (const std::string& answer : answers) bytes.push_back(bytes_of(answer));
  return {std::make_unique<ScriptedClient>(bytes), framing, "script", ismk_options};
}

TEST(ModbusRtuClient, AnswersThatDoNotFit) {
  const auto rtu = ModbusClient::Framing::rtu;
  const std::string good = "01 03 02 00 0F F8 40";
  EXPECT_EQ(scripted({good}, rtu).read<std::uint16_t>(1, 0x3100), 15);
  EXPECT_EQ(scripted({"01 03 02 00 0F F8 41", good}, rtu).read<std::uint16_t>(1, 0x3100), 15) << "disturbed, again";
  EXPECT_EQ(scripted({"01 03", good}, rtu).read<std::uint16_t>(1, 0x3100), 15) << "cut off, again";
  EXPECT_EQ(scripted({"", good}, rtu).read<std::uint16_t>(1, 0x3100), 15) << "lost, again";
  expect_error(Kind::no_answer, Exception::none, "no answer", [&] {
    scripted({"", ""}, rtu).read<std::uint16_t>(1, 0);
  });
  expect_error(Kind::no_answer, Exception::none, "no answer",  // a write is not repeated
               [&] {
                 scripted({"", "01 06 31 00 00 0F C7 32"}, rtu).write<std::uint16_t>(1, 0x3100, 15);
               });
  expect_error(Kind::malformed, Exception::none, "unit 1 answered",
               [&] { scripted({good}, rtu).read<std::uint16_t>(2, 0); });
  expect_error(Kind::malformed, Exception::none, "other registers",
               [&] { scripted({"01 06 31 00 00 0F C7 32"}, rtu).write<std::uint16_t>(1, 0x3100, 14); });
  expect_error(Kind::malformed, Exception::none, "instead of 2 registers",
               [&] { scripted({good}, rtu).read<std::uint32_t>(1, 0x3100); });
}

TEST(ModbusTcpClient, AnswersThatDoNotFit) {
  const auto tcp = ModbusClient::Framing::tcp;
  EXPECT_EQ(scripted({"00 01 00 00 00 05 01 03 02 00 0F"}, tcp).read<std::uint16_t>(1, 0x3100), 15);
  EXPECT_EQ(scripted({"00 00 00 00 00 05 01 03 02 00 FF 00 01 00 00 00 05 01 03 02 00 0F"}, tcp)
                .read<std::uint16_t>(1, 0x3100),
            15)
      << "behind the late answer to an earlier request";
  expect_error(Kind::malformed, Exception::none, "not Modbus TCP",
               [&] { scripted({"00 01 00 01 00 05 01 03 02 00 0F"}, tcp).read<std::uint16_t>(1, 0); });
  expect_error(Kind::malformed, Exception::none, "unit 2 answered",
               [&] { scripted({"00 01 00 00 00 05 02 03 02 00 0F"}, tcp).read<std::uint16_t>(1, 0); });
  expect_error(Kind::refused, Exception::gateway_target_failed_to_respond,
               "choose a station behind the gateway with --node",
               [&] { scripted({"00 01 00 00 00 03 01 83 0B"}, tcp).read<std::uint16_t>(1, 0); });
  expect_error(Kind::malformed, Exception::none, "answered with 04h",
               [&] { scripted({"00 01 00 00 00 05 01 04 02 00 0F"}, tcp).read<std::uint16_t>(1, 0); });
}

// Through the operating system's ptys and sockets.
TEST(ModbusClientLinks, PtyAndTcp) {
  const std::string path = fmt::format("{}servodrome_modbus_{}", testing::TempDir(), ::getpid());
  links::test::SerialRig rig;
  auto& objects = rig.add_rtu(1).device.objects;
  const auto pty = rig.open("pty:" + path);
  const auto tcp = rig.open("tcp:127.0.0.1:0");
  const links::test::SerialRigThread thread(rig);
  ModbusClient over_pty = ModbusClient::open("pty:" + path, ismk_options);
  ModbusClient over_tcp = ModbusClient::open(tcp->name(), ismk_options);
  for (int i = 0; i < 20; ++i) {
    over_pty.write<std::int32_t>(1, 0x4000, i * 100'000);
    EXPECT_EQ(over_tcp.read<std::int32_t>(1, 0x4000), i * 100'000);
    over_tcp.write<std::int32_t>(1, 0x4000, -i);
    EXPECT_EQ(over_pty.read<std::int32_t>(1, 0x4000), -i);
  }
  EXPECT_EQ(objects.target_position, -19);
  expect_error(Kind::refused, Exception::gateway_target_failed_to_respond, "0Bh",
               [&] { over_tcp.read<std::uint16_t>(9, 0x3100); });
}

TEST(ModbusClientLinks, WhatCannotBeOpened) {
  EXPECT_THROW(ModbusClient::open("tcp:127.0.0.1:1"), MasterError);
  EXPECT_THROW(ModbusClient::open("pty:/nonexistent"), MasterError);
  EXPECT_THROW(ModbusClient::open("mem:"), MasterError);
  EXPECT_THROW(ModbusClient::open("nonsense"), MasterError);
}

}  // namespace
}  // namespace modbus_client_test
}  // namespace servodrome::master::test
