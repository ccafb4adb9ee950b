// The master with complete drives on an EtherCAT segment, in virtual time: homing and moves by objects, and the cyclic
// synchronous modes by process data.
#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "axis/axis402.hpp"
#include "axis/cyclic/cyclic_axis.hpp"
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/cyclic/lost_master.hpp"
#include "catalogue/product.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"
#include "master/ethercat/coe_objects.hpp"
#include "master/problem_of.hpp"

namespace servodrome::master {
namespace ethercat_axes_test {
namespace {

using test::problem_of;

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr std::int32_t revolution = 131072;

constexpr const char* three_drives = R"(
clock = "virtual"
[[bus]]
name = "ring"
type = "ethercat"
[[axis]]
name = "x"
product = "generic402-ec"
bus = "ring"
alias = 301
oscillator_ppm = 60
cable_ns = 120
[[axis]]
name = "y"
product = "generic402-ec"
bus = "ring"
oscillator_ppm = -90
cable_ns = 500
[[axis]]
name = "z"
product = "generic402-ec"
bus = "ring"
oscillator_ppm = 100
)";

// The slaves of a line with one EtherCAT bus.
class SlavesOfLine : public testing::Test {
 protected:
  explicit SlavesOfLine(const char* line_file) : line(line::test::settings_of(line_file)) {
    for (const FoundSlave& one : found) slaves.push_back(std::make_unique<EthercatSlave>(master, one));
    for (const auto& slave : slaves) all.push_back(slave.get());
  }

  line::Line line;
  EthercatMaster master{std::make_unique<links::MemoryEthercatClient>(line.ethercat_buses()[0]->bus, line)};
  std::vector<FoundSlave> found = scan_slaves(master);
  std::vector<std::unique_ptr<EthercatSlave>> slaves;
  std::vector<EthercatSlave*> all;
};

class EthercatAxes : public SlavesOfLine {
 protected:
  EthercatAxes() : SlavesOfLine(three_drives) {}
  OperationOptions options(bool clocks) const {
    return {.cyclic = {.period = 1ms}, .distributed_clocks = clocks, .clock = {.drift_frames = 3000}};
  }
};

TEST_F(EthercatAxes, AreFound) {
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].alias, 301);
  EXPECT_EQ(found[0].sii.identity.vendor_id, slaves[0]->coe().read<std::uint32_t>(0x1018, 1));
  EXPECT_EQ(found[0].sii.identity.product_code, slaves[0]->coe().read<std::uint32_t>(0x1018, 2));
  EXPECT_EQ(slaves[0]->coe().read<std::uint32_t>(0x1000) & 0xFFFF, 402U);
}

// A program that only watches must not end the cycles of the one that moves the axes.
TEST_F(EthercatAxes, TheEndOfAWatchingBusEndsItsOwnCallsOnly) {
  EthercatOperation operation(master, found, all, options(false));
  EthercatCyclicBus moving(master, operation);
  unsigned moved = 0;
  unsigned watched = 0;
  moving.on_cycle([&] { ++moved; });
  {
    EthercatCyclicBus watching(master, operation, {.watches = true});
    watching.on_cycle([&] { ++watched; });
    master.wait(10ms);
    EXPECT_GE(watched, 9U);
  }
  moved = watched = 0;
  master.wait(10ms);
  EXPECT_GE(moved, 9U);
  EXPECT_EQ(watched, 0U);
}

class EthercatAxesFreeAndClocked : public EthercatAxes, public testing::WithParamInterface<bool> {};
INSTANTIATE_TEST_SUITE_P(FreeRunAndClocks, EthercatAxesFreeAndClocked, testing::Bool());

TEST_P(EthercatAxesFreeAndClocked, HomesAndMovesByItsObjects) {
  EthercatOperation operation(master, found, all, options(GetParam()));
  CoeObjects objects(*all[1], operation.exchange(), 1);
  Axis402 axis(objects);
  axis.enable();
  EXPECT_EQ(axis.state(), PowerState::operation_enabled);
  axis.home({35, {}, {}, {}, 0}, 5s);
  EXPECT_NEAR(axis.position(), 0, 20);
  axis.move_to(3 * revolution, {20 * revolution, 200 * revolution, 200 * revolution}, 5s);
  EXPECT_NEAR(axis.position(), 3 * revolution, 50);
  axis.move_by(-revolution, {20 * revolution, 200 * revolution, 200 * revolution}, 5s);
  EXPECT_NEAR(axis.position(), 2 * revolution, 50);
  axis.run_at(5 * revolution, {{}, 100 * revolution, 100 * revolution}, 5s);
  axis.stop();
  axis.disable();
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
  operation.exchange().check();
  EXPECT_EQ(operation.exchange().statistics().wrong_counters, 0U);
  EXPECT_EQ(operation.exchange().statistics().lost, 0U);
}

// All three axes follow a sine in cyclic synchronous position.
TEST_P(EthercatAxesFreeAndClocked, FollowTargetsCycleByCycle) {
  EthercatOperation operation(master, found, all, options(GetParam()));
  CyclicExchange& exchange = operation.exchange();
  std::vector<CyclicAxis> axes;
  for (std::size_t i = 0; i < all.size(); ++i) {
    CoeObjects(*all[i], exchange, i).write<std::int8_t>(0x6060, 0, 8);
    axes.emplace_back(exchange.image(i));
  }
  bool enabled = false;
  unsigned cycle = 0;
  std::vector<std::int32_t> start(axes.size());
  double worst = 0.0;
  std::vector<std::int32_t> targets(axes.size());
  exchange.on_cycle([&] {
    if (!enabled) {
      enabled = true;
      for (std::size_t i = 0; i < axes.size(); ++i) {
        enabled = axes[i].enable() && enabled;
        start[i] = targets[i] = axes[i].position();
      }
      return;
    }
    ++cycle;
    for (std::size_t i = 0; i < axes.size(); ++i) {
      worst = std::max(worst, std::abs(static_cast<double>(axes[i].position()) - targets[i]) / revolution);
      const double angle = 2 * 3.14159265358979 * cycle * 0.001;  // 1 Hz
      targets[i] = start[i] + static_cast<std::int32_t>(std::lround(0.5 * revolution * (1 - std::cos(angle))));
      axes[i].set_target_position(targets[i]);
    }
  });
  master.wait(3s);
  exchange.on_cycle({});
  exchange.check();
  EXPECT_TRUE(enabled);
  EXPECT_GT(cycle, 2500U);
  EXPECT_GT(worst, 0.0001);
  EXPECT_LT(worst, 0.01);  // a lag of one or two cycles, and that of the loop
  for (const CyclicAxis& axis : axes) {
    EXPECT_EQ(axis.state(), PowerState::operation_enabled);
    EXPECT_EQ(axis.mode(), 8);
  }
  std::printf("following within %.4f revolutions\n", worst);
}

TEST_F(EthercatAxes, ADriveWhoseMasterIsGoneStopsAndSaysWhy) {
  EthercatOperation operation(master, found, all, options(false));
  CoeObjects objects(*all[0], operation.exchange(), 0);
  Axis402 axis(objects);
  axis.enable();
  operation.exchange().stop();
  line.run_until(line.now() + 500ms);
  operation.exchange().start();
  EXPECT_THAT(problem_of([&] { objects.wait(20ms); }), HasSubstr("SAFEOP with error 001Bh sync manager watchdog"));
}

constexpr const char* two_kincos = R"(
clock = "virtual"
[[bus]]
name = "ring"
type = "ethercat"
[[axis]]
name = "x"
product = "ismk-ea"
bus = "ring"
[[axis]]
name = "y"
product = "ismk-ea"
bus = "ring"
)";

// The factory value of 6007h of these drives is 0.
class EthercatKincos : public SlavesOfLine {
 protected:
  EthercatKincos() : SlavesOfLine(two_kincos) {}
  std::int16_t option(std::size_t slave) { return slaves[slave]->coe().read<std::int16_t>(0x6007); }
  bool turns(std::size_t axis) {
    const auto before = line.axes()[axis]->plant().position_counts();
    master.wait(100ms);
    return std::abs(line.axes()[axis]->plant().position_counts() - before) > 50;
  }
  static void run(Axis402& axis) {
    axis.reset_fault();
    axis.enable();
    const AxisUnits units = axis.units().value();
    const auto ramp = static_cast<std::uint32_t>(100 * units.acceleration);
    axis.run_at(static_cast<std::int32_t>(5 * units.velocity), {.acceleration = ramp, .deceleration = ramp}, 5s);
  }

  const OperationOptions options{.cyclic = {.period = 2ms, .tolerated_losses = 50}, .sync_error_limit = 0};
};

TEST_F(EthercatKincos, StopWhenTheirMasterIsGone) {
  {
    LostMasterReaction reaction(*slaves[0]);
    EXPECT_EQ(option(0), 1);
    EthercatOperation operation(master, found, all, options);
    CoeObjects objects(*all[0], operation.exchange(), 0);
    Axis402 axis(objects, {.product = &catalogue::product_of("ismk-ea")});
    run(axis);
    EXPECT_TRUE(turns(0));
    EXPECT_FALSE(reaction.end()) << "the motor is on";
    operation.exchange().stop();
    master.wait(1s);
    EXPECT_FALSE(turns(0));
  }
  EXPECT_EQ(option(0), 0);
  EXPECT_EQ(option(1), 0) << "it has no reaction object";
}

TEST_F(EthercatKincos, KeepTheirOwnReaction) {
  slaves[0]->coe().write<std::int16_t>(0x6007, 0, 1);
  { const LostMasterReaction reaction(*slaves[0]); }
  EXPECT_EQ(option(0), 1);
}

TEST_F(EthercatKincos, OneIsStoppedAfterTheOtherHasLostItsSupply) {
  EthercatOperation operation(master, found, all, options);
  CoeObjects objects(*all[0], operation.exchange(), 0);
  Axis402 axis(objects, {.product = &catalogue::product_of("ismk-ea")});
  run(axis);
  ASSERT_TRUE(turns(0));
  line.axes()[1]->power_off(line.now());
  master.wait(500ms);
  EXPECT_NE(problem_of([&] { operation.exchange().check(); }), "");
  axis.stop();
  axis.disable();
  EXPECT_FALSE(turns(0));
  EXPECT_EQ(axis.state(), PowerState::switch_on_disabled);
}

TEST_F(EthercatAxes, AFaultIsNamedWithItsEmergency) {
  EthercatOperation operation(master, found, all, options(false));
  CoeObjects objects(*all[0], operation.exchange(), 0);
  Axis402 axis(objects);
  axis.enable();
  line.axes()[0]->inject(drive::Cause::over_voltage, true);
  master.wait(50ms);
  EXPECT_THAT(problem_of([&] { axis.move_to(revolution, {}, 5s); }),
              HasSubstr("error code 603Fh 3210h DC link over-voltage, latest EMCY 3210h"));
  line.axes()[0]->inject(drive::Cause::over_voltage, false);
  axis.reset_fault();
  axis.enable();
  EXPECT_EQ(axis.state(), PowerState::operation_enabled);
}

}  // namespace
}  // namespace ethercat_axes_test
}  // namespace servodrome::master
