// Distributed clocks: the master's start-up, and the deviation between the clocks. Prints the figures.
#include <gmock/gmock.h>
#include <map>

#include "ethercat_line.hpp"
#include "master/ethercat/coe_objects.hpp"

namespace servodrome::master::test {
namespace ethercat_master_clock_test {
namespace {

using testing::HasSubstr;

constexpr std::int32_t largest_ppb = 100'000;

// Oscillators from -100 to +100 ppm, including both limits; the slaves are switched on one after the other.
void spread(EthercatLine& line) {
  std::uint32_t seed = 7;
  std::size_t i = 0;
  for (EthercatDevice& device : line.devices) {
    line.advance(line.now + Time{1'234'567});
    line.segment->set_powered(i, true, line.now);
    seed = seed * 1664525U + 1013904223U;
    const auto random = static_cast<std::int32_t>((seed >> 4) % (2 * largest_ppb)) - largest_ppb;
    device.esc.clock().set_oscillator(i == 1 ? largest_ppb : i == 2 ? -largest_ppb : random, line.now);
    device.slave.start(line.now);
    ++i;
  }
}

std::int64_t worst_difference(EthercatLine& line) {
  std::int64_t worst = 0;
  const std::uint64_t reference = line.devices.front().esc.clock().system_time(line.now);
  for (const EthercatDevice& device : line.devices) {
    const auto difference = static_cast<std::int64_t>(device.esc.clock().system_time(line.now) - reference);
    worst = std::max(worst, std::abs(difference));
  }
  return worst;
}

OperationOptions options_with_clocks(Time period = 1ms) {
  return {.cyclic = {.period = period}, .distributed_clocks = true, .clock = {.epoch = 700'000'000'000'000'000}};
}

// The receive times have 32 bits; between the times of two ports their highest bit may change, or all bits.
TEST(Clocks, TheDelayDoesNotDependOnTheLocalTime) {
  const auto delays = [](std::optional<std::uint32_t> middle, std::uint32_t& middle_found) {
    EthercatLine line({.slaves = 3, .hop = 5us});
    line.open();
    if (middle) line.devices.front().esc.jump_clock(Time{*middle - middle_found}, line.now);
    DistributedClocks clocks(*line.master, line.found);
    clocks.start({.measurements = 1, .drift_frames = 0});
    const std::uint16_t station = line.found.front().station;
    const auto first = line.master->read<std::uint32_t>(station, ethercat::reg::receive_time_port);
    const auto second = line.master->read<std::uint32_t>(station, ethercat::reg::receive_time_port + 4);
    middle_found = first + (second - first) / 2;
    return std::pair{clocks.delay_ns(line.found[1].station), clocks.delay_ns(line.found[2].station)};
  };
  std::uint32_t usual = 0;
  const auto expected = delays({}, usual);
  EXPECT_GT(expected.first, 4000U);
  for (const std::uint32_t middle : {0x80000000U, 0U}) {
    std::uint32_t found = usual;
    EXPECT_EQ(delays(middle, found), expected) << middle;
    EXPECT_EQ(found, middle);
  }
}

struct Case {
  std::size_t slaves;
  Time hop;
};
void PrintTo(const Case& one, std::ostream* out) { *out << one.slaves << " slaves, " << one.hop.count() << " ns"; }

class ClockAcceptance : public testing::TestWithParam<Case> {};

INSTANTIATE_TEST_SUITE_P(Lines, ClockAcceptance,
                         testing::Values(Case{1, 400ns}, Case{8, 400ns}, Case{8, 1337ns}, Case{64, 713ns}));

// Acceptance: for 10 s of 1 ms cycles after the start-up, every clock is within 100 ns of the reference; measured each
// millisecond, just before the next frame.
TEST_P(ClockAcceptance, EverySlaveWithin100nsOfTheReferenceFor10s) {
  const Case& one = GetParam();
  EthercatLine line({.slaves = one.slaves, .hop = one.hop});
  spread(line);
  const auto all = line.open();
  EthercatOperation operation(*line.master, line.found, all, options_with_clocks());
  // The delays must be those of the segment, except for the oscillators' error over the round trip.
  for (std::size_t i = 0; i < one.slaves; ++i) {
    const auto delay = static_cast<double>(operation.clocks()->delay_ns(all[i]->station()));
    EXPECT_NEAR(delay, static_cast<double>(one.hop.count()) * static_cast<double>(i), 20.0);
  }
  std::int64_t worst = 0;
  for (int i = 0; i < 10'000; ++i) {
    line.master->wait(1ms);
    worst = std::max(worst, worst_difference(line));
  }
  EXPECT_LE(worst, 100);
  operation.exchange().check();
  EXPECT_EQ(operation.exchange().statistics().wrong_counters, 0U);
  EXPECT_EQ(operation.exchange().statistics().lost, 0U);
  EXPECT_LT(std::abs(operation.exchange().clock_error().count()), 10'000);
  std::printf("%zu slaves, %lld ns per hop: at most %lld ns from the reference in 10 s\n", one.slaves,
              static_cast<long long>(one.hop.count()), static_cast<long long>(worst));
}

TEST(EthercatClocks, Sync0OfAllSlavesAtTheSameTimeAndSteady) {
  constexpr std::size_t slaves = 16;
  EthercatLine line({.slaves = slaves, .hop = 450ns});
  spread(line);
  const auto all = line.open();
  EthercatOperation operation(*line.master, line.found, all, options_with_clocks());
  for (EthercatDevice& device : line.devices) device.events.sync_times.clear();
  const std::uint64_t before = line.devices.front().esc.clock().sync(0).last;
  line.master->wait(2s);
  // For each pulse: the time between the first and the last slave; and for each slave the time between pulses, where
  // the reference's own error is known.
  Time widest{0};
  Time jitter{0};
  const auto& reference = line.devices.front().events.sync_times;
  ASSERT_GE(reference.size(), 1999U);
  for (std::size_t n = 0; n + 1 < reference.size(); ++n) {
    Time first = Time::max();
    Time last{0};
    for (const EthercatDevice& device : line.devices) {
      ASSERT_GT(device.events.sync_times.size(), n);
      const Time at = device.events.sync_times[n];
      first = std::min(first, at);
      last = std::max(last, at);
      if (n == 0) continue;
      const Time period = at - device.events.sync_times[n - 1];
      const Time reference_period = reference[n] - reference[n - 1];
      jitter = std::max(jitter, std::chrono::abs(period - reference_period));
    }
    widest = std::max(widest, last - first);
  }
  EXPECT_LE(widest, 100ns);
  EXPECT_LE(jitter, 100ns);
  EXPECT_NE(before, 0U);
  std::printf("SYNC0 of %zu slaves within %lld ns, from pulse to pulse within %lld ns\n", slaves,
              static_cast<long long>(widest.count()), static_cast<long long>(jitter.count()));
}

TEST(EthercatClocks, ShiftedPulsesAndFramesAtTheirPlace) {
  EthercatLine line({.slaves = 2});
  const auto all = line.open();
  OperationOptions options = options_with_clocks(2ms);
  options.sync0_shift = 300us;
  options.before_sync0 = 500us;
  EthercatOperation operation(*line.master, line.found, all, options);
  line.master->wait(200ms);
  for (const EthercatDevice& device : line.devices) {
    EXPECT_EQ(device.esc.clock().sync(0).last % 2'000'000, 300'000U);
    EXPECT_EQ(device.objects.communication.output_sync.sync0_cycle_time_ns, 2'000'000U);
  }
  // A cycle's frame passes 500 us before SYNC0.
  const std::uint64_t now = line.devices.front().esc.clock().system_time(operation.exchange().due());
  EXPECT_NEAR(static_cast<double>(now % 2'000'000), 1'800'000.0, 10'000.0);
}

// ETG.2000, CycleTimeSync0: a cycle of its own, or the master's times the factor; a negative factor divides.
TEST(EthercatClocks, Sync0HasTheCycleOfTheSlavesDcMode) {
  struct Row {
    std::uint32_t cycle_ns;
    std::int16_t factor;
    std::uint64_t sync0_cycle_ns;
  };
  for (const Row& one : {Row{0, 0, 2'000'000}, Row{0, 1, 2'000'000}, Row{0, 3, 6'000'000}, Row{0, -4, 500'000},
                         Row{1'000'000, 3, 1'000'000}}) {
    SCOPED_TRACE(testing::Message() << one.cycle_ns << " ns, factor " << one.factor);
    ethercat::DcMode mode = sync0_mode;
    mode.sync0_cycle_ns = one.cycle_ns;
    mode.sync0_factor = one.factor;
    EthercatLine line({.slaves = 1, .dc_mode = mode});
    const auto all = line.open();
    OperationOptions options = options_with_clocks(2ms);
    options.sync_error_limit = 0;  // not every SYNC0 has a frame
    EthercatOperation operation(*line.master, line.found, all, options);
    line.master->wait(200ms);
    EXPECT_EQ(line.device(0).esc.clock().sync(0).step, one.sync0_cycle_ns);
    EXPECT_EQ(line.device(0).objects.communication.output_sync.sync0_cycle_time_ns, one.sync0_cycle_ns);
    // The frame passes in the middle between two pulses.
    const std::uint64_t shortest = std::min<std::uint64_t>(one.sync0_cycle_ns, 2'000'000);
    const std::uint64_t at = line.device(0).esc.clock().system_time(operation.exchange().due());
    EXPECT_NEAR(static_cast<double>(at % shortest), static_cast<double>(shortest) / 2.0, 10'000.0);
  }
}

class LossOfSync : public testing::Test {
 protected:
  LossOfSync() {
    operation.emplace(*line.master, line.found, all, options_with_clocks());
    line.master->wait(5ms);  // do not count the first cycle in OP
  }
  void lose(int frames) {
    line.lost_out = [frames]() mutable { return frames-- > 0; };
    line.master->wait(50ms);
  }

  EthercatLine line{{.slaves = 3}};
  std::vector<EthercatSlave*> all = line.open();
  std::optional<EthercatOperation> operation;
};

// 10F1h sub 2 is 4: a cycle without outputs adds 3, a cycle with outputs subtracts 1.
TEST_F(LossOfSync, OneLostFrameIsBorneTwoInARowAreNot) {
  lose(1);
  operation->exchange().check();
  EXPECT_EQ(line.device(1).objects.communication.output_sync.events_missed, 1);
  lose(1);  // the first loss has been subtracted by now
  operation->exchange().check();
  lose(2);
  EXPECT_THAT(problem_of([&] { operation->exchange().check(); }),
              HasSubstr("it left OP: it is in SAFEOP with error 001Ah synchronization error; send outputs in every"));
  EXPECT_TRUE(line.device(1).objects.communication.output_sync.sync_error);
  // And back to OP.
  operation->exchange().to_operational();
  line.master->wait(20ms);
  operation->exchange().check();
}

TEST_F(LossOfSync, TheLimitIsTheMasters) {
  for (EthercatSlave* slave : all) slave->coe().write<std::uint16_t>(0x10F1, 2, 30);
  lose(10);
  operation->exchange().check();
  lose(11);
  EXPECT_THAT(problem_of([&] { operation->exchange().check(); }), HasSubstr("001Ah"));
}

TEST_F(LossOfSync, PulsesThatStopAreFatal) {
  operation->clocks()->stop_sync(all[1]->station());
  line.master->wait(20ms);
  EXPECT_THAT(problem_of([&] { operation->exchange().check(); }),
              HasSubstr("slave 2 (Test device): it left OP: it is in SAFEOP with error 002Ch"));
}

TEST(EthercatClocks, ASlaveSwitchedOffAndOnIsTakenUpAgain) {
  EthercatLine line({.slaves = 3});
  {
    const auto all = line.open();
    EthercatOperation operation(*line.master, line.found, all, options_with_clocks());
    line.segment->set_powered(1, false, line.now);
    line.master->wait(200ms);
    EXPECT_NE(problem_of([&] { operation.exchange().check(); }), "");
    line.segment->set_powered(1, true, line.now);
    line.device(1).slave.start(line.now);
  }
  line.slaves.clear();
  const auto all = line.open();
  ASSERT_EQ(all.size(), 3U);
  EthercatOperation operation(*line.master, line.found, all, options_with_clocks());
  line.master->wait(100ms);
  operation.exchange().check();
  EXPECT_LE(worst_difference(line), 100);
}

}  // namespace
}  // namespace ethercat_master_clock_test
}  // namespace servodrome::master::test
