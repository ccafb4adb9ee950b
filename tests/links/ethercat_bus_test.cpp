// The simulated EtherCAT bus: stations, cables, disturbances, observers.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "links/ethercat_rig.hpp"

namespace servodrome::links {
namespace ethercat_bus_test {
namespace {

using namespace test;
using testing::ElementsAre;
using Exit = EthercatBus::Exit;
using Port = EthercatBus::Port;

constexpr std::uint32_t al_control = 0x0120;
constexpr std::uint32_t of_first(std::uint32_t offset) { return offset << 16; }

TEST(EthercatBus, AFramePassesAllStationsAndTakesTheirTime) {
  EthercatRig rig(3, {100ns, 50ns});
  OneDatagram frame(Command::brd, 0, Bytes(2));
  const auto passage = rig.bus.exchange(frame.bytes, 1ms, Port::primary, EthercatBus::Encapsulation::ethernet);
  EXPECT_EQ(passage.exit, Exit::primary);
  EXPECT_EQ(passage.leaves, 1ms + 450ns);
  EXPECT_EQ(frame.counter(), 3U);
  EXPECT_EQ(rig.bus.counters().frames, 1U);
  EXPECT_EQ(rig.bus.counters().lost, 0U);
}

TEST(EthercatBus, OnlyStationsWithSomethingToDoAreTold) {
  EthercatRig rig(2);
  rig.broadcast();
  EXPECT_TRUE(rig.stations[0]->passed.empty());
  OneDatagram write(Command::apwr, of_first(al_control) | 0xFFFF, {2, 0});  // the second station
  rig.send(write);
  EXPECT_EQ(write.counter(), 1U);
  EXPECT_TRUE(rig.stations[0]->passed.empty());
  EXPECT_THAT(rig.stations[1]->passed, ElementsAre(rig.time));
}

TEST(EthercatBus, StationsAreToldAfterTheFrameOnlyWhenTheyAreSettled) {
  EthercatRig rig(1);
  OneDatagram write(Command::apwr, of_first(al_control), {2, 0});
  rig.bus.pass(write.bytes, 5us, Port::primary, EthercatBus::Encapsulation::ethernet);
  EXPECT_TRUE(rig.stations[0]->passed.empty());
  rig.bus.settle(5us);
  rig.bus.settle(6us);
  EXPECT_THAT(rig.stations[0]->passed, ElementsAre(5us));
}

TEST(EthercatBus, WhatAStationHasPutOffIsNotToldUntilSomethingMayBeDue) {
  EthercatRig rig(1);
  ethercat::Esc& esc = rig.stations[0]->esc();
  const auto pass = [&rig](Command command, std::uint16_t offset, Time at) {
    OneDatagram frame(command, of_first(offset), {2, 0});
    rig.bus.pass(frame.bytes, at, Port::primary, EthercatBus::Encapsulation::ethernet);
  };
  pass(Command::apwr, al_control, 5us);
  esc.put_off(esc.attention());
  esc.set_quiet_until(9us);
  rig.bus.settle(5us);
  rig.bus.settle(8us);
  EXPECT_TRUE(rig.stations[0]->passed.empty());
  rig.bus.settle(9us);
  EXPECT_THAT(rig.stations[0]->passed, ElementsAre(9us));
  // A write to any register may bring a deadline forward.
  pass(Command::apwr, al_control, 10us);
  esc.put_off(esc.attention());
  esc.set_quiet_until(20us);
  pass(Command::apwr, ethercat::reg::station_address, 11us);
  rig.bus.settle(11us);
  EXPECT_THAT(rig.stations[0]->passed, ElementsAre(9us, 11us));
}

// The time until which stations without due work need no poll.
TEST(EthercatBus, SettlingTellsUntilWhenTheStationsMayBeLeftAlone) {
  EthercatRig rig(2);
  for (const auto& station : rig.stations) station->esc().set_quiet_until(1ms);
  const auto settled = [&rig](Command command, std::uint32_t address, Time at) {
    OneDatagram frame(command, address, {2, 0});
    rig.bus.pass(frame.bytes, at, Port::primary, EthercatBus::Encapsulation::ethernet);
    rig.bus.forget_events();
    rig.bus.settle(at);
    return rig.bus.next_event();
  };
  EXPECT_EQ(settled(Command::brd, of_first(al_control), 5us), never);
  // A station that was called returns its own time.
  EXPECT_EQ(settled(Command::apwr, of_first(al_control), 6us), 16us);
  EXPECT_THAT(rig.stations[0]->passed, ElementsAre(6us));
  // A register was written, but the station was not called: the time is unknown.
  rig.stations[0]->esc().set_quiet_until(1ms);
  EXPECT_EQ(settled(Command::apwr, of_first(ethercat::reg::station_address) | 0xFFFF, 7us), ethercat::Esc::unknown);
  EXPECT_TRUE(rig.stations[1]->passed.empty());
  rig.stations[1]->esc().set_quiet_until(1ms);
  EXPECT_EQ(settled(Command::brd, of_first(al_control), 8us), never);
  rig.bus.set_powered(1, false, 9us);
  EXPECT_EQ(settled(Command::brd, of_first(al_control), 9us), never);
}

TEST(EthercatBus, CutCablesAndMissingPowerMakeTheTailSilent) {
  EthercatRig rig(3);
  rig.bus.set_cable(2, false);
  EXPECT_EQ(rig.broadcast(), 2U);
  rig.bus.set_cable(2, true);
  EXPECT_EQ(rig.broadcast(), 3U);
  rig.bus.set_powered(1, false, rig.time);
  EXPECT_EQ(rig.broadcast(), 1U);
  rig.bus.set_powered(1, true, rig.time);
  EXPECT_EQ(rig.broadcast(), 3U);
  rig.bus.set_cable(0, false);
  EXPECT_EQ(rig.broadcast(), std::nullopt);
  EXPECT_EQ(rig.bus.counters().lost, 1U);
}

TEST(EthercatBus, ARingBearsABreak) {
  EthercatRig rig(3);
  rig.bus.set_cable(3, true);
  OneDatagram whole(Command::brd, 0, Bytes(2));
  EXPECT_EQ(rig.send(whole).exit, Exit::secondary);
  EXPECT_EQ(whole.counter(), 3U);
  rig.bus.set_cable(1, false);
  OneDatagram front(Command::brd, 0, Bytes(2));
  EXPECT_EQ(rig.send(front).exit, Exit::primary);
  EXPECT_EQ(front.counter(), 1U);
  OneDatagram back(Command::brd, 0, Bytes(2));
  EXPECT_EQ(rig.send(back, Port::secondary).exit, Exit::secondary);
  EXPECT_EQ(back.counter(), 2U);
}

TEST(EthercatBus, ADetachedStationIsLikeOneWithoutPower) {
  EthercatRig rig(3);
  rig.bus.detach(1);
  rig.stations[1].reset();
  EXPECT_EQ(rig.broadcast(), 1U);
  EXPECT_EQ(rig.bus.size(), 3U);
}

TEST(EthercatBus, WithoutStationsNothingComesBack) {
  EthercatRig rig(0);
  EXPECT_EQ(rig.broadcast(), std::nullopt);
}

TEST(EthercatBus, CountsWhatIsNoEthercatFrame) {
  EthercatRig rig;
  OneDatagram cut_short(Command::brd, 0, Bytes(20));
  cut_short.bytes = cut_short.bytes.first(30);
  rig.send(cut_short);
  OneDatagram other(Command::brd, 0, Bytes(20));
  other.bytes[12] = 0x08;
  other.bytes[13] = 0x06;
  EXPECT_EQ(rig.send(other).exit, Exit::lost);  // slave controllers destroy such a frame (DL control bit 0)
  EXPECT_EQ(rig.bus.counters().malformed, 1U);
  EXPECT_EQ(rig.bus.counters().foreign, 1U);
}

// ---- Disturbances ----

std::string pattern(EthercatRig& rig, int frames) {
  std::string seen;
  for (int i = 0; i < frames; ++i) seen += rig.broadcast() ? '.' : 'x';
  return seen;
}

TEST(EthercatDisturbance, DroppedFramesAreSeenByNoSlaveOrByAll) {
  for (const bool answer : {false, true}) {
    EthercatRig rig(1);
    rig.bus.disturb(answer ? EthercatDisturbance{.drop_answer = 1} : EthercatDisturbance{.drop = 1});
    OneDatagram write(Command::apwr, of_first(al_control), {2, 0});
    EXPECT_EQ(rig.send(write).exit, Exit::lost);
    EXPECT_EQ(rig.stations[0]->passed.size(), answer ? 1U : 0U);
    EXPECT_EQ(rig.bus.counters().dropped, 1U);
    EXPECT_EQ(rig.bus.counters().lost, 1U);
    rig.bus.clear_disturbance();
    EXPECT_EQ(rig.broadcast(), 1U);
  }
}

TEST(EthercatDisturbance, EqualSeedsGiveEqualLosses) {
  EthercatRig one;
  EthercatRig same;
  EthercatRig other;
  one.bus.disturb({.drop = 0.2, .seed = 7});
  same.bus.disturb({.drop = 0.2, .seed = 7});
  other.bus.disturb({.drop = 0.2, .seed = 8});
  const std::string losses = pattern(one, 1000);
  EXPECT_EQ(losses, pattern(same, 1000));
  EXPECT_NE(losses, pattern(other, 1000));
  EXPECT_NEAR(static_cast<double>(one.bus.counters().dropped), 200.0, 50.0);
  // Adding another kind of disturbance does not change the draws of this one.
  one.bus.disturb({.drop = 0.2, .delay = 0.5, .delay_time = 1ms, .seed = 7});
  EXPECT_EQ(losses, pattern(one, 1000));
}

TEST(EthercatDisturbance, StopsAtItsLimit) {
  EthercatRig rig;
  rig.bus.disturb({.drop = 1, .limit = 3});
  EXPECT_EQ(pattern(rig, 5), "xxx..");
}

TEST(EthercatDisturbance, ACorruptedFrameIsCountedByTheSlavesFromThereOn) {
  EthercatRig rig(3);
  rig.bus.disturb({.corrupt = 1, .position = 1, .limit = 1});
  OneDatagram write(Command::bwr, of_first(al_control), {2, 0});
  EXPECT_EQ(rig.send(write).exit, Exit::lost);
  EXPECT_EQ(rig.stations[0]->passed.size(), 1U);  // before the corrupting slave the frame was good
  EXPECT_EQ(rig.stations[1]->passed.size(), 0U);
  const auto errors = [&](std::size_t station, std::uint16_t counter) {
    return rig.stations[station]->esc().read_register<std::uint8_t>(counter, rig.time);
  };
  EXPECT_EQ(errors(0, ethercat::reg::rx_errors), 0U);
  EXPECT_EQ(errors(1, ethercat::reg::rx_errors), 1U);
  EXPECT_EQ(errors(2, ethercat::reg::forwarded_rx_errors), 1U);
  EXPECT_EQ(rig.bus.counters().corrupted, 1U);
  EXPECT_EQ(rig.broadcast(), 3U);
}

TEST(EthercatDisturbance, WhatDoesNotComeToThePlaceIsNotCorrupted) {
  EthercatRig rig(3);
  rig.bus.set_cable(2, false);
  rig.bus.disturb({.corrupt = 1, .position = 2});
  EXPECT_EQ(rig.broadcast(), 2U);
  EXPECT_EQ(rig.bus.counters().corrupted, 0U);
  rig.bus.clear_disturbance();
  rig.bus.set_cable(2, true);
  EXPECT_EQ(rig.broadcast(), 3U);
}

TEST(EthercatDisturbance, ADelayedFrameSaysByHowMuch) {
  EthercatRig rig(2, {100ns, 50ns});
  rig.bus.disturb({.delay = 1, .delay_time = 3ms});
  OneDatagram frame(Command::brd, 0, Bytes(2));
  const auto passage = rig.send(frame);
  EXPECT_EQ(passage.delay, 3ms);
  EXPECT_EQ(passage.leaves, rig.time + 300ns + 3ms);
  EXPECT_EQ(rig.bus.counters().delayed, 1U);
}

// ---- Observers ----

struct Watcher final : EthercatObserver {
  struct Seen {
    Bytes bytes;
    Direction direction;
    Time at;
  };
  void on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation /*encapsulation*/,
                Direction direction, Time at) override {
    seen.push_back({Bytes(bytes.begin(), bytes.end()), direction, at});
  }
  std::vector<Seen> seen;
};

TEST(EthercatBus, ObserversSeeFramesAsTheyComeAndAsTheyGoBack) {
  EthercatRig rig(1, {100ns, 50ns});
  Watcher watcher;
  rig.bus.add_observer(watcher);
  OneDatagram frame(Command::brd, 0, Bytes(2));
  const Bytes sent(frame.bytes.begin(), frame.bytes.end());
  rig.send(frame);
  ASSERT_EQ(watcher.seen.size(), 2U);
  EXPECT_EQ(watcher.seen[0].bytes, sent);
  EXPECT_EQ(watcher.seen[0].direction, EthercatObserver::Direction::in);
  EXPECT_EQ(watcher.seen[0].at, rig.time);
  EXPECT_EQ(watcher.seen[1].bytes, Bytes(frame.bytes.begin(), frame.bytes.end()));
  EXPECT_NE(watcher.seen[1].bytes, sent);
  EXPECT_EQ(watcher.seen[1].at, rig.time + 150ns);
  rig.bus.set_cable(0, false);
  rig.broadcast();
  EXPECT_EQ(watcher.seen.size(), 3U);  // a lost frame does not come back
  rig.bus.remove_observer(watcher);
  rig.broadcast();
  EXPECT_EQ(watcher.seen.size(), 3U);
}

}  // namespace
}  // namespace ethercat_bus_test
}  // namespace servodrome::links
