// TPDOs on CAN for recordings, in virtual time: those that drives send to another master, and those that are set up and
// restored.
#include "studio/tpdo_recorder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <set>

#include "bus_of_rig.hpp"

namespace servodrome::studio {
namespace tpdo_recorder_test {
namespace {

using namespace std::chrono_literals;
using api::Taken;
using testing::Each;

constexpr master::ObjectAddress position{0x6064, 0};
constexpr master::PdoObject position_entry{position, 32};
constexpr master::PdoObject statusword_entry{{0x6041, 0}, 16};

double number_of(std::span<const std::byte> bytes) {
  std::int32_t value = 0;
  std::memcpy(&value, bytes.data(), std::min(bytes.size(), sizeof value));
  return value;
}

class TpdoRecorderTest : public testing::Test {
 protected:
  TpdoRecorderTest() {
    listening_ = rig_.can->listen([this](const canopen::Frame& frame) { heard_.hear(false, frame, rig_.line.now()); });
  }

  void begin() {
    const auto of = [](std::uint8_t node) {
      return master::CanDrive{
          .node_id = node, .tpdos = {{position_entry, statusword_entry}}, .sets_interpolation_time = false};
    };
    recorder_.begin(bus_, {{{0, of(1)}, {1, of(2)}}, 1ms, wanted_}, [this] { ++steps_; });
  }
  std::shared_ptr<BusSamples> sample(std::size_t drive, const Sampling& sampling) {
    begin_ = now() / 16 * 16 + 16;
    auto samples = std::make_shared<BusSamples>(drive, position, number_of, sampling, 16, begin_);
    sampling.by == Sampling::By::cycle ? cycle_.add({&samples, 1}) : heard_.add(samples);
    return samples;
  }
  std::int64_t now() const { return (rig_.line.now() - start_) / 62'500ns; }
  // How the rows of 100 ms were taken, from 10 ms on.
  std::vector<Taken> taken(BusSamples& samples) {
    samples.fetch(now() - 160);
    samples.fill(now() - 160, true);
    std::vector<Taken> taken;
    for (int i = 10; i < 110; ++i) taken.push_back(samples.taken(begin_ + 16 * i));
    return taken;
  }
  // Everything that is configured for the TPDOs of a drive.
  std::string tpdos(std::size_t drive) {
    std::string text;
    for (std::uint8_t number = 0; number < 4; ++number) {
      const auto pdo = master::read_pdo(rig_.objects(drive), true, number, 4);
      if (!pdo) break;
      text += fmt::format("{:X} {} ", pdo->cob_id, pdo->transmission_type);
      for (const auto& words : {pdo->mapping, pdo->unused}) {
        for (const std::uint32_t word : words) text += fmt::format("{:08X},", word);
      }
      text += "\n";
    }
    return text;
  }
  void wait(master::Time span) { rig_.objects().wait(span); }

  master::test::AxisRig rig_{{"generic402"}, 2};
  master::Time start_ = rig_.line.now();
  BusOfRig bus_{rig_, BusOfRig::Pace::virtual_time};
  CycleSampler cycle_{start_};
  HeardPdos heard_{start_};
  TpdoRecorder recorder_{cycle_, heard_};
  std::shared_ptr<void> wanted_ = std::make_shared<int>();
  master::Bus::Subscription listening_;
  std::int64_t begin_ = 0;
  int steps_ = 0;
};

TEST_F(TpdoRecorderTest, BothDrivesAreSampledAtEachSync) {
  begin();
  EXPECT_EQ(cycle_.period_of(1, position), 16);
  EXPECT_EQ(cycle_.period_of(1, {0x606C, 0}), std::nullopt);
  const auto first = sample(0, {.by = Sampling::By::cycle, .period = 16});
  const auto second = sample(1, {.by = Sampling::By::cycle, .period = 16});
  wait(150ms);
  EXPECT_THAT(taken(*first), Each(Taken::sampled));
  EXPECT_THAT(taken(*second), Each(Taken::sampled));
  EXPECT_FALSE(recorder_.is_over());
  EXPECT_GE(steps_, 16) << "others may use the bus between two TPDOs";
}

TEST_F(TpdoRecorderTest, TheTpdosAreRestoredAtTheEnd) {
  const std::string before[] = {tpdos(0), tpdos(1)};
  begin();
  EXPECT_NE(tpdos(0), before[0]);
  EXPECT_NE(tpdos(1), before[1]);
  wanted_.reset();
  EXPECT_TRUE(recorder_.is_over());
  recorder_.end();
  EXPECT_EQ(tpdos(0), before[0]);
  EXPECT_EQ(tpdos(1), before[1]);
  EXPECT_FALSE(recorder_.must_restore(0));
  EXPECT_EQ(cycle_.period_of(0, position), std::nullopt);
}

TEST_F(TpdoRecorderTest, ADriveThatWasAwayAtTheEndIsRestoredWhenItAnswers) {
  const std::string before = tpdos(0);
  begin();
  rig_.line.buses()[0]->bus.cut_bus(true);
  wait(300ms);
  EXPECT_TRUE(recorder_.is_over()) << "the TPDOs do not come any more";
  recorder_.end();
  ASSERT_TRUE(recorder_.must_restore(0));
  rig_.line.buses()[0]->bus.cut_bus(false);
  wait(100ms);
  EXPECT_NE(tpdos(0), before);
  recorder_.restore(bus_, 0, [] {});
  EXPECT_EQ(tpdos(0), before);
  EXPECT_FALSE(recorder_.must_restore(0));
}

TEST_F(TpdoRecorderTest, ADriveThatWasSwitchedOffKeepsItsOwnTpdos) {
  master::PdoParameters own = *master::read_pdo(rig_.objects(0), true, 0);
  own.transmission_type = 10;  // in the RAM only
  master::write_pdo(rig_.objects(0), own);
  begin();
  rig_.power_off(0);
  wait(300ms);
  recorder_.end();
  rig_.drive(0).power_on(rig_.line.now());
  wait(2s);
  const std::string fresh = tpdos(0);
  ASSERT_TRUE(recorder_.must_restore(0));
  recorder_.restore(bus_, 0, [] {});
  EXPECT_EQ(tpdos(0), fresh);
}

TEST_F(TpdoRecorderTest, TpdosForAnotherMasterAreTakenAsTheyArrive) {
  EXPECT_FALSE(heard_.use(rig_.line.now()).by_others);
  // Another master: an event timer of 1 ms, and the node started.
  master::PdoParameters pdo = *master::read_pdo(rig_.objects(1), true, 0);
  pdo.cob_id = 0x182;
  pdo.transmission_type = 255;
  pdo.mapping = {0x60410010, 0x60640020};
  pdo.unused.clear();
  master::write_pdo(rig_.objects(1), pdo);
  rig_.objects(1).write<std::uint16_t>(0x1800, 5, 1);
  master::Master(*rig_.can).command(master::NmtCommand::start, 2);
  const auto samples =
      sample(1, {.by = Sampling::By::pdo, .period = 16, .can_id = 0x182, .bits = {.first = 16, .count = 32}});
  wait(150ms);
  EXPECT_THAT(taken(*samples), Each(Taken::sampled));
  EXPECT_EQ(samples->at(begin_ + 800), rig_.objects(1).read<std::int32_t>(0x6064));
  const auto use = heard_.use(rig_.line.now());
  ASSERT_TRUE(use.by_others);
  EXPECT_EQ(use.by_others->node_id, 2);
  EXPECT_TRUE(heard_.is_sent(0x182, rig_.line.now()));
  EXPECT_FALSE(heard_.is_sent(0x181, rig_.line.now()));
  heard_.forget(rig_.line.now());
  EXPECT_FALSE(heard_.use(rig_.line.now()).by_others);
}

TEST_F(TpdoRecorderTest, SynchronousTpdosHaveTheTimeOfTheirSync) {
  auto samples =
      BusSamples(0, position, number_of,
                 {.by = Sampling::By::pdo, .period = 16, .can_id = 0x181, .bits = {0, 32}, .on_sync = true}, 16, 16);
  const std::shared_ptr<BusSamples> shared(&samples, [](BusSamples*) {});
  heard_.add(shared);
  canopen::Frame sync;
  sync.id = 0x80;
  canopen::Frame tpdo;
  tpdo.id = 0x181;
  tpdo.length = 4;
  for (int i = 1; i <= 20; ++i) {
    const master::Time at = start_ + i * 1ms;
    tpdo.data[0] = static_cast<std::uint8_t>(i);
    heard_.hear(false, sync, at);
    heard_.hear(false, tpdo, at + 900us);
  }
  samples.fetch(16 * 20 + 1);
  samples.fill(16 * 20 + 1, true);
  for (int i = 1; i <= 20; ++i) EXPECT_EQ(samples.at(16 * i), i);
  EXPECT_EQ(heard_.use(start_ + 21ms).sync_period, 1ms);
  heard_.forget(start_ + 21ms);
  EXPECT_EQ(heard_.use(start_ + 22ms).sync_period, std::nullopt) << "that was the SYNC of this program";
}

}  // namespace
}  // namespace tpdo_recorder_test
}  // namespace servodrome::studio
