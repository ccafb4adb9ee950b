// SocketCAN. Tests that need an interface use vcan0 (a Linux with the vcan module) and are skipped if it does not
// exist.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <string>

#include "links/can/client.hpp"
#include "links/can/socketcan_link.hpp"
#include "links/can_rig.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace can_socketcan_test {
namespace {

using canopen::Frame;
using test::Rig;
using test::RigThread;

TEST(Socketcan, MissingSupportOrInterfaceIsAnErrorThatSaysSo) {
  Rig rig;
  for (const bool as_client : {false, true}) {
    try {
      if (as_client) {
        open_can_client("socketcan:nocan7");
      } else {
        open_can_link(SocketcanName{"nocan7"}, rig.bus, rig.io, rig);
      }
      FAIL();
    } catch (const LinkError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("cannot open \"socketcan:nocan7\""));
      EXPECT_THAT(error.what(),
                  testing::AnyOf(testing::HasSubstr("modprobe -a can"), testing::HasSubstr("no such interface")));
    }
  }
}

TEST(Socketcan, InterfaceThatIsNoCanInterface) {
  try {
    open_can_client("socketcan:lo");
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_THAT(error.what(),
                testing::AnyOf(testing::HasSubstr("modprobe -a can"), testing::HasSubstr("must be a CAN interface")));
  }
}

struct VcanTest : testing::Test {
  void SetUp() override {
    if (::if_nametoindex("vcan0") == 0) {
      GTEST_SKIP()
          << "this kernel has no vcan0; ./test --all runs this program once more under tools/with-socketcan, which has";
    }
    link = open_can_link(SocketcanName{"vcan0"}, rig.bus, rig.io, rig);
  }
  Rig rig;
  std::unique_ptr<CanLink> link;
};

TEST_F(VcanTest, FramesBothWaysInOrder) {
  RigThread thread(rig);
  const auto client = open_can_client("socketcan:vcan0");
  for (std::uint8_t i = 1; i < 100; ++i) {
    const Frame request{.id = 0x600U + i, .length = 2, .data = {i, 0xEE}};
    client->send(request);
    Frame expected = request;
    expected.id -= 0x80;
    ASSERT_EQ(client->receive(std::chrono::seconds(10)), expected);
  }
  EXPECT_FALSE(client->receive(std::chrono::milliseconds(1)));
}

TEST_F(VcanTest, RemoteAndExtendedFrames) {
  const auto client = open_can_client("socketcan:vcan0");
  const Frame remote{.id = 0x18FF0001, .extended = true, .remote = true, .length = 3};
  client->send(remote);
  ASSERT_TRUE(rig.until([&] { return !rig.received.empty(); }));
  EXPECT_EQ(rig.received[0], remote);
  rig.bus.transmit(rig.node, {.id = 0x701, .remote = true, .length = 1}, rig.time);
  rig.run_bus();
  EXPECT_EQ(client->receive(std::chrono::seconds(10)), (Frame{.id = 0x701, .remote = true, .length = 1}));
}

TEST_F(VcanTest, BurstLosesNothing) {
  const auto client = open_can_client("socketcan:vcan0");
  constexpr std::size_t count = 2000;
  for (std::size_t i = 0; i < count; ++i) {
    client->send(
        {.id = 0x123, .length = 2, .data = {static_cast<std::uint8_t>(i / 256), static_cast<std::uint8_t>(i % 256)}});
    // The socket's receive buffer holds some 200 frames, so the test waits after every 150. The bus queue, which
    // belongs to the link, holds more.
    if (i % 150 == 149) {
      ASSERT_TRUE(rig.until([&] { return rig.received.size() == i + 1; }));
    }
  }
  ASSERT_TRUE(rig.until([&] { return rig.received.size() == count; }));
  for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(rig.received[i].data[0] * 256U + rig.received[i].data[1], i);
}

}  // namespace
}  // namespace can_socketcan_test
}  // namespace servodrome::links
