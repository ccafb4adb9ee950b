// The text protocols of socketcand and slcan, without sockets.

#include <gtest/gtest.h>
#include <random>
#include <string>
#include <vector>

#include "links/can/slcan_protocol.hpp"
#include "links/can/socketcand_protocol.hpp"

namespace servodrome::links {
namespace can_protocol_test {
namespace {

using canopen::Frame;

std::vector<std::string> elements(std::string_view bytes, std::size_t piece, std::uint64_t* oversized = nullptr) {
  socketcand::ElementReader reader;
  std::vector<std::string> result;
  while (!bytes.empty()) {
    std::string_view part = bytes.substr(0, piece);
    bytes.remove_prefix(part.size());
    while (!part.empty()) {
      part.remove_prefix(reader.feed(part));
      if (reader.ready()) result.emplace_back(reader.element());
    }
  }
  if (oversized != nullptr) *oversized = reader.oversized();
  return result;
}

TEST(Socketcand, ElementsInAnyPieces) {
  const std::string stream = "< open can0 >< rawmode >\r\n< send 123 0 >";
  const std::vector<std::string> expected = {" open can0 ", " rawmode ", " send 123 0 "};
  for (const std::size_t piece : {1U, 2U, 3U, 7U, 1000U}) EXPECT_EQ(elements(stream, piece), expected) << piece;
}

TEST(Socketcand, GarbageAndOversizeElements) {
  EXPECT_EQ(elements(">>xx> < ok >", 3), std::vector<std::string>{" ok "});
  EXPECT_EQ(elements("< lost < ok >", 2), std::vector<std::string>{" ok "});
  std::uint64_t oversized = 0;
  const std::string longest(256, 'a');
  EXPECT_EQ(elements("<" + longest + ">", 10), std::vector<std::string>{longest});
  EXPECT_EQ(elements("<" + longest + "b><x>", 10, &oversized), std::vector<std::string>{"x"});
  EXPECT_EQ(oversized, 1U);
}

std::optional<Frame> sent(std::string_view element) { return socketcand::parse_send(socketcand::Words(element)); }

TEST(Socketcand, Send) {
  EXPECT_EQ(sent("send 123 0"), (Frame{.id = 0x123}));
  EXPECT_EQ(sent("send 1AAAAAAA 2 1 F1"), (Frame{.id = 0x1AAAAAAA, .extended = true, .length = 2, .data = {1, 0xF1}}));
  EXPECT_EQ(sent("send 7ff 8 0 1 2 3 4 5 6 ff"),
            (Frame{.id = 0x7FF, .length = 8, .data = {0, 1, 2, 3, 4, 5, 6, 0xFF}}));
  EXPECT_EQ(sent("sendrtr 701 0"), (Frame{.id = 0x701, .remote = true}));
  EXPECT_EQ(sent("sendrtr 1AAAAAAA 2"), (Frame{.id = 0x1AAAAAAA, .extended = true, .remote = true, .length = 2}));
  // python-can sends a remote frame of length 8 in this form.
  EXPECT_EQ(sent(" send 701 8  "), (Frame{.id = 0x701, .remote = true, .length = 8}));
  for (const char* wrong :
       {"send", "send 123", "send 800 0", "send 20000000 0", "send 123456789 0", "send 123 9", "send 123 1 100",
        "send 123 1 1 2", "send 123 2 1", "send 12x 0", "send 123 1 g", "send 123 -1", "send -12 0", "sendrtr 1 1 1",
        "send 123 8 1 2 3 4 5 6 7 8 9", "send 123 8 1 2 3 4 5 6 7 8 9 A B"}) {
    EXPECT_FALSE(sent(wrong)) << wrong;
  }
}

TEST(Socketcand, Frame) {
  const Time timestamp = std::chrono::microseconds(23'424'242);
  const Frame frame{.id = 0x123, .length = 4, .data = {0x11, 0x22, 0x33, 0x44}};
  EXPECT_EQ(socketcand::format_frame(frame, timestamp), "< frame 123 23.424242 11223344 >");
  const Frame remote{.id = 0x123, .remote = true, .length = 4};
  EXPECT_EQ(socketcand::format_frame(remote, timestamp), "< rtr 123 23.424242 4 >");
  EXPECT_EQ(socketcand::format_frame({.id = 1, .extended = true}, Time{}), "< frame 00000001 0.000000  >");
  // The form that socketcand writes in BCM mode.
  EXPECT_EQ(socketcand::parse_frame(socketcand::Words("frame 123 23.424242 11 22 33 44")), frame);
}

Frame random_frame(std::mt19937& random) {
  Frame frame;
  frame.extended = random() % 2 != 0;
  frame.remote = random() % 3 == 0;
  frame.id = static_cast<std::uint32_t>(random()) & (frame.extended ? 0x1FFFFFFFU : 0x7FFU);
  frame.length = static_cast<std::uint8_t>(random() % 9);
  for (unsigned i = 0; !frame.remote && i < frame.length; ++i) frame.data[i] = static_cast<std::uint8_t>(random());
  return frame;
}

TEST(CanProtocols, EveryFrameSurvivesBothWays) {
  std::mt19937 random(1);
  for (int i = 0; i < 5000; ++i) {
    const Frame frame = random_frame(random);
    const auto send = elements(socketcand::format_send(frame), 5);
    const auto show = elements(socketcand::format_frame(frame, Time(i * 1000)), 5);
    ASSERT_EQ(send.size() + show.size(), 2U);
    ASSERT_EQ(sent(send[0]), frame);
    ASSERT_EQ(socketcand::parse_frame(socketcand::Words(show[0])), frame);
    ASSERT_EQ(slcan::parse_frame(slcan::format_frame(frame)), frame);
    ASSERT_EQ(slcan::parse_frame(slcan::format_frame(frame) + "BEEF"), frame);
  }
}

struct FakeController : slcan::Controller {
  std::vector<std::string> calls;
  std::vector<Frame> frames;
  bool has_room = true;
  void open(bool listen_only) override { calls.push_back(listen_only ? "listen" : "open"); }
  void close() override { calls.push_back("close"); }
  void set_bit_rate(std::uint32_t bit_rate) override { calls.push_back(std::to_string(bit_rate)); }
  bool transmit(const Frame& frame) override {
    if (has_room) frames.push_back(frame);
    return has_room;
  }
  std::uint8_t status_flags() override { return 0x24; }
};

struct SlcanTest : testing::Test {
  FakeController controller;
  slcan::Adapter adapter{controller};
  std::string say(std::string_view text) {
    std::string answer;
    for (const char byte : text) adapter.receive(byte, answer);
    return answer;
  }
};

// Each command in the states where it is allowed and where it is not; the first column is the state.
TEST_F(SlcanTest, Commands) {
  struct Case {
    bool open;
    const char* command;
    const char* answer;
  };
  const Case cases[] = {
      {false, "\r", "\r"},           {false, "C\r", "\a"},        {false, "S6\r", "\r"},
      {false, "S9\r", "\a"},         {false, "S\r", "\a"},        {false, "S66\r", "\a"},
      {false, "V\r", "V1013\r"},     {false, "V1\r", "\a"},       {false, "N\r", "NSD01\r"},
      {false, "F\r", "\a"},          {false, "Z1\r", "\r"},       {false, "Z0\r", "\r"},
      {false, "Z2\r", "\a"},         {false, "t1230\r", "\a"},    {false, "M00000000\r", "\r"},
      {false, "mFFFFFFFF\r", "\r"},  {false, "M0000000\r", "\a"}, {false, "s0014\r", "\r"},
      {false, "s001\r", "\a"},       {false, "xyz\r", "\a"},      {false, "O\r", "\r"},
      {true, "O\r", "\a"},           {true, "S6\r", "\a"},        {true, "Z1\r", "\a"},
      {true, "M00000000\r", "\a"},   {true, "F\r", "F24\r"},      {true, "t1230\r", "z\r"},
      {true, "t12321122\r", "z\r"},  {true, "t1232112\r", "\a"},  {true, "t123211223344\r", "\a"},
      {true, "t8000\r", "\a"},       {true, "t1239\r", "\a"},     {true, "T1234567811A\r", "z\r"},
      {true, "T200000000\r", "\a"},  {true, "r7011\r", "z\r"},    {true, "r701111\r", "\a"},
      {true, "R000001238\r", "z\r"}, {true, "t12\r", "\a"},       {true, "C\r", "\r"},
      {false, "O\nV\r", "\a"},       {false, "O\r\n", "\r"},      {true, "C\r", "\r"},
      {false, "L\r", "\r"},          {true, "t1230\r", "\a"},     {true, "C\r", "\r"},
  };
  for (const Case& item : cases) {
    EXPECT_EQ(adapter.is_open(), item.open) << item.command;
    std::string expected = item.answer;
    if (expected == "z\r" && (item.command[0] == 'T' || item.command[0] == 'R')) expected = "Z\r";
    EXPECT_EQ(say(item.command), expected) << item.command;
  }
  EXPECT_EQ(controller.calls,
            (std::vector<std::string>{"500000", "1000000", "open", "close", "open", "close", "listen", "close"}));
  ASSERT_EQ(controller.frames.size(), 5U);
  EXPECT_EQ(controller.frames[1], (Frame{.id = 0x123, .length = 2, .data = {0x11, 0x22}}));
  EXPECT_EQ(controller.frames[3], (Frame{.id = 0x701, .remote = true, .length = 1}));
}

TEST_F(SlcanTest, FullQueueIsAnError) {
  say("O\r");
  controller.has_room = false;
  EXPECT_EQ(say("t1230\r"), "\a");
}

TEST_F(SlcanTest, OversizeLineIsOneError) {
  EXPECT_EQ(say(std::string(1000, 'x') + "\rV\r"), "\aV1013\r");
  EXPECT_EQ(adapter.refused_commands(), 1U);
}

TEST_F(SlcanTest, FramesForTheHost) {
  const Frame frame{.id = 0x123, .length = 2, .data = {0xAB, 0x01}};
  const Time at = std::chrono::milliseconds(61'234);
  EXPECT_EQ(adapter.frame_text(frame, at), "");
  say("O\r");
  EXPECT_EQ(adapter.frame_text(frame, at), "t1232AB01\r");
  EXPECT_EQ(adapter.frame_text({.id = 0x701, .remote = true, .length = 1}, at), "r7011\r");
  EXPECT_EQ(adapter.frame_text({.id = 0x123, .extended = true}, at), "T000001230\r");
  say("C\rZ1\rO\r");
  EXPECT_EQ(adapter.frame_text(frame, at), "t1232AB0104D2\r");  // 1234 ms into the minute
  adapter.reset();
  say("O\r");
  EXPECT_EQ(adapter.frame_text(frame, at), "t1232AB01\r");
}

// SJA1000, dual filter: 0x601 through filter 1, 0x700..0x77F through filter 2.
TEST_F(SlcanTest, AcceptanceFilter) {
  const std::uint32_t filter1 = (0x601U << 5U) << 16U;
  const std::uint32_t filter2 = 0x700U << 5U;
  slcan::AcceptanceFilter filter{filter1 | filter2, 0x001F0FFFU};
  EXPECT_TRUE(filter.passes({.id = 0x601}));
  EXPECT_TRUE(filter.passes({.id = 0x601, .length = 1, .data = {0x55}}));
  EXPECT_FALSE(filter.passes({.id = 0x602}));
  EXPECT_TRUE(filter.passes({.id = 0x77F}));
  EXPECT_FALSE(filter.passes({.id = 0x780}));
  // First data byte 0x23 passes filter 1; nothing passes filter 2.
  filter = {filter1 | 0x00020000U | 0xFFE3U, 0x00100000U};
  EXPECT_TRUE(filter.passes({.id = 0x601, .length = 1, .data = {0x23}}));
  EXPECT_FALSE(filter.passes({.id = 0x601, .length = 1, .data = {0x24}}));
  EXPECT_TRUE(slcan::AcceptanceFilter{}.passes({.id = 0x1FFFFFFF, .extended = true}));
  // Extended: identifier bits 28..13.
  filter = {(0x10000000U >> 13U) << 16U, 0};
  EXPECT_TRUE(filter.passes({.id = 0x10000123, .extended = true}));
  EXPECT_FALSE(filter.passes({.id = 0x10002000, .extended = true}));
}

TEST(CanProtocols, RandomBytesDoNoHarm) {
  std::mt19937 random(5);
  const std::string alphabet = "<> sendrt0123456789ABCDEFtTrROCLSZMm\r\n\a\xFF";
  FakeController controller;
  slcan::Adapter adapter(controller);
  socketcand::ElementReader reader;
  std::string answer;
  std::size_t count = 0;
  for (int i = 0; i < 200'000; ++i) {
    const char byte = alphabet[random() % alphabet.size()];
    adapter.receive(byte, answer);
    reader.feed(std::string_view(&byte, 1));
    if (reader.ready()) {
      const socketcand::Words words(reader.element());
      if (const auto frame = socketcand::parse_send(words)) {
        EXPECT_LE(frame->length, 8);
      }
      ++count;
    }
  }
  EXPECT_GT(count, 100U);
  for (const Frame& frame : controller.frames) EXPECT_LE(frame.length, 8);
}

}  // namespace
}  // namespace can_protocol_test
}  // namespace servodrome::links
