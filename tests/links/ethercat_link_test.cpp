// The udp: link end to end on loopback, the mem: link in virtual time, and captures.

#include <filesystem>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <iterator>
#include <set>
#include <unistd.h>

#include "links/ethercat/client.hpp"
#include "links/ethercat/log.hpp"
#include "links/ethercat/memory_client.hpp"
#include "links/ethercat_master.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace ethercat_link_test {
namespace {

using namespace test;
using testing::HasSubstr;

struct EthercatUdp : testing::TestWithParam<bool> {
  EthercatUdp() {
    link = open_ethercat_link(EthercatUdpName{"127.0.0.1", 0, GetParam()}, rig.bus, rig.io, rig.watch, rig);
    server_name = link->name();
    start();
  }
  void start() { thread = std::make_unique<EthercatRigThread>(rig, GetParam() ? link.get() : nullptr); }
  Master master() const { return Master(open_ethercat_client(server_name)); }

  EthercatRig rig{3};
  std::unique_ptr<EthercatLink> link;
  std::string server_name;
  std::unique_ptr<EthercatRigThread> thread;
};

TEST_P(EthercatUdp, FramesComeBackInOrder) {
  Master one = master();
  for (std::uint8_t i = 1; i < 200; ++i) {
    one.send(i);
    ASSERT_EQ(one.receive(), Answer(i, 3));
  }
  for (std::uint8_t i = 1; i < 100; ++i) one.send(i);  // does not wait for answers, so that the link serves batches
  for (std::uint8_t i = 1; i < 100; ++i) ASSERT_EQ(one.receive(), Answer(i, 3));
  EXPECT_EQ(one.receive(0ns), Answer());
  thread.reset();
  EXPECT_EQ(link->counters().to_bus, 298U);
  EXPECT_EQ(link->counters().from_bus, 298U);
}

TEST_P(EthercatUdp, EachMasterGetsItsOwnFrames) {
  Master one = master();
  Master two = master();
  for (std::uint8_t i = 1; i < 100; ++i) {
    one.send(i);
    two.send(static_cast<std::uint8_t>(i + 100));
    ASSERT_EQ(one.receive(), Answer(i, 3));
    ASSERT_EQ(two.receive(), Answer(i + 100, 3));
  }
}

TEST_P(EthercatUdp, WhatIsNoFrameHurtsNobody) {
  Master one = master();
  const Bytes nonsense(1400, 0xA5);
  one.client->send(std::span(nonsense).first(1));
  one.client->send(nonsense);
  one.send(9);
  EXPECT_EQ(one.receive(), Answer());  // the first, malformed, comes back unchanged; the second does not come back
  EXPECT_EQ(one.receive(), Answer(9, 3));
  thread.reset();
  EXPECT_EQ(link->counters().malformed, 2U);
}

TEST_P(EthercatUdp, ADelayedFrameIsOvertaken) {
  thread.reset();
  rig.bus.disturb({.delay = 1, .delay_time = 20ms, .limit = 1});
  start();
  Master one = master();
  one.send(1);
  one.send(2);
  EXPECT_EQ(one.receive(), Answer(2, 3));
  EXPECT_EQ(one.receive(), Answer(1, 3));
}

// Keeps the first frame until the second one has passed.
struct KeepsFirst final : EthercatInterposer {
  explicit KeepsFirst(EthercatBus& its_bus) : bus(its_bus) { bus.interpose(this); }
  ~KeepsFirst() { bus.interpose(nullptr); }
  Return returns(std::span<std::uint8_t> frame, Encapsulation, Time) override {
    Return result;
    if (++frames == 1) {
      sender = bus.sender();
      kept.assign(frame.begin(), frame.end());
      result.lost = true;
    } else if (frames == 2) {
      bus.bring_back(sender, kept);
    }
    return result;
  }
  EthercatBus& bus;
  int frames = 0;
  EthercatSender sender;
  Bytes kept;
};

TEST_P(EthercatUdp, AKeptFrameComesBackToItsSender) {
  thread.reset();
  KeepsFirst keeps(rig.bus);
  start();
  Master one = master();
  Master two = master();
  one.send(1);
  for (const std::uint8_t i : std::initializer_list<std::uint8_t>{2, 3}) {
    two.send(i);
    EXPECT_EQ(two.receive(), Answer(i, 3));
  }
  EXPECT_EQ(two.receive(50ms), Answer());
  one.send(4);
  const std::set<Answer> back{one.receive(), one.receive()};
  EXPECT_EQ(back, (std::set<Answer>{Answer(1, 3), Answer(4, 3)}));
  thread.reset();
}

TEST_P(EthercatUdp, AMasterWhoseServerIsGoneIsTold) {
  Master one = master();
  thread.reset();
  link.reset();
  one.send(1);
  try {
    one.receive();
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::connection_refused);
    EXPECT_THAT(error.what(), HasSubstr("is \"servodrome up\" running?"));
  }
}

INSTANTIATE_TEST_SUITE_P(SleepingAndBusy, EthercatUdp, testing::Bool(),
                         [](const auto& which) { return which.param ? "busy" : "sleeping"; });

TEST(EthercatUdpErrors, ThePortIsTaken) {
  EthercatRig rig;
  const auto first = open_ethercat_link(EthercatUdpName{"127.0.0.1", 0}, rig.bus, rig.io, rig.watch, rig);
  try {
    open_ethercat_link(parse_ethercat_link(first->name()), rig.bus, rig.io, rig.watch, rig);
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_THAT(error.what(), HasSubstr("another program has UDP port"));
  }
}

TEST(EthercatUdpErrors, TheHostIsUnknownOrElsewhere) {
  EthercatRig rig;
  for (const char* host : {"no.such.host.invalid", "192.0.2.1"}) {
    EXPECT_THROW(open_ethercat_link(EthercatUdpName{host, 0}, rig.bus, rig.io, rig.watch, rig), LinkError) << host;
  }
  EXPECT_THROW(open_ethercat_client("udp:no.such.host.invalid:1"), LinkError);
}

TEST(EthercatClient, RefusesWhatDoesNotFitIntoAFrame) {
  const auto client = open_ethercat_client("udp:127.0.0.1:9");
  EXPECT_THROW(client->send(Bytes(1501)), LinkError);
}

// ---- mem: ----

struct Clock final : VirtualClock {
  Time now() const override { return time; }
  void step(Time /*latest*/) override { time += 1ms; }
  void run_until(Time target) override { time = std::max(time, target); }
  Time time{1s};
};

struct EthercatMem : testing::Test {
  EthercatRig rig{4, {300ns, 200ns}};
  Clock clock;
  Master master{std::make_unique<MemoryEthercatClient>(rig.bus, clock)};
};

TEST_F(EthercatMem, AFrameIsBackAfterItsTravelTime) {
  master.send(1);
  EXPECT_EQ(master.receive(1999ns), Answer());
  EXPECT_EQ(clock.time, 1s + 1999ns);
  EXPECT_EQ(master.receive(1ms), Answer(1, 4));
  EXPECT_EQ(clock.time, 1s + 2000ns);
}

TEST_F(EthercatMem, WaitingLetsTimePassAndKeepsFrames) {
  master.send(1);
  master.send(2);
  master.client->wait(5ms);
  EXPECT_EQ(master.client->now(), 1s + 5ms);
  EXPECT_EQ(master.receive(0ns), Answer(1, 4));
  EXPECT_EQ(master.receive(0ns), Answer(2, 4));
  EXPECT_EQ(master.receive(0ns), Answer());
  EXPECT_EQ(clock.time, 1s + 5ms);
}

TEST_F(EthercatMem, LostFramesTakeTheTimeout) {
  rig.bus.set_cable(0, false);
  master.send(1);
  EXPECT_EQ(master.receive(7ms), Answer());
  EXPECT_EQ(clock.time, 1s + 7ms);
}

TEST_F(EthercatMem, DelayedFramesAreOvertaken) {
  rig.bus.disturb({.delay = 1, .delay_time = 3ms, .limit = 1});
  master.send(1);
  master.send(2);
  EXPECT_EQ(master.receive(10ms), Answer(2, 4));
  EXPECT_EQ(master.receive(10ms), Answer(1, 4));
  EXPECT_EQ(clock.time, 1s + 2us + 3ms);
}

// ---- Captures ----

TEST(EthercatLog, FramesWithAndWithoutTheirEthernetHeader) {
  const auto path =
      std::filesystem::path(testing::TempDir()) / ("servodrome_ethercat_log" + std::to_string(::getpid()));
  {
    EthercatRig rig(1, {100ns, 50ns});
    EthercatLog log(path.string(), 1000s);
    rig.bus.add_observer(log);
    OneDatagram whole(Command::brd, 0, Bytes(2));
    rig.bus.exchange(whole.bytes, 7us, EthercatBus::Port::primary, EthercatBus::Encapsulation::ethernet);
    OneDatagram content(Command::brd, 0, Bytes(2), true);
    rig.bus.exchange(content.bytes, 9us, EthercatBus::Port::primary, EthercatBus::Encapsulation::payload);
    EXPECT_FALSE(log.failed());
  }
  std::ifstream file(path, std::ios::binary);
  const Bytes bytes{std::istreambuf_iterator<char>(file), {}};
  std::filesystem::remove(path);
  constexpr std::size_t frame = 14 + 2 + 12 + 2;
  ASSERT_EQ(bytes.size(), 24 + 4 * (16 + frame));
  EXPECT_EQ(ethercat::load_u32(&bytes[0]), 0xA1B23C4DU);
  EXPECT_EQ(ethercat::load_u32(&bytes[20]), 1U);  // Ethernet
  struct Expected {
    std::uint32_t nanoseconds;
    std::uint8_t source;
    std::uint16_t counter;
  };
  const Expected frames[] = {{7000, 0x10, 0}, {7150, 0x12, 1}, {9000, 0x10, 0}, {9150, 0x12, 1}};
  for (std::size_t i = 0; i < 4; ++i) {
    const std::uint8_t* at = &bytes[24 + i * (16 + frame)];
    EXPECT_EQ(ethercat::load_u32(at), 1000U);
    EXPECT_EQ(ethercat::load_u32(at + 4), frames[i].nanoseconds);
    EXPECT_EQ(ethercat::load_u32(at + 8), frame);
    EXPECT_EQ(at[16 + 6], frames[i].source);
    EXPECT_EQ(at[16 + 12], 0x88);
    EXPECT_EQ(at[16 + 13], 0xA4);
    EXPECT_EQ(ethercat::load_u16(at + 16 + frame - 2), frames[i].counter);
  }
}

TEST(EthercatLog, AFileThatCannotBeMadeIsAnError) {
  EXPECT_THROW(EthercatLog("/nonexistent/log.pcap", Time{}), LinkError);
}

}  // namespace
}  // namespace ethercat_link_test
}  // namespace servodrome::links
