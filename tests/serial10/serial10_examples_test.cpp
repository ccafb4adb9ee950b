// Every frame of the iSMK manual's "RS232 protocol" (ch. 8.4.1 and 8.4.2), byte by byte.
#include "modbus/ismk_objects.hpp"
#include "serial10/ismk_examples.hpp"
#include "serial10/server.hpp"

namespace servodrome::serial10 {
namespace serial10_examples_test {
namespace {

using test::bytes_of;
using test::hex_of;

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
  for (const IsmkExample& example : ismk_examples) {
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

// The manual's read of 2FF0.09 with every other checksum, and each frame with each single bit inverted.
TEST(Serial10Examples, WrongChecksumIsNotAnswered) {
  Drive drive;
  std::vector<std::uint8_t> bytes = bytes_of(ismk_examples[0].request);
  for (unsigned checksum = 0; checksum < 256; ++checksum) {
    bytes[9] = static_cast<std::uint8_t>(checksum);
    EXPECT_EQ(drive.ask(bytes).empty(), checksum != 0x97);
  }
  for (const IsmkExample& example : ismk_examples) {
    for (std::size_t bit = 0; bit < 80; ++bit) {
      std::vector<std::uint8_t> damaged = bytes_of(example.request);
      damaged[bit / 8] = static_cast<std::uint8_t>(damaged[bit / 8] ^ 1U << bit % 8);
      EXPECT_EQ(drive.ask(damaged), "") << example.what << ", bit " << bit;
    }
  }
  EXPECT_EQ(drive.device.objects.controlword, 6);
}

// A request to id 127 reaches any drive; it answers with its own id.
TEST(Serial10Examples, UniversalId) {
  Drive drive(5);
  drive.device.objects.target_speed_rpm = 600;
  EXPECT_EQ(drive.ask(Frame::make(127, Command::read, 0x2FF0, 9, 0).bytes), "05 4B F0 2F 09 58 02 00 00 2E");
  EXPECT_EQ(drive.ask(Frame::make(5, Command::read, 0x2FF0, 9, 0).bytes), "05 4B F0 2F 09 58 02 00 00 2E");
  EXPECT_EQ(drive.ask(Frame::make(1, Command::read, 0x2FF0, 9, 0).bytes), "") << "ch. 8.4.1";
  drive.server.set_id(1);
  EXPECT_EQ(drive.ask(ismk_examples[0].request), ismk_examples[0].answer);
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
}  // namespace serial10_examples_test
}  // namespace servodrome::serial10
