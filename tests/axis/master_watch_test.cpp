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

TEST_P(Watched, WhatAPulledCableLeftBehindIsOurs) {
  rig.objects().write<std::uint32_t>(0x1016, 1, 0x7F05DC);
  ObjectClient* const drives[] = {&rig.objects()};
  { const MasterWatch watch(*rig.can, drives); }
  EXPECT_EQ(watched_time(), 0U);
}

}  // namespace
}  // namespace master_watch_test
}  // namespace servodrome::master
