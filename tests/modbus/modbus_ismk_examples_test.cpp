// Every Modbus frame of the iSMK manual (ch. 8.3), byte by byte.
#include "modbus/ismk_examples.hpp"
#include "modbus/ismk_modbus.hpp"

namespace servodrome::modbus::test {
namespace modbus_ismk_examples_test {
namespace {

TEST(IsmkModbusExamples, ByteByByte) {
  for (const IsmkExample& example : ismk_examples) {
    Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
    station.device.objects.statusword = example.index == 0x6041 ? static_cast<std::uint16_t>(example.value) : 0;
    EXPECT_EQ(station.ask(example.request), example.response == nullptr ? example.request : example.response)
        << example.what;
    EXPECT_EQ(station.device.dictionary.number(example.index, example.sub), example.value) << example.what;
  }
}

// The one frame of the manual with a wrong CRC (Table 8-1, register 5020), and every frame with each single bit
// inverted.
TEST(IsmkModbusExamples, WrongCrcIsNotAnswered) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  EXPECT_EQ(station.ask(ismk_wrong_crc), "");
  EXPECT_EQ(station.device.objects.homing_speed_switch, 0U);
  for (const IsmkExample& example : ismk_examples) {
    const std::vector<std::uint8_t> request = bytes_of(example.request);
    for (std::size_t bit = 0; bit < 8 * request.size(); ++bit) {
      std::vector<std::uint8_t> damaged = request;
      damaged[bit / 8] = static_cast<std::uint8_t>(damaged[bit / 8] ^ 1U << bit % 8);
      station.send(damaged);
      EXPECT_EQ(station.answer(), "") << example.what << ", bit " << bit;
    }
  }
  EXPECT_EQ(station.device.objects.controlword, 6);
  EXPECT_EQ(station.ask(ismk_examples[0].request), ismk_examples[0].request);
}

// Error answers have the printed function codes: 81h for reading (not 83h), 86h, 90h (ch. 8.3.1).
TEST(IsmkModbusExamples, PrintedErrorCodes) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  EXPECT_EQ(station.ask_sealed("01 03 32 02 00 01"), "01 81 02");  // no object there
  EXPECT_EQ(station.ask_sealed("01 03 00 00 00 01"), "01 81 02");  // before the first object
  EXPECT_EQ(station.ask_sealed("01 06 32 00 00 01"), "01 86 02");  // read only
  EXPECT_EQ(station.ask_sealed("01 06 35 00 00 08"), "01 86 03");  // out of range
  EXPECT_EQ(station.ask_sealed("01 06 34 02 00 00"), "01 86 02");  // no such address
  EXPECT_EQ(station.ask_sealed("01 10 32 00 00 01 02 00 00"), "01 90 02");
  EXPECT_EQ(station.ask_sealed("01 10 6F 00 00 01 02 00 00"), "01 90 03");  // half of an object
  // Functions that it does not support.
  for (const char* function : {"01", "02", "04", "05", "08", "0F", "16", "17", "2B", "7F"}) {
    const std::string error =
        hex_of(std::vector<std::uint8_t>{static_cast<std::uint8_t>(bytes_of(function)[0] | 0x80)});
    EXPECT_EQ(station.ask_sealed("01 " + std::string(function) + " 31 00 00 01"), "01 " + error + " 01");
  }
}

// An object of 16 or 8 bits read as two registers: the second register is the sign extension.
TEST(IsmkModbusExamples, SmallObjectsAnswerToTwoRegisters) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  station.device.objects.mode = -3;
  EXPECT_EQ(station.ask_sealed("01 03 35 00 00 02"), "01 03 04 FF FD FF FF");
  EXPECT_EQ(station.ask_sealed("01 03 35 00 00 01"), "01 03 02 FF FD");
  EXPECT_EQ(station.ask_sealed("01 03 35 00 00 03"), "01 81 02");
  station.device.objects.statusword = 0x0231;
  EXPECT_EQ(station.ask_sealed("01 03 32 00 00 02"), "01 03 04 02 31 00 00");
  EXPECT_EQ(station.ask_sealed("01 03 32 01 00 01"), "01 03 02 00 00");
  // The same for writes: the second register must be the sign extension.
  EXPECT_EQ(station.ask_sealed("01 10 31 00 00 02 04 00 0F 00 00"), "01 10 31 00 00 02");
  EXPECT_EQ(station.device.objects.controlword, 0x0F);
  EXPECT_EQ(station.ask_sealed("01 10 31 00 00 02 04 90 0F FF FF"), "01 10 31 00 00 02");
  EXPECT_EQ(station.device.objects.controlword, 0x900F);
  EXPECT_EQ(station.ask_sealed("01 10 31 00 00 02 04 90 0F 00 00"), "01 10 31 00 00 02");
  EXPECT_EQ(station.ask_sealed("01 10 31 00 00 02 04 00 0F 00 01"), "01 90 03");
  EXPECT_EQ(station.ask_sealed("01 10 31 00 00 02 04 00 0F FF FF"), "01 90 03");
  EXPECT_EQ(station.ask_sealed("01 10 31 00 00 02 04 90 0F FF 00"), "01 90 03");
  EXPECT_EQ(station.ask_sealed("01 06 31 01 00 0F"), "01 86 03") << "the second register alone";
  EXPECT_EQ(station.device.objects.controlword, 0x900F);
  // Mode -3 as one register, sign-extended or as a single byte; 01FDh is neither of the two.
  EXPECT_EQ(station.ask_sealed("01 06 35 00 FF FD"), "01 06 35 00 FF FD");
  EXPECT_EQ(station.device.objects.mode, -3);
  EXPECT_EQ(station.ask_sealed("01 06 35 00 00 FC"), "01 06 35 00 00 FC");
  EXPECT_EQ(station.device.objects.mode, -4);
  EXPECT_EQ(station.ask_sealed("01 06 35 00 01 FD"), "01 86 03");
}

TEST(IsmkModbusExamples, LowWordFirst) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  station.device.objects.position = -2;
  EXPECT_EQ(station.ask_sealed("01 03 37 00 00 02"), "01 03 04 FF FE FF FF");
  station.device.objects.position = 0x12345678;
  EXPECT_EQ(station.ask_sealed("01 03 37 00 00 02"), "01 03 04 56 78 12 34");
  EXPECT_EQ(station.ask_sealed("01 03 37 01 00 01"), "01 03 02 12 34");
}

TEST(IsmkModbusExamples, TheSecondRegisterIsTheSecondInEitherWordOrder) {
  Profile high_first = ismk_profile;
  high_first.word_order = WordOrder::high_word_first;
  high_first.extension = Extension::by_type;
  Station<servodrome::test::IsmkDevice> station(high_first, ismk_map);
  station.device.objects.statusword = 0xC037;
  EXPECT_EQ(station.ask_sealed("01 03 32 00 00 02"), "01 03 04 C0 37 00 00");
  EXPECT_EQ(station.ask_sealed("01 10 31 00 00 02 04 90 0F 00 01"), "01 90 03");
  EXPECT_EQ(station.ask_sealed("01 10 31 00 00 02 04 90 0F 00 00"), "01 10 31 00 00 02");
}

// 2FF0.11 has its printed address and the one that the rule gives (ch. 3.7 prints 2A01h).
TEST(IsmkModbusExamples, DriveUtilizationHasTwoAddresses) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  station.device.objects.motor_utilization = 40;
  station.device.objects.drive_utilization = 50;
  EXPECT_EQ(station.ask_sealed("01 03 2A 00 00 02"), "01 03 04 00 28 00 32");
  EXPECT_EQ(station.ask_sealed("01 03 2A 10 00 01"), "01 03 02 00 32");
}

TEST(IsmkModbusExamples, BroadcastWritesSilently) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  EXPECT_EQ(station.ask_sealed("00 06 31 00 00 0F"), "");
  EXPECT_EQ(station.device.objects.controlword, 0x0F);
  EXPECT_EQ(station.ask_sealed("00 10 40 00 00 02 04 C3 50 00 00"), "");
  EXPECT_EQ(station.device.objects.target_position, 50000);
  EXPECT_EQ(station.ask_sealed("00 03 31 00 00 01"), "");
  Profile deaf = ismk_profile;
  deaf.broadcast = false;
  Station<servodrome::test::IsmkDevice> other(deaf, ismk_map);
  EXPECT_EQ(other.ask_sealed("00 06 31 00 00 0F"), "");
  EXPECT_EQ(other.device.objects.controlword, 6);
}

}  // namespace
}  // namespace modbus_ismk_examples_test
}  // namespace servodrome::modbus::test
