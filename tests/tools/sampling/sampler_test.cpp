// Samples of a moving axis must equal the values that its drive had at those times: every product on every bus it has,
// in virtual time. Afterwards the drives must be as before.
#include <deque>
#include <gmock/gmock.h>

#include "axis/axis_rig.hpp"
#include "master/forwarded_objects.hpp"
#include "tools/sampling/sampler_recorder.hpp"

namespace servodrome::master::sampling {
namespace sampler_test {
namespace {

using namespace std::chrono_literals;
using master::ForwardedObjects;
using master::test::AxisRig;
using master::test::problem_of;
using master::test::RigCase;
using testing::HasSubstr;

// Records an object's value in the drive, tick by tick.
class Truth final : public line::Follower {
 public:
  Truth(line::Line& line, ObjectAddress object) : line_(line), object_(object), next_(line.now() + line::tick_length) {
    line_.add_follower(*this);
  }
  ~Truth() { line_.remove_follower(*this); }
  Truth(const Truth&) = delete;
  Truth& operator=(const Truth&) = delete;

  line::Time next_deadline() const override { return next_; }
  void reached(line::Time now) override {
    next_ = now + line::tick_length;
    const auto& dictionary = line_.axes()[0]->device().dictionary();
    dictionary::AbortCode abort{};
    const dictionary::Entry* entry = dictionary.find(object_.index, object_.sub, abort);
    dictionary::ReadValue value;
    if (entry == nullptr || dictionary.read(*entry, value) != dictionary::AbortCode::none) return;
    values_.emplace_back(now, number_of(entry->type, value.bytes));
  }

  // True if the object had this value at a tick from `from` to `to`.
  bool had(double value, Time from, Time to) const {
    return std::any_of(values_.begin(), values_.end(),
                       [&](const auto& one) { return one.first >= from && one.first <= to && one.second == value; });
  }
  double last() const { return values_.back().second; }

 private:
  line::Line& line_;
  ObjectAddress object_;
  line::Time next_;
  std::deque<std::pair<Time, double>> values_;
};

class Sampling : public testing::TestWithParam<RigCase> {
 protected:
  Sampling() : rig(GetParam()) {
    if (!is_ethercat()) return;
    // The rig's own master would disturb the sampler.
    rig.clients.clear();
    rig.operation.reset();
    rig.clients.push_back(std::make_unique<CoeObjects>(*rig.slaves[0]));
  }

  bool is_ethercat() const { return rig.rig_case.bus == RigCase::BusKind::ethercat; }
  bool is_can() const { return rig.rig_case.bus == RigCase::BusKind::can; }
  std::vector<Channel> channels(std::initializer_list<const char*> names) {
    std::vector<Channel> list;
    for (const char* name : names) {
      Channel channel = named_channel(name, ObjectCatalogue::standard());
      if (channel.object == ObjectAddress{0x6064, 0}) channel.object = position_object();
      complete(channel, rig.objects());
      add_channel(list, channel);
    }
    return list;
  }
  std::unique_ptr<Sampler> open(std::vector<Channel> list, const SamplerOptions& options) {
    if (is_can()) return open_can_sampler(*rig.can, dynamic_cast<SdoClient&>(rig.objects()), std::move(list), options);
    if (is_ethercat()) {
      return open_ethercat_sampler(*rig.ethercat, rig.found, *rig.slaves[0], std::move(list), options);
    }
    return open_polled_sampler(rig.objects(), std::move(list), options);
  }
  // Tolerance between the time of a sample and the time of its value in the drive. Process data: the SYNC's time on the
  // bus; on EtherCAT the inputs may also be of the drive's previous cycle. Objects: the duration of the request.
  std::pair<Time, Time> tolerance() const {
    if (is_can()) return {125us, 500us};
    if (is_ethercat()) return {2100us, 200us};
    return {8ms, 8ms};
  }

  // Jitter of SYNC, which waits until the frames on the bus before it have been sent.
  Time on_grid() const { return is_can() ? Time(200us) : Time(0); }
  // The object of the position on this bus: an iSMK has no register for 6064h.
  ObjectAddress position_object() const {
    const bool has_internal_only =
        rig.rig_case.bus == RigCase::BusKind::modbus && std::string_view(rig.rig_case.product) == "ismk";
    return {static_cast<std::uint16_t>(has_internal_only ? 0x6063 : 0x6064), 0};
  }

  static scope::Recording record(Sampler& sampler, Time duration) {
    SamplerRecorder recorder(sampler, {.duration = duration});
    for (int i = 0; i < 1000 && !recorder.done(); ++i) sampler.objects().wait(5ms);
    EXPECT_TRUE(recorder.done());
    return recorder.recording();
  }

  // Reads communication and mapping of the PDOs.
  std::vector<std::string> pdo_set_up() {
    std::vector<std::string> all;
    const std::vector<std::uint16_t> indexes = is_ethercat()
                                                   ? std::vector<std::uint16_t>{0x1C12, 0x1C13, 0x1A00, 0x1A01, 0x1600}
                                                   : std::vector<std::uint16_t>{0x1800, 0x1801, 0x1802, 0x1803, 0x1A00,
                                                                                0x1A01, 0x1A02, 0x1A03, 0x1400, 0x1600};
    for (const std::uint16_t index : indexes) {
      for (std::uint8_t sub = 0; sub < 13; ++sub) {
        try {
          const auto bytes = rig.objects().upload({index, sub});
          all.push_back(fmt::format("{} = {}", text_of(ObjectAddress{index, sub}),
                                    text_of_value(bytes, dictionary::Type::octet_string)));
        } catch (const ObjectError&) {
          // The drive does not have it.
        }
      }
    }
    return all;
  }

  AxisRig rig;
};
INSTANTIATE_TEST_SUITE_P(Every, Sampling, testing::ValuesIn(master::test::every_product),
                         [](const auto& row) { return row.param.name(); });

// A velocity of about one revolution per second, in the drive's units.
std::int32_t moderate_velocity(Axis402& axis) {
  const auto units = axis.units();
  return units ? static_cast<std::int32_t>(units->velocity) : 131072;
}

TEST_P(Sampling, BringsWhatTheDriveHadAtThoseTimes) {
  const auto list = channels({"position", "statusword"});
  const auto before = pdo_set_up();
  {
    auto sampler = open(list, {.moves = true});
    if (is_can()) {
      EXPECT_EQ(sampler->way(), "TPDOs on SYNC") << sampler->remark();
      EXPECT_EQ(sampler->period(), 4ms);
    }
    if (is_ethercat()) {
      EXPECT_EQ(sampler->way(), "process data in OP") << sampler->remark();
      EXPECT_EQ(sampler->period(), 2ms);
    }
    Axis402 axis(sampler->objects(), rig.options());
    axis.enable();
    axis.run_at(moderate_velocity(axis), {}, 10s);
    const Truth position(rig.line, position_object());
    const Truth statusword(rig.line, {0x6041, 0});
    const Time begin = rig.line.now();
    SamplerRecorder recorder(*sampler, {.duration = 300ms});
    while (!recorder.done() && rig.line.now() < begin + 2s) {
      axis.status();  // uses the drive meanwhile
      sampler->objects().wait(5ms);
    }
    ASSERT_TRUE(recorder.done());
    const scope::Recording recording = recorder.recording();
    const auto [early, late] = tolerance();
    for (std::size_t row = 0; row < recording.rows(); ++row) {
      const Time at = recording.zero + recording.time(row, 0);
      EXPECT_TRUE(position.had(recording.value(row, 0), at - early, at + late))
          << "row " << row << " at " << at.count() << ": " << recording.value(row, 0);
      const Time word_at = recording.zero + recording.time(row, 1);
      EXPECT_TRUE(statusword.had(recording.value(row, 1), word_at - early, word_at + late)) << "row " << row;
      if (row != 0) {
        EXPECT_GT(recording.time(row, 0), recording.time(row - 1, 0));
        EXPECT_NE(recording.value(row, 0), recording.value(row - 1, 0)) << "it moves";
      }
    }
    if (recording.period > Time{0}) {
      EXPECT_EQ(recording.missed, 0U);
      EXPECT_EQ(recording.rows(), static_cast<std::size_t>(300ms / recording.period));
      for (std::size_t row = 0; row < recording.rows(); ++row) {
        const Time off = recording.time(row, 0) - recording.period * static_cast<std::int64_t>(row);
        EXPECT_LE(std::chrono::abs(off), on_grid()) << "row " << row;
      }
    } else {
      EXPECT_GT(recording.rows(), 10U);
    }
    std::printf("%s: %s, %.0f Hz\n", GetParam().name().c_str(), recording.way.c_str(), recording.rate_hz());
    axis.stop();
    axis.disable();
    sampler->close();
  }
  if (is_can() || is_ethercat()) {
    EXPECT_EQ(pdo_set_up(), before) << "PDOs are as they were";
  }
}

TEST_P(Sampling, OnlyLooksWhereNobodyMoves) {
  const auto list = channels({"position", "velocity", "statusword"});
  const auto before = pdo_set_up();
  auto sampler = open(list, {});
  if (is_ethercat()) {
    EXPECT_EQ(sampler->way(), "process data in SAFEOP") << sampler->remark();
    EXPECT_EQ(rig.slaves[0]->status().state(), ethercat::AlState::safe_operational);
  }
  const scope::Recording recording = record(*sampler, 50ms);
  EXPECT_GT(recording.rows(), 1U);
  sampler.reset();
  EXPECT_EQ(pdo_set_up(), before) << "put back by the destructor, too";
  // The sampler must not change power state or mode.
  EXPECT_EQ(rig.objects().read<std::uint16_t>(0x6041), recording.value(0, recording.channels.size() - 1));
}

TEST_P(Sampling, KeepsARateThatIsGiven) {
  const Time period = is_ethercat() ? Time(1ms) : is_can() ? Time(2ms) : Time(50ms);
  auto sampler = open(channels({"position"}), {.period = period});
  const scope::Recording recording = record(*sampler, period * 20);
  ASSERT_EQ(recording.rows(), 20U);
  EXPECT_EQ(recording.missed, 0U);
  EXPECT_EQ(recording.period, period);
  // Polled samples are on the grid within the duration of a request.
  const Time jitter = is_ethercat() || is_can() ? on_grid() : Time(8ms);
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    const Time off = recording.time(row, 0) - period * static_cast<std::int64_t>(row);
    EXPECT_LE(off, jitter);
    EXPECT_GE(off, -jitter);
  }
}

TEST_P(Sampling, ASlowRateIsEverySoManyCycles) {
  auto sampler = open(channels({"position"}), {.period = 100ms});
  const scope::Recording recording = record(*sampler, 1s);
  EXPECT_EQ(recording.rows(), 10U);
  EXPECT_EQ(recording.missed, 0U);
}

TEST_P(Sampling, ReadsObjectsWhenItIsToldTo) {
  const auto before = pdo_set_up();
  auto sampler = open(channels({"position", "statusword"}), {.polls = true});
  const scope::Recording recording = record(*sampler, 50ms);
  EXPECT_GT(recording.rows(), 1U);
  EXPECT_EQ(recording.group_count, 2U) << "not neighbours";
  EXPECT_NE(recording.time(0, 1), recording.time(0, 0)) << "each has its own time";
  EXPECT_EQ(pdo_set_up(), before);
}

// Refuses 6077h from a given moment.
class Refusing final : public ForwardedObjects {
 public:
  using ForwardedObjects::ForwardedObjects;
  std::vector<std::byte> upload(ObjectAddress object) override {
    if (refuses && object == ObjectAddress{0x6077, 0}) throw ObjectError("it is busy", where(), "ask later", false);
    return ForwardedObjects::upload(object);
  }

  bool refuses = false;
};

TEST(PolledSampler, AChannelThatIsRefusedEndsTheSamplingAndNotTheStop) {
  AxisRig rig({"generic402"});
  Refusing drive(rig.objects());
  std::vector<Channel> list;
  for (const char* name : {"position", "torque"}) {
    Channel channel = named_channel(name, ObjectCatalogue::standard());
    complete(channel, drive);
    add_channel(list, channel);
  }
  auto sampler = open_polled_sampler(drive, std::move(list));
  SamplerRecorder recorder(*sampler, {});
  Axis402 axis(sampler->objects(), rig.options());
  axis.enable();
  axis.run_at(131072, {.acceleration = 1310720, .deceleration = 1310720}, 5s);
  sampler->check();
  drive.refuses = true;
  sampler->objects().wait(50ms);
  const std::size_t rows = recorder.recording().rows();
  EXPECT_GT(rows, 1U);
  EXPECT_THAT(problem_of([&] { sampler->check(); }), HasSubstr("it is busy"));
  drive.refuses = false;
  axis.stop();
  axis.disable();
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
  EXPECT_EQ(recorder.recording().rows(), rows) << "the sampling has ended";
}

TEST_P(Sampling, TellsWhenTheBusIsCut) {
  auto sampler = open(channels({"position"}), {});
  SamplerRecorder recorder(*sampler, {});
  sampler->objects().wait(50ms);
  const std::size_t rows = recorder.recording().rows();
  EXPECT_GT(rows, 1U);
  rig.cut();
  EXPECT_NE(problem_of([&] {
              for (int i = 0; i < 1000; ++i) {
                sampler->objects().wait(10ms);
                sampler->check();
              }
            }),
            "");
  EXPECT_LE(recorder.recording().rows(), rows + 1) << "nothing is made up";
  EXPECT_LT(rig.line.now(), 20s);
}

// ---- Differences between the buses ----

class SamplingOnCan : public Sampling {};
INSTANTIATE_TEST_SUITE_P(Some, SamplingOnCan, testing::Values(RigCase{"generic402"}, RigCase{"pronet"}),
                         [](const auto& row) { return row.param.name(); });

TEST_P(SamplingOnCan, SamplesUpToAThousandTimesASecond) {
  const Truth ticks(rig.line, {0x6064, 0});  // makes the line's time advance tick by tick
  auto sampler = open(channels({"position", "velocity", "6060", "statusword"}), {.period = 1ms});
  const scope::Recording recording = record(*sampler, 100ms);
  EXPECT_NEAR(static_cast<double>(recording.rows()), 100.0, 1.0);  // the first may be some microseconds late
  EXPECT_EQ(recording.missed, 0U);
  sampler.reset();
  EXPECT_THAT(problem_of([&] { open(channels({"position"}), {.period = 500us}); }), HasSubstr("give a lower rate"));
}

TEST_P(SamplingOnCan, CountsWhatDidNotCome) {
  auto sampler = open(channels({"position"}), {});
  SamplerRecorder recorder(*sampler, {.duration = 400ms});
  sampler->objects().wait(100ms);
  rig.line.buses()[0]->bus.cut_bus(true);
  sampler->objects().wait(100ms);
  rig.line.buses()[0]->bus.cut_bus(false);
  for (int i = 0; i < 100 && !recorder.done(); ++i) sampler->objects().wait(10ms);
  const scope::Recording recording = recorder.recording();
  EXPECT_EQ(recording.rows() + recording.missed, 100U);
  EXPECT_NEAR(static_cast<double>(recording.missed), 25, 3);
}

// Another master on the bus, with its own connection.
class OtherMaster final : public line::Follower {
 public:
  explicit OtherMaster(line::Line& line) : line_(line), client_(line.buses()[0]->bus, line), next_(line.now() + 10ms) {
    line_.add_follower(*this);
  }
  ~OtherMaster() { line_.remove_follower(*this); }
  OtherMaster(const OtherMaster&) = delete;
  OtherMaster& operator=(const OtherMaster&) = delete;

  line::Time next_deadline() const override { return next_; }
  void reached(line::Time now) override {
    next_ = now + 10ms;
    canopen::Frame sync;
    sync.id = 0x080;
    client_.send(sync);
  }

 private:
  line::Line& line_;
  links::MemoryCanClient client_;
  line::Time next_;
};

TEST_P(SamplingOnCan, DoesNotDisturbAnotherMaster) {
  const auto before = pdo_set_up();
  const OtherMaster master(rig.line);
  auto sampler = open(channels({"position"}), {});
  EXPECT_EQ(sampler->way(), "SDO");
  EXPECT_THAT(sampler->remark(), HasSubstr("another master sends SYNC"));
  SamplerRecorder recorder(*sampler, {.duration = 50ms});
  sampler->objects().wait(100ms);
  EXPECT_GT(recorder.recording().rows(), 10U);
  EXPECT_EQ(pdo_set_up(), before);
}

TEST_P(SamplingOnCan, MoreThanItsPdosHoldIsRead) {
  std::vector<Channel> many;
  for (const int number : {0x6040, 0x6041, 0x605A, 0x605B, 0x605C, 0x605D, 0x6062, 0x6063, 0x6064, 0x6065, 0x6067,
                           0x606B, 0x606C, 0x607A, 0x6081, 0x6083}) {
    const auto index = static_cast<std::uint16_t>(number);
    Channel channel{
        .object = {index, 0}, .type = dictionary::Type::integer32, .name = text_of(ObjectAddress{index, 0})};
    try {
      complete(channel, rig.objects());
      add_channel(many, channel);
    } catch (const ObjectError&) {
      // Not every drive has all of these objects.
    }
  }
  const auto before = pdo_set_up();
  auto sampler = open(many, {});
  EXPECT_EQ(sampler->way(), "SDO");
  EXPECT_THAT(sampler->remark(), HasSubstr("TPDOs could not be set up"));
  EXPECT_EQ(pdo_set_up(), before);
}

class SamplingOnEthercat : public Sampling {};
INSTANTIATE_TEST_SUITE_P(Every, SamplingOnEthercat,
                         testing::Values(RigCase{"jmc_ec", RigCase::BusKind::ethercat},
                                         RigCase{"ismk-ea", RigCase::BusKind::ethercat},
                                         RigCase{"generic402-ec", RigCase::BusKind::ethercat}),
                         [](const auto& row) { return row.param.name(); });

TEST_P(SamplingOnEthercat, DoesNotDisturbAnotherMaster) {
  EthercatSlave* const slaves[] = {rig.slaves[0].get()};
  EthercatOperation others(*rig.ethercat, rig.found, slaves, {.cyclic = {.period = 2ms, .tolerated_losses = 50}});
  const auto list = channels({"position"});
  auto sampler = open(list, {});
  EXPECT_EQ(sampler->way(), "SDO");
  EXPECT_THAT(sampler->remark(), HasSubstr("another master"));
  SamplerRecorder recorder(*sampler, {.duration = 50ms});
  sampler->objects().wait(100ms);
  EXPECT_GT(recorder.recording().rows(), 5U);
  EXPECT_EQ(rig.slaves[0]->status().state(), ethercat::AlState::operational);
  EXPECT_THAT(problem_of([&] { open(list, {.moves = true}); }), HasSubstr("another master"));
  others.exchange().check();
}

TEST_P(SamplingOnEthercat, SamplesAtFourKilohertzWithDistributedClocks) {
  for (const bool clocks : {false, true}) {
    auto sampler = open(channels({"position", "statusword"}), {.period = 250us, .distributed_clocks = clocks});
    const scope::Recording recording = record(*sampler, 50ms);
    EXPECT_NEAR(static_cast<double>(recording.rows()), 200, 1);
    EXPECT_EQ(recording.missed, 0U);
  }
  EXPECT_THAT(problem_of([&] { open(channels({"position"}), {.period = 100us}); }), HasSubstr("give a lower rate"));
}

// A parameter that cannot be mapped to a PDO is read by SDO, even if the axis is in OP in order to move.
TEST_P(SamplingOnEthercat, WhatCannotBeMappedIsRead) {
  for (const bool moves : {false, true}) {
    const auto before = pdo_set_up();
    auto sampler = open(channels({"position", "1018:01"}), {.moves = moves});
    EXPECT_EQ(sampler->way(), "SDO");
    EXPECT_THAT(sampler->remark(), HasSubstr("cannot be mapped as process data"));
    EXPECT_GT(record(*sampler, 50ms).rows(), 1U);
    if (moves) {
      Axis402 axis(sampler->objects(), rig.options());
      axis.enable();
      axis.disable();
    }
    sampler.reset();
    EXPECT_EQ(pdo_set_up(), before);
  }
}

class ScopeOnModbus : public Sampling {};
INSTANTIATE_TEST_SUITE_P(Some, ScopeOnModbus,
                         testing::Values(RigCase{"ismk", RigCase::BusKind::modbus},
                                         RigCase{"generic402", RigCase::BusKind::modbus}),
                         [](const auto& row) { return row.param.name(); });

// Neighbouring registers are read in one request and get the same time; the values equal those of single reads.
TEST_P(ScopeOnModbus, ReadsNeighboursAtOnce) {
  auto& objects = dynamic_cast<ModbusObjects&>(rig.objects());
  std::vector<ObjectAddress> all;
  std::vector<Channel> list;
  for (const ObjectAddress object : {ObjectAddress{0x6083, 0}, ObjectAddress{0x6084, 0}, ObjectAddress{0x6081, 0},
                                     ObjectAddress{0x6060, 0}, position_object()}) {
    all.push_back(object);
    Channel channel{.object = object, .name = text_of(object)};
    complete(channel, objects);
    add_channel(list, channel);
  }
  const auto sets = objects.read_together(all);
  std::size_t members = 0;
  for (const auto& set : sets) {
    members += set.size();
    std::vector<ObjectAddress> together;
    for (const std::size_t i : set) together.push_back(all[i]);
    const auto values = objects.upload_together(together);
    for (std::size_t i = 0; i < together.size(); ++i) EXPECT_EQ(values[i], objects.upload(together[i]));
  }
  EXPECT_EQ(members, all.size());
  auto sampler = open(list, {});
  EXPECT_EQ(sampler->group_count(), sets.size());
  std::printf("%s: %zu objects in %zu requests\n", GetParam().name().c_str(), all.size(), sets.size());
}

}  // namespace
}  // namespace sampler_test
}  // namespace servodrome::master::sampling
