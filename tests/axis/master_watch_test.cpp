#include "axis/master_watch.hpp"

#include <gmock/gmock.h>

#include "axis/axis_rig.hpp"

// A moving axis after the cable of its master is pulled.
namespace servodrome::master {
namespace master_watch_test {
namespace {

using namespace test;

class Watched : public testing::TestWithParam<RigCase> {
 protected:
  std::uint32_t watched_time() { return rig.objects().read<std::uint32_t>(0x1016, 1); }
  std::optional<std::int16_t> option() { return rig.objects().read_if_present<std::int16_t>(0x6007); }
  void pull_cable_while_moving() {
    Axis402 axis(rig.objects(), rig.options());
    axis.enable();
    const AxisUnits units = axis.units().value_or(AxisUnits{131072, 131072, 131072});
    const MotionProfile profile{.velocity = static_cast<std::uint32_t>(units.velocity)};
    const std::string problem = problem_of([&] {
      axis.move_to(static_cast<std::int32_t>(500 * units.position), profile, 60s, [&](const AxisStatus&) {
        if (std::abs(rig.shaft_counts() - start) > 1000) rig.cut();
      });
    });
    EXPECT_THAT(problem, testing::HasSubstr("mem:"));
  }
  double counts_in_a_second() {
    const double before = rig.shaft_counts();
    rig.line.run_until(rig.line.now() + 1s);
    return std::abs(rig.shaft_counts() - before);
  }

  AxisRig rig{GetParam()};
  double start = rig.shaft_counts();
};
INSTANTIATE_TEST_SUITE_P(Drives, Watched,
                         testing::Values(RigCase{"ismc"}, RigCase{"pronet"}, RigCase{"ismk"}, RigCase{"generic402"}),
                         [](const auto& row) { return row.param.name(); });

TEST_P(Watched, StopsWhenTheCableIsPulled) {
  ObjectClient* const drives[] = {&rig.objects()};
  const MasterWatch watch(*rig.can, drives);
  EXPECT_EQ(watch.watched(), 1U);
  pull_cable_while_moving();
  rig.line.run_until(rig.line.now() + MasterWatch::longest_silence + 2s);
  EXPECT_LT(counts_in_a_second(), 100.0);
}

TEST_P(Watched, GoesOnWhenItIsNot) {
  pull_cable_while_moving();
  rig.line.run_until(rig.line.now() + MasterWatch::longest_silence + 2s);
  EXPECT_GT(counts_in_a_second(), 1000.0);
}

TEST_P(Watched, IsLeftAsItWas) {
  const auto before = option();
  ObjectClient* const drives[] = {&rig.objects()};
  {
    const MasterWatch watch(*rig.can, drives);
    EXPECT_EQ(watched_time(), 0x7F05DCU);
    EXPECT_NE(option(), 0);
    rig.objects().wait(10s);  // with the master's heartbeat the drive has no fault
    EXPECT_FALSE(rig.objects().latest_emergency());
  }
  EXPECT_EQ(watched_time(), 0U);
  EXPECT_EQ(option(), before);
  rig.objects().wait(5s);
  EXPECT_FALSE(rig.objects().latest_emergency());
}

TEST_P(Watched, AnotherMastersIsNotTakenAway) {
  constexpr std::uint32_t another = 0x7E0BB8;
  rig.objects().write<std::uint32_t>(0x1016, 1, another);
  ObjectClient* const drives[] = {&rig.objects()};
  {
    const MasterWatch watch(*rig.can, drives);
    EXPECT_EQ(watch.watched(), 0U);
    EXPECT_EQ(watched_time(), another);
  }
  EXPECT_EQ(watched_time(), another);
}

TEST_P(Watched, AnotherMastersInAnotherSubIndexIsNotTakenAway) {
  const auto entries = rig.objects().read<std::uint8_t>(0x1016, 0);
  if (entries < 2) return;  // the drive can monitor only one node
  const auto before = option();
  rig.objects().write<std::uint32_t>(0x1016, entries, 0x7E0BB8);
  ObjectClient* const drives[] = {&rig.objects()};
  const MasterWatch watch(*rig.can, drives);
  EXPECT_EQ(watch.watched(), 0U);
  EXPECT_EQ(option(), before);
}

TEST_P(Watched, SaysWhatItCannotPutBack) {
  const auto before = option();
  std::vector<std::string> said;
  {
    ObjectClient* const drives[] = {&rig.objects()};
    const MasterWatch watch(*rig.can, drives, [&](const std::string& sentence) { said.push_back(sentence); });
    rig.cut();
  }
  using testing::HasSubstr;
  ASSERT_EQ(said.size(), 1U);
  EXPECT_THAT(said[0], testing::AllOf(HasSubstr("mem:"), HasSubstr("1016h:01 = 007F05DCh"), HasSubstr("next reset")));
  EXPECT_EQ(said[0].find("6007h = 1") != std::string::npos, before == 0);
}

TEST_P(Watched, IsToldAnewAfterAReset) {
  const auto before = option();
  {
    ObjectClient* const drives[] = {&rig.objects()};
    MasterWatch watch(*rig.can, drives);
    Master(*rig.can).command_and_wait(NmtCommand::reset_node, static_cast<std::uint8_t>(rig.objects().address()), 10s);
    EXPECT_EQ(watched_time(), 0U);
    watch.renew(rig.objects());
    EXPECT_EQ(watched_time(), 0x7F05DCU);
    EXPECT_NE(option(), 0);
  }
  EXPECT_EQ(watched_time(), 0U);
  EXPECT_EQ(option(), before);
}

// A restart clears 1016h, also one that is too short for a missing answer. (A ProNet keeps it at reset communication.)
TEST_P(Watched, NoticesARestart) {
  ObjectClient* const drives[] = {&rig.objects()};
  MasterWatch watch(*rig.can, drives);
  const auto restart_and_renew = [&](const char* what, const auto& restart) {
    EXPECT_TRUE(watch.is_watching(rig.objects())) << what;
    EXPECT_FALSE(watch.has_restarted(rig.objects())) << what;
    restart();
    rig.objects().wait(3s);
    EXPECT_FALSE(watch.is_watching(rig.objects())) << what;
    EXPECT_TRUE(watch.has_restarted(rig.objects())) << what;
    watch.renew(rig.objects());
    EXPECT_EQ(watched_time(), 0x7F05DCU) << what;
  };
  const auto node = static_cast<std::uint8_t>(rig.objects().address());
  restart_and_renew("reset node", [&] { Master(*rig.can).command(NmtCommand::reset_node, node); });
  restart_and_renew("reset communication", [&] { Master(*rig.can).command(NmtCommand::reset_communication, node); });
  restart_and_renew("power", [&] {
    line::Axis& axis = *rig.line.axes()[0];
    axis.power_off(rig.line.now());
    axis.power_on(rig.line.now());
  });
  pull_cable_while_moving();
  rig.line.run_until(rig.line.now() + MasterWatch::longest_silence + 2s);
  EXPECT_LT(counts_in_a_second(), 100.0);
}

// A drive that stores its objects stores its own values.
TEST_P(Watched, IsReleasedAloneAndToldAnew) {
  const auto before = option();
  ObjectClient* const drives[] = {&rig.objects()};
  MasterWatch watch(*rig.can, drives);
  watch.release(rig.objects());
  EXPECT_EQ(watched_time(), 0U);
  EXPECT_EQ(option(), before);
  rig.objects().wait(3s);
  watch.renew(rig.objects());
  EXPECT_EQ(watched_time(), 0x7F05DCU);
  EXPECT_NE(option(), 0);
  watch.end();
  EXPECT_EQ(watched_time(), 0U);
  EXPECT_EQ(option(), before);
}

// Immediately, not only after the next heartbeat, which is up to 0.25 s later.
TEST_P(Watched, WatchesAtOnceWhenToldAnew) {
  ObjectClient* const drives[] = {&rig.objects()};
  MasterWatch watch(*rig.can, drives);
  rig.objects().write<std::uint32_t>(0x1016, 1, 0);  // as after a reset
  watch.renew(rig.objects());
  pull_cable_while_moving();
  rig.line.run_until(rig.line.now() + MasterWatch::longest_silence + 2s);
  EXPECT_LT(counts_in_a_second(), 100.0);
}

// Whatever ends the program, the supervision of a moving axis must stay on.
TEST_P(Watched, AnAxisThatStillMovesAtTheEndKeepsItsWatch) {
  std::vector<std::string> said;
  {
    ObjectClient* const drives[] = {&rig.objects()};
    const MasterWatch watch(*rig.can, drives, [&](const std::string& sentence) { said.push_back(sentence); });
    Axis402 axis(rig.objects(), rig.options());
    axis.enable();
    const AxisUnits units = axis.units().value_or(AxisUnits{131072, 131072, 131072});
    axis.run_at(static_cast<std::int32_t>(units.velocity), {}, 20s);
  }
  ASSERT_EQ(said.size(), 1U);
  EXPECT_THAT(said[0], testing::HasSubstr("misses this program's heartbeat"));
  EXPECT_EQ(watched_time(), 0x7F05DCU);
  rig.line.run_until(rig.line.now() + MasterWatch::longest_silence + 2s);
  EXPECT_LT(counts_in_a_second(), 100.0);
}

TEST_P(Watched, AnAxisThatHoldsItsPositionAtTheEndGoesOnHolding) {
  {
    ObjectClient* const drives[] = {&rig.objects()};
    const MasterWatch watch(*rig.can, drives);
    Axis402 axis(rig.objects(), rig.options());
    axis.enable();
  }
  EXPECT_EQ(watched_time(), 0U);
  rig.line.run_until(rig.line.now() + 5s);
  EXPECT_EQ(Axis402(rig.objects(), rig.options()).state(), PowerState::operation_enabled);
}

// Whichever of the node-IDs the program had.
TEST_P(Watched, WhatAPulledCableLeftBehindIsReplaced) {
  for (const std::uint32_t node_id : {127U, 126U, 120U}) {
    rig.objects().write<std::uint32_t>(0x1016, 1, node_id << 16 | 1500);
    ObjectClient* const drives[] = {&rig.objects()};
    {
      const MasterWatch watch(*rig.can, drives);
      EXPECT_EQ(watched_time(), 0x7F05DCU);
    }
    EXPECT_EQ(watched_time(), 0U);
  }
}

// Another program may have taken the drive, for example after a reset.
TEST_P(Watched, AtItsEndAnotherMastersEntryStays) {
  constexpr std::uint32_t another = 0x050BB8;
  {
    ObjectClient* const drives[] = {&rig.objects()};
    const MasterWatch watch(*rig.can, drives);
    rig.objects().write<std::uint32_t>(0x1016, 1, another);
  }
  EXPECT_EQ(watched_time(), another);
}

TEST_P(Watched, CanBeEndedAndToldAnew) {
  const auto before = option();
  ObjectClient* const drives[] = {&rig.objects()};
  MasterWatch watch(*rig.can, drives);
  watch.end();
  EXPECT_EQ(watch.watched(), 0U);
  EXPECT_EQ(watched_time(), 0U);
  EXPECT_EQ(option(), before);
  const Time ended = rig.line.now();
  watch.renew(rig.objects());
  EXPECT_LT(rig.line.now() - ended, MasterWatch::listening_time) << "it has listened before";
  EXPECT_EQ(watched_time(), 0x7F05DCU);
  pull_cable_while_moving();
  rig.line.run_until(rig.line.now() + MasterWatch::longest_silence + 2s);
  EXPECT_LT(counts_in_a_second(), 100.0);
}

// ---- Two programs, each with its own connection to one bus ----

class WatchedByTwo : public testing::TestWithParam<RigCase> {
 protected:
  static std::uint32_t entry(ObjectClient& drive) { return drive.read<std::uint32_t>(0x1016, 1); }
  // The first program works while `other_bus` runs. It is killed by keep.reset().
  Bus::Subscription keep_first_program() {
    return other_bus.every(10ms, [this] { rig.can->drain(); });
  }
  void start_motion() {
    Axis402 axis(rig.objects(), rig.options());
    axis.enable();
    const AxisUnits units = axis.units().value_or(AxisUnits{131072, 131072, 131072});
    axis.run_at(static_cast<std::int32_t>(units.velocity), {}, 20s);
  }
  double counts_in_a_second() {
    const double before = rig.shaft_counts();
    other_bus.run_for(1s);
    return std::abs(rig.shaft_counts() - before);
  }

  AxisRig rig{GetParam(), 2};
  Bus other_bus{std::make_unique<links::MemoryCanClient>(rig.line.buses()[0]->bus, rig.line), "mem:", &rig.line};
  SdoClient first_to_other{other_bus, 1};  // the clients of the second program
  SdoClient second_to_other{other_bus, 2};
};
INSTANTIATE_TEST_SUITE_P(Drives, WatchedByTwo,
                         testing::Values(RigCase{"ismc"}, RigCase{"pronet"}, RigCase{"ismk"}, RigCase{"generic402"}),
                         [](const auto& row) { return row.param.name(); });

// The second program continues to send its heartbeat.
TEST_P(WatchedByTwo, TheDriveOfAKilledProgramStops) {
  ObjectClient* const moved[] = {&rig.objects()};
  const MasterWatch watch(*rig.can, moved);
  start_motion();
  Bus::Subscription keep = keep_first_program();
  ObjectClient* const others[] = {&second_to_other};
  const MasterWatch other_watch(other_bus, others);
  EXPECT_EQ(other_watch.watched(), 1U);
  other_bus.run_for(MasterWatch::longest_silence + 2s);
  EXPECT_GT(counts_in_a_second(), 1000.0) << "both programs run";
  keep.reset();
  other_bus.run_for(MasterWatch::longest_silence + 2s);
  EXPECT_LT(counts_in_a_second(), 100.0);
}

TEST_P(WatchedByTwo, TheDriveOfAnotherProgramIsLeftToIt) {
  ObjectClient* const drives[] = {&rig.objects()};
  const MasterWatch watch(*rig.can, drives);
  Bus::Subscription keep = keep_first_program();
  {
    ObjectClient* const same[] = {&first_to_other};
    const MasterWatch other_watch(other_bus, same);
    EXPECT_EQ(other_watch.watched(), 0U);
  }
  EXPECT_EQ(entry(first_to_other), 0x7F05DCU);
  start_motion();
  keep.reset();
  other_bus.run_for(MasterWatch::longest_silence + 2s);
  EXPECT_LT(counts_in_a_second(), 100.0);
}

TEST_P(WatchedByTwo, TheFreeOneOfTwoDrivesMonitorsAnotherHeartbeat) {
  ObjectClient* const drives[] = {&rig.objects()};
  const MasterWatch watch(*rig.can, drives);
  const Bus::Subscription keep = keep_first_program();
  ObjectClient* const both[] = {&first_to_other, &second_to_other};
  const MasterWatch other_watch(other_bus, both);
  EXPECT_FALSE(other_watch.is_watching(first_to_other));
  EXPECT_TRUE(other_watch.is_watching(second_to_other));
  EXPECT_EQ(entry(first_to_other), 0x7F05DCU);
  EXPECT_EQ(entry(second_to_other), 0x7E05DCU);
}

// The heartbeats of programs, or of nodes with these node-IDs.
TEST_P(WatchedByTwo, UsesNoNodeIdThatIsInUse) {
  std::vector<std::uint32_t> in_use{0x77F, 0x77D};
  const Bus::Subscription others = rig.can->every(250ms, [&] {
    for (const std::uint32_t id : in_use) other_bus.send(id, {0x05});
  });
  ObjectClient* const drives[] = {&rig.objects()};
  {
    const MasterWatch watch(*rig.can, drives);
    EXPECT_EQ(entry(rig.objects()), 0x7E05DCU);
  }
  in_use = {0x778, 0x779, 0x77A, 0x77B, 0x77C, 0x77D, 0x77E, 0x77F};
  const MasterWatch watch(*rig.can, drives);
  EXPECT_EQ(watch.watched(), 0U);
  EXPECT_EQ(entry(rig.objects()), 0U);
}

TEST_P(WatchedByTwo, ListensOnceForAllDrives) {
  const Time start = rig.line.now();
  ObjectClient* const drives[] = {&rig.objects(0), &rig.objects(1)};
  const MasterWatch watch(*rig.can, drives);
  EXPECT_EQ(watch.watched(), 2U);
  EXPECT_LT(rig.line.now() - start, 2 * MasterWatch::listening_time);
}

// Its search for a node-ID begins at 124, the drive's own.
TEST(WatchedNode, DoesNotMonitorItself) {
  line::Line line(line::test::settings_of(R"(
clock = "virtual"
[[bus]]
name = "field"
[[axis]]
name = "axis"
product = "generic402"
bus = "field"
node = 124
)"));
  Bus bus(std::make_unique<links::MemoryCanClient>(line.buses()[0]->bus, line), "mem:", &line);
  bus.run_for(100ms);
  SdoClient drive(bus, 124);
  ObjectClient* const drives[] = {&drive};
  const MasterWatch watch(bus, drives);
  EXPECT_EQ(drive.read<std::uint32_t>(0x1016, 1), 0x7B05DCU);
}

}  // namespace
}  // namespace master_watch_test
}  // namespace servodrome::master
