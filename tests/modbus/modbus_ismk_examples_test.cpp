// Every Modbus frame of the iSMK manual (L2277-2429; section 16.1 of its digest), byte by byte.
#include "modbus/ismk_modbus.hpp"

namespace servodrome::modbus::test {
namespace {

struct Example {
  const char* what;
  const char* request;
  const char* response;  // nullptr: the request comes back
  std::uint16_t index;
  std::uint8_t sub;
  std::int64_t value;  // afterwards; before, where it is read
};

constexpr Example examples[] = {
    {"RS232 protocol at once", "01 06 86 C0 00 01 61 7E", nullptr, 0x6510, 0x0C, 1},
    {"RS232 protocol after saving", "01 06 86 C0 00 03 E0 BF", nullptr, 0x6510, 0x0C, 3},
    {"store control parameters", "01 06 29 10 00 01 41 93", nullptr, 0x2FF0, 1, 1},
    {"target speed 30 rpm", "01 10 6F 00 00 02 04 55 55 00 08 1A 47", "01 10 6F 00 00 02 5C DC", 0x60FF, 0, 0x85555},
    {"mode 3", "01 06 35 00 00 03 C6 07", nullptr, 0x6060, 0, 3},
    {"150 rpm", "01 10 6F 00 00 02 04 F5 C3 00 28 D9 B3", "01 10 6F 00 00 02 5C DC", 0x60FF, 0, 0x28F5C3},
    {"enable", "01 06 31 00 00 0F C7 32", nullptr, 0x6040, 0, 0x0F},
    {"status, homing found", "01 03 32 00 00 02 CA B3", "01 03 04 C0 37 FF FF 76 4D", 0x6041, 0, 0xC037},
    {"mode 6", "01 06 35 00 00 06 06 04", nullptr, 0x6060, 0, 6},
    {"homing method 33", "01 06 4D 00 00 21 5E BE", nullptr, 0x6098, 0, 33},
    {"homing speed 200 rpm", "01 10 50 10 00 02 04 9D 03 00 36 51 1A", "01 10 50 10 00 02 51 0D", 0x6099, 1, 0x369D03},
    {"zero speed 150 rpm", "01 10 50 20 00 02 04 F5 C3 00 28 CE 5A", "01 10 50 20 00 02 51 02", 0x6099, 2, 0x28F5C3},
    {"start homing", "01 06 31 00 00 1F C6 FE", nullptr, 0x6040, 0, 0x1F},
    {"mode 1", "01 06 35 00 00 01 47 C6", nullptr, 0x6060, 0, 1},
    {"target position 50000", "01 10 40 00 00 02 04 C3 50 00 00 FE 39", "01 10 40 00 00 02 54 08", 0x607A, 0, 50000},
    {"profile speed 30 rpm", "01 10 4A 00 00 02 04 55 55 00 08 BC D6", "01 10 4A 00 00 02 57 D0", 0x6081, 0, 0x85555},
    {"controlword 2F", "01 06 31 00 00 2F C6 EA", nullptr, 0x6040, 0, 0x2F},
    {"controlword 3F", "01 06 31 00 00 3F C7 26", nullptr, 0x6040, 0, 0x3F},
    {"controlword 4F", "01 06 31 00 00 4F C6 C2", nullptr, 0x6040, 0, 0x4F},
    {"controlword 5F", "01 06 31 00 00 5F C7 0E", nullptr, 0x6040, 0, 0x5F},
    {"status, position reached", "01 03 32 00 00 02 CA B3", "01 03 04 D4 37 FF FF 73 BD", 0x6041, 0, 0xD437},
};

TEST(IsmkModbusExamples, ByteByByte) {
  for (const Example& example : examples) {
    Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
    station.device.objects.statusword = example.index == 0x6041 ? static_cast<std::uint16_t>(example.value) : 0;
    EXPECT_EQ(station.ask(example.request), example.response == nullptr ? example.request : example.response)
        << example.what;
    EXPECT_EQ(station.device.dictionary.number(example.index, example.sub), example.value) << example.what;
  }
}

// The one frame of the manual whose CRC is wrong (L2402), and every frame with any one bit turned over.
TEST(IsmkModbusExamples, WrongCrcIsNotAnswered) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  EXPECT_EQ(station.ask("01 10 50 10 00 02 04 9D 03 00 36 57 98"), "");
  EXPECT_EQ(station.device.objects.homing_speed_switch, 0U);
  for (const Example& example : examples) {
    const std::vector<std::uint8_t> request = bytes_of(example.request);
    for (std::size_t bit = 0; bit < 8 * request.size(); ++bit) {
      std::vector<std::uint8_t> damaged = request;
      damaged[bit / 8] = static_cast<std::uint8_t>(damaged[bit / 8] ^ 1U << bit % 8);
      station.send(damaged);
      EXPECT_EQ(station.answer(), "") << example.what << ", bit " << bit;
    }
  }
  EXPECT_EQ(station.device.objects.controlword, 6);
  EXPECT_EQ(station.ask(examples[0].request), examples[0].request);
}

// Error answers have the printed function codes: 81h for reading (not 83h), 86h, 90h (L2317, L2331, L2353).
TEST(IsmkModbusExamples, PrintedErrorCodes) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  EXPECT_EQ(station.ask_sealed("01 03 32 02 00 01"), "01 81 02");  // nothing there
  EXPECT_EQ(station.ask_sealed("01 03 00 00 00 01"), "01 81 02");  // before the first object
  EXPECT_EQ(station.ask_sealed("01 06 32 00 00 01"), "01 86 02");  // read only
  EXPECT_EQ(station.ask_sealed("01 06 35 00 00 08"), "01 86 03");  // out of range
  EXPECT_EQ(station.ask_sealed("01 06 34 02 00 00"), "01 86 02");  // no such address
  EXPECT_EQ(station.ask_sealed("01 10 32 00 00 01 02 00 00"), "01 90 02");
  EXPECT_EQ(station.ask_sealed("01 10 6F 00 00 01 02 00 00"), "01 90 03");  // half of an object
  // Functions it does not have.
  for (const char* function : {"01", "02", "04", "05", "08", "0F", "16", "17", "2B", "7F"}) {
    const std::string error =
        hex_of(std::vector<std::uint8_t>{static_cast<std::uint8_t>(bytes_of(function)[0] | 0x80)});
    EXPECT_EQ(station.ask_sealed("01 " + std::string(function) + " 31 00 00 01"), "01 " + error + " 01");
  }
}

// Two registers of an object of 16 or 8 bits: the second repeats the topmost bit of the value.
TEST(IsmkModbusExamples, SmallObjectsAnswerToTwoRegisters) {
  Station<servodrome::test::IsmkDevice> station(ismk_profile, ismk_map);
  station.device.objects.mode = -3;
  EXPECT_EQ(station.ask_sealed("01 03 35 00 00 02"), "01 03 04 FF FD FF FF");
  EXPECT_EQ(station.ask_sealed("01 03 35 00 00 01"), "01 03 02 FF FD");
  EXPECT_EQ(station.ask_sealed("01 03 35 00 00 03"), "01 81 02");
  station.device.objects.statusword = 0x0231;
  EXPECT_EQ(station.ask_sealed("01 03 32 00 00 02"), "01 03 04 02 31 00 00");
  EXPECT_EQ(station.ask_sealed("01 03 32 01 00 01"), "01 03 02 00 00");
  // Written alike: the surplus must be an extension.
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
  // Mode -3 as one register, sign-extended or as the bare byte; 01FDh is neither.
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

// 2FF0.11 is found at its printed address and at the one the rule gives (contradiction C20 of the digest).
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
}  // namespace servodrome::modbus::test
