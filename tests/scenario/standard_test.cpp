// Requirements for every master during any fault: each standard expectation has a master that violates it and one that
// does not.
#include "scenario/standard.hpp"

#include "scenario/support.hpp"
#include "scenario/trial_result.hpp"

namespace servodrome::scenario::test {
namespace {

// A line with the standard expectations.
class StandardStage : public Stage {
 public:
  explicit StandardStage(const std::string& rules = "") : Stage(with_standards(scenario_of(rules))) {}

  Verdict verdict(std::string_view name) {
    director.finish();
    for (const Verdict& one : director.verdicts()) {
      if (one.name == name) return one;
    }
    ADD_FAILURE() << name;
    return {};
  }

  static Scenario with_standards(Scenario scenario) {
    for (Expectation& one : standard_expectations(scenario, {"x"})) scenario.expectations.push_back(std::move(one));
    return scenario;
  }
};

constexpr std::string_view resets = "x gets at most 5 fault resets in a second";
constexpr std::string_view set_point = "x gets its first cyclic set-point within reach of one cycle";
constexpr std::string_view repeats = "x gets at most 20 repeated SDO requests in a second";

void reset_fault(Stage& stage) {
  stage.write(0x6040, 0x80, 2);
  stage.write(0x6040, 0x00, 2);
}

TEST(StandardExpectations, SixFaultResetsInASecondAreAStorm) {
  StandardStage stage;
  for (int n = 0; n < 6; ++n) reset_fault(stage);
  const Verdict verdict = stage.verdict(resets);
  EXPECT_EQ(verdict.outcome, Outcome::failed);
  EXPECT_EQ(verdict.found.substr(0, 26), "6 fault resets in a second");
}

TEST(StandardExpectations, FaultResetsOverALongerTimeAreNoStorm) {
  StandardStage stage;
  for (int n = 0; n < 20; ++n) {
    reset_fault(stage);
    stage.run(200ms);
  }
  EXPECT_EQ(stage.verdict(resets).outcome, Outcome::passed);
}

TEST(StandardExpectations, BitSevenThatStaysIsOneFaultReset) {
  StandardStage stage;
  for (int n = 0; n < 20; ++n) stage.write(0x6040, 0x80, 2);
  EXPECT_EQ(stage.verdict(resets).outcome, Outcome::passed);
}

// One revolution is not possible in a millisecond.
TEST(StandardExpectations, AFirstSetPointFarAwayIsAJump) {
  StandardStage stage;
  stage.enable(8);
  ASSERT_EQ(stage.state(), drive::PowerState::operation_enabled);
  stage.write(0x607A, stage.read(0x6064) + 131072, 4);
  const Verdict verdict = stage.verdict(set_point);
  EXPECT_EQ(verdict.outcome, Outcome::failed);
  EXPECT_NE(verdict.found.find("1.000 revolutions from the shaft"), std::string::npos) << verdict.found;
}

TEST(StandardExpectations, AFirstSetPointAtTheShaftIsNone) {
  StandardStage stage;
  stage.enable(8);
  stage.write(0x607A, stage.read(0x6064), 4);
  stage.run(100ms);
  EXPECT_EQ(stage.verdict(set_point).outcome, Outcome::passed);
}

// The axis still goes to a far set-point, with bit 7 set, when another scenario begins.
TEST(StandardExpectations, WhatHappenedBeforeTheTrialIsNotJudged) {
  StandardStage stage;
  stage.enable(8);
  stage.write(0x607A, 10 * 131072, 4);
  stage.write(0x6040, 0x8F, 2);
  ASSERT_EQ(stage.state(), drive::PowerState::operation_enabled);
  Director next(stage.line, StandardStage::with_standards(scenario_of("")));
  next.take_over(stage.director);
  next.begin();
  stage.run(10ms);
  stage.write(0x6040, 0x00, 2);
  for (int n = 0; n < 5; ++n) reset_fault(stage);  // one more would be a storm
  next.finish();
  for (const Verdict& one : next.verdicts()) {
    const bool is_about_before = one.name == resets || one.name == set_point;
    EXPECT_TRUE(!is_about_before || one.outcome == Outcome::passed) << one.name << ": " << one.found;
  }
}

// The drive does not follow a target in 607Ah that was not sent in this mode.
TEST(StandardExpectations, AnEnabledAxisWithoutASetPointDoesNotJump) {
  StandardStage stage;
  stage.write(0x607A, 500'000, 4);
  stage.enable(8);
  stage.run(100ms);
  EXPECT_EQ(stage.verdict(set_point).outcome, Outcome::passed);
}

TEST(StandardExpectations, ARequestRepeatedAtOnceIsAStorm) {
  constexpr const char* deaf = "[[rule]]\non = { message = \"sdo_answer\" }\ndo = \"withhold\"\n";
  StandardStage storm(deaf);
  for (int n = 0; n < 22; ++n) storm.sdo(line::test::sdo_read(1, 0x6041, 0), 10ms);
  const Verdict verdict = storm.verdict(repeats);
  EXPECT_EQ(verdict.outcome, Outcome::failed);
  EXPECT_EQ(verdict.found.substr(0, 31), "21 requests repeated in a secon");
  StandardStage patient(deaf);
  for (int n = 0; n < 30; ++n) patient.sdo(line::test::sdo_read(1, 0x6041, 0), 100ms);
  EXPECT_EQ(patient.verdict(repeats).outcome, Outcome::passed);
}

TEST(StandardExpectations, AnAbortBetweenTwoRequestsHidesNoRepetition) {
  StandardStage storm("[[rule]]\non = { message = \"sdo_answer\" }\ndo = \"withhold\"\n");
  canopen::Frame abort = line::test::sdo_read(1, 0x6041, 0);
  abort.data = {0x80, 0x41, 0x60, 0x00, 0x00, 0x00, 0x04, 0x05};
  for (int n = 0; n < 22; ++n) {
    storm.sdo(line::test::sdo_read(1, 0x6041, 0), 10ms);
    storm.sdo(abort, 10ms);
  }
  EXPECT_EQ(storm.verdict(repeats).outcome, Outcome::failed);
}

TEST(StandardExpectations, AnsweredRequestsAreNoStorm) {
  StandardStage stage;
  for (int n = 0; n < 100; ++n) stage.sdo(line::test::sdo_read(1, 0x6041, 0), 1ms);
  EXPECT_EQ(stage.verdict(repeats).outcome, Outcome::passed);
}

TEST(StandardExpectations, AMasterThatDoesNotEndFails) {
  TrialResult result;
  result.exit_status = 1;
  result.scenario.master = MasterStatus::failure;
  judge(result);
  EXPECT_EQ(result.outcome, TrialResult::Outcome::passed);
  TrialResult ended = result;
  ended.verdicts.clear();
  ended.was_ended = true;
  judge(ended);
  EXPECT_EQ(ended.outcome, TrialResult::Outcome::failed);
  ASSERT_EQ(ended.verdicts.size(), 1U);
  EXPECT_EQ(ended.verdicts[0].name, "the master ends by itself");
  EXPECT_EQ(ended.verdicts[0].found, "the trial ended it after 10 s");
}

TEST(StandardExpectations, AFailureCountsAlsoIfNoRuleHasActed) {
  TrialResult result;
  result.rules.emplace_back();
  judge(result);
  EXPECT_EQ(result.outcome, TrialResult::Outcome::not_reached);
  TrialResult failed;
  failed.rules.emplace_back();
  failed.verdicts.emplace_back().name = "x rests after the master has ended";
  failed.verdicts.back().outcome = Outcome::failed;
  judge(failed);
  EXPECT_EQ(failed.outcome, TrialResult::Outcome::failed);
  TrialResult ended;
  ended.rules.emplace_back();
  ended.was_ended = true;
  judge(ended);
  EXPECT_EQ(ended.outcome, TrialResult::Outcome::failed);
}

// Nothing has been done to the master yet, so the error is its own, whatever exit status the scenario wants.
TEST(StandardExpectations, AMasterThatBreaksDownBeforeAnyRuleActsFails) {
  for (const MasterStatus wanted : {MasterStatus::any, MasterStatus::success, MasterStatus::failure}) {
    TrialResult result;
    result.scenario.master = wanted;
    result.rules.emplace_back();
    result.exit_status = 3;
    judge(result);
    EXPECT_EQ(result.outcome, TrialResult::Outcome::failed);
    EXPECT_EQ(result.reason, "the master ended with status 3 before any rule acted");
    TrialResult ended;
    ended.scenario.master = wanted;
    ended.rules.emplace_back();
    judge(ended);
    EXPECT_EQ(ended.outcome, TrialResult::Outcome::not_reached);
  }
}

// A master that sends nothing proves nothing, though a rule such as `show` has acted.
TEST(StandardExpectations, ASilentMasterDoesNotPass) {
  for (const MasterStatus wanted : {MasterStatus::any, MasterStatus::success, MasterStatus::failure}) {
    TrialResult result;
    result.scenario.master = wanted;
    result.rules.emplace_back().acts = 1;
    result.was_silent = true;
    judge(result);
    EXPECT_EQ(result.outcome, TrialResult::Outcome::not_reached);
    EXPECT_EQ(result.reason, "the master sent nothing on the bus");
    result.exit_status = 1;
    judge(result);
    EXPECT_EQ(result.outcome, TrialResult::Outcome::failed);
    EXPECT_EQ(result.reason, "the master ended with status 1 before it sent anything");
  }
}

TEST(StandardExpectations, AMasterThatCrashesDoesNotEndByItself) {
  for (const MasterStatus wanted : {MasterStatus::any, MasterStatus::failure}) {
    TrialResult result;
    result.scenario.master = wanted;
    result.exit_status = 139;
    judge(result);
    EXPECT_EQ(result.outcome, TrialResult::Outcome::failed);
    ASSERT_EQ(result.verdicts.size(), 1U);
    EXPECT_EQ(result.verdicts[0].found, "SIGSEGV ended it (status 139)");
    TrialResult asked;
    asked.scenario.master = wanted;
    asked.exit_status = 143;
    judge(asked);
    EXPECT_EQ(asked.outcome, TrialResult::Outcome::passed);
  }
}

TEST(StandardExpectations, OneThatWasNotWatchedHasNotPassed) {
  TrialResult result;
  result.verdicts.emplace_back().name = "x rests after the master has ended";
  judge(result);
  EXPECT_EQ(result.outcome, TrialResult::Outcome::not_reached);
  EXPECT_NE(result.reason.find("x rests after the master has ended"), std::string::npos);
}

TEST(StandardExpectations, AScenarioWaivesOneByItsWordWithAReason) {
  const Scenario scenario = scenario_of("[waive]\nfault_resets = \"it counts them\"\nends = \"it waits\"\n");
  const auto left = standard_expectations(scenario, {"x", "y"});
  EXPECT_EQ(left.size(), 2 * (standards().size() - 2));
  for (const Expectation& one : left) EXPECT_EQ(one.name.find("fault resets"), std::string::npos);
  TrialResult ended;
  ended.scenario = scenario;
  ended.was_ended = true;
  judge(ended);
  EXPECT_EQ(ended.outcome, TrialResult::Outcome::passed);
  ASSERT_EQ(ended.verdicts.size(), 2U);
  EXPECT_EQ(ended.verdicts[0].found, "waived: it counts them");
  EXPECT_EQ(ended.verdicts[0].outcome, Outcome::not_reached);
}

TEST(StandardExpectations, AWaiverNeedsAKnownWordAndAReason) {
  const auto first_error = [](const std::string& text) {
    const ScenarioFile file = parse_scenario("title = \"t\"\n" + text, "t.toml");
    return file.diagnostics.empty() ? std::string() : to_string(file.diagnostics.front());
  };
  EXPECT_NE(first_error("[waive]\nrest = \"x\"\n").find("rest"), std::string::npos);
  EXPECT_NE(first_error("[waive]\nends = \"\"\n").find("has no reason"), std::string::npos);
  EXPECT_NE(first_error("[waive]\nends = true\n").find("expected a string"), std::string::npos);
}

}  // namespace
}  // namespace servodrome::scenario::test
