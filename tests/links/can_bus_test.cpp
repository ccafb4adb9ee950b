#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <stdexcept>
#include <string>
#include <vector>

#include "links/can/bus.hpp"
#include "links/can/frame_length.hpp"
#include "links/can/memory_port.hpp"

namespace servodrome::links {
namespace can_bus_test {
namespace {

using canopen::Frame;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

Frame make(std::uint32_t id, std::initializer_list<std::uint8_t> bytes = {}) {
  Frame frame;
  frame.id = id;
  frame.length = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

struct Node : Receiver {
  std::vector<TimedFrame> received;
  std::vector<TimedFrame> sent;
  std::vector<std::uint32_t> tags;
  std::vector<std::pair<ErrorState, Time>> states;
  std::function<void(const Frame&, Time)> answer;

  void on_frame(const Frame& frame, Time at) override {
    received.push_back({frame, at});
    if (answer) answer(frame, at);
  }
  void on_sent(const Frame& frame, std::uint32_t tag, Time at) override {
    sent.push_back({frame, at});
    tags.push_back(tag);
  }
  void on_error_state(ErrorState state, Time at) override { states.emplace_back(state, at); }

  std::vector<std::uint32_t> ids() const {
    std::vector<std::uint32_t> result;
    for (const auto& entry : received) result.push_back(entry.frame.id);
    return result;
  }
};

struct Recorder : BusObserver {
  std::vector<BusEvent> events;
  void on_bus_event(const BusEvent& event) override { events.push_back(event); }
};

Time bits(std::uint64_t count, std::uint32_t bit_rate) {
  return Time(static_cast<std::int64_t>(count * 1'000'000'000U / bit_rate));
}

struct CanBusTest : testing::Test {
  CanBus bus{BusConfig{.bit_rate = 500'000}};
  Node a, b, c;
  PortId pa = bus.attach(a);
  PortId pb = bus.attach(b);
  PortId pc = bus.attach(c);
};

TEST_F(CanBusTest, DeliversAtTheEndOfTheFrameToAllOthers) {
  const Frame frame = make(0x123, {0x11, 0x22});  // 62 bits
  EXPECT_EQ(bus.next_event(), never);
  ASSERT_TRUE(bus.transmit(pa, frame, microseconds(100), 7));
  EXPECT_EQ(bus.next_event(), microseconds(100));
  bus.advance(microseconds(223));
  EXPECT_TRUE(b.received.empty());
  EXPECT_EQ(bus.next_event(), microseconds(100 + 62 * 2));
  bus.advance(microseconds(224));
  ASSERT_EQ(b.received.size(), 1U);
  EXPECT_EQ(b.received[0].frame, frame);
  EXPECT_EQ(b.received[0].at, microseconds(224));
  EXPECT_EQ(c.received.size(), 1U);
  EXPECT_TRUE(a.received.empty());
  ASSERT_EQ(a.sent.size(), 1U);
  EXPECT_EQ(a.tags[0], 7U);
  EXPECT_EQ(bus.counters().frames, 1U);
  EXPECT_EQ(bus.counters().bits, 65U);
  EXPECT_EQ(bus.counters(pa).sent, 1U);
  EXPECT_EQ(bus.counters(pb).received, 1U);
}

TEST_F(CanBusTest, OneAdvanceOrManyMakesNoDifference) {
  const auto run = [](Time step) {
    CanBus line(BusConfig{.bit_rate = 250'000});
    Node master, drive;
    const PortId m = line.attach(master);
    const PortId d = line.attach(drive);
    drive.answer = [&](const Frame& frame, Time at) { line.transmit(d, make(frame.id + 1, {1, 2, 3}), at); };
    line.disturb({.drop = 0.1, .delay = 0.2, .corrupt = 0.2, .delay_time = microseconds(700), .seed = 5});
    for (int i = 0; i < 50; ++i)
      line.transmit(m, make(0x200 + static_cast<std::uint32_t>(i) * 2), microseconds(i * 300));
    if (step == Time{}) {
      line.advance(seconds(1));
    } else {
      for (Time now{}; now <= seconds(1); now += step) line.advance(now);
    }
    std::vector<std::pair<std::uint32_t, Time>> log;
    for (const auto& entry : master.received) log.emplace_back(entry.frame.id, entry.at);
    for (const auto& entry : drive.received) log.emplace_back(entry.frame.id, entry.at);
    return log;
  };
  const auto whole = run(Time{});
  EXPECT_GT(whole.size(), 50U);
  EXPECT_EQ(whole, run(microseconds(50)));
  EXPECT_EQ(whole, run(microseconds(62) + Time(500)));
}

TEST_F(CanBusTest, ArbitratesByIdentifierAmongFramesPendingWhenTheWireFallsIdle) {
  Node d;
  bus.attach(d);
  Frame extended = make(0x100U << 18U);
  extended.extended = true;
  Frame remote = make(0x100);
  remote.remote = true;
  bus.transmit(pa, make(0x500), Time{});  // the only frame: it is sent first, whatever its identifier
  bus.transmit(pb, make(0x300), microseconds(10));
  bus.transmit(pa, extended, microseconds(20));
  bus.transmit(pc, remote, microseconds(30));
  bus.transmit(pc, make(0x001), microseconds(31));  // waits behind the remote frame in its own mailbox
  bus.transmit(pb, make(0x100), seconds(1));        // ready too late
  bus.advance(seconds(2));
  ASSERT_EQ(d.received.size(), 6U);
  EXPECT_EQ(d.ids(), (std::vector<std::uint32_t>{0x500, 0x100, 0x001, 0x100U << 18U, 0x300, 0x100}));
  EXPECT_TRUE(d.received[1].frame.remote);
  // Frames follow each other with three bits in between.
  for (std::size_t i = 1; i < 5; ++i) {
    const unsigned length = frame_length_bits(d.received[i].frame);
    EXPECT_EQ(d.received[i].at - d.received[i - 1].at, bits(length + 3, 500'000)) << i;
  }
}

TEST_F(CanBusTest, AnswersQueuedDuringDeliveryCompeteForTheNextStart) {
  b.answer = [&](const Frame& frame, Time at) {
    if (frame.id == 0x80) bus.transmit(pb, make(0x182), at);
  };
  c.answer = [&](const Frame& frame, Time at) {
    if (frame.id == 0x80) bus.transmit(pc, make(0x181), at);
  };
  bus.transmit(pa, make(0x080), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(a.ids(), (std::vector<std::uint32_t>{0x181, 0x182}));
}

TEST_F(CanBusTest, QueueIsBoundedAndCounted) {
  CanBus small;
  Node sender, other;
  const PortId port = small.attach(sender, 4);
  small.attach(other);
  int taken = 0;
  for (std::uint32_t i = 0; i < 10; ++i) taken += small.transmit(port, make(i), Time{}) ? 1 : 0;
  EXPECT_EQ(taken, 4);
  EXPECT_EQ(small.counters(port).refused, 6U);
  EXPECT_EQ(small.queue_space(port), 0U);
  small.advance(seconds(1));
  EXPECT_EQ(other.ids(), (std::vector<std::uint32_t>{0, 1, 2, 3}));
  EXPECT_EQ(small.pending(port), 0U);
}

TEST_F(CanBusTest, RefusesWhatIsNoFrame) {
  EXPECT_FALSE(bus.transmit(pa, make(0x800), Time{}));
  Frame nine = make(1);
  nine.length = 9;
  EXPECT_FALSE(bus.transmit(pa, nine, Time{}));
  Frame wide = make(0x20000000);
  wide.extended = true;
  EXPECT_FALSE(bus.transmit(pa, wide, Time{}));
  EXPECT_EQ(bus.counters(pa).refused, 3U);
}

TEST_F(CanBusTest, LoadIsTheBusyShareOfTheLastSecond) {
  // 109 + 3 bits at 500 kbit/s take 224 us; one frame every millisecond is 22.4 %.
  const Frame frame = make(0x555, {0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55, 0x55});
  for (int ms = 0; ms < 2000; ++ms) {
    bus.transmit(pa, frame, milliseconds(ms));
    bus.advance(milliseconds(ms + 1));
    if (ms == 499) {
      EXPECT_NEAR(bus.load_percent(milliseconds(500)), 11.2, 1e-9);
    }
  }
  EXPECT_NEAR(bus.load_percent(seconds(2)), 22.4, 1e-9);
  bus.advance(seconds(10));
  EXPECT_EQ(bus.load_percent(seconds(10)), 0.0);
}

TEST_F(CanBusTest, SaturatedWireIsFullyLoaded) {
  a.answer = [&](const Frame& frame, Time at) { bus.transmit(pa, frame, at); };
  b.answer = [&](const Frame& frame, Time at) { bus.transmit(pb, frame, at); };
  bus.transmit(pa, make(0x101, {1}), Time{});
  bus.advance(seconds(2));
  EXPECT_NEAR(bus.load_percent(seconds(2)), 100.0, 1e-6);
}

TEST_F(CanBusTest, BitRateScalesTime) {
  for (const std::uint32_t rate : {10'000U, 20'000U, 50'000U, 125'000U, 250'000U, 800'000U, 1'000'000U}) {
    CanBus line(BusConfig{.bit_rate = rate});
    Node sender, other;
    const PortId port = line.attach(sender);
    line.attach(other);
    line.transmit(port, make(0x123, {0x11, 0x22}), Time{});
    line.advance(seconds(1));
    ASSERT_EQ(other.received.size(), 1U);
    EXPECT_EQ(other.received[0].at, bits(62, rate)) << rate;
  }
  EXPECT_THROW(CanBus(BusConfig{.bit_rate = 9'999}), std::invalid_argument);
  EXPECT_THROW(bus.set_bit_rate(1'000'001), std::invalid_argument);
}

TEST_F(CanBusTest, IdealBusTakesNoTime) {
  CanBus ideal(BusConfig{.ideal = true});
  Node master, drive;
  const PortId m = ideal.attach(master);
  const PortId d = ideal.attach(drive);
  drive.answer = [&](const Frame&, Time at) { ideal.transmit(d, make(0x581), at); };
  ideal.transmit(m, make(0x601), milliseconds(3));
  ideal.advance(milliseconds(3));
  ASSERT_EQ(master.received.size(), 1U);
  EXPECT_EQ(master.received[0].at, milliseconds(3));
  // No acknowledge is needed.
  ideal.detach(d);
  ideal.transmit(m, make(0x601), milliseconds(4));
  ideal.advance(milliseconds(4));
  EXPECT_EQ(master.sent.size(), 2U);
}

// --- faults

TEST_F(CanBusTest, EqualFramesAtOnceAreOneFrame) {
  bus.transmit(pa, make(0x80), Time{});
  bus.transmit(pb, make(0x80), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(c.received.size(), 1U);
  EXPECT_EQ(a.sent.size(), 1U);
  EXPECT_EQ(b.sent.size(), 1U);
  EXPECT_EQ(bus.counters().frames, 1U);
}

// Two nodes with the same identifier and different data break each other's frames until both are bus-off.
TEST_F(CanBusTest, TwoNodesWithOneIdentifierDriveEachOtherBusOff) {
  bus.set_automatic_recovery(pa, false);
  bus.set_automatic_recovery(pb, false);
  bus.transmit(pa, make(0x701, {0x00}), Time{});
  bus.transmit(pb, make(0x701, {0x05}), Time{});
  bus.advance(seconds(1));
  EXPECT_TRUE(c.received.empty());
  EXPECT_EQ(bus.error_state(pa), ErrorState::bus_off);
  EXPECT_EQ(bus.error_state(pb), ErrorState::bus_off);
  EXPECT_EQ(bus.counters().collisions, 32U);  // 256 / 8
  EXPECT_EQ(bus.counters().errors, 32U);
  EXPECT_EQ(bus.counters(pc).receive_errors, 32U);
  EXPECT_EQ(bus.counters(pa).discarded, 1U);
  ASSERT_EQ(a.states.size(), 2U);
  EXPECT_EQ(a.states[0].first, ErrorState::passive);
  EXPECT_EQ(a.states[1].first, ErrorState::bus_off);
  EXPECT_FALSE(bus.transmit(pa, make(0x701), seconds(1)));
}

TEST_F(CanBusTest, CorruptedFrameIsRepeatedAndCounted) {
  Recorder recorder;
  bus.add_observer(recorder);
  bus.disturb({.corrupt = 1.0, .seed = 9, .limit = 3});
  const Frame frame = make(0x123, {0x11, 0x22});
  bus.transmit(pa, frame, Time{});
  bus.advance(seconds(1));
  ASSERT_EQ(b.received.size(), 1U);
  EXPECT_EQ(bus.counters().errors, 3U);
  EXPECT_EQ(bus.counters().corrupted, 3U);
  EXPECT_EQ(bus.counters(pa).errors, 3U);
  EXPECT_EQ(bus.counters(pa).transmit_errors, 3 * 8 - 1);
  EXPECT_EQ(bus.counters(pb).receive_errors, 3 - 1);
  ASSERT_EQ(recorder.events.size(), 4U);
  Time idle{};
  for (std::size_t i = 0; i < 3; ++i) {
    const BusEvent& event = recorder.events[i];
    EXPECT_EQ(event.kind, BusEvent::Kind::error);
    EXPECT_EQ(event.start, idle);
    EXPECT_GE(event.end - event.start, bits(20, 500'000));
    EXPECT_LT(event.end - event.start, bits(62 + 20, 500'000));
    idle = event.end + bits(3, 500'000);
  }
  EXPECT_EQ(recorder.events[3].kind, BusEvent::Kind::frame);
  EXPECT_EQ(recorder.events[3].start, idle);
}

TEST_F(CanBusTest, PersistentCorruptionLeadsToBusOffAndRecoversAfter128Times11Bits) {
  bus.disturb({.corrupt = 1.0, .seed = 2});
  bus.transmit(pa, make(0x123), Time{});
  bus.transmit(pa, make(0x124), Time{});
  bus.advance(milliseconds(10));
  ASSERT_EQ(a.states.size(), 3U);
  EXPECT_EQ(a.states[1].first, ErrorState::bus_off);
  EXPECT_EQ(a.states[2].first, ErrorState::active);
  EXPECT_EQ(a.states[2].second - a.states[1].second, bits(128 * 11, 500'000));
  EXPECT_EQ(bus.counters(pa).bus_off_count, 1U);
  EXPECT_EQ(bus.counters(pa).discarded, 2U);
  EXPECT_EQ(bus.counters().errors, 32U);
  bus.clear_disturbance();
  EXPECT_TRUE(bus.transmit(pa, make(0x125), milliseconds(10)));
  bus.advance(milliseconds(20));
  EXPECT_EQ(b.ids(), std::vector<std::uint32_t>{0x125});
}

TEST_F(CanBusTest, RecoveryOnRequest) {
  bus.set_automatic_recovery(pa, false);
  bus.disturb({.corrupt = 1.0});
  bus.transmit(pa, make(0x123), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(bus.error_state(pa), ErrorState::bus_off);
  bus.recover(pa, seconds(2));
  EXPECT_EQ(bus.next_event(), seconds(2) + bits(1408, 500'000));
  bus.advance(seconds(3));
  EXPECT_EQ(bus.error_state(pa), ErrorState::active);
  EXPECT_EQ(bus.counters(pa).transmit_errors, 0);
}

// An error passive sender waits 8 bits more before its next frame, so other nodes may send first.
TEST_F(CanBusTest, ErrorPassiveSenderSuspendsTransmission) {
  bus.disturb({.corrupt = 1.0, .limit = 16});  // 16 x 8 = 128: passive
  bus.transmit(pa, make(0x010), Time{});
  bus.transmit(pa, make(0x020), Time{});
  while (bus.counters(pa).sent == 0) bus.advance(bus.next_event());
  EXPECT_EQ(bus.counters(pa).transmit_errors, 127);  // active again after the first success
  EXPECT_EQ(a.states.back().first, ErrorState::active);
  // From the error that made it passive to the repetition: 3 + 8 bits.
  ASSERT_EQ(a.states.size(), 2U);
  const Time repetition = a.sent[0].at - bits(frame_length_bits(make(0x010)), 500'000);
  EXPECT_EQ(repetition - a.states[0].second, bits(11, 500'000));
}

TEST_F(CanBusTest, DropReachesNobodyYetIsAcknowledged) {
  bus.disturb({.drop = 1.0, .id = 0x701, .id_mask = 0x7FF});
  bus.transmit(pa, make(0x701), Time{});
  bus.transmit(pa, make(0x702), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(b.ids(), std::vector<std::uint32_t>{0x702});
  EXPECT_EQ(a.sent.size(), 2U);
  EXPECT_EQ(bus.counters().dropped, 1U);
}

TEST_F(CanBusTest, DelayHoldsAFrameAndWhatIsBehindIt) {
  bus.disturb({.delay = 1.0, .delay_time = milliseconds(5), .port = static_cast<std::uint16_t>(pa), .limit = 1});
  bus.transmit(pa, make(0x101), Time{});
  bus.transmit(pa, make(0x102), Time{});
  bus.transmit(pb, make(0x103), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(c.ids(), (std::vector<std::uint32_t>{0x103, 0x101, 0x102}));
  EXPECT_EQ(c.received[1].at, milliseconds(5) + bits(frame_length_bits(make(0x101)), 500'000));
}

TEST_F(CanBusTest, DelayedFramesWaitNoLongerThanTheDisturbance) {
  bus.disturb({.delay = 1.0, .delay_time = seconds(60)});
  bus.transmit(pa, make(0x101), Time{});
  bus.transmit(pa, make(0x102), Time{});
  bus.advance(seconds(1));
  EXPECT_TRUE(c.received.empty());
  bus.clear_disturbance();
  bus.advance(seconds(2));
  ASSERT_EQ(c.ids(), (std::vector<std::uint32_t>{0x101, 0x102}));
  EXPECT_EQ(c.received[0].at, seconds(1) + bits(frame_length_bits(make(0x101)), 500'000));

  bus.disturb({.delay = 1.0, .delay_time = seconds(60)});
  bus.transmit(pa, make(0x103), seconds(2));
  bus.disturb({.drop = 1.0, .id = 0x7FF, .id_mask = 0x7FF});
  bus.advance(seconds(3));
  EXPECT_EQ(c.received.size(), 3U);
}

TEST_F(CanBusTest, EqualSeedsDisturbEqually) {
  const auto run = [](std::uint64_t seed, double corrupt) {
    CanBus line;
    Node sender, other;
    const PortId port = line.attach(sender, 1000);
    line.attach(other);
    line.disturb({.drop = 0.2, .corrupt = corrupt, .seed = seed});
    for (std::uint32_t i = 0; i < 500; ++i) line.transmit(port, make(i), Time{});
    line.advance(seconds(10));
    return std::pair(other.ids(), line.counters());
  };
  const auto one = run(1, 0.01);
  EXPECT_EQ(one.first, run(1, 0.01).first);
  EXPECT_NE(one.first, run(2, 0.01).first);
  EXPECT_EQ(run(1, 0.0).second.dropped + run(1, 0.0).first.size(), 500U);
  EXPECT_NEAR(static_cast<double>(run(1, 0.0).second.dropped), 100.0, 40.0);
  EXPECT_GT(one.second.corrupted, 0U);
}

// Without acknowledge a port becomes error passive after 16 attempts, but not bus-off. The frame is sent when the cable
// is connected again.
TEST_F(CanBusTest, LoneSenderKeepsItsFrame) {
  bus.cut(pa, true);
  EXPECT_TRUE(bus.is_cut(pa));
  bus.transmit(pa, make(0x701, {0}), Time{});
  bus.transmit(pb, make(0x702, {0}), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(bus.counters(pa).transmit_errors, 128);
  EXPECT_EQ(bus.error_state(pa), ErrorState::passive);
  EXPECT_EQ(bus.next_event(), never);
  EXPECT_EQ(c.ids(), std::vector<std::uint32_t>{0x702});
  EXPECT_TRUE(a.received.empty());
  bus.cut(pa, false);
  bus.advance(seconds(2));
  EXPECT_EQ(c.ids(), (std::vector<std::uint32_t>{0x702, 0x701}));
  EXPECT_EQ(c.received[1].at, seconds(1) + bits(frame_length_bits(make(0x701, {0})), 500'000));
  EXPECT_EQ(bus.error_state(pa), ErrorState::active);  // 127
}

TEST_F(CanBusTest, CutBusPassesNothing) {
  bus.cut_bus(true);
  bus.transmit(pa, make(0x1), Time{});
  bus.transmit(pb, make(0x2), Time{});
  bus.advance(seconds(1));
  EXPECT_TRUE(a.received.empty() && b.received.empty() && c.received.empty());
  EXPECT_EQ(bus.counters().frames, 0U);
  bus.cut_bus(false);
  bus.advance(seconds(2));
  EXPECT_EQ(c.ids(), (std::vector<std::uint32_t>{0x1, 0x2}));
}

TEST_F(CanBusTest, CutInTheMiddleOfAFrameBreaksIt) {
  bus.transmit(pa, make(0x123, {0x11, 0x22}), Time{});
  bus.advance(microseconds(50));
  bus.cut(pa, true);
  bus.advance(milliseconds(1));
  EXPECT_TRUE(b.received.empty());
  EXPECT_EQ(bus.counters().errors, 1U);
  EXPECT_EQ(bus.counters(pb).receive_errors, 1);
  bus.cut(pa, false);
  bus.advance(seconds(1));
  EXPECT_EQ(b.received.size(), 1U);
}

TEST_F(CanBusTest, WrongBitRateNeitherSendsNorReceives) {
  bus.set_port_bit_rate(pb, 250'000);
  bus.transmit(pa, make(0x1), Time{});
  bus.transmit(pb, make(0x2), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(c.ids(), std::vector<std::uint32_t>{0x1});
  EXPECT_TRUE(b.received.empty());
  EXPECT_EQ(bus.error_state(pb), ErrorState::passive);
  bus.set_bit_rate(250'000);
  bus.advance(seconds(2));
  EXPECT_EQ(c.ids(), (std::vector<std::uint32_t>{0x1, 0x2}));
}

TEST_F(CanBusTest, PortThatIsOffDoesNotAcknowledge) {
  bus.set_participation(pb, Participation::off);
  bus.set_participation(pc, Participation::listen_only);
  bus.transmit(pa, make(0x1), Time{});
  EXPECT_FALSE(bus.transmit(pb, make(0x2), Time{}));
  EXPECT_FALSE(bus.transmit(pc, make(0x2), Time{}));
  bus.advance(milliseconds(100));
  EXPECT_TRUE(c.received.empty());
  bus.set_participation(pb, Participation::normal);
  bus.advance(milliseconds(200));
  EXPECT_EQ(c.received.size(), 1U);  // the listen-only port receives now that another port acknowledges
  // `off` resets the controller.
  bus.cut_bus(true);
  bus.transmit(pa, make(0x3), milliseconds(200));
  bus.advance(milliseconds(300));
  EXPECT_EQ(bus.error_state(pa), ErrorState::passive);
  bus.set_participation(pa, Participation::off);
  EXPECT_EQ(bus.error_state(pa), ErrorState::active);
  EXPECT_EQ(bus.pending(pa), 0U);
  EXPECT_EQ(bus.counters(pa).discarded, 1U);
}

TEST_F(CanBusTest, AdvanceFromAReceiverIsAnError) {
  b.answer = [&](const Frame&, Time at) { bus.advance(at); };
  bus.transmit(pa, make(0x1), Time{});
  EXPECT_THROW(bus.advance(seconds(1)), std::logic_error);
  b.answer = nullptr;
  bus.transmit(pa, make(0x2), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(b.ids(), (std::vector<std::uint32_t>{0x1, 0x2}));
}

TEST(MemoryPort, KeepsABoundedInbox) {
  CanBus bus;
  MemoryPort master(bus, 3);
  Node drive;
  const PortId port = bus.attach(drive);
  for (std::uint32_t i = 0; i < 5; ++i) bus.transmit(port, make(i), Time{});
  bus.advance(seconds(1));
  EXPECT_EQ(master.waiting(), 3U);
  EXPECT_EQ(master.dropped(), 2U);
  for (std::uint32_t i = 0; i < 3; ++i) EXPECT_EQ(master.receive()->frame.id, i);
  EXPECT_FALSE(master.receive());
  EXPECT_TRUE(master.send(make(0x99), seconds(1)));
  bus.advance(seconds(2));
  EXPECT_EQ(drive.ids(), std::vector<std::uint32_t>{0x99});
}

}  // namespace
}  // namespace can_bus_test
}  // namespace servodrome::links
