// An interposer on the simulated EtherCAT bus changes, loses, delays and repeats frames.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "links/ethercat/memory_client.hpp"
#include "links/ethercat_rig.hpp"

namespace servodrome::links {
namespace ethercat_interposer_test {
namespace {

using namespace test;
using testing::ElementsAre;
using Exit = EthercatBus::Exit;

constexpr std::uint32_t al_control = 0x0120;
constexpr std::uint32_t memory = 0x1000;
constexpr std::uint32_t first(std::uint32_t offset) { return offset << 16; }

class Meddler final : public EthercatInterposer {
 public:
  Entry enters(std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) override {
    entered.push_back(at);
    if (on_entry) change(frame, encapsulation, on_entry);
    return entry;
  }
  Return returns(std::span<std::uint8_t> frame, Encapsulation encapsulation, Time at) override {
    returned.push_back(at);
    if (on_return) change(frame, encapsulation, on_return);
    return back;
  }

  Entry entry;
  Return back;
  std::function<void(ethercat::Datagram&)> on_entry;
  std::function<void(ethercat::Datagram&)> on_return;
  std::vector<Time> entered;
  std::vector<Time> returned;

 private:
  static void change(std::span<std::uint8_t> bytes, Encapsulation encapsulation,
                     const std::function<void(ethercat::Datagram&)>& action) {
    ethercat::Frame frame;
    ASSERT_EQ(ethercat::Segment::parse(bytes, encapsulation, frame), ethercat::FrameKind::ethercat);
    for (ethercat::Datagram& datagram : frame.datagrams()) action(datagram);
  }
};

struct Watcher final : EthercatObserver {
  void on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation, Direction direction,
                Time at) override {
    (direction == Direction::in ? in : out).emplace_back(bytes.begin(), bytes.end());
    times.push_back(at);
  }
  std::vector<Bytes> in;
  std::vector<Bytes> out;
  std::vector<Time> times;
};

class EthercatInterposition : public testing::Test {
 protected:
  EthercatInterposition() {
    rig.bus.interpose(&meddler);
    rig.bus.add_observer(watcher);
  }
  std::uint16_t control_of(std::size_t station) {
    return rig.stations[station]->esc().read_register<std::uint16_t>(al_control, rig.time);
  }

  EthercatRig rig{2, {100ns, 50ns}};
  Meddler meddler;
  Watcher watcher;
};

TEST_F(EthercatInterposition, SeesEachFrameBeforeTheFirstSlaveAndBehindTheLast) {
  EXPECT_EQ(rig.broadcast(), 2U);
  EXPECT_THAT(meddler.entered, ElementsAre(rig.time));
  EXPECT_THAT(meddler.returned, ElementsAre(rig.time + 300ns));
  rig.bus.set_cable(0, false);
  EXPECT_EQ(rig.broadcast(), std::nullopt);
  EXPECT_EQ(meddler.entered.size(), 2U);
  EXPECT_EQ(meddler.returned.size(), 1U);  // lost on the cable
  rig.bus.interpose(nullptr);
  rig.bus.set_cable(0, true);
  EXPECT_EQ(rig.broadcast(), 2U);
  EXPECT_EQ(meddler.entered.size(), 2U);
}

TEST_F(EthercatInterposition, TheSlavesExecuteTheChangedFrame) {
  meddler.on_entry = [](ethercat::Datagram& datagram) {
    EXPECT_EQ(datagram.index(), 0x55);
    datagram.content()[0] = 4;
  };
  OneDatagram write(Command::apwr, first(al_control), {2, 0});
  rig.send(write);
  EXPECT_EQ(control_of(0), 4);
  // The capture shows the master's own frame, and the answer that the master gets.
  ASSERT_EQ(watcher.in.size(), 1U);
  EXPECT_EQ(watcher.in[0][14 + 2 + 10], 2);
  EXPECT_EQ(watcher.out[0][14 + 2 + 10], 4);
}

TEST_F(EthercatInterposition, TheMasterGetsTheChangedAnswer) {
  meddler.on_return = [](ethercat::Datagram& datagram) {
    datagram.set_working_counter(datagram.working_counter() - 1);
  };
  EXPECT_EQ(rig.broadcast(), 1U);
  ASSERT_EQ(watcher.out.size(), 1U);
  EXPECT_EQ(watcher.out[0][14 + 2 + 10 + 2], 1);
}

TEST_F(EthercatInterposition, LosesAFrameOnTheWayInOrOnTheWayBack) {
  for (const bool in : {true, false}) {
    meddler.entry.lost = in;
    meddler.back.lost = !in;
    const auto before = rig.bus.counters();
    OneDatagram write(Command::bwr, first(al_control), {2, 0});
    EXPECT_EQ(rig.send(write).exit, Exit::lost);
    EXPECT_EQ(rig.stations[0]->passed.size(), in ? 0U : 1U);
    EXPECT_EQ(rig.bus.counters().lost, before.lost + 1);
    EXPECT_EQ(rig.bus.counters().dropped, before.dropped + 1);
  }
  EXPECT_EQ(watcher.in.size(), 2U);
  EXPECT_TRUE(watcher.out.empty());
  meddler.back.lost = false;
  EXPECT_EQ(rig.broadcast(), 2U);
}

TEST_F(EthercatInterposition, ALossIsCountedOnceTogetherWithADisturbance) {
  meddler.entry.lost = meddler.back.lost = true;
  rig.bus.disturb({.drop = 1});
  EXPECT_EQ(rig.broadcast(), std::nullopt);
  EXPECT_EQ(rig.bus.counters().dropped, 1U);
  rig.bus.disturb({.drop_answer = 1});
  EXPECT_EQ(rig.broadcast(), std::nullopt);
  EXPECT_EQ(rig.bus.counters().dropped, 2U);
  EXPECT_TRUE(meddler.returned.empty());
}

TEST_F(EthercatInterposition, ADelayedFrameComesBackLater) {
  meddler.back.delay = 3ms;
  OneDatagram frame(Command::brd, 0, Bytes(2));
  auto passage = rig.send(frame);
  EXPECT_EQ(passage.delay, 3ms);
  EXPECT_EQ(passage.leaves, rig.time + 300ns + 3ms);
  EXPECT_EQ(watcher.times.back(), passage.leaves);
  EXPECT_EQ(rig.bus.counters().delayed, 1U);
  rig.bus.disturb({.delay = 1, .delay_time = 1ms});  // both delay: the times add up, and it is one delayed frame
  passage = rig.send(frame);
  EXPECT_EQ(passage.delay, 4ms);
  EXPECT_EQ(rig.bus.counters().delayed, 2U);
}

TEST_F(EthercatInterposition, ADelayedFrameIsOvertaken) {
  struct Clock final : VirtualClock {
    Time now() const override { return time; }
    void run_until(Time target) override { time = std::max(time, target); }
    void step(Time latest) override { run_until(latest); }
    Time time{};
  } clock;
  MemoryEthercatClient client(rig.bus, clock);
  meddler.back.delay = 1ms;
  OneDatagram slow(Command::brd, 0, {1, 0}, true);
  client.send(slow.bytes);
  meddler.back.delay = {};
  OneDatagram quick(Command::brd, 0, {2, 0}, true);
  client.send(quick.bytes);
  std::array<std::uint8_t, 100> answer{};
  ASSERT_NE(client.receive(answer, 2ms), 0U);
  EXPECT_EQ(answer[12] & 2, 2);
  EXPECT_EQ(clock.time, 300ns);
  ASSERT_NE(client.receive(answer, 2ms), 0U);
  EXPECT_EQ(answer[12] & 1, 1);
  EXPECT_EQ(clock.time, 1ms + 300ns);
}

TEST_F(EthercatInterposition, AFrameThatPassesTwiceIsExecutedTwice) {
  meddler.entry.passes = 2;
  OneDatagram frame(Command::brd, 0, Bytes(2));
  const auto passage = rig.send(frame);
  EXPECT_EQ(frame.counter(), 4U);
  EXPECT_EQ(passage.leaves, rig.time + 600ns);
  EXPECT_EQ(rig.stations[0]->esc().frames(), 2U);
  EXPECT_EQ(rig.bus.counters().frames, 1U);  // the master sent one
  EXPECT_EQ(watcher.out.size(), 1U);
  // The exchange of a byte gives the master its own byte back.
  OneDatagram swap(Command::lrw, 0x100, {7});
  ethercat::Esc& esc = rig.stations[0]->esc();
  for (const unsigned read_write : {1U, 2U}) {
    Bytes fmmu(16);
    ethercat::store_u32(&fmmu[0], 0x100);
    ethercat::store_u16(&fmmu[4], 1);
    fmmu[7] = 7;
    ethercat::store_u16(&fmmu[8], memory);
    fmmu[11] = static_cast<std::uint8_t>(read_write);
    fmmu[12] = 1;
    meddler.entry.passes = 1;
    OneDatagram set(Command::apwr, first(ethercat::reg::fmmu + 16U * read_write), fmmu);
    rig.send(set);
  }
  esc.write_register<std::uint8_t>(memory, 3);
  meddler.entry.passes = 2;
  rig.send(swap);
  EXPECT_EQ(swap.counter(), 6U);
  EXPECT_THAT(swap.data(), ElementsAre(7));
}

TEST_F(EthercatInterposition, APositionAddressHitsNoSlaveOnTheSecondPass) {
  meddler.entry.passes = 2;
  OneDatagram write(Command::apwr, first(al_control), {2, 0});
  rig.send(write);
  EXPECT_EQ(write.counter(), 1U);
  EXPECT_EQ(write.frame.datagrams()[0].position(), 4U);
  EXPECT_THAT(rig.stations[0]->passed, ElementsAre(rig.time));  // its application acts once
}

TEST_F(EthercatInterposition, AFrameThatIsLostOnTheFirstPassDoesNotPassAgain) {
  meddler.entry.passes = 2;
  rig.bus.disturb({.corrupt = 1, .position = 1, .limit = 1});
  EXPECT_EQ(rig.broadcast(), std::nullopt);
  EXPECT_EQ(rig.stations[0]->esc().frames(), 1U);
}

TEST_F(EthercatInterposition, WorksOnUdpPayloadAsOnEthernetFrames) {
  meddler.on_entry = [](ethercat::Datagram& datagram) { datagram.content()[0] = 1; };
  OneDatagram write(Command::apwr, first(al_control), {2, 0}, true);
  rig.bus.exchange(write.bytes, 1us, EthercatBus::Port::primary, EthercatBus::Encapsulation::payload);
  EXPECT_EQ(control_of(0), 1);
}

TEST_F(EthercatInterposition, AFrameThatNoLongerFitsIsMalformed) {
  meddler.on_entry = [](ethercat::Datagram& datagram) { ethercat::store_u16(datagram.header + 6, 100); };
  OneDatagram write(Command::bwr, first(al_control), {2, 0});
  rig.send(write);
  EXPECT_EQ(rig.bus.counters().malformed, 1U);
  EXPECT_TRUE(rig.stations[0]->passed.empty());
}

}  // namespace
}  // namespace ethercat_interposer_test
}  // namespace servodrome::links
