// Frames in pieces, pauses, other drives on the line, noise.
#include <random>

#include "modbus/ismk_objects.hpp"
#include "serial10/server.hpp"

namespace servodrome::serial10 {
namespace serial10_line_test {
namespace {

using namespace std::chrono_literals;
using test::hex_of;

struct Serial10Line : testing::Test {
  std::string send(std::span<const std::uint8_t> bytes) {
    for (const std::uint8_t byte : bytes) server.receive(byte, now += 87us);
    return hex_of(server.take());
  }

  test::IsmkDevice device;
  Server server{device.dictionary, 1};
  Time now{1h};
  Frame enable = Frame::make(1, Command::write_2, 0x6040, 0, 0x0F);
  std::string confirmed = "01 60 40 60 00 0F 00 00 00 F0";
};

TEST_F(Serial10Line, AnswersWithTheLastCharacter) {
  for (std::size_t i = 0; i < 9; ++i) {
    server.receive(enable.bytes[i], now += 87us);
    EXPECT_TRUE(server.take().empty());
  }
  server.receive(enable.bytes[9], now += 87us);
  EXPECT_EQ(hex_of(server.take()), confirmed);
  EXPECT_TRUE(server.take().empty()) << "once";
  EXPECT_EQ(server.next_deadline(), never);
}

TEST_F(Serial10Line, PartOfAFrameIsForgottenAfterAPause) {
  const std::span<const std::uint8_t> bytes(enable.bytes);
  for (std::size_t split = 1; split < 10; ++split) {
    for (const Time pause : {Server::partial_frame_timeout - 87us, Server::partial_frame_timeout - 87us + 1ns}) {
      server.reset();
      EXPECT_EQ(send(bytes.first(split)), "");
      now += pause;
      const bool in_time = pause + 87us <= Server::partial_frame_timeout;
      EXPECT_EQ(send(bytes.subspan(split)), in_time ? confirmed : "") << split;
    }
  }
  now += 51ms;
  EXPECT_EQ(send(bytes), confirmed);
}

TEST_F(Serial10Line, FramesBackToBack) {
  for (int i = 0; i < 100; ++i) EXPECT_EQ(send(enable.bytes), confirmed);
}

// An additional character shifts all following ones until there is a pause.
TEST_F(Serial10Line, StrayCharacters) {
  for (std::size_t count = 1; count < 10; ++count) {
    const std::vector<std::uint8_t> stray(count, 0x55);
    EXPECT_EQ(send(stray), "");
    EXPECT_EQ(send(enable.bytes), "");
    now += 60ms;
    EXPECT_EQ(send(enable.bytes), confirmed) << count;
  }
}

TEST_F(Serial10Line, GarbledCharactersSpoilTheFrame) {
  for (std::size_t bad = 0; bad < 10; ++bad) {
    for (std::size_t i = 0; i < 10; ++i) {
      now += 87us;
      if (i == bad) {
        server.receive_garbled(now);
      } else {
        server.receive(enable.bytes[i], now);
      }
    }
    EXPECT_TRUE(server.take().empty());
    EXPECT_EQ(send(enable.bytes), confirmed);
  }
  server.receive_garbled(now += 87us);
  now += 60ms;
  EXPECT_EQ(send(enable.bytes), confirmed);
}

// A garbled character belongs to the previous frame until the same pause as for any other character.
TEST_F(Serial10Line, GarbledCharactersAfterAPause) {
  const std::span<const std::uint8_t> bytes(enable.bytes);
  for (const bool too_late : {false, true}) {
    server.reset();
    EXPECT_EQ(send(bytes.first(4)), "");
    now += Server::partial_frame_timeout + (too_late ? 1ns : 0ns);
    server.receive_garbled(now);
    EXPECT_EQ(send(bytes.first(too_late ? 9 : 5)), "") << "the spoilt frame ends here";
    EXPECT_EQ(send(bytes), confirmed) << too_late;
  }
}

TEST_F(Serial10Line, AnAnswerNobodyTookIsGone) {
  for (const std::uint8_t byte : enable.bytes) server.receive(byte, now += 87us);
  server.receive(1, now += 87us);
  EXPECT_TRUE(server.take().empty());
}

// Values of more than four bytes do not fit into a frame.
TEST(Serial10, ObjectsThatDoNotFit) {
  struct Objects {
    std::uint64_t wide = 1;
  } objects;
  static constexpr auto table = std::to_array<dictionary::Entry>(
      {dictionary::var(0x2000, "", SERVODROME_FIELD(Objects, wide), dictionary::Access::rw)});
  dictionary::Dictionary dictionary(table, std::as_writable_bytes(std::span(&objects, 1)));
  Server server(dictionary, 1);
  EXPECT_EQ(server.answer(Frame::make(1, Command::read, 0x2000, 0, 0)),
            Frame::make(1, Command::error, 0x2000, 0, 0x06010000));
  EXPECT_EQ(server.answer(Frame::make(1, Command::write_4, 0x2000, 0, 5)),
            Frame::make(1, Command::error, 0x2000, 0, 0x06070013));
  EXPECT_EQ(objects.wide, 1U);
}

// Each of four drives receives the requests to the others and their answers.
TEST(Serial10, DrivesOnOneLine) {
  std::array<test::IsmkDevice, 4> devices;
  std::array<Server, 4> servers{Server{devices[0].dictionary, 1}, Server{devices[1].dictionary, 2},
                                Server{devices[2].dictionary, 3}, Server{devices[3].dictionary, 126}};
  Time now{};
  for (unsigned round = 0; round < 100; ++round) {
    const std::size_t asked = round % 4;
    const Frame request = Frame::make(servers[asked].id(), Command::write_4, 0x607A, 0, round);
    for (const std::uint8_t byte : request.bytes) {
      now += 87us;
      for (Server& server : servers) server.receive(byte, now);
    }
    Frame answer;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto bytes = servers[i].take();
      ASSERT_EQ(bytes.size(), i == asked ? 10U : 0U);
      std::copy(bytes.begin(), bytes.end(), answer.bytes.begin());
    }
    EXPECT_EQ(answer, Frame::make(servers[asked].id(), Command::written, 0x607A, 0, round));
    for (const std::uint8_t byte : answer.bytes) {
      now += 87us;
      for (std::size_t i = 0; i < 4; ++i) {
        if (i != asked) servers[i].receive(byte, now);
      }
    }
    for (Server& server : servers) EXPECT_TRUE(server.take().empty());
    EXPECT_EQ(devices[asked].objects.target_position, static_cast<std::int32_t>(round));
  }
}

TEST_F(Serial10Line, RandomStreams) {
  std::minstd_rand source{1};
  const auto below = [&source](unsigned limit) { return static_cast<unsigned>(source() >> 4) % limit; };
  static constexpr std::array<std::uint16_t, 8> objects = {0x6040, 0x6041, 0x6060, 0x607A,
                                                           0x2FF0, 0x6099, 0x1008, 0x5000};
  static constexpr std::array<std::uint8_t, 6> commands = {0x40, 0x23, 0x2B, 0x2F, 0x60, 0x00};
  unsigned answers = 0;
  for (unsigned stream = 0; stream < 1'000'000; ++stream) {
    Frame frame =
        Frame::make(static_cast<std::uint8_t>(below(4) == 0 ? 127 : below(3)), static_cast<Command>(commands[below(6)]),
                    objects[below(8)], static_cast<std::uint8_t>(below(12)), below(65536) * below(65536));
    if (below(3) == 0) frame.bytes[below(10)] = static_cast<std::uint8_t>(below(256));
    const std::size_t size = below(20) == 0 ? below(10) : 10;
    if (below(10) == 0) now += Time(below(100'000'000));
    for (std::size_t i = 0; i < size; ++i) {
      now += 87us;
      if (below(300) == 0) {
        server.receive_garbled(now);
      } else {
        server.receive(frame.bytes[i], now);
      }
    }
    Frame answer;
    const auto bytes = server.take();
    if (bytes.empty()) continue;
    ++answers;
    ASSERT_EQ(bytes.size(), 10U);
    std::copy(bytes.begin(), bytes.end(), answer.bytes.begin());
    ASSERT_TRUE(answer.is_intact());
    ASSERT_EQ(answer.id(), 1);
  }
  EXPECT_GT(answers, 50'000U);
  now += 60ms;
  EXPECT_EQ(send(enable.bytes), confirmed);
}

}  // namespace
}  // namespace serial10_line_test
}  // namespace servodrome::serial10
