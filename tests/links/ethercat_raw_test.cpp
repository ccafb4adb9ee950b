// raw: over virtual Ethernet cables. The program restarts itself in its own network namespace (tools/with-veth); the
// tests are skipped if it cannot create one.

#include <cstdlib>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <net/if.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "links/ethercat/packet_socket.hpp"
#include "links/ethercat_master.hpp"
#include "links/link_error.hpp"
#include "source_dir.hpp"

namespace servodrome::links {
namespace {

using namespace test;
using testing::AnyOf;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* with_veth = SERVODROME_SOURCE_DIR "/tools/with-veth";

void shell(const std::string& command) { ASSERT_EQ(std::system(command.c_str()), 0) << command; }

// A port of a master that sends and receives whole frames.
struct Port {
  explicit Port(const std::string& interface) : socket(interface, "raw:" + interface) {}

  void send(std::span<std::uint8_t> bytes) {
    const iovec frame{bytes.data(), bytes.size()};
    ASSERT_EQ(socket.send(std::span(&frame, 1)), 1U);
  }
  // Returns the next frame; empty: none came.
  Bytes receive(Time timeout = patience) {
    if (!wait_readable(socket.descriptor(), std::chrono::steady_clock::now() + timeout)) return {};
    const auto frame = socket.frame(0);
    Bytes bytes(frame.begin(), frame.end());
    socket.release(1);
    return bytes;
  }

  PacketSocket socket;
};

unsigned counter_of(Bytes& bytes) {
  ethercat::Frame frame;
  if (ethercat::parse_ethernet(bytes, frame) != ethercat::FrameKind::ethercat) return 0xFFFF;
  return frame.datagrams()[0].working_counter();
}

struct EthercatRaw : testing::Test {
  void SetUp() override {
    if (std::getenv("WITH_VETH") == nullptr) {
      GTEST_SKIP() << "no network namespace with virtual Ethernet here: see tools/with-veth";
    }
    // For tests that change the interface.
    shell("ip link add plug type veth peer name socket && ip link set plug up && ip link set socket up");
  }
  void TearDown() override {
    if (::if_nametoindex("plug") != 0) shell("ip link delete plug");
  }

  void open(const std::string& name) {
    link = open_ethercat_link(parse_ethercat_link(name), rig.bus, rig.io, rig.watch, rig);
  }
  std::string error_of(const std::string& name) {
    try {
      open(name);
    } catch (const LinkError& error) {
      return error.what();
    }
    return "no error";
  }
  // Runs the link until the condition holds; false: it did not hold in time.
  bool until(const std::function<bool()>& condition) {
    const auto give_up = std::chrono::steady_clock::now() + patience;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > give_up) return false;
      rig.watch.wait(5ms);
      if (link && link->busy()) link->check();  // like a line that polls
      rig.io.restart();
      rig.io.poll();
    }
    return true;
  }

  EthercatRig rig{3};
  std::unique_ptr<EthercatLink> link;
};

TEST_F(EthercatRaw, FramesComeBackInOrder) {
  for (const bool busy : {false, true}) {
    open(busy ? "raw:servo0,busy" : "raw:servo0");
    EthercatRigThread thread(rig, busy ? link.get() : nullptr);
    Master one(open_ethercat_client("raw:master0"));
    for (std::uint8_t i = 1; i < 200; ++i) {
      one.send(i);
      ASSERT_EQ(one.receive(), Answer(i, 3));
    }
    for (std::uint8_t i = 1; i < 100; ++i) one.send(i);
    for (std::uint8_t i = 1; i < 100; ++i) ASSERT_EQ(one.receive(), Answer(i, 3));
    EXPECT_EQ(one.receive(0ns), Answer());
  }
}

TEST_F(EthercatRaw, EachMasterGetsItsOwnFrames) {
  open("raw:servo0");
  EthercatRigThread thread(rig);
  Master one(open_ethercat_client("raw:master0"));
  Master two(open_ethercat_client("raw:master0"));
  for (std::uint8_t i = 1; i < 100; ++i) {
    one.send(i);
    two.send(static_cast<std::uint8_t>(i + 100));
    ASSERT_EQ(one.receive(), Answer(i, 3));
    ASSERT_EQ(two.receive(), Answer(i + 100, 3));
  }
  EXPECT_EQ(one.receive(0ns), Answer());
}

TEST_F(EthercatRaw, AFrameComesBackAsTheSlavesLeaveIt) {
  open("raw:servo0");
  Port port("master0");
  OneDatagram longest(Command::brd, 0, Bytes(ethercat::max_datagram_data));
  const Bytes sent(longest.bytes.begin(), longest.bytes.end());
  ASSERT_EQ(sent.size(), 1514U);
  port.send(longest.bytes);
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 1; }));
  Bytes back = port.receive();
  ASSERT_EQ(back.size(), sent.size());
  EXPECT_EQ(back[6], sent[6] | 0x02);  // the mark of a slave controller
  EXPECT_EQ(counter_of(back), 3U);
}

TEST_F(EthercatRaw, BurstsLongerThanABatchAreServedWhole) {
  open("raw:servo0");
  Port port("master0");
  OneDatagram frame(Command::brd, 0, Bytes(2));
  for (int i = 0; i < 300; ++i) port.send(frame.bytes);  // the link has not polled yet
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 300; }));
  for (int i = 0; i < 300; ++i) {
    Bytes back = port.receive();
    ASSERT_EQ(counter_of(back), 3U) << i;
  }
  EXPECT_EQ(link->counters().dropped, 0U);
}

TEST_F(EthercatRaw, FramesThatFindNoRoomAreCounted) {
  open("raw:servo0");
  Port port("master0");
  OneDatagram frame(Command::brd, 0, Bytes(2));
  for (int i = 0; i < 600; ++i) port.send(frame.bytes);  // the ring has 512 slots
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 512; }));
  for (int i = 0; i < 10; ++i) port.send(frame.bytes);
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 522; }));
  EXPECT_EQ(link->counters().dropped, 88U);
}

TEST_F(EthercatRaw, VlanTagsStay) {
  open("raw:servo0");
  Port port("master0");
  OneDatagram plain(Command::brd, 0, Bytes(2));
  Bytes tagged(plain.bytes.begin(), plain.bytes.end());
  const std::uint8_t tag[] = {0x81, 0x00, 0x60, 0x05};  // priority 3, VLAN 5
  tagged.insert(tagged.begin() + 12, std::begin(tag), std::end(tag));
  port.send(tagged);
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 1; }));
  Bytes back = port.receive();
  ASSERT_EQ(back.size(), tagged.size());
  EXPECT_THAT(Bytes(back.begin() + 12, back.begin() + 18), ElementsAre(0x81, 0x00, 0x60, 0x05, 0x88, 0xA4));
  EXPECT_EQ(counter_of(back), 3U);
}

TEST_F(EthercatRaw, EthercatInUdpInEthernet) {
  open("raw:servo0");
  Port port("master0");
  OneDatagram content(Command::brd, 0, Bytes(2), true);
  const auto length = static_cast<std::uint8_t>(content.bytes.size());
  Bytes frame(6, 0xFF);
  const std::uint8_t headers[] = {0x10, 0x10,
                                  0x10, 0x10,
                                  0x10, 0x10,
                                  0x08, 0x00,  //
                                  0x45, 0,
                                  0,    static_cast<std::uint8_t>(28 + length),
                                  0,    0,
                                  0,    0,
                                  64,   17,
                                  0,    0,  //
                                  10,   0,
                                  0,    1,
                                  255,  255,
                                  255,  255,  //
                                  0x88, 0xA4,
                                  0x88, 0xA4,
                                  0,    static_cast<std::uint8_t>(8 + length),
                                  0x12, 0x34};
  frame.insert(frame.end(), std::begin(headers), std::end(headers));
  frame.insert(frame.end(), content.bytes.begin(), content.bytes.end());
  port.send(frame);
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 1; }));
  Bytes back = port.receive();
  EXPECT_EQ(counter_of(back), 3U);
  EXPECT_EQ(back[40], 0);  // the checksum is removed, because it is no longer valid
  EXPECT_EQ(back[41], 0);
}

TEST_F(EthercatRaw, OtherProtocolsAreNotReceived) {
  open("raw:servo0");
  Port port("master0");
  OneDatagram frame(Command::brd, 0, Bytes(2));
  Bytes other(frame.bytes.begin(), frame.bytes.end());
  other[13] = 0xCC;  // type 88CCh: LLDP
  port.send(other);
  port.send(frame.bytes);
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 1; }));
  EXPECT_EQ(link->counters().to_bus, 1U);
}

TEST_F(EthercatRaw, ARingOfTwoInterfacesBearsABreak) {
  open("raw:servo0+servo1");
  Port front("master0");
  Port back("master1");
  const auto counter_at = [](Port& port) {
    Bytes bytes = port.receive();
    return counter_of(bytes);
  };
  OneDatagram one(Command::brd, 0, Bytes(2));
  front.send(one.bytes);
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 1; }));
  EXPECT_EQ(counter_at(back), 3U);
  rig.bus.set_cable(2, false);
  front.send(one.bytes);
  back.send(one.bytes);
  ASSERT_TRUE(until([&] { return link->counters().from_bus == 3; }));
  EXPECT_EQ(counter_at(front), 2U);
  EXPECT_EQ(counter_at(back), 1U);
}

TEST_F(EthercatRaw, ADelayedFrameIsOvertaken) {
  open("raw:servo0");
  rig.bus.disturb({.delay = 1, .delay_time = 20ms, .limit = 1});
  EthercatRigThread thread(rig);
  Master one(open_ethercat_client("raw:master0"));
  one.send(1);
  one.send(2);
  EXPECT_EQ(one.receive(), Answer(2, 3));
  EXPECT_EQ(one.receive(), Answer(1, 3));
}

// ---- Errors ----

TEST_F(EthercatRaw, InterfacesThatCannotBeUsedAreErrorsThatSayWhy) {
  EXPECT_THAT(error_of("raw:nowhere"),
              AllOf(HasSubstr("cannot open \"raw:nowhere\": there is no interface \"nowhere\""),
                    HasSubstr("ip link add nowhere type veth")));
  EXPECT_THAT(error_of("raw:lo"),
              AllOf(HasSubstr("\"lo\" is not an Ethernet interface"), HasSubstr("udp:127.0.0.1:34980")));
  shell("ip link set plug mtu 1400");
  EXPECT_THAT(error_of("raw:plug"),
              AllOf(HasSubstr("MTU of interface \"plug\" is 1400"), HasSubstr("ip link set plug mtu 1500")));
  shell("ip link set plug down");
  EXPECT_THAT(error_of("raw:plug"), AllOf(HasSubstr("interface \"plug\" is down"), HasSubstr("ip link set plug up")));
  EXPECT_THAT(error_of("raw:servo0+nowhere"), HasSubstr("there is no interface \"nowhere\""));
  EXPECT_THROW(open_ethercat_client("raw:nowhere"), LinkError);
  EXPECT_THROW(open_ethercat_client("raw:servo0+servo1"), LinkError);
}

TEST_F(EthercatRaw, WithoutTheRightItSaysHowToGetIt) {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  __user_cap_data_struct sets[2]{};
  ASSERT_EQ(::syscall(SYS_capget, &header, sets), 0);
  const auto effective = sets[0].effective;
  sets[0].effective &= ~(1U << CAP_NET_RAW);
  ASSERT_EQ(::syscall(SYS_capset, &header, sets), 0);
  const std::string error = error_of("raw:servo0");
  sets[0].effective = effective;
  ASSERT_EQ(::syscall(SYS_capset, &header, sets), 0);
  EXPECT_THAT(error, AllOf(HasSubstr("raw Ethernet is not permitted"), HasSubstr("cap_net_raw"), HasSubstr("sudo"),
                           HasSubstr("udp:127.0.0.1:34980")));
}

struct Loss {
  const char* name;
  const char* away;
  const char* back;
  bool busy;
};

struct EthercatRawLoss : EthercatRaw, testing::WithParamInterface<Loss> {};

TEST_P(EthercatRawLoss, AnInterfaceThatCameBackIsUsedAgain) {
  open(GetParam().busy ? "raw:plug,busy" : "raw:plug");
  shell(GetParam().away);
  ASSERT_TRUE(until([&] { return rig.reports.size() == 1; }));
  EXPECT_THAT(rig.reports[0], AllOf(HasSubstr("interface \"plug\" is lost"), HasSubstr("waiting for it to come back")));
  EXPECT_EQ(link->counters().clients, 0U);
  link->poll();  // no socket: must do nothing
  shell(GetParam().back);
  ASSERT_TRUE(until([&] { return rig.reports.size() == 2; }));
  EXPECT_THAT(rig.reports[1], HasSubstr("interface \"plug\" is back"));
  Port port("socket");
  OneDatagram frame(Command::brd, 0, Bytes(2));
  port.send(frame.bytes);
  ASSERT_TRUE(until([&] {
    if (GetParam().busy) link->poll();
    return link->counters().from_bus == 1;
  }));
  Bytes bytes = port.receive();
  EXPECT_EQ(counter_of(bytes), 3U);
}

INSTANTIATE_TEST_SUITE_P(
    Ways, EthercatRawLoss,
    testing::Values(Loss{"down", "ip link set plug down", "ip link set plug up", false},
                    Loss{"busy_and_down", "ip link set plug down", "ip link set plug up", true},
                    Loss{"deleted", "ip link delete plug",
                         "ip link add plug type veth peer name socket && ip link set plug up && ip link set socket up",
                         false}),
    [](const auto& which) { return which.param.name; });

TEST_F(EthercatRaw, ARingHasAClientAsLongAsOneInterfaceIsThere) {
  shell("ip link add spare type veth peer name spare0 && ip link set spare up && ip link set spare0 up");
  open("raw:plug+spare");
  EXPECT_EQ(link->counters().clients, 1U);
  std::size_t reports = 0;
  const auto after = [&](const char* command) {
    shell(command);
    ++reports;
    EXPECT_TRUE(until([&] { return rig.reports.size() == reports; })) << command;
    return link->counters().clients;
  };
  EXPECT_EQ(after("ip link set plug down"), 1U);
  EXPECT_EQ(after("ip link set spare down"), 0U);
  EXPECT_EQ(after("ip link set plug up"), 1U);
  EXPECT_EQ(after("ip link set plug down"), 0U);
  EXPECT_EQ(after("ip link set spare up"), 1U);
  EXPECT_EQ(after("ip link set plug up"), 1U);
  EXPECT_EQ(after("ip link set spare down"), 1U);
  link.reset();
  shell("ip link delete spare");
}

TEST_F(EthercatRaw, AMasterWhoseInterfaceGoesDownIsTold) {
  const auto client = open_ethercat_client("raw:socket");
  shell("ip link set socket down");
  OneDatagram frame(Command::brd, 0, Bytes(2), true);
  EXPECT_THROW(client->send(frame.bytes), LinkError);
  std::array<std::uint8_t, 100> memory{};
  try {
    client->receive(memory, patience);
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::network_down);
    EXPECT_THAT(error.what(), HasSubstr("ip link show socket"));
  }
}

}  // namespace
}  // namespace servodrome::links

int main(int argc, char** argv) {
  using servodrome::links::with_veth;
  if (std::getenv("WITH_VETH") == nullptr && std::system((std::string(with_veth) + " true").c_str()) == 0) {
    std::vector<char*> arguments{const_cast<char*>(with_veth)};
    arguments.insert(arguments.end(), argv, argv + argc + 1);  // with the terminating null
    ::execv(with_veth, arguments.data());
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
