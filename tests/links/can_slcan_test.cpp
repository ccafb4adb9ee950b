#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <string>
#include <termios.h>

#include "links/can/client.hpp"
#include "links/can/slcan_link.hpp"
#include "links/can_rig.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace can_slcan_test {
namespace {

using canopen::Frame;
using test::RawClient;
using test::Rig;
using test::RigThread;

struct SlcanLinkTest : testing::Test {
  std::filesystem::path path =
      std::filesystem::path(testing::TempDir()) / fmt::format("servodrome_slcan_{}", ::getpid());
  Rig rig{BusConfig{.bit_rate = 500'000}};
  std::unique_ptr<CanLink> link = open_can_link(SlcanName{path.string()}, rig.bus, rig.io, rig);

  RawClient open_tty() const { return RawClient(FileDescriptor(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK))); }
  RawClient open_channel() {
    RawClient client = open_tty();
    client.write("O\r");
    EXPECT_TRUE(rig.until([&] { return client.text() == "\r"; }));
    client.clear();
    return client;
  }
};

TEST_F(SlcanLinkTest, LinksThePtyAndRemovesTheLink) {
  EXPECT_TRUE(std::filesystem::is_symlink(path));
  EXPECT_EQ(link->name(), "slcan:" + path.string());
  link.reset();
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(path)));
}

TEST_F(SlcanLinkTest, ReplacesAStaleLinkButNothingElse) {
  link.reset();
  std::filesystem::create_symlink("/dev/pts/99999", path);
  link = open_can_link(SlcanName{path.string()}, rig.bus, rig.io, rig);
  EXPECT_TRUE(open_tty().is_open());
  link.reset();
  std::ofstream(path) << "precious";
  try {
    open_can_link(SlcanName{path.string()}, rig.bus, rig.io, rig);
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::file_exists);
    EXPECT_THAT(error.what(), testing::HasSubstr(path.string()));
    EXPECT_THAT(error.what(), testing::HasSubstr("choose another path"));
  }
  EXPECT_TRUE(std::filesystem::is_regular_file(path));
  std::filesystem::remove(path);
  EXPECT_THROW(open_can_link(SlcanName{"/nonexistent/x"}, rig.bus, rig.io, rig), LinkError);
}

TEST_F(SlcanLinkTest, APathInUseIsRefusedAndStaysWithWhoHasIt) {
  const auto device = std::filesystem::read_symlink(path);
  const auto relative = path.lexically_relative(std::filesystem::current_path());
  for (const std::string& name : {path.string(), relative.string()}) {
    try {
      open_can_link(SlcanName{name}, rig.bus, rig.io, rig);
      ADD_FAILURE() << name;
    } catch (const LinkError& error) {
      EXPECT_EQ(error.code(), std::errc::address_in_use);
      EXPECT_THAT(error.what(), testing::HasSubstr("another line has this path"));
    }
    EXPECT_EQ(std::filesystem::read_symlink(path), device);
  }
  // A port that a refused link left on the bus would acknowledge this frame, through a pointer to nothing.
  rig.bus.transmit(rig.node, {.id = 0x81}, rig.time);
  rig.run_bus();
  EXPECT_EQ(rig.bus.error_state(rig.node), ErrorState::passive);
  // After the first link has ended, another one can use the path.
  link.reset();
  link = open_can_link(SlcanName{path.string()}, rig.bus, rig.io, rig);
  EXPECT_TRUE(open_tty().is_open());
}

TEST_F(SlcanLinkTest, WhoeverOpensThePtyWakesTheLine) {
  rig.io.poll();
  EXPECT_EQ(rig.wakes, 0);
  const RawClient client = open_tty();
  EXPECT_TRUE(rig.until([&] { return link->counters().clients == 1; }));
  EXPECT_EQ(rig.wakes, 1);
}

TEST_F(SlcanLinkTest, FramesBothWays) {
  RawClient client = open_channel();
  client.write("t60521122\r");
  ASSERT_TRUE(rig.until([&] { return client.text() == "z\rt58521122\r"; })) << client.text();
  client.clear();
  client.write("T1234567801\rr7011\rR0000000F0\r");
  client.clear();
  ASSERT_TRUE(rig.until([&] { return rig.received.size() == 3; }));
  EXPECT_EQ(rig.received[1], (Frame{.id = 0x701, .remote = true, .length = 1}));
  EXPECT_EQ(rig.received[2], (Frame{.id = 0xF, .extended = true, .remote = true}));
  rig.bus.transmit(rig.node, {.id = 0x701, .remote = true, .length = 1}, rig.time);
  rig.bus.transmit(rig.node, {.id = 0x1ABCDEF0, .extended = true, .length = 1, .data = {0xFE}}, rig.time);
  ASSERT_TRUE(rig.until([&] { return client.has("T1ABCDEF01FE\r"); }));
  EXPECT_TRUE(client.has("r7011\r"));
}

// A closed channel receives no frames and does not acknowledge.
TEST_F(SlcanLinkTest, ClosedChannelTakesNoPart) {
  RawClient client = open_tty();
  rig.bus.transmit(rig.node, {.id = 0x81}, rig.time);
  client.write("t1230\rV\r");
  ASSERT_TRUE(rig.until([&] { return client.text() == "\aV1013\r"; }));
  EXPECT_EQ(rig.bus.counters().frames, 0U);
  EXPECT_EQ(rig.bus.error_state(rig.node), ErrorState::passive);
  client.write("O\r");
  // The node's frame waited for an acknowledge.
  ASSERT_TRUE(rig.until([&] { return client.has("t0810\r"); }));
  client.write("C\r");
  client.clear();
  ASSERT_TRUE(rig.until([&] { return client.text() == "\r"; }));
  rig.bus.transmit(rig.node, {.id = 0x82}, rig.time);
  rig.run_bus();
  client.write("N\r");
  ASSERT_TRUE(rig.until([&] { return client.has("NSD01\r"); }));
  EXPECT_FALSE(client.has("t082"));
}

TEST_F(SlcanLinkTest, SurvivesClientsThatComeAndGo) {
  for (int i = 0; i < 5; ++i) {
    RawClient client = open_channel();
    client.write("t6011AA\r");
    ASSERT_TRUE(rig.until([&] { return client.text() == "z\rt5811AA\r"; })) << i << client.text();
    // Frames that a client did not read must not reach the next client.
    rig.bus.transmit(rig.node, {.id = 0x99}, rig.time);
    rig.run_bus();
    client.close();
    ASSERT_TRUE(rig.until([&] { return link->counters().clients == 0; }));
    EXPECT_EQ(rig.bus.participation(link->port()), Participation::off);
  }
}

TEST_F(SlcanLinkTest, WrongBitRateHearsNothing) {
  RawClient client = open_tty();
  client.write("S4\rO\rt6011AA\r");
  ASSERT_TRUE(rig.until([&] { return client.text() == "\r\rz\r"; }));
  rig.run_bus();
  EXPECT_TRUE(rig.received.empty());
  client.clear();
  client.write("F\r");
  ASSERT_TRUE(rig.until([&] { return client.text() == "F24\r"; })) << client.text();  // warning, error passive
  client.clear();
  client.write("C\rS6\rO\rt6011AB\r");
  ASSERT_TRUE(rig.until([&] { return client.text() == "\r\r\rz\rt5811AB\r"; })) << client.text();
}

TEST_F(SlcanLinkTest, ListenOnlyHearsButDoesNotSend) {
  RawClient client = open_tty();
  client.write("L\rt1230\r");
  ASSERT_TRUE(rig.until([&] { return client.text() == "\r\a"; }));
  MemoryPort other(rig.bus);
  rig.bus.transmit(rig.node, {.id = 0x81}, rig.time);
  EXPECT_TRUE(rig.until([&] { return client.has("t0810\r"); }));
}

TEST_F(SlcanLinkTest, BurstLosesNothing) {
  RawClient client = open_channel();
  std::string burst;
  for (int i = 0; i < 3000; ++i) burst += fmt::format("t1232{:04X}\r", i);
  std::string_view rest = burst;
  ASSERT_TRUE(rig.until([&] {
    client.text();  // the z answers
    const ssize_t size = rest.empty() ? 0 : ::write(client.descriptor(), rest.data(), rest.size());
    if (size > 0) rest.remove_prefix(static_cast<std::size_t>(size));
    return rig.received.size() == 3000;
  })) << rig.received.size();
  for (std::size_t i = 0; i < 3000; ++i) ASSERT_EQ(rig.received[i].data[0] * 256U + rig.received[i].data[1], i);
}

TEST_F(SlcanLinkTest, SlowReaderLosesFrames) {
  RawClient client = open_channel();
  constexpr int count = 20'000;
  for (int i = 0; i < count; ++i) {
    rig.bus.transmit(rig.node, {.id = 0x181, .length = 8}, rig.time);
    if (i % 100 == 99) {
      rig.run_bus();
      rig.io.restart();
      rig.io.poll();
    }
  }
  EXPECT_GT(link->counters().dropped, 0U);
  EXPECT_EQ(link->counters().dropped + link->counters().from_bus, static_cast<std::uint64_t>(count));
  client.write("F\r");
  EXPECT_TRUE(rig.until([&] { return client.has("F09\r"); }));  // receive queue full, data overrun
  EXPECT_THAT(client.text(), testing::StartsWith("t18180000000000000000\rt1818"));
}

TEST_F(SlcanLinkTest, BlockingClient) {
  RigThread thread(rig);
  {
    const auto client = open_can_client(link->name(), {.bit_rate = 500'000});
    for (std::uint8_t i = 1; i < 50; ++i) {
      const Frame request{.id = 0x600U + i, .length = 3, .data = {i, 0, 0xEE}};
      client->send(request);
      Frame expected = request;
      expected.id -= 0x80;
      ASSERT_EQ(client->receive(std::chrono::seconds(10)), expected);
    }
    EXPECT_FALSE(client->receive(std::chrono::milliseconds(1)));
  }
  const auto again = open_can_client(link->name());
  again->send({.id = 0x601});
  EXPECT_EQ(again->receive(std::chrono::seconds(10)), (Frame{.id = 0x581}));
}

TEST(SlcanClient, Errors) {
  try {
    open_can_client("slcan:/nonexistent/tty");
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::no_such_file_or_directory);
    EXPECT_THAT(error.what(), testing::HasSubstr("slcan:/nonexistent/tty"));
    EXPECT_THAT(error.what(), testing::HasSubstr("check the path"));
  }
  try {
    open_can_client("slcan:/dev/null");
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("is not a serial port"));
  }
  EXPECT_THROW(open_can_client("slcan:/dev/null", {.bit_rate = 12345}), LinkError);
}

}  // namespace
}  // namespace can_slcan_test
}  // namespace servodrome::links
