// The master's own trajectories with complete drives, in virtual time: EtherCAT and CAN, with the same code above both.
#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/motion_group.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/problem_of.hpp"
#include "ring_rig.hpp"
#include "source_dir.hpp"

namespace servodrome::master {
namespace cyclic_bus_test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr double revolution = 131072;
constexpr MotionLimits gentle{5 * revolution, 40 * revolution, 40 * revolution, 1000 * revolution};

using test::problem_of;

MotionLimits in_counts(double counts_per_revolution) {
  const double scale = counts_per_revolution / revolution;
  return {gentle.velocity * scale, gentle.acceleration * scale, gentle.deceleration * scale, gentle.jerk * scale};
}

// Moves all axes by the same number of revolutions. The set-points must equal the closed form in each cycle. Returns
// the worst following error of each axis in revolutions.
std::vector<double> follow_a_profile(MotionGroup& group, double revolutions,
                                     std::span<const double> counts_per_revolution) {
  const auto counts = [&](std::size_t i) {
    return counts_per_revolution[std::min(i, counts_per_revolution.size() - 1)];
  };
  std::vector<double> start;
  std::vector<double> targets;
  std::vector<MotionLimits> limits;
  std::vector<trajectory::Trajectory> exact(group.size());
  for (std::size_t i = 0; i < group.size(); ++i) {
    start.push_back(group.axis(i).set_point().position);
    targets.push_back(start.back() + revolutions * counts(i));
    limits.push_back(in_counts(counts(i)));
    exact[i].plan_position({0.0, 0.0, 0.0}, revolutions * counts(i), 0.0, limits[i],
                           trajectory::RampShape::jerk_limited);
  }
  const double period_s = std::chrono::duration<double>(group.bus().period()).count();
  unsigned cycle = 0;
  std::vector<double> worst(group.size());
  group.start_together(targets, limits);
  group.on_cycle([&] {
    for (std::size_t i = 0; i < group.size(); ++i) {
      const double expected = start[i] + exact[i].at(cycle * period_s).position;
      EXPECT_NEAR(group.axis(i).set_point().position, expected, 1e-6) << "axis " << i << " cycle " << cycle;
      worst[i] = std::max(worst[i], std::abs(group.axis(i).following_error()) / counts(i));
    }
    ++cycle;
  });
  EXPECT_TRUE(group.wait_until([&] { return group.all_done(); }, 10s));
  group.wait(300ms);
  group.on_cycle({});
  for (std::size_t i = 0; i < group.size(); ++i) {
    EXPECT_EQ(group.axis(i).set_point().position, targets[i]);
    EXPECT_NEAR(static_cast<double>(group.axis(i).position()), targets[i], 1e-3 * counts(i)) << i;
  }
  return worst;
}

constexpr std::array same{revolution};
constexpr std::array different{revolution, 4000.0};  // counts per revolution of the axes of the ring

class EthercatMotion : public testing::TestWithParam<int>, protected test::RingRig {
 protected:
  void start(Time period) {
    set_up({.period = period});
    operate(period);
  }
};
// Periods in us, up to 4 kHz.
INSTANTIATE_TEST_SUITE_P(Periods, EthercatMotion, testing::Values(250, 1000, 2000));

TEST_P(EthercatMotion, ProfilesInPosition) {
  start(std::chrono::microseconds(GetParam()));
  MotionGroup group(*bus);
  group.enable();
  const std::vector<double> worst = follow_a_profile(group, 3.0, different);
  EXPECT_LT(worst[0], 0.005);
  EXPECT_LT(worst[1], 0.2);  // no feed-forward in its position loop by default
  std::printf("%d us: following within %.5f and %.5f revolutions\n", GetParam(), worst[0], worst[1]);
  EXPECT_EQ(bus->counters().missed + bus->counters().skipped, 0U);
  bus->check();
  group.disable(gentle);
}

TEST_P(EthercatMotion, VelocityAndTorque) {
  start(std::chrono::microseconds(GetParam()));
  MotionGroup group(*bus);
  group.enable();
  ASSERT_TRUE(group.axis(0).run_in_velocity_mode(2 * revolution, gentle));
  ASSERT_TRUE(group.axis(0).axis().can_command(OperationMode::cyclic_synchronous_torque));
  group.wait(1s);
  EXPECT_EQ(group.axis(0).axis().mode(), 9);
  EXPECT_NEAR(group.axis(0).velocity() / revolution, 2.0, 0.1);
  ASSERT_TRUE(group.axis(0).apply_torque(30.0, 500.0, 4 * revolution));
  group.wait(2s);
  EXPECT_EQ(group.axis(0).axis().mode(), 10);
  EXPECT_NEAR(group.axis(0).torque_set_point(), 30.0, 1e-9);
  EXPECT_LT(group.axis(0).velocity() / revolution, 4.5);
  group.axis(0).run_at(0.0, gentle);
  ASSERT_TRUE(group.wait_until([&] { return group.all_done(); }, 5s));
  group.wait(200ms);
  EXPECT_EQ(group.axis(0).axis().mode(), 8);
  EXPECT_NEAR(group.axis(0).velocity() / revolution, 0.0, 0.05);
}

TEST(EthercatMotionFaults, AFaultOfTheDriveIsNamed) {
  test::RingRig rig;
  rig.set_up({.period = 1ms});
  rig.operate(1ms);
  MotionGroup group(*rig.bus);
  group.enable();
  group.axis(0).run_at(revolution, gentle);
  group.wait(100ms);
  rig.line.axes()[0]->inject(drive::Cause::over_voltage, true);
  EXPECT_THAT(problem_of([&] { group.wait(100ms); }), HasSubstr("the drive has a fault, 603Fh is 3210h"));
  rig.line.axes()[0]->inject(drive::Cause::over_voltage, false);
  group.reset_faults();
  group.enable();
}

// The line of bench/cyclic_axes, in virtual time: every cycle is exactly on time, none is missed, and two runs are
// identical to the last bit.
std::vector<double> run_eight_axes(std::vector<std::int64_t>& shafts) {
  line::LineFile file = line::load_line_file(SERVODROME_SOURCE_DIR "/lines/cyclic-axes.toml", line::all_products());
  EXPECT_TRUE(file.diagnostics.empty());
  line::Line line{file.settings};
  EthercatMaster master{std::make_unique<links::MemoryEthercatClient>(line.ethercat_buses()[0]->bus, line)};
  const std::vector<FoundSlave> found = scan_slaves(master);
  EXPECT_EQ(found.size(), 8U);
  std::vector<std::unique_ptr<EthercatSlave>> slaves;
  std::vector<EthercatSlave*> all;
  std::vector<double> turn;
  for (const FoundSlave& one : found) {
    slaves.push_back(std::make_unique<EthercatSlave>(master, one));
    all.push_back(slaves.back().get());
    slaves.back()->to_pre_operational();
    set_up_cyclic_axis(*slaves.back(), {.period = 1ms});
  }
  for (const auto& axis : line.axes()) {
    const std::string_view product = axis->settings().product->name;
    turn.push_back(product == "jmc_ec" ? 4000.0 : revolution);
  }
  EthercatOperation operation(master, found, all, {.cyclic = {.period = 1ms}});
  EthercatCyclicBus bus(master, operation);
  MotionGroup group(bus);
  group.enable();
  operation.exchange().forget_statistics();
  const std::vector<double> worst = follow_a_profile(group, 5.0, turn);
  EXPECT_EQ(bus.counters().missed + bus.counters().skipped, 0U);
  EXPECT_EQ(bus.counters().worst_lateness, Time{0});
  EXPECT_GT(bus.counters().cycles, 1000U);
  for (std::size_t i = 0; i < turn.size(); ++i) EXPECT_LT(worst[i], turn[i] == revolution ? 0.005 : 0.2) << i;
  for (const auto& axis : line.axes()) shafts.push_back(axis->plant().position_counts());
  return worst;
}

TEST(EightAxes, AtOneKilohertzMissNothingAndRepeatToTheLastBit) {
  std::vector<std::int64_t> shafts, shafts_again;
  const std::vector<double> worst = run_eight_axes(shafts);
  EXPECT_EQ(run_eight_axes(shafts_again), worst);
  EXPECT_EQ(shafts, shafts_again);
}

constexpr const char* can_line = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "reference"
product = "generic402"
node = 1
[[axis]]
name = "ismc"
product = "ismc"
node = 2
[[axis]]
name = "pronet"
product = "pronet"
node = 3
)";

// A client that does not receive the frames for which `loses` returns true.
class LossyCanClient final : public links::CanClient {
 public:
  LossyCanClient(links::CanBus& bus, links::VirtualClock& clock, std::function<bool(const canopen::Frame&)> loses)
      : client_(bus, clock), loses_(std::move(loses)) {}
  void send(const canopen::Frame& frame) override { client_.send(frame); }
  std::optional<canopen::Frame> receive(Time timeout) override {
    const auto frame = client_.receive(timeout);
    return frame && loses_(*frame) ? std::nullopt : frame;
  }

 private:
  links::MemoryCanClient client_;
  std::function<bool(const canopen::Frame&)> loses_;
};

// Answers of node 1 to downloads of one object that get lost.
struct LostAnswers {
  ObjectAddress object;
  unsigned left = 0;

  bool operator()(const canopen::Frame& frame) {
    constexpr std::uint8_t download_response = 0x60;
    const bool is_one = left > 0 && frame.id == 0x581 && frame.data[0] == download_response &&
                        (frame.data[1] | frame.data[2] << 8) == object.index && frame.data[3] == object.sub;
    if (is_one) --left;
    return is_one;
  }
};

class CanMotion : public testing::Test {
 protected:
  void SetUp() override { bus.run_for(500ms); }
  // Configuration of a node's PDOs, word by word.
  std::vector<std::uint32_t> pdos_of(std::uint8_t node) {
    SdoClient objects(bus, node);
    std::vector<std::uint32_t> all;
    for (const bool transmit : {false, true}) {
      for (std::uint8_t number = 0; number < 8; ++number) {
        const auto pdo = read_pdo(objects, transmit, number);
        if (!pdo) break;
        all.insert(all.end(), {pdo->cob_id, pdo->transmission_type});
        all.insert(all.end(), pdo->mapping.begin(), pdo->mapping.end());
      }
    }
    all.push_back(objects.read_if_present<std::uint8_t>(0x60C2, 1).value_or(0));
    all.push_back(objects.read_if_present<std::uint32_t>(0x2105).value_or(0));
    all.push_back(objects.read_if_present<std::uint32_t>(0x6081).value_or(0));
    return all;
  }
  Bus lossy_bus(LostAnswers& lost) {
    return Bus(std::make_unique<LossyCanClient>(line.buses()[0]->bus, line, std::ref(lost)), "mem:", &line);
  }
  static CanDrive drive_with_a_value() {
    CanDrive drive = synchronous_drive(1);
    drive.values.push_back({{0x6081, 0}, 4711, 4});
    return drive;
  }
  static inline const CanCyclicOptions impatient{.period = 2ms, .sdo = {50ms, 0}};

  line::Line line{line::test::settings_of(can_line)};
  Bus bus{std::make_unique<links::MemoryCanClient>(line.buses()[0]->bus, line), "mem:", &line};
};

TEST_F(CanMotion, SynchronousPositionInStepWithSync) {
  const auto before = std::array{pdos_of(1), pdos_of(2)};
  {
    CanCyclicBus cyclic(bus, {synchronous_drive(1), synchronous_position_drive(2)}, {.period = 2ms});
    MotionGroup group(cyclic);
    group.enable();
    const std::vector<double> worst = follow_a_profile(group, 3.0, same);
    EXPECT_LT(worst[0], 0.005);
    EXPECT_LT(worst[1], 0.005);
    std::printf("SYNC at 2 ms: following within %.5f and %.5f revolutions\n", worst[0], worst[1]);
    EXPECT_EQ(cyclic.counters().missed + cyclic.counters().skipped, 0U);
    EXPECT_EQ(cyclic.counters().worst_lateness, Time{0});
    group.disable(gentle);
  }
  EXPECT_EQ(pdos_of(1), before[0]);
  EXPECT_EQ(pdos_of(2), before[1]);
}

TEST_F(CanMotion, InterpolatedPositionOfADriveWithoutSynchronousModes) {
  const auto before = pdos_of(3);
  {
    CanDrive drive = interpolated_position_drive(3);
    drive.values.push_back({{0x2105, 0}, 2000, 4});  // the same period in us (ProNet manual, ch. 7.5.4)
    CanCyclicBus cyclic(bus, {drive}, {.period = 2ms});
    const std::array options{MotionAxisOptions{.position_mode = OperationMode::interpolated_position}};
    MotionGroup group(cyclic, options);
    group.enable();
    const std::vector<double> worst = follow_a_profile(group, 3.0, same);
    EXPECT_LT(worst[0], 0.01);
    std::printf("interpolated position: following within %.5f revolutions\n", worst[0]);
    EXPECT_EQ(cyclic.counters().missed, 0U);
    group.disable(gentle);
  }
  EXPECT_EQ(pdos_of(3), before);
}

TEST_F(CanMotion, VelocityAndTorqueOverCan) {
  CanCyclicBus cyclic(bus, {synchronous_drive(1)}, {.period = 2ms});
  MotionGroup group(cyclic);
  group.enable();
  ASSERT_TRUE(group.axis(0).run_in_velocity_mode(-2 * revolution, gentle));
  group.wait(1s);
  EXPECT_NEAR(group.axis(0).velocity() / revolution, -2.0, 0.1);
  ASSERT_TRUE(group.axis(0).apply_torque(-30.0, 500.0, 4 * revolution));
  group.wait(1s);
  EXPECT_EQ(group.axis(0).axis().mode(), 10);
  EXPECT_LT(group.axis(0).velocity() / revolution, -2.0);
}

// The drive's supply fails in motion: the message must name the node; objects cannot be restored then, and no call may
// hang.
TEST_F(CanMotion, ANodeThatFallsSilentStopsTheAxis) {
  CanCyclicBus cyclic(bus, {synchronous_drive(1), synchronous_position_drive(2)}, {.period = 2ms, .sdo = {50ms, 0}});
  MotionGroup group(cyclic);
  group.enable();
  group.axis(0).run_at(revolution, gentle);
  group.axis(1).run_at(revolution, gentle);
  group.wait(200ms);
  line.axes()[1]->power_off(line.now());
  EXPECT_THAT(problem_of([&] { group.wait(500ms); }),
              testing::AllOf(HasSubstr("its process data were not received"), HasSubstr("node 2")));
  EXPECT_THAT(problem_of([&] { cyclic.check(); }), HasSubstr("node 2"));
  EXPECT_GT(cyclic.counters().longest_miss, 10U);
  EXPECT_TRUE(group.axis(0).is_enabled());
}

TEST_F(CanMotion, LeavingTheLoopStopsTheDrives) {
  {
    CanCyclicBus cyclic(bus, {synchronous_drive(1)}, {.period = 2ms});
    MotionGroup group(cyclic);
    group.enable();
    group.axis(0).run_at(2 * revolution, gentle);
    group.wait(500ms);
  }
  bus.run_for(1s);
  SdoClient objects(bus, 1);
  EXPECT_NE(state_of(objects.read<std::uint16_t>(0x6041)), PowerState::operation_enabled);
  EXPECT_NEAR(objects.read<std::int32_t>(0x606C) / revolution, 0.0, 0.01);
}

TEST_F(CanMotion, WhatCannotBeMappedIsRefusedAndPutBack) {
  const auto before = pdos_of(2);
  CanDrive drive = synchronous_drive(2);
  drive.rpdos.push_back({{{0x5FFF, 0}, 32}});
  EXPECT_THAT(problem_of([&] { CanCyclicBus cyclic(bus, {drive}, {.period = 2ms}); }), HasSubstr("node 2"));
  EXPECT_EQ(pdos_of(2), before);
  EXPECT_THAT(problem_of([&] { CanCyclicBus cyclic(bus, {synchronous_position_drive(2)}, {.period = 300ms}); }),
              HasSubstr("cannot be written to 60C2h"));
  EXPECT_EQ(pdos_of(2), before);
}

TEST_F(CanMotion, AValueWhoseAnswerWasLostIsPutBack) {
  const auto before = pdos_of(1);
  for (const ObjectAddress object : {ObjectAddress{0x6081, 0}, ObjectAddress{0x60C2, 1}}) {
    LostAnswers lost{object, 1};
    Bus lossy = lossy_bus(lost);
    EXPECT_THAT(problem_of([&] { CanCyclicBus cyclic(lossy, {drive_with_a_value()}, impatient); }),
                HasSubstr("node 1"));
    EXPECT_EQ(lost.left, 0U);
    EXPECT_EQ(pdos_of(1), before);
  }
}

// Objects are restored in reverse order: 60C2h, 6081h, the TPDOs, the RPDOs.
TEST_F(CanMotion, AnObjectThatCannotBePutBackHindersNoOther) {
  const auto before = pdos_of(1);
  for (const ObjectAddress object : {ObjectAddress{0x60C2, 1}, ObjectAddress{0x6081, 0}}) {
    LostAnswers lost{object};
    Bus lossy = lossy_bus(lost);
    CanCyclicBus cyclic(lossy, {drive_with_a_value()}, impatient);
    EXPECT_NE(pdos_of(1), before);
    lost.left = 100;
    EXPECT_THAT(problem_of([&] { cyclic.close(); }), HasSubstr("node 1"));
    EXPECT_LT(lost.left, 100U);
    EXPECT_EQ(pdos_of(1), before);
  }
}

TEST_F(CanMotion, APdoWhoseAnswerWasLostIsPutBackCompletely) {
  const auto before = pdos_of(1);
  for (const ObjectAddress object : {ObjectAddress{0x1800, 1}, ObjectAddress{0x1600, 0}}) {
    LostAnswers lost{object};
    Bus lossy = lossy_bus(lost);
    CanCyclicBus cyclic(lossy, {drive_with_a_value()}, impatient);
    lost.left = 1;
    cyclic.close();
    EXPECT_EQ(lost.left, 0U);
    EXPECT_EQ(pdos_of(1), before);
  }
}

// The restored objects are many more than the unanswered requests.
TEST_F(CanMotion, ASilentNodeIsGivenUp) {
  CanCyclicBus cyclic(bus, {drive_with_a_value()}, {.period = 2ms, .sdo = {50ms, 0}, .stops_drives = false});
  line.axes()[0]->power_off(line.now());
  const Time begin = bus.now();
  EXPECT_THAT(problem_of([&] { cyclic.close(); }), HasSubstr("node 1"));
  EXPECT_LE(bus.now() - begin, 200ms) << "three timeouts";
}

}  // namespace
}  // namespace cyclic_bus_test
}  // namespace servodrome::master
