// Process data: mapping, logical addresses, cycles, lost frames.
#include <gmock/gmock.h>

#include "ethercat_line.hpp"
#include "master/ethercat/coe_objects.hpp"

namespace servodrome::master::test {
namespace ethercat_master_cyclic_test {
namespace {

using testing::HasSubstr;

constexpr ObjectAddress controlword{0x6040, 0};
constexpr ObjectAddress target{0x607A, 0};
constexpr ObjectAddress position{0x6064, 0};
constexpr ObjectAddress statusword{0x6041, 0};
constexpr ObjectAddress wide{0x2003, 0};

TEST(ProcessObject, AnyBits) {
  std::array<std::uint8_t, 12> bytes{};
  for (unsigned first = 0; first < 16; ++first) {
    for (const unsigned count : {1U, 3U, 8U, 13U, 32U, 64U}) {
      bytes.fill(0xA5);
      ProcessObject object(bytes.data(), {first, count});
      const std::uint64_t value = 0x8123456789ABCDEFU & (count == 64 ? ~0ULL : (1ULL << count) - 1);
      object.set_raw(value);
      EXPECT_EQ(object.get<std::uint64_t>(), value);
      for (unsigned bit = 0; bit < 96; ++bit) {
        if (bit >= first && bit < first + count) continue;
        EXPECT_EQ(bytes[bit / 8] >> bit % 8 & 1, 0xA5 >> bit % 8 & 1) << first << " " << count << " " << bit;
      }
    }
  }
  ProcessObject object(bytes.data(), {5, 13});
  object.set<std::int32_t>(-3);
  EXPECT_EQ(object.get<std::int32_t>(), -3);
  EXPECT_EQ(object.get<std::uint32_t>(), 0x1FFDU);
}

class CyclicTest : public testing::TestWithParam<bool> {
 protected:
  OperationOptions options() const { return {.cyclic = {.period = 1ms, .use_lrw = GetParam()}}; }
  void start(std::size_t slaves) {
    line.emplace(EthercatLine::Settings{.slaves = slaves});
    all = line->open();
    operation.emplace(*line->master, line->found, all, options());
    exchange = &operation->exchange();
  }

  std::optional<EthercatLine> line;
  std::vector<EthercatSlave*> all;
  std::optional<EthercatOperation> operation;
  CyclicExchange* exchange = nullptr;
};

INSTANTIATE_TEST_SUITE_P(LrwOrBoth, CyclicTest, testing::Bool());

// However the master ends, its axes must come to rest.
TEST_P(CyclicTest, ASlaveWithoutAWatchdogGetsOne) {
  line.emplace(EthercatLine::Settings{.slaves = 2});
  all = line->open();
  EthercatMaster& master = *line->master;
  master.write<std::uint16_t>(all[0]->station(), 0x0420, 0);
  master.write<std::uint16_t>(all[1]->station(), 0x0420, 500);
  operation.emplace(master, line->found, all, options());
  exchange = &operation->exchange();
  EXPECT_EQ(exchange->watchdog(0), 100ms);
  EXPECT_EQ(exchange->watchdog(1), 50ms) << "that of a slave that has one stays";
  for (const EthercatSlave* slave : all) {
    EXPECT_NE(master.read<std::uint8_t>(slave->station(), 0x0814) & 0x40, 0) << "outputs trigger it";
  }
  exchange->stop();
  master.wait(200ms);
  for (EthercatSlave* slave : all) {
    EXPECT_EQ(slave->status().state(), AlState::safe_operational);
    EXPECT_EQ(slave->status().code, AlStatusCode::sync_manager_watchdog);
  }
}

TEST_P(CyclicTest, InputsFollowOutputs) {
  start(5);
  EXPECT_EQ(exchange->uses_lrw(), GetParam());
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(line->device(i).slave.state(), AlState::operational);
    exchange->output(i, target)->set(1000 * static_cast<std::int32_t>(i) - 2000);
    exchange->output(i, controlword)->set<std::uint16_t>(static_cast<std::uint16_t>(0x10 + i));
  }
  EXPECT_FALSE(exchange->output(0, position).has_value());
  EXPECT_FALSE(exchange->input(0, target).has_value());
  line->master->wait(3ms);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(exchange->input(i, position)->get<std::int32_t>(), 1000 * static_cast<std::int32_t>(i) - 1999);
    EXPECT_EQ(exchange->input(i, statusword)->get<std::uint16_t>(), 0x8010 + i);
  }
  exchange->check();
  line->master->wait(500ms);
  const CyclicStatistics& statistics = exchange->statistics();
  EXPECT_GE(statistics.cycles, 500U);
  EXPECT_EQ(statistics.lost + statistics.wrong_counters + statistics.skipped, 0U);
  operation.reset();
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(line->device(i).slave.state(), AlState::pre_operational);
}

TEST_P(CyclicTest, OutputsBeginWithWhatTheObjectsHave) {
  line.emplace(EthercatLine::Settings{});
  all = line->open();
  line->device(0).objects.target_position = 77'777;
  line->device(0).objects.mode = 8;
  line->device(0).objects.controlword = 0x0F;
  operation.emplace(*line->master, line->found, all, options());
  line->master->wait(5ms);
  EXPECT_EQ(line->device(0).objects.target_position, 77'777);
  EXPECT_EQ(line->device(0).objects.mode, 8);
  EXPECT_EQ(line->device(0).objects.controlword, 0);  // commands nothing
}

// 96 bytes in each direction: 7 slaves fill a frame.
TEST_P(CyclicTest, ManySlavesTakeSeveralFrames) {
  constexpr std::size_t slaves = 20;
  line.emplace(EthercatLine::Settings{.slaves = slaves});
  all = line->open();
  Pdo outputs{.index = 0x1601};
  Pdo inputs{.index = 0x1A01};
  for (int i = 0; i < 12; ++i) {
    outputs.entries.push_back({.object = wide, .bits = 64});
    inputs.entries.push_back({.object = wide, .bits = 64});
  }
  for (EthercatSlave* slave : all) {
    slave->to_pre_operational();
    map_pdo(slave->coe(), outputs);
    map_pdo(slave->coe(), inputs);
    assign_pdos(slave->coe(), rx_assignment, std::array<std::uint16_t, 1>{0x1601});
    assign_pdos(slave->coe(), tx_assignment, std::array<std::uint16_t, 1>{0x1A01});
  }
  operation.emplace(*line->master, line->found, all, options());
  exchange = &operation->exchange();
  EXPECT_EQ(exchange->frames_with_data(), 3U);
  for (std::size_t i = 0; i < slaves; ++i) {
    ASSERT_EQ(exchange->outputs(i).size(), 96U);
    // The last entry takes effect.
    ethercat::store(exchange->outputs(i).data() + 88, std::uint64_t{0x1234567800000000} + i);
  }
  line->frames = 0;
  line->master->wait(10ms);
  EXPECT_EQ(line->frames, 10U * 3U);  // the AL status is in the first frame
  for (std::size_t i = 0; i < slaves; ++i) {
    EXPECT_EQ(line->device(i).objects.wide, 0x1234567800000000U + i);
    EXPECT_EQ(exchange->input(i, wide)->get<std::uint64_t>(), 0x1234567800000000U + i);
  }
  EXPECT_EQ(exchange->statistics().wrong_counters, 0U);
}

TEST_P(CyclicTest, LostFramesAreCountedAndForgotten) {
  start(3);
  exchange->forget_statistics();
  line->lost_out = [lose = 3]() mutable { return lose-- > 0; };
  line->master->wait(20ms);
  exchange->check();
  EXPECT_EQ(exchange->statistics().lost, 3U);
  EXPECT_EQ(exchange->statistics().longest_loss, 3U);
  EXPECT_EQ(exchange->statistics().losses_in_a_row, 0U);
  EXPECT_TRUE(exchange->inputs_are_fresh());
}

TEST_P(CyclicTest, LateFramesAreToldFromLostOnes) {
  start(3);
  exchange->output(2, target)->set(700);
  line->master->wait(3ms);
  exchange->forget_statistics();
  line->delay_back = [late = 2]() mutable { return late-- > 0 ? 2500us : 0us; };
  line->lost_back = [frame = 0]() mutable { return ++frame == 6; };
  line->master->wait(1ms);
  exchange->output(2, target)->set(800);
  line->master->wait(19ms);
  exchange->check();
  const CyclicStatistics& statistics = exchange->statistics();
  EXPECT_EQ(statistics.late, 2U);
  EXPECT_EQ(statistics.lost, 1U);
  EXPECT_EQ(statistics.wrong_counters, 0U);
  EXPECT_EQ(statistics.longest_loss, 2U);
  EXPECT_EQ(exchange->input(2, position)->get<std::int32_t>(), 801);  // not the values of the late frames
}

TEST_P(CyclicTest, ALateFrameWithAWrongCounterIsNotLate) {
  start(3);
  exchange->forget_statistics();
  line->delay_back = [late = 1]() mutable { return late-- > 0 ? 1500us : 0us; };
  line->segment->set_cable(2, false);
  line->master->wait(1ms);
  line->segment->set_cable(2, true);
  line->master->wait(19ms);
  EXPECT_EQ(exchange->statistics().late, 0U);
  EXPECT_EQ(exchange->statistics().lost, 0U);
  EXPECT_EQ(exchange->statistics().wrong_counters, 1U);
}

TEST_P(CyclicTest, ATailThatIsGoneIsToldAndSoIsTheWatchdogAfterwards) {
  start(4);
  line->segment->set_cable(2, false);
  line->master->wait(20ms);
  EXPECT_GE(exchange->statistics().wrong_counters, 19U);
  EXPECT_THAT(problem_of([&] { exchange->check(); }), HasSubstr("mem:: process data were not exchanged 20 times"));
  line->segment->set_cable(2, true);
  line->master->wait(20ms);
  exchange->check();  // shorter than the watchdog time
  line->segment->set_cable(2, false);
  line->master->wait(300ms);
  line->segment->set_cable(2, true);
  line->master->wait(20ms);
  EXPECT_THAT(problem_of([&] { exchange->check(); }),
              HasSubstr("mem:, slave 3 (Test device): it left OP: it is in SAFEOP with error 001Bh sync manager "
                        "watchdog; send process data in time"));
  exchange->to_operational();
  exchange->check();
}

TEST_P(CyclicTest, MailboxesWorkMeanwhile) {
  start(2);
  exchange->forget_statistics();
  std::vector<std::byte> bytes(3000, std::byte{0x5A});
  for (int i = 0; i < 10; ++i) {
    all[1]->coe().download({0x2002, 0}, bytes);
    EXPECT_EQ(all[1]->coe().upload({0x2002, 0}), bytes);
    line->master->wait(1ms);
  }
  exchange->check();
  EXPECT_GT(exchange->statistics().cycles, 10U);
  EXPECT_EQ(exchange->statistics().lost + exchange->statistics().skipped, 0U);
}

TEST_P(CyclicTest, MappedObjectsGoByTheProcessData) {
  start(2);
  CoeObjects objects(*all[1], *exchange, 1);
  objects.write<std::int32_t>(0x607A, 0, -5);
  EXPECT_EQ(line->device(1).objects.target_position, -5);
  EXPECT_EQ(objects.read<std::int32_t>(0x6064), -4);
  EXPECT_EQ(objects.read<std::int32_t>(0x607A), -5);
  objects.write<std::int16_t>(0x2006, 0, 55);  // by SDO
  EXPECT_EQ(line->device(1).objects.ranged, 55);
  EXPECT_THAT(problem_of([&] { objects.write<std::int16_t>(0x607A, 0, 1); }), HasSubstr("has 32 bits, not 2 bytes"));
  line->segment->set_powered(1, false, line->now);
  EXPECT_THAT(problem_of([&] { objects.wait(50ms); }), HasSubstr("process data were not exchanged"));
}

// For example a quick stop: without an error the slave has it.
TEST_P(CyclicTest, AWriteOfAMappedObjectEndsWhenTheSlaveHasIt) {
  start(2);
  CoeObjects objects(*all[1], *exchange, 1);
  line->lost_out = [lose = 8]() mutable { return lose-- > 0; };
  objects.write<std::int32_t>(0x607A, 0, -7);
  EXPECT_EQ(line->device(1).objects.target_position, -7);
  line->lost_out = [] { return true; };
  EXPECT_THAT(problem_of([&] { objects.write<std::int32_t>(0x607A, 0, -9); }),
              HasSubstr("process data were not exchanged"));
  EXPECT_EQ(line->device(1).objects.target_position, -7);
}

// One slave loses its supply, another one leaves OP: the objects of the first slave can still stop its axis.
TEST_P(CyclicTest, ObjectsOfASlaveThatWorksAreReadAlthoughAnotherOneIsLost) {
  start(3);
  CoeObjects objects(*all[0], *exchange, 0);
  CoeObjects lost(*all[2], *exchange, 2);
  all[1]->request(AlState::safe_operational);
  line->master->wait(5ms);
  objects.write<std::int32_t>(0x607A, 0, 7);
  EXPECT_EQ(objects.read<std::int32_t>(0x6064), 8);
  line->segment->set_powered(2, false, line->now);
  for (int i = 0; i < 100; ++i) objects.wait(1ms);
  objects.write<std::int32_t>(0x607A, 0, 9);
  EXPECT_EQ(objects.read<std::int32_t>(0x6064), 10);
  EXPECT_THAT(problem_of([&] { lost.wait(1ms); }), HasSubstr("slave 3 (Test device): process data were not exchanged"));
  line->lost_back = [] { return true; };
  EXPECT_THAT(problem_of([&] { objects.wait(50ms); }), HasSubstr("slave 1 (Test device): process data were not"));
}

// The frames of the first slave carry no data of it any more, and no slave is lost.
TEST_P(CyclicTest, AWrongCounterThatNoSlaveExplainsIsAnErrorOfEach) {
  start(2);
  CoeObjects objects(*all[0], *exchange, 0);
  line->master->write<std::uint8_t>(all[1]->station(), ethercat::reg::fmmu + 12, 0);
  EXPECT_THAT(problem_of([&] { objects.wait(50ms); }), HasSubstr("mem:: process data were not exchanged"));
}

TEST_P(CyclicTest, OneOfThemAfterAllOfThem) {
  start(3);
  operation.reset();
  for (EthercatSlave* slave : all) {
    operation.emplace(*line->master, line->found, std::span(&slave, 1), options());
    operation->exchange().output(0, target)->set(5);
    line->master->wait(20ms);
    operation->exchange().check();
    EXPECT_EQ(operation->exchange().statistics().wrong_counters, 0U);
    EXPECT_EQ(operation->exchange().input(0, position)->get<std::int32_t>(), 6);
    operation.reset();
  }
}

// 1C32h sub 1 keeps its value from an earlier start.
TEST_P(CyclicTest, FreeRunAfterClocksAndBack) {
  start(2);
  for (const bool clocks : {true, false, true}) {
    operation.reset();
    OperationOptions next = options();
    next.distributed_clocks = clocks;
    next.clock.drift_frames = 1000;
    operation.emplace(*line->master, line->found, all, next);
    line->master->wait(20ms);
    operation->exchange().check();
    EXPECT_EQ(line->device(1).objects.communication.output_sync.type, clocks ? 2 : 0);
  }
}

TEST_P(CyclicTest, PulsesThatAnotherMasterLeftAreSwitchedOff) {
  start(1);
  operation.reset();
  DistributedClocks clocks(*line->master, line->found);
  clocks.start_sync(all[0]->station(), clocks.common_start(1'000'000), {.sync0_cycle_ns = 1'000'000});
  operation.emplace(*line->master, line->found, all, options());
  EXPECT_FALSE(line->device(0).esc.clock().sync(0).pending);
  line->master->wait(20ms);
  operation->exchange().check();
}

TEST_P(CyclicTest, RefusalsNameTheSlave) {
  line.emplace(EthercatLine::Settings{.slaves = 3});
  all = line->open();
  line->device(1).events.refused = AlState::safe_operational;
  line->device(1).events.refusal = AlStatusCode::invalid_input_mapping;
  EXPECT_THAT(problem_of([&] { operation.emplace(*line->master, line->found, all, options()); }),
              HasSubstr("mem:, slave 2 (Test device): it does not go to SAFEOP: it is in PREOP with error 0024h"));
}

// Some drives refuse the first request for OP, until their application has seen process data.
TEST_P(CyclicTest, ATransientRefusalOfOpIsRepeated) {
  line.emplace(EthercatLine::Settings{.slaves = 3});
  all = line->open();
  DeviceEvents& events = line->device(1).events;
  events.refused = AlState::operational;
  events.refusals = 2;
  events.refusal = AlStatusCode::sync_manager_watchdog;
  operation.emplace(*line->master, line->found, all, options());
  operation->exchange().check();
  EXPECT_EQ(events.refusals, 0U);
  operation.reset();
  for (const auto& [code, requests] : {std::pair{AlStatusCode::sync_manager_watchdog, 3U},
                                       std::pair{AlStatusCode::invalid_output_configuration, 1U}}) {
    events.refusals = UINT_MAX;
    events.refusal = code;
    EXPECT_THAT(problem_of([&] { operation.emplace(*line->master, line->found, all, options()); }),
                HasSubstr("mem:, slave 2 (Test device): it does not go to OP: it is in SAFEOP with error"));
    EXPECT_EQ(UINT_MAX - events.refusals, requests);
  }
}

TEST(ProcessData, OfASlaveWithoutCoeComesFromItsSii) {
  EthercatLine line;
  auto found = scan_slaves(*line.master);
  found[0].sii.protocols = 0;
  EthercatSlave slave(*line.master, found[0]);
  slave.to_pre_operational();
  const ProcessData data = read_process_data(slave);
  ASSERT_EQ(data.outputs.size(), 1U);
  EXPECT_EQ(bytes_of(data.outputs), 7U);
  EXPECT_EQ(bytes_of(data.inputs), 7U);
  EXPECT_EQ(find_mapped(data.inputs, {0x6064, 0})->first, 24U);
}

TEST(ProcessData, OfTheSlaveIsWhatWasAssigned) {
  EthercatLine line;
  EthercatSlave& slave = *line.open()[0];
  slave.to_pre_operational();
  map_pdo(slave.coe(),
          {.index = 0x1602, .entries = {{.object = {0x2020, 0}, .bits = 1}, {.object = {0x2006, 0}, .bits = 16}}});
  assign_pdos(slave.coe(), rx_assignment, std::array<std::uint16_t, 2>{0x1600, 0x1602});
  const ProcessData data = read_process_data(slave);
  EXPECT_EQ(bits_of(data.outputs), 73U);
  EXPECT_EQ(find_mapped(data.outputs, {0x2006, 0})->first, 57U);
}

}  // namespace
}  // namespace ethercat_master_cyclic_test
}  // namespace servodrome::master::test
