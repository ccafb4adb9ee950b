// What the checks do to the axis, its objects and the other devices of the bus, also if something goes wrong.
#include <gmock/gmock.h>

#include "tools/conform/conform_can_rig.hpp"

namespace servodrome::master::conform::test {
namespace conform_safety_test {
namespace {

std::uint16_t state_bits(CanRig& rig) {
  return static_cast<std::uint16_t>(rig.line.axes()[0]->device().dictionary().number(0x6041, 0) & 0x6F);
}
constexpr std::uint16_t bits_enabled = 0x27;
constexpr std::uint16_t bits_disabled = 0x40;
constexpr double revolution_counts = 131072.0;

double shaft_of(CanRig& rig) { return static_cast<double>(rig.line.axes()[0]->plant().position_counts()); }

// The greatest distance in counts of the shaft from its place at begin().
class FurthestWay {
 public:
  explicit FurthestWay(CanRig& rig) : rig_(rig) {
    begin();
    rig.from_drive = [this](Frame&) {
      furthest_ = std::max(furthest_, std::abs(shaft_of(rig_) - start_));
      return true;
    };
  }
  void begin() {
    start_ = shaft_of(rig_);
    furthest_ = 0.0;
  }
  double furthest() const { return furthest_; }

 private:
  CanRig& rig_;
  double start_ = 0.0;
  double furthest_ = 0.0;
};

// Targets of another master stay in the drive; the checks enable the axis in its mode.
TEST(ConformSafety, AStandingTargetDoesNotMoveTheAxisWhenACheckEnablesIt) {
  struct Standing {
    std::int8_t mode;
    std::uint16_t index;
    std::int32_t value;
    std::size_t bytes;
  };
  for (const Standing& standing :
       {Standing{3, 0x60FF, 200'000, 4}, Standing{4, 0x6071, 300, 2}, Standing{8, 0x607A, 500'000, 4},
        Standing{9, 0x60FF, 200'000, 4}, Standing{9, 0x60B1, 200'000, 4}, Standing{10, 0x60B2, 300, 2}}) {
    CanRig rig("generic402");
    const auto bytes = std::as_bytes(std::span(&standing.value, 1)).first(standing.bytes);
    rig.sdo.write<std::int8_t>(0x6060, 0, standing.mode);
    rig.sdo.download({standing.index, 0}, bytes);
    FurthestWay way(rig);
    const Report report = rig.run({.only = {"power.transition-4", "power.voltage-enabled", "cst.at-rest"}});
    EXPECT_EQ(text_of(report, {Verdict::fail, Verdict::skipped}), "");
    EXPECT_LT(way.furthest(), revolution_counts / 1000.0)
        << fmt::format("mode {}, {:04X}h", standing.mode, standing.index);
    EXPECT_EQ(rig.sdo.read<std::int8_t>(0x6060), standing.mode);
    EXPECT_EQ(rig.sdo.read<std::int32_t>(standing.index), standing.value);
  }
}

// The link fails in the halt of the check and is back when the program looks for the drive again.
TEST(ConformSafety, AfterAGapOfTheLinkTheTargetsAreRestoredOnlyWhenTheAxisIsOff) {
  constexpr std::int32_t standing = 300'000;
  CanRig rig("generic402");
  rig.sdo.write<std::int32_t>(0x60FF, 0, standing);
  bool is_gap = false;
  bool was_gap = false;
  std::vector<std::uint16_t> states;
  rig.to_drive = [&](Frame& frame) {
    if (is_write(frame, 0x6040) && word_in(frame) == 0x010F && !was_gap) is_gap = was_gap = true;
    if (frame.id == 0) is_gap = false;
    if (is_gap && frame.id == 0x605) return false;
    if (is_write(frame, 0x60FF) && number_in(frame) == standing) states.push_back(state_bits(rig));
    return true;
  };
  const Report report = rig.run({.only = {"pv.halt"}});
  EXPECT_TRUE(was_gap);
  EXPECT_FALSE(report.lost);
  EXPECT_TRUE(report.at_rest);
  EXPECT_THAT(states, testing::ElementsAre(bits_disabled));
  EXPECT_EQ(state_bits(rig), bits_disabled);
  EXPECT_EQ(rig.sdo.read<std::int32_t>(0x60FF), standing);
}

TEST(ConformSafety, AnAxisThatCannotBeSwitchedOffEndsTheRunAndKeepsItsObjects) {
  constexpr std::int32_t standing = 300'000;
  CanRig rig("generic402");
  rig.sdo.write<std::int32_t>(0x60FF, 0, standing);
  bool is_on = false;
  rig.to_drive = [&](Frame& frame) {
    if (!is_write(frame, 0x6040)) return true;
    is_on = is_on || (word_in(frame) & 0x0F) == 0x0F;
    if (is_on) put_word(frame, 0x000F);
    return true;
  };
  const Report report = rig.run({.watch = false, .only = {"pv.halt", "nmt.guarding"}});
  ASSERT_EQ(report.outcomes.size(), 2U);
  EXPECT_EQ(text_of(report.outcomes[1]),
            text_of({report.outcomes[1].check, Verdict::skipped, "the axis could not be brought to rest"}));
  EXPECT_FALSE(report.at_rest);
  EXPECT_THAT(report.problems, testing::Contains(testing::HasSubstr("the axis may move")));
  EXPECT_EQ(state_bits(rig), bits_enabled);
  EXPECT_EQ(rig.sdo.read<std::int32_t>(0x60FF), 0);
}

// With 100 position units in a revolution two positions 20 ms apart are nearly equal while the axis turns.
TEST(ConformSafety, TheAxisHasStoppedBeforeItsPowerIsSwitchedOffWhateverTheUnits) {
  CanRig rig("generic402");
  rig.sdo.write<std::uint32_t>(0x6092, 1, 100);
  rig.sdo.write<std::uint32_t>(0x6092, 2, 1);
  int left = -1;
  double fastest_without_power = 0.0;
  double last = shaft_of(rig);
  Time last_time{};
  rig.to_drive = [&](Frame& frame) {
    if (is_write(frame, 0x60FF) && number_in(frame) != 0) left = 8;  // the axis is accelerating
    return true;
  };
  rig.from_drive = [&](Frame&) {
    const Time span = rig.bus.now() - last_time;
    if (span < 5ms) return true;
    const double speed = std::abs(shaft_of(rig) - last) / std::chrono::duration<double>(span).count();
    if (state_bits(rig) != bits_enabled && last_time != Time{})
      fastest_without_power = std::max(fastest_without_power, speed);
    last = shaft_of(rig);
    last_time = rig.bus.now();
    return true;
  };
  Subject subject(CanAccess{rig.bus, rig.sdo}, {.cancelled = [&] { return left > 0 && --left == 0; }});
  const Report report = run_checks(subject, {.only = {"pv.halt"}});
  EXPECT_TRUE(report.cancelled);
  EXPECT_TRUE(report.at_rest);
  EXPECT_LT(fastest_without_power, revolution_counts / 20.0);
}

// A drive that takes a relative target for an absolute one would turn by revolutions.
TEST(ConformSafety, AWrongMotionEndsAtThePermittedWay) {
  for (const double revolutions : {0.1, 0.5}) {
    CanRig rig("generic402", "", 1'000'000);
    rig.to_drive = [&](Frame& frame) {
      if (is_write(frame, 0x6040)) put_word(frame, word_in(frame) & ~0x40U);
      return true;
    };
    FurthestWay way(rig);
    Subject subject(CanAccess{rig.bus, rig.sdo}, {.revolutions = revolutions});
    const Report report = run_checks(subject, {.only = {"pp.relative"}});
    EXPECT_THAT(failed(report), testing::ElementsAre("pp.relative"));
    EXPECT_LT(way.furthest(), revolution_counts * (revolutions + 0.15));
    EXPECT_EQ(state_bits(rig), bits_disabled);
  }
}

TEST(ConformSafety, RevolutionsLimitTheMotionsOfTheProfileModes) {
  for (const double revolutions : {0.05, 0.5, 4.0}) {
    CanRig rig("generic402");
    FurthestWay way(rig);
    Subject subject(CanAccess{rig.bus, rig.sdo}, {.revolutions = revolutions});
    run_checks(subject, {.only = {"pp", "pv", "fault", "homing", "probe.off"},
                         .before = [&](const Check&) { way.begin(); },
                         .after =
                             [&](const Outcome& outcome) {
                               EXPECT_NE(outcome.verdict, Verdict::fail) << revolutions << "\n" << text_of(outcome);
                               EXPECT_LE(way.furthest(), revolution_counts * (revolutions + 0.02)) << outcome.check->id;
                             }});
  }
}

// Interrupts each moment of the homing checks: the position value must be as before.
TEST(ConformSafety, AnInterruptedHomingCheckRestoresThePositionValue) {
  constexpr int start_counts = 1'000'000;
  int restored = 0;
  bool is_cancelled = true;
  for (int polls = 1; is_cancelled; ++polls) {
    CanRig rig("generic402", "", start_counts);
    int left = polls;
    Subject subject(CanAccess{rig.bus, rig.sdo}, {.cancelled = [&] { return --left < 0; }});
    const double value = rig.sdo.read<std::int32_t>(0x6064) - shaft_of(rig);
    const Report report = run_checks(subject, {.only = {"homing.attained", "homing.offset"}});
    is_cancelled = report.cancelled;
    restored += is_cancelled ? 1 : 0;
    EXPECT_TRUE(report.at_rest);
    EXPECT_EQ(text_of(report, {Verdict::fail}), "");
    EXPECT_EQ(state_bits(rig), bits_disabled);
    EXPECT_NEAR(rig.sdo.read<std::int32_t>(0x6064) - shaft_of(rig), value, revolution_counts / 25.0) << polls;
  }
  EXPECT_GT(restored, 5);
}

TEST(ConformSafety, ALostAnswerInHomingDoesNotLoseThePositionValue) {
  CanRig rig("generic402", "", 1'000'000);
  bool is_homed = false;
  int lost = 0;
  rig.to_drive = [&](Frame& frame) {
    is_homed = is_homed || (is_write(frame, 0x6040) && word_in(frame) == 0x001F);
    if (!is_homed || lost == 4 || frame.id != 0x605 || is_write(frame, 0x6040)) return true;
    ++lost;  // a read, its retry, and the abort after each
    return false;
  };
  const double value = rig.sdo.read<std::int32_t>(0x6064) - shaft_of(rig);
  const Report report = rig.run({.only = {"homing.attained"}});
  EXPECT_EQ(lost, 4);
  EXPECT_THAT(failed(report), testing::ElementsAre("homing.attained"));
  EXPECT_NEAR(rig.sdo.read<std::int32_t>(0x6064) - shaft_of(rig), value, revolution_counts / 25.0);
}

// Method 35 in place of the search sets the position value to 0.
TEST(ConformSafety, ASearchThatEndsEarlyReportsAChangedPositionValue) {
  for (const bool is_interrupted : {false, true}) {
    CanRig rig("generic402", "", 1'000'000);
    bool is_homed = false;
    int lost = 0;
    rig.to_drive = [&](Frame& frame) {
      if (is_write(frame, 0x6098)) frame.data[4] = 35;
      is_homed = is_homed || (is_write(frame, 0x6040) && word_in(frame) == 0x001F);
      if (is_interrupted || !is_homed || lost == 4 || frame.id != 0x605 || is_write(frame, 0x6040)) return true;
      ++lost;
      return false;
    };
    rig.cancelled = [&] { return is_interrupted && is_homed; };
    const Report report = rig.run({.only = {"homing.not-attained-while-searching"}});
    EXPECT_EQ(report.cancelled, is_interrupted);
    ASSERT_EQ(report.problems.size(), 1U);
    EXPECT_THAT(report.problems[0], testing::HasSubstr("changed the position value by -"));
  }
}

// The axis is switched off in place of being homed.
TEST(ConformSafety, AnAxisThatIsOffIsNotHomedAgain) {
  CanRig rig("generic402", "", 1'000'000);
  int starts = 0;
  rig.to_drive = [&](Frame& frame) {
    if (!is_write(frame, 0x6040) || word_in(frame) != 0x001F) return true;
    ++starts;
    put_word(frame, 0x0000);
    return true;
  };
  const Report report = rig.run({.only = {"homing.attained"}});
  EXPECT_EQ(starts, 1);
  EXPECT_EQ(text_of(report, {}), "");
  EXPECT_LT(report.outcomes[0].duration, 4s) << "the check itself waits 3 s for the end of homing";
}

// ---- Positions that wrap around (607Bh), within one revolution

struct WrappingRig : CanRig {
  explicit WrappingRig(int start_counts) : CanRig("generic402", "", start_counts) {
    sdo.write<std::int32_t>(0x607B, 1, 0);
    sdo.write<std::int32_t>(0x607B, 2, 131071);
  }
};

TEST(ConformSafety, APositionThatWrapsAroundIsOnThePermittedWay) {
  WrappingRig rig(130'000);
  const Report report = rig.run({.only = {"power", "pv", "pp", "csp", "csv", "cst", "homing", "fault", "probe"}});
  EXPECT_EQ(text_of(report, {Verdict::fail}), "");
  EXPECT_THAT(text_of(report, {Verdict::pass}), testing::HasSubstr("pv.target-reached"));
  EXPECT_THAT(text_of(report, {Verdict::skipped}), testing::HasSubstr("wraps around"));
}

// The drive takes the sign from negative velocities. Half a revolution either way is the whole range.
TEST(ConformSafety, AWrongMotionEndsAtThePermittedWayAlsoIfThePositionWrapsAround) {
  WrappingRig rig(130'000);
  rig.to_drive = [](Frame& frame) {
    const auto velocity = static_cast<std::int32_t>(number_in(frame));
    if (is_write(frame, 0x60FF) && velocity < 0) std::memcpy(&frame.data[4], std::array{-velocity}.data(), 4);
    return true;
  };
  FurthestWay way(rig);
  const Report report = rig.run({.only = {"pv.target-reached"}});
  EXPECT_THAT(failed(report), testing::ElementsAre("pv.target-reached"));
  EXPECT_LT(way.furthest(), revolution_counts * 0.65);
}

TEST(ConformSafety, AnAxisAtTheEndOfTheRangeIsAtRest) {
  WrappingRig rig(0);
  bool is_high = false;
  rig.from_drive = [&](Frame& frame) {
    if (!is_answer(frame, 0x6064)) return true;
    is_high = !is_high;
    std::memcpy(&frame.data[4], std::array{is_high ? 131071 : 0}.data(), 4);
    return true;
  };
  const Report report = rig.run({.only = {"power.voltage-enabled"}});
  EXPECT_EQ(text_of(report, {Verdict::fail}), "");
  EXPECT_TRUE(report.at_rest);
}

// The permitted way is longer than the range.
TEST(ConformSafety, TheTargetOfAFollowingErrorStaysInTheRange) {
  for (const int start : {5'000, 65'000, 126'000}) {
    WrappingRig rig(start);
    std::vector<std::int32_t> targets;
    rig.to_drive = [&](Frame& frame) {
      if (is_write(frame, 0x607A)) targets.push_back(static_cast<std::int32_t>(number_in(frame)));
      return true;
    };
    Subject subject(CanAccess{rig.bus, rig.sdo}, {.revolutions = 2.0});
    const Report report = run_checks(subject, {.only = {"fault.reaction"}});
    EXPECT_EQ(text_of(report, {Verdict::fail, Verdict::skipped}), "") << start;
    EXPECT_THAT(targets, testing::Each(testing::AllOf(testing::Ge(0), testing::Le(131071)))) << start;
    EXPECT_THAT(targets,
                testing::Contains(testing::Not(testing::AllOf(testing::Gt(start - 5'000), testing::Lt(start + 5'000)))))
        << start;
  }
}

// The drive stays in operation enabled until its brake has closed.
TEST(ConformSafety, AnAxisIsOffOnlyWhenItsBrakeHasClosed) {
  CanRig rig("ismk");
  rig.sdo.write<std::uint16_t>(0x6410, 0x12, 12'000);
  rig.sdo.write<std::uint8_t>(0x6410, 0x17, 1);
  const Report report = rig.run({.only = {"power.transition-4", "power.transition-9"}});
  EXPECT_EQ(text_of(report, {Verdict::fail, Verdict::skipped}), "");
  EXPECT_TRUE(report.at_rest);
  EXPECT_EQ(state_bits(rig) & ~0x20U, bits_disabled);
}

// The drive takes 605Ah = 2 in place of 6, and leaves quick stop active when its brake has closed.
TEST(ConformSafety, AQuickStopIsHeldOnlyIfItOutlastsTheBrake) {
  CanRig rig("generic402");
  rig.sdo.write<std::uint16_t>(0x2020, 2, 1500);
  rig.to_drive = [](Frame& frame) {
    if (is_write(frame, 0x605A) && word_in(frame) == 6) put_word(frame, 2);
    return true;
  };
  const Report report = rig.run({.only = {"power.transition-11", "power.transition-12", "power.transition-16"}});
  EXPECT_THAT(failed(report),
              testing::ElementsAre("power.transition-11", "power.transition-12", "power.transition-16"));
}

// The loss of a heartbeat causes the faults then.
TEST(ConformSafety, ADriveWithoutFollowingErrorPassesTheChecksOfFaults) {
  CanRig rig("generic402");
  rig.from_drive = [](Frame& frame) {
    if (is_answer(frame, 0x6065)) {
      frame.data[0] = 0x80;
      constexpr std::array absent{std::uint32_t{0x06020000}};
      std::memcpy(&frame.data[4], absent.data(), 4);
    }
    return true;
  };
  const Report report = rig.run({.only = {"fault"}});
  EXPECT_EQ(text_of(report, {Verdict::fail}), "");
  EXPECT_EQ(report.count(Verdict::skipped), 1U) << text_of(report, {Verdict::skipped});
}

// An object that could not be read must not be written, because it could not be restored.
TEST(ConformSafety, AnObjectIsWrittenOnlyIfItsValueIsKnown) {
  CanRig rig("generic402");
  rig.sdo.write<std::uint32_t>(0x6085, 0, 4711);
  bool is_running = false;
  unsigned reads = 0;
  unsigned writes = 0;
  rig.to_drive = [&](Frame& frame) {
    if (!is_running || frame.id != 0x605 || (frame.data[1] | frame.data[2] << 8) != 0x6085) return true;
    if (is_write(frame, 0x6085)) ++writes;
    if ((frame.data[0] & 0xE0) == 0x40) ++reads;
    return reads != 2 && reads != 3;  // the second read, for the value before, and its retry get no answer
  };
  const Report report = rig.run({.only = {"pp.acknowledge"}, .before = [&](const Check&) { is_running = true; }});
  EXPECT_THAT(failed(report), testing::ElementsAre("pp.acknowledge"));
  EXPECT_EQ(writes, 0U);
  rig.to_drive = {};
  EXPECT_EQ(rig.sdo.read<std::uint32_t>(0x6085), 4711U);
}

// The supply fails for half a second before the controlword with this number.
TEST(ConformSafety, AfterAGapOfThePowerTheDriveIsAsBefore) {
  for (int moment = 1; moment < 80; moment += 9) {
    CanRig rig("generic402");
    line::Axis& axis = *rig.line.axes()[0];
    rig.sdo.write<std::uint32_t>(0x6085, 0, 4711);
    const auto before = writable_objects(rig);
    int words = 0;
    Time off{};
    rig.to_drive = [&](Frame& frame) {
      if (is_write(frame, 0x6040) && ++words == moment) {
        axis.power_off(rig.line.now());
        off = rig.line.now();
      }
      if (!axis.powered() && rig.line.now() > off + 500ms) axis.power_on(rig.line.now());
      return true;
    };
    const Report report = rig.run({.only = {"pv.halt", "pp.relative", "homing.attained", "fault.reset", "power"}});
    EXPECT_NE(off, Time{}) << moment;
    EXPECT_FALSE(report.lost) << moment;
    EXPECT_TRUE(report.at_rest) << moment;
    for (const auto& [object, number] : writable_objects(rig))
      EXPECT_EQ(number, before.at(object)) << fmt::format("{:04X}h:{:02X}, {}", object.first, object.second, moment);
  }
}

TEST(ConformSafety, ACancelledCheckLeavesTheDriveAsBefore) { cancel_each_check<CanRig>("generic402", buses::can); }

TEST(ConformSafety, CancellationEndsARunOfChecksThatDoNotPoll) {
  CanRig rig("generic402");
  bool is_cancelled = false;
  Subject subject(CanAccess{rig.bus, rig.sdo}, {.cancelled = [&] { return is_cancelled; }});
  const Report report = run_checks(subject, {.only = {"sdo"}, .after = [&](const Outcome&) { is_cancelled = true; }});
  EXPECT_TRUE(report.cancelled);
  EXPECT_TRUE(report.at_rest);
  EXPECT_EQ(report.outcomes.size(), 1U);
}

// ---- Other devices of the bus ----

TEST(ConformSafety, TheChecksDoNotChangeOtherNodes) {
  CanRig rig("generic402", "", 0, "\n[[axis]]\nname = \"y\"\nproduct = \"generic402\"\nbus = \"bus\"\nnode = 127\n");
  SdoClient neighbour(rig.bus, 127);
  neighbour.write<std::uint16_t>(0x1017, 0, 20);
  bool is_time_sent = false;
  rig.to_drive = [&](Frame& frame) {
    is_time_sent = is_time_sent || frame.id == 0x100;
    return true;
  };
  const Report report = rig.run({.only = {"nmt.other-node", "time.consumer"}});
  EXPECT_EQ(report.count(Verdict::pass), 2U) << text_of(report, {Verdict::fail, Verdict::skipped});
  EXPECT_FALSE(is_time_sent);
  Master master(rig.bus);
  rig.bus.run_for(100ms);
  EXPECT_EQ(master.health(127).state, NmtState::pre_operational);
}

}  // namespace
}  // namespace conform_safety_test
}  // namespace servodrome::master::conform::test
