// Every frame of the iSMK manual's "RS232 protocol" (L2468-2619; section 16.2 of its digest), byte by byte.
#include "modbus/ismk_objects.hpp"
#include "serial10/server.hpp"

namespace servodrome::serial10 {
namespace {

using test::bytes_of;
using test::hex_of;

struct Example {
  const char* what;
  const char* request;
  const char* answer;
  std::int64_t value;  // of the object afterwards; before, where it is read
};

constexpr Example examples[] = {
    {"read 2FF0.09", "01 40 F0 2F 09 00 00 00 00 97", "01 4B F0 2F 09 58 02 00 00 32", 600},
    {"write 2FF0.09", "01 2B F0 2F 09 58 02 00 00 52", "01 60 F0 2F 09 58 02 00 00 1D", 600},
    {"controlword 0F", "01 2B 40 60 00 0F 00 00 00 25", "01 60 40 60 00 0F 00 00 00 F0", 0x0F},
    {"mode 6", "01 2F 60 60 00 06 00 00 00 0A", "01 60 60 60 00 06 00 00 00 D9", 6},
    {"method 33", "01 2F 98 60 00 21 00 00 00 B7", "01 60 98 60 00 21 00 00 00 86", 33},
    {"6099.01 = 200 rpm", "01 23 99 60 01 03 9D 36 00 0C", "01 60 99 60 01 03 9D 36 00 CF", 0x369D03},
    {"6099.02 = 100 rpm", "01 23 99 60 02 82 4E 1B 00 F6", "01 60 99 60 02 82 4E 1B 00 B9", 0x1B4E82},
    {"controlword 1F", "01 2B 40 60 00 1F 00 00 00 15", "01 60 40 60 00 1F 00 00 00 E0", 0x1F},
    {"status after homing", "01 40 41 60 00 00 00 00 00 1E", "01 4B 41 60 00 31 C0 FF FF 24", 0xC031},
    {"controlword 2F", "01 2B 40 60 00 2F 00 00 00 05", "01 60 40 60 00 2F 00 00 00 D0", 0x2F},
    {"controlword 4F", "01 2B 40 60 00 4F 00 00 00 E5", "01 60 40 60 00 4F 00 00 00 B0", 0x4F},
    {"mode 1", "01 2F 60 60 00 01 00 00 00 0F", "01 60 60 60 00 01 00 00 00 DE", 1},
    {"607A = 50000", "01 23 7A 60 00 50 C3 00 00 EF", "01 60 7A 60 00 50 C3 00 00 B2", 50000},
    {"6081 = 200 rpm", "01 23 81 60 00 03 9D 36 00 25", "01 60 81 60 00 03 9D 36 00 E8", 0x369D03},
    {"6083 = 100 rps/s", "01 23 83 60 00 6E A3 01 00 E7", "01 60 83 60 00 6E A3 01 00 AA", 107374},
    {"6084 = 100 rps/s", "01 23 84 60 00 6E A3 01 00 E6", "01 60 84 60 00 6E A3 01 00 A9", 107374},
    {"controlword 3F", "01 2B 40 60 00 3F 00 00 00 F5", "01 60 40 60 00 3F 00 00 00 C0", 0x3F},
    {"controlword 5F", "01 2B 40 60 00 5F 00 00 00 D5", "01 60 40 60 00 5F 00 00 00 A0", 0x5F},
    {"position reached", "01 40 41 60 00 00 00 00 00 1E", "01 4B 41 60 00 37 C4 FF FF 1A", 0xC437},
    {"mode 3", "01 2F 60 60 00 03 00 00 00 0D", "01 60 60 60 00 03 00 00 00 DC", 3},
    {"60FF = -100 rpm", "01 23 FF 60 00 7E B1 E4 FF 6B", "01 60 FF 60 00 7E B1 E4 FF 2E", -1789570},
};

struct Drive {
  explicit Drive(std::uint8_t id = 1) : server(device.dictionary, id) {}
  std::string ask(std::span<const std::uint8_t> bytes) {
    for (const std::uint8_t byte : bytes) server.receive(byte, now += std::chrono::microseconds(87));
    return hex_of(server.take());
  }
  std::string ask(const std::string& request) { return ask(bytes_of(request)); }

  test::IsmkDevice device;
  Server server;
  Time now{};
};

TEST(Serial10Examples, ByteByByte) {
  for (const Example& example : examples) {
    Drive drive;
    drive.device.objects.statusword = static_cast<std::uint16_t>(example.value);
    drive.device.objects.target_speed_rpm = static_cast<std::int16_t>(example.value);
    EXPECT_EQ(drive.ask(example.request), example.answer) << example.what;
    Frame request;
    std::ranges::copy(bytes_of(example.request), request.bytes.begin());
    EXPECT_EQ(drive.device.dictionary.number(request.index(), request.sub()), example.value) << example.what;
    EXPECT_EQ(request, Frame::make(request.id(), request.command(), request.index(), request.sub(), request.data()))
        << "the checksum of " << example.what;
  }
}

// The manual's read of 2FF0.09 with each other checksum, and each frame with any bit turned over.
TEST(Serial10Examples, WrongChecksumIsNotAnswered) {
  Drive drive;
  std::vector<std::uint8_t> bytes = bytes_of(examples[0].request);
  for (unsigned checksum = 0; checksum < 256; ++checksum) {
    bytes[9] = static_cast<std::uint8_t>(checksum);
    EXPECT_EQ(drive.ask(bytes).empty(), checksum != 0x97);
  }
  for (const Example& example : examples) {
    for (std::size_t bit = 0; bit < 80; ++bit) {
      std::vector<std::uint8_t> damaged = bytes_of(example.request);
      damaged[bit / 8] = static_cast<std::uint8_t>(damaged[bit / 8] ^ 1U << bit % 8);
      EXPECT_EQ(drive.ask(damaged), "") << example.what << ", bit " << bit;
    }
  }
  EXPECT_EQ(drive.device.objects.controlword, 6);
}

// Whoever sends 127 reaches any drive; it answers with its own id.
TEST(Serial10Examples, UniversalId) {
  Drive drive(5);
  drive.device.objects.target_speed_rpm = 600;
  EXPECT_EQ(drive.ask(Frame::make(127, Command::read, 0x2FF0, 9, 0).bytes), "05 4B F0 2F 09 58 02 00 00 2E");
  EXPECT_EQ(drive.ask(Frame::make(5, Command::read, 0x2FF0, 9, 0).bytes), "05 4B F0 2F 09 58 02 00 00 2E");
  EXPECT_EQ(drive.ask(Frame::make(1, Command::read, 0x2FF0, 9, 0).bytes), "") << "L2479";
  drive.server.set_id(1);
  EXPECT_EQ(drive.ask(examples[0].request), examples[0].answer);
}

TEST(Serial10Examples, ErrorsCarryTheAbortCode) {
  struct Case {
    Frame request;
    dictionary::AbortCode abort;
  };
  using dictionary::AbortCode;
  const Case cases[] = {
      {Frame::make(1, Command::read, 0x5000, 0, 0), AbortCode::object_does_not_exist},
      {Frame::make(1, Command::read, 0x2FF0, 0x30, 0), AbortCode::sub_index_does_not_exist},
      {Frame::make(1, Command::read, 0x1008, 0, 0), AbortCode::unsupported_access},
      {Frame::make(1, Command::write_2, 0x5000, 0, 0), AbortCode::object_does_not_exist},
      {Frame::make(1, Command::write_2, 0x6041, 0, 0), AbortCode::read_only},
      {Frame::make(1, Command::write_4, 0x6040, 0, 0), AbortCode::length_too_high},
      {Frame::make(1, Command::write_1, 0x6040, 0, 0), AbortCode::length_too_low},
      {Frame::make(1, Command::write_1, 0x6060, 0, 8), AbortCode::value_too_high},
      {Frame::make(1, Command::write_1, 0x6060, 0, 0xFB), AbortCode::value_too_low},
      {Frame::make(1, Command::written, 0x6040, 0, 0), AbortCode::command_specifier_unknown},
      {Frame::make(1, static_cast<Command>(0), 0x6040, 0, 0), AbortCode::command_specifier_unknown},
  };
  for (const Case& item : cases) {
    Drive drive;
    const Frame answer = Frame::make(1, Command::error, item.request.index(), item.request.sub(),
                                     static_cast<std::uint32_t>(item.abort));
    EXPECT_EQ(drive.ask(item.request.bytes), hex_of(answer.bytes));
    EXPECT_EQ(drive.device.objects.controlword, 6);
  }
}

}  // namespace
}  // namespace servodrome::serial10
