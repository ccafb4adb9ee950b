// Values that the thread of a bus samples: the rows in which they stand, the rows between, and the missing ones.
#include "studio/bus_samples.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <set>

#include "axis/axis_rig.hpp"
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "studio/cycle_sampler.hpp"

namespace servodrome::studio {
namespace bus_samples_test {
namespace {

using namespace std::chrono_literals;
using api::Taken;
using testing::ElementsAre;
using testing::IsNan;

double number_of(std::span<const std::byte> bytes) {
  std::int32_t value = 0;
  std::memcpy(&value, bytes.data(), std::min(bytes.size(), sizeof value));
  return value;
}

void note(BusSamples& samples, std::int64_t tick, std::int32_t value) {
  samples.note(tick, std::as_bytes(std::span(&value, 1)));
}

void advance(BusSamples& samples, std::int64_t end, bool answers = true) {
  samples.fetch(end);
  samples.fill(end, answers);
}

std::vector<Taken> taken_until(BusSamples& samples, std::int64_t end) {
  advance(samples, end);
  std::vector<Taken> taken;
  for (std::int64_t tick = samples.stride(); tick < end; tick += samples.stride()) taken.push_back(samples.taken(tick));
  return taken;
}

TEST(BusSamplesTest, EachCycleHasItsRowAlthoughSomeAreLate) {
  BusSamples samples{0, {0x6064, 0}, number_of, {.by = Sampling::By::cycle, .period = 16}, 16, 16};
  // The cycles are due between two rows, where being late by a tick would change the nearest row.
  const std::int64_t late[] = {0, 1, 0, 2, 0, 3, 1};
  for (int i = 0; i < 7; ++i) note(samples, 16 + 7 + 16 * i + late[i], 100 + i);
  EXPECT_THAT(taken_until(samples, 113), testing::Each(Taken::sampled));
  for (int i = 0; i < 7; ++i) EXPECT_EQ(samples.at(16 + 16 * i), 100 + i);
}

TEST(BusSamplesTest, AMissingCycleIsCountedAndIsNoNumber) {
  BusSamples samples{0, {0x6064, 0}, number_of, {.by = Sampling::By::cycle, .period = 16}, 16, 16};
  for (const std::int64_t tick : {16, 32, 80}) note(samples, tick, 5);
  EXPECT_THAT(taken_until(samples, 97),
              ElementsAre(Taken::sampled, Taken::sampled, Taken::missed, Taken::missed, Taken::sampled, Taken::missed));
  EXPECT_THAT(samples.at(48), IsNan());
}

TEST(BusSamplesTest, RowsBetweenSlowerValuesHoldTheLastOne) {
  BusSamples samples{0, {0x6064, 0}, number_of, {.by = Sampling::By::reading, .period = 64}, 16, 16};
  note(samples, 16, 7);
  note(samples, 85, 8);  // late
  EXPECT_THAT(taken_until(samples, 113), ElementsAre(Taken::sampled, Taken::held, Taken::held, Taken::held,
                                                     Taken::sampled, Taken::held, Taken::held));
  EXPECT_EQ(samples.at(64), 7);
  EXPECT_EQ(samples.at(112), 8);
  advance(samples, 400);
  EXPECT_EQ(samples.at(160), 8) << "may be late by half a period";
  EXPECT_THAT(samples.at(192), IsNan());
  const auto missed = [&](std::int64_t tick) { return samples.taken(tick) == Taken::missed; };
  EXPECT_TRUE(missed(176));
  EXPECT_FALSE(missed(192)) << "one missed value is counted once";
  EXPECT_TRUE(missed(240));
}

// The thread of the bus may note values while the server fills rows.
TEST(BusSamplesTest, RowsAreFilledWithTheValuesThatWereFetched) {
  BusSamples samples{0, {0x6064, 0}, number_of, {.by = Sampling::By::cycle, .period = 16}, 16, 16};
  for (const std::int64_t tick : {16, 32, 48}) note(samples, tick, static_cast<std::int32_t>(tick));
  samples.fetch(33);
  note(samples, 64, 64);
  samples.fill(33, true);
  EXPECT_EQ(samples.due(), 48);
  for (const std::int64_t row : {16, 32}) EXPECT_EQ(samples.at(row), row);
  EXPECT_THAT(taken_until(samples, 65), testing::Each(Taken::sampled));
  for (const std::int64_t row : {48, 64}) EXPECT_EQ(samples.at(row), row);
}

TEST(BusSamplesTest, OfSeveralCyclesTheNearestToTheRowCounts) {
  BusSamples samples{0, {0x6064, 0}, number_of, {.by = Sampling::By::cycle, .period = 16}, 32, 32};
  for (std::int32_t tick = 16; tick <= 112; tick += 16) note(samples, tick, tick);
  EXPECT_THAT(taken_until(samples, 97), testing::Each(Taken::sampled));
  for (const std::int64_t row : {32, 64, 96}) EXPECT_EQ(samples.at(row), row);
}

TEST(BusSamplesTest, ADriveThatDoesNotAnswerHoldsNoValue) {
  BusSamples samples{0, {0x6064, 0}, number_of, {.by = Sampling::By::reading, .period = 160}, 16, 16};
  note(samples, 16, 7);
  advance(samples, 33);
  advance(samples, 65, false);
  EXPECT_EQ(samples.at(32), 7);
  EXPECT_THAT(samples.at(48), IsNan());
}

// Two EtherCAT drives in virtual time, with a cycle of 1 ms.
class CycleSamplerTest : public testing::Test {
 protected:
  CycleSamplerTest()
      : rig_({"generic402-ec", master::test::RigCase::BusKind::ethercat, "", 1ms}, 2),
        cycle_(*rig_.ethercat, *rig_.operation, {.stops_drives = false, .watches = true}),
        start_(rig_.line.now()),
        sampler_(start_),
        attached_(std::in_place, sampler_, &cycle_) {}

  std::shared_ptr<BusSamples> sample(std::size_t drive) {
    auto samples = std::make_shared<BusSamples>(drive, position, number_of, Sampling{Sampling::By::cycle, 16}, 16, 16);
    sampler_.add({&samples, 1});
    return samples;
  }
  // The end of the rows whose samples have arrived.
  std::int64_t end() const { return (rig_.line.now() - start_ - 1ms) / 62'500ns; }

  static constexpr master::ObjectAddress position{0x6064, 0};
  master::test::AxisRig rig_;
  master::EthercatCyclicBus cycle_;
  master::Time start_;
  CycleSampler sampler_;
  std::optional<CycleSampler::Attachment> attached_;
};

TEST_F(CycleSamplerTest, KnowsWhatIsMapped) {
  EXPECT_EQ(sampler_.period_of(1, position), 16);
  EXPECT_EQ(sampler_.period_of(1, {0x1018, 1}), std::nullopt);
  attached_.reset();
  EXPECT_EQ(sampler_.period_of(1, position), std::nullopt);
}

TEST_F(CycleSamplerTest, TakesTheInputsOfBothDrivesInEachCycle) {
  master::Axis402 axis(rig_.objects(1), rig_.options());
  axis.enable();
  axis.set_mode(master::OperationMode::profile_velocity);
  rig_.objects(1).write<std::int32_t>(0x60FF, 0, 100'000);
  rig_.objects(1).wait(300ms);
  const std::int64_t begin = end() / 16 * 16 + 32;
  const auto first = sample(0);
  const auto second = sample(1);
  rig_.objects(1).wait(200ms);
  advance(*first, end());
  advance(*second, end());
  std::set<double> positions;
  for (std::int64_t tick = begin; tick < begin + 16 * 180; tick += 16) {
    EXPECT_EQ(first->taken(tick), Taken::sampled) << tick;
    EXPECT_EQ(second->taken(tick), Taken::sampled) << tick;
    positions.insert(second->at(tick));
  }
  EXPECT_EQ(positions.size(), 180U) << "the axis moves: each cycle has another position";
}

TEST_F(CycleSamplerTest, CountsTheCyclesWithoutInputs) {
  const auto samples = sample(0);
  rig_.ethercat->wait(20ms);
  rig_.line.ethercat_buses()[0]->bus.disturb({.drop = 1.0});
  rig_.ethercat->wait(5ms);
  rig_.line.ethercat_buses()[0]->bus.disturb({});
  rig_.ethercat->wait(20ms);
  advance(*samples, end());
  int missed = 0;
  for (std::int64_t tick = 64; tick < end() / 16 * 16; tick += 16) missed += samples->taken(tick) == Taken::missed;
  EXPECT_EQ(missed, 5);
}

TEST_F(CycleSamplerTest, LeavesAnotherProgramOfTheCycleAlone) {
  master::EthercatCyclicBus other(*rig_.ethercat, *rig_.operation, {.stops_drives = false});
  int cycles = 0;
  other.on_cycle([&] { ++cycles; });
  rig_.ethercat->wait(10ms);
  attached_.reset();
  rig_.ethercat->wait(10ms);
  other.on_cycle({});
  EXPECT_GE(cycles, 19);
}

}  // namespace
}  // namespace bus_samples_test
}  // namespace servodrome::studio
