// The end of a program in motion, with complete drives in virtual time: no drive stays enabled.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <initializer_list>
#include <utility>

#include "axis/axis402.hpp"
#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/cyclic/motion_group.hpp"
#include "drive/drive.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "master/problem_of.hpp"

namespace servodrome::master {
namespace orderly_end_test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr double revolution = 131072;
constexpr MotionLimits gentle{5 * revolution, 40 * revolution, 40 * revolution, 1000 * revolution};

using test::problem_of;

// An exception of the program, as at Ctrl-C.
struct Interrupted {};

// ---- EtherCAT ----

std::string segment_of(std::initializer_list<const char*> products) {
  std::string text = "clock = \"virtual\"\n[[bus]]\nname = \"ring\"\ntype = \"ethercat\"\n";
  unsigned number = 0;
  for (const char* product : products) {
    text += fmt::format("[[axis]]\nname = \"axis{}\"\nproduct = \"{}\"\nbus = \"ring\"\n", ++number, product);
  }
  return text;
}

// Drives in OP with the process data of a cyclic axis. A test may end the operation and the bus.
struct Segment {
  Segment(std::initializer_list<const char*> products) : line(line::test::settings_of(segment_of(products))) {
    for (const FoundSlave& one : found) slaves.push_back(std::make_unique<EthercatSlave>(master, one));
    for (const auto& slave : slaves) {
      all.push_back(slave.get());
      slave->to_pre_operational();
      set_up_cyclic_axis(*slave, {.period = 1ms});
    }
    operation.emplace(master, found, all, OperationOptions{.cyclic = {.period = 1ms}});
    bus.emplace(master, *operation);
  }
  PowerState state(std::size_t axis = 0) { return line.axes()[axis]->device().drive().state(); }
  bool is_energised(std::size_t axis = 0) { return line.axes()[axis]->device().drive().energised(); }
  double turns(std::size_t axis = 0) {
    return static_cast<double>(line.axes()[axis]->plant().position_counts()) / revolution;
  }

  line::Line line;
  EthercatMaster master{std::make_unique<links::MemoryEthercatClient>(line.ethercat_buses()[0]->bus, line)};
  std::vector<FoundSlave> found = scan_slaves(master);
  std::vector<std::unique_ptr<EthercatSlave>> slaves;
  std::vector<EthercatSlave*> all;
  std::optional<EthercatOperation> operation;
  std::optional<EthercatCyclicBus> bus;
};

// The factory value of its 6007h is 0: it does not react to the loss of its master.
TEST(EthercatEnd, AnIsmkIsNotEnabledAfterTheProgram) {
  Segment segment{"ismk-ea"};
  {
    MotionGroup group(*segment.bus);
    group.enable();
    ASSERT_EQ(segment.state(), PowerState::operation_enabled);
  }
  segment.bus.reset();
  segment.operation.reset();
  segment.line.run_until(segment.line.now() + 1s);
  EXPECT_NE(segment.state(), PowerState::operation_enabled);
  EXPECT_FALSE(segment.is_energised());
}

TEST(EthercatEnd, AnIsmkWhoseMasterIsGoneDoesNotStayEnabled) {
  Segment segment{"ismk-ea"};
  MotionGroup group(*segment.bus);
  group.enable();
  ASSERT_EQ(segment.state(), PowerState::operation_enabled);
  segment.operation->exchange().stop();
  segment.line.run_until(segment.line.now() + 500ms);  // more than the watchdog
  EXPECT_NE(segment.state(), PowerState::operation_enabled);
}

TEST(EthercatEnd, OnlyAMissingReactionToTheLossOfTheMasterIsChanged) {
  constexpr std::int16_t quick_stop = 3;
  for (const std::int16_t before : {std::int16_t{0}, quick_stop}) {
    Segment segment{"generic402-ec"};
    segment.bus.reset();
    segment.operation.reset();
    CoeClient& coe = segment.slaves[0]->coe();
    coe.write<std::int16_t>(0x6007, 0, before);
    set_up_cyclic_axis(*segment.slaves[0], {.period = 1ms});
    EXPECT_EQ(coe.read<std::int16_t>(0x6007), before == 0 ? 1 : before);
  }
}

TEST(EthercatEnd, TheEndOfAGroupStopsTheShaftWhileTheBusGoesOn) {
  Segment segment{"generic402-ec"};
  {
    MotionGroup group(*segment.bus);
    group.enable();
    ASSERT_TRUE(group.axis(0).run_in_velocity_mode(2 * revolution, gentle));
    group.wait(1s);
    ASSERT_NEAR(group.axis(0).velocity() / revolution, 2.0, 0.1);
  }
  segment.bus->wait(1s);
  EXPECT_NE(segment.state(), PowerState::operation_enabled);
  const double rest = segment.turns();
  segment.bus->wait(1s);
  EXPECT_NEAR(segment.turns(), rest, 0.001);
}

// The bus ends while the drive, which is enabled without a group, moves. It waits for the end of the quick stop.
TEST(EthercatEnd, TheEndOfTheBusStopsADriveWithoutAGroup) {
  Segment segment{"generic402-ec"};
  CyclicAxis axis(segment.bus->image(0));
  segment.bus->on_cycle([&axis] {
    axis.set_mode(OperationMode::cyclic_synchronous_velocity);
    if (axis.enable()) axis.set_target_velocity(static_cast<std::int32_t>(2 * revolution));
  });
  segment.bus->wait(1s);
  ASSERT_EQ(segment.state(), PowerState::operation_enabled);
  const double begin = segment.turns();
  segment.bus->wait(100ms);
  ASSERT_GT(segment.turns(), begin + 0.1) << "it moves";
  segment.bus.reset();
  EXPECT_EQ(segment.state(), PowerState::switch_on_disabled);
  const double rest = segment.turns();
  segment.master.wait(500ms);
  EXPECT_NEAR(segment.turns(), rest, 0.001);
}

// An iSMK shows the ramp of its quick stop as Switch on disabled (0050h).
TEST(EthercatEnd, TheEndOfTheBusWaitsForTheRampOfAnIsmk) {
  Segment segment{"ismk-ea"};
  CoeClient& coe = segment.slaves[0]->coe();
  coe.write<std::uint32_t>(0x6085, 0, coe.read<std::uint32_t>(0x6083) / 5);
  CyclicAxis axis(segment.bus->image(0));
  segment.bus->on_cycle([&axis] {
    axis.set_mode(OperationMode::profile_velocity);
    if (axis.enable()) axis.set_target_velocity(10'000'000);
  });
  segment.bus->wait(2s);
  ASSERT_EQ(segment.state(), PowerState::operation_enabled);
  const double begin = segment.turns();
  segment.bus->wait(100ms);
  ASSERT_GT(segment.turns(), begin + 0.1) << "it moves";
  const Time ended = segment.master.now();
  segment.bus.reset();
  EXPECT_GT(segment.master.now() - ended, 200ms) << "the ramp is long";
  const double rest = segment.turns();
  segment.master.wait(500ms);
  EXPECT_NEAR(segment.turns(), rest, 0.001);
  EXPECT_EQ(segment.state(), PowerState::switch_on_disabled);
}

TEST(EthercatEnd, TheEndOfTheBusWaitsUntilTheBrakeHasClosed) {
  Segment segment{"generic402-ec"};
  segment.slaves[0]->coe().write<std::uint16_t>(0x2020, 2, 4000);
  segment.bus.emplace(segment.master, *segment.operation, EthercatCyclicOptions{.brake_delay = 4s});
  {
    MotionGroup group(*segment.bus);
    group.enable();
    ASSERT_EQ(segment.state(), PowerState::operation_enabled);
  }
  segment.bus.reset();
  EXPECT_EQ(segment.state(), PowerState::switch_on_disabled);
  EXPECT_FALSE(segment.is_energised());
}

TEST(EthercatEnd, TheEndOfTheBusDoesNotStopADriveThatItDidNotMove) {
  Segment segment{"generic402-ec", "generic402-ec"};
  CoeObjects objects(*segment.all[1], segment.operation->exchange(), 1);
  Axis402 other(objects);
  other.enable();
  CyclicAxis axis(segment.bus->image(0));
  segment.bus->on_cycle([&axis] {
    axis.set_mode(OperationMode::cyclic_synchronous_velocity);
    axis.enable();
  });
  segment.bus->wait(500ms);
  ASSERT_EQ(segment.state(0), PowerState::operation_enabled);
  ASSERT_EQ(segment.state(1), PowerState::operation_enabled);
  segment.bus.reset();
  EXPECT_NE(segment.state(0), PowerState::operation_enabled);
  EXPECT_EQ(segment.state(1), PowerState::operation_enabled);
}

// ---- CAN ----

constexpr const char* can_line = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "x"
product = "generic402"
node = 1
[[axis]]
name = "y"
product = "generic402"
node = 2
)";

class CanEnd : public testing::Test {
 protected:
  void SetUp() override { bus.run_for(500ms); }
  PowerState state(std::size_t axis) { return line.axes()[axis]->device().drive().state(); }
  double turns(std::size_t axis) {
    return static_cast<double>(line.axes()[axis]->plant().position_counts()) / revolution;
  }
  // Configuration of the first RPDOs and TPDOs of a node, word by word.
  std::vector<std::uint32_t> pdos_of(std::uint8_t node) {
    SdoClient objects(bus, node);
    std::vector<std::uint32_t> all;
    for (const bool transmit : {false, true}) {
      for (std::uint8_t number = 0; number < 4; ++number) {
        const auto pdo = read_pdo(objects, transmit, number);
        if (!pdo) break;
        all.insert(all.end(), {pdo->cob_id, pdo->transmission_type});
        all.insert(all.end(), pdo->mapping.begin(), pdo->mapping.end());
      }
    }
    return all;
  }
  // Throws at the first answer of node 1 to an SDO that this command specifier and object identify.
  Bus::Subscription interrupt_at(std::uint8_t specifier, std::uint16_t index, bool& is_thrown) {
    return bus.listen([specifier, index, &is_thrown](const Frame& frame) {
      if (frame.id != 0x581 || frame.data[0] != specifier || (frame.data[1] | frame.data[2] << 8) != index) return;
      if (!std::exchange(is_thrown, true)) throw Interrupted{};
    });
  }
  static inline const CanCyclicOptions impatient{.period = 4ms, .sdo = {50ms, 0}};

  line::Line line{line::test::settings_of(can_line)};
  Bus bus{std::make_unique<links::MemoryCanClient>(line.buses()[0]->bus, line), "mem:", &line};
};

// The first node that the bus stops has lost its power. The other one runs in velocity mode. It gets its quick stop
// before the timeout of the first one.
TEST_F(CanEnd, ASilentNodeDoesNotKeepTheOtherDriveEnabled) {
  CanCyclicBus cyclic(bus, {synchronous_drive(1), synchronous_drive(2)}, impatient);
  MotionGroup group(cyclic);
  group.enable();
  ASSERT_TRUE(group.axis(1).run_in_velocity_mode(2 * revolution, gentle));
  group.wait(500ms);
  line.axes()[0]->power_off(line.now());
  PowerState soon = PowerState::operation_enabled;
  bool has_looked = false;
  const Bus::Subscription looking = bus.every(20ms, [&] {
    if (!std::exchange(has_looked, true)) soon = state(1);
  });
  EXPECT_THAT(problem_of([&] { cyclic.close(); }), HasSubstr("node 1"));
  EXPECT_NE(soon, PowerState::operation_enabled);
  EXPECT_NE(state(1), PowerState::operation_enabled);
  bus.run_for(1s);
  const double rest = turns(1);
  bus.run_for(1s);
  EXPECT_NEAR(turns(1), rest, 0.001);
}

// As examples::Can does at a second Ctrl-C, during the first request of the end.
TEST_F(CanEnd, ATimerThatThrowsDoesNotEndTheStop) {
  const auto before = pdos_of(1);
  bool is_thrown = false;
  Bus::Subscription timer;
  {
    CanCyclicBus cyclic(bus, {synchronous_drive(1)}, {.period = 4ms});
    MotionGroup group(cyclic);
    group.enable();
    ASSERT_TRUE(group.axis(0).run_in_velocity_mode(2 * revolution, gentle));
    group.wait(500ms);
    timer = bus.every(100us, [&is_thrown] {
      if (!std::exchange(is_thrown, true)) throw Interrupted{};
    });
  }
  timer.reset();
  EXPECT_TRUE(is_thrown);
  EXPECT_NE(state(0), PowerState::operation_enabled);
  EXPECT_EQ(pdos_of(1), before);
}

TEST_F(CanEnd, AnExceptionDuringTheStopIsThrownAfterIt) {
  const auto before = pdos_of(1);
  CanCyclicBus cyclic(bus, {synchronous_drive(1)}, {.period = 4ms});
  MotionGroup group(cyclic);
  group.enable();
  bool is_thrown = false;
  constexpr std::uint8_t upload_of_two_bytes = 0x4B;
  const Bus::Subscription interrupting = interrupt_at(upload_of_two_bytes, 0x6041, is_thrown);
  EXPECT_THROW(cyclic.close(), Interrupted);
  EXPECT_NE(state(0), PowerState::operation_enabled);
  EXPECT_EQ(pdos_of(1), before);
}

TEST_F(CanEnd, AnExceptionDuringTheSetUpRestoresThePdos) {
  const auto before = pdos_of(1);
  bool is_thrown = false;
  constexpr std::uint8_t download_answer = 0x60;
  const Bus::Subscription interrupting = interrupt_at(download_answer, 0x1601, is_thrown);
  EXPECT_THROW(CanCyclicBus(bus, {synchronous_drive(1)}, {.period = 4ms}), Interrupted);
  EXPECT_TRUE(is_thrown);
  EXPECT_EQ(pdos_of(1), before);
}

}  // namespace
}  // namespace orderly_end_test
}  // namespace servodrome::master
