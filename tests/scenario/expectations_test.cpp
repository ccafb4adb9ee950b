// Expectations judge the drive and the shaft, not the values on the bus.
#include "scenario/support.hpp"

namespace servodrome::scenario::test {
namespace {

constexpr const char* expectations = R"(
[[rule]]
name = "fault"
when = { state = "operation_enabled", after = "lie", after_ms = 100 }
do = "inject"
fault = "0x2310"
[[rule]]
name = "lie"
do = "show"
object = "6041"
value = 0
[[expect]]
name = "stops"
when = { after = "fault" }
eventually = { at_rest = true }
within_ms = 2000
[[expect]]
name = "stays"
when = { after = "fault", after_ms = 1 }
never = { state = "operation_enabled" }
[[expect]]
name = "reads"
when = { after = "fault" }
eventually = { message = { message = "sdo_request", object = "603F" } }
within_ms = 1000
[[expect]]
name = "elsewhere"
when = { position_above = 1e6 }
always = { powered = true }
)";

Outcome outcome(const Stage& stage, std::string_view name) {
  for (const Verdict& verdict : stage.director.verdicts()) {
    if (verdict.name == name) return verdict.outcome;
  }
  ADD_FAILURE() << name;
  return Outcome::failed;
}

TEST(Expectations, AMasterThatReadsTheFaultPasses) {
  Stage stage(expectations);
  stage.enable();
  stage.run(200ms);
  ASSERT_EQ(stage.state(), drive::PowerState::fault);
  stage.read(0x603F);
  stage.run(1s);
  stage.director.finish();
  EXPECT_EQ(outcome(stage, "stops"), Outcome::passed);
  EXPECT_EQ(outcome(stage, "stays"), Outcome::passed);
  EXPECT_EQ(outcome(stage, "reads"), Outcome::passed);
  EXPECT_EQ(outcome(stage, "elsewhere"), Outcome::not_reached);
}

TEST(Expectations, AMasterThatDoesNotLookFails) {
  Stage stage(expectations);
  stage.enable();
  stage.run(2s);
  stage.director.finish();
  EXPECT_EQ(outcome(stage, "reads"), Outcome::failed);
}

// The trial ends before the time of an `eventually` has elapsed: the master could still do it.
TEST(Expectations, AnEventuallyWhoseTimeHasNotElapsedIsNotReached) {
  constexpr const char* never_read =
      "[[expect]]\nname = \"reads\"\neventually = { message = { message = \"sdo_request\" } }\nwithin_ms = 1000\n";
  for (const bool elapsed : {false, true}) {
    Stage stage(never_read);
    stage.run(elapsed ? 1100ms : 900ms);
    stage.director.finish();
    EXPECT_EQ(outcome(stage, "reads"), elapsed ? Outcome::failed : Outcome::not_reached);
  }
}

TEST(Expectations, TheShaftIsJudgedNotTheStatusword) {
  Stage stage(R"(
[[rule]]
do = "show"
object = "606C"
value = 0
[[expect]]
name = "rests"
always = { at_rest = true }
)");
  stage.enable(3);
  stage.write(0x6083, 1'000'000, 4);
  stage.write(0x60FF, 200'000, 4);
  stage.run(300ms);
  EXPECT_EQ(stage.read(0x606C), 0U);
  stage.director.finish();
  EXPECT_EQ(outcome(stage, "rests"), Outcome::failed);
}

}  // namespace
}  // namespace servodrome::scenario::test
