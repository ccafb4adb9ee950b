// Rules on objects: the values on the bus differ from the behaviour of the drive.
#include "scenario/support.hpp"

namespace servodrome::scenario::test {
namespace {

TEST(ObjectRules, ABitOfTheStatuswordIsFrozen) {
  Stage stage(R"(
[[rule]]
do = "show"
object = "6041"
clear_bits = 0x0400
)");
  stage.enable();
  EXPECT_EQ(stage.read(0x6041) & 0x0400U, 0U);
  EXPECT_NE(stage.x().device().drive().statusword() & 0x0400, 0) << "the drive itself has it";
  EXPECT_EQ(stage.state(), drive::PowerState::operation_enabled);
}

TEST(ObjectRules, ProcessDataShowTheSame) {
  Stage stage(R"(
[[rule]]
do = "show"
object = "6041"
set_bits = 0x4000
)");
  stage.write(0x1400, 0xFF, 1, 2);
  stage.send(line::test::nmt(1, 1));
  stage.run(100ms);
  const auto frames = stage.received(0x181);
  ASSERT_FALSE(frames.empty());
  EXPECT_NE(frames.back().data[1] & 0x40, 0);
}

TEST(ObjectRules, APositionFreezesAndTheShaftGoesOn) {
  Stage stage(R"(
[[rule]]
name = "freeze"
when = { speed_above_rpm = 50 }
for_ms = 500
do = "show"
object = "6064"
freeze = true
)");
  stage.enable(3);
  stage.write(0x6083, 1'000'000, 4);
  stage.write(0x60FF, 200'000, 4);
  stage.run(300ms);
  ASSERT_TRUE(stage.director.rules().front().first_act.has_value());
  const std::uint32_t shown = stage.read(0x6064);
  const double before = revolutions(stage.x());
  stage.run(100ms);
  EXPECT_EQ(stage.read(0x6064), shown);
  EXPECT_GT(revolutions(stage.x()), before);
  stage.run(500ms);
  EXPECT_NE(stage.read(0x6064), shown);
}

TEST(ObjectRules, AValueComesLate) {
  Stage stage(R"(
[[rule]]
do = "show"
object = "6081"
late_ms = 50
)");
  stage.run(100ms);
  const std::uint32_t old = stage.read(0x6081);
  stage.write(0x6081, old + 5, 4);
  EXPECT_EQ(stage.read(0x6081), old);
  stage.run(50ms);
  EXPECT_EQ(stage.read(0x6081), old + 5);
}

// An object without sub-index in the rule: each sub-index has its own value.
TEST(ObjectRules, EachSubIndexHasItsOwnValue) {
  for (const char* how : {"freeze = true", "late_ms = 50"}) {
    Stage stage(fmt::format("[[rule]]\ndo = \"show\"\nobject = \"6099\"\n{}\n", how));
    const auto own = [&stage](std::uint8_t sub) {
      return static_cast<std::uint32_t>(stage.x().device().dictionary().number(0x6099, sub));
    };
    stage.run(100ms);
    ASSERT_NE(own(1), own(2));
    for (std::uint8_t sub = 0; sub <= 2; ++sub) EXPECT_EQ(stage.read(0x6099, sub), own(sub)) << how;
  }
}

TEST(ObjectRules, IgnoredBitsAreThoseOfTheSubIndex) {
  Stage stage("[[rule]]\ndo = \"ignore\"\nobject = \"6099\"\nmask = 0x0F\n");
  const auto own = [&stage](std::uint8_t sub) { return stage.x().device().dictionary().number(0x6099, sub); };
  const std::int64_t before = own(1);
  stage.write(0x6099, 0x12345, 4, 1);
  EXPECT_EQ(own(1), 0x12340 | (before & 0x0F));
}

TEST(ObjectRules, AModeThatIsNotShown) {
  Stage stage(R"(
[[rule]]
do = "show"
object = "6061"
value = 0
)");
  stage.write(0x6060, 3, 1);
  EXPECT_EQ(stage.read(0x6061) & 0xFFU, 0U);
  EXPECT_EQ(stage.x().device().drive().mode(), drive::Mode::profile_velocity);
}

TEST(ObjectRules, TwoResetsAreIgnored) {
  Stage stage(R"(
[[rule]]
do = "ignore"
object = "6040"
mask = 0x80
times = 2
[[rule]]
when = { time_ms = 10 }
for_ms = 10
do = "inject"
fault = "0x2310"
)");
  stage.run(50ms);
  ASSERT_EQ(stage.state(), drive::PowerState::fault);
  for (const int n : {1, 2, 3}) {
    stage.write(0x6040, 0, 2);
    stage.write(0x6040, 0x80, 2);
    stage.write(0x6040, 0x80, 2);
    stage.run(20ms);
    EXPECT_EQ(stage.state() == drive::PowerState::fault, n < 3) << n;
  }
}

constexpr const char* held_enable = R"(
[[rule]]
when = { state = "switched_on" }
do = "hold"
object = "6040"
ms = 300
times = 1
)";

void switch_on(Stage& stage) {
  for (const std::uint32_t word : {0x06U, 0x07U}) stage.write(0x6040, word, 2);
  stage.run(1s);
}

TEST(ObjectRules, AnEnableThatIsSlow) {
  Stage stage(held_enable);
  switch_on(stage);
  ASSERT_EQ(stage.state(), drive::PowerState::switched_on);
  stage.write(0x6040, 0x0F, 2);
  stage.run(250ms);
  EXPECT_EQ(stage.state(), drive::PowerState::switched_on);
  stage.run(600ms);
  EXPECT_EQ(stage.state(), drive::PowerState::operation_enabled);
}

TEST(ObjectRules, AWriteThatIsHeldIsLostWithThePower) {
  Stage stage("[[rule]]\ndo = \"hold\"\nobject = \"6081\"\nms = 300\ntimes = 1\n");
  const auto own = [&stage] { return stage.x().device().dictionary().number(0x6081); };
  const std::int64_t before = own();
  stage.write(0x6081, 4711, 4);
  stage.x().power_off(stage.line.now());
  stage.run(1ms);
  stage.x().power_on(stage.line.now());
  stage.run(1s);
  EXPECT_EQ(own(), before);
}

TEST(ObjectRules, AWriteThatIsHeldIsLostWithARestart) {
  const std::vector<std::pair<std::string, std::function<void(Stage&)>>> restarts{
      {"power cycle",
       [](Stage& stage) {
         stage.x().power_off(stage.line.now());
         stage.x().power_on(stage.line.now());
       }},
      {"reset node", [](Stage& stage) { stage.send(line::test::nmt(0x81, 1)); }},
      {"reset communication of all", [](Stage& stage) { stage.send(line::test::nmt(0x82, 0)); }}};
  for (const auto& [what, restart] : restarts) {
    SCOPED_TRACE(what);
    Stage stage("[[rule]]\ndo = \"hold\"\nobject = \"6081\"\nms = 3000\ntimes = 1\n");
    const auto own = [&stage] { return stage.x().device().dictionary().number(0x6081); };
    stage.write(0x6081, 4711, 4);
    restart(stage);
    stage.run(2s);
    stage.write(0x6081, 4712, 4);
    EXPECT_EQ(own(), 4712) << "later writes are not delayed either";
    stage.run(2s);
    EXPECT_EQ(own(), 4712);
  }
}

TEST(ObjectRules, AResetOfAnotherNodeLosesNoWrite) {
  Stage stage("[[rule]]\ndo = \"hold\"\nobject = \"6081\"\nms = 300\ntimes = 1\n");
  stage.write(0x6081, 4711, 4);
  stage.send(line::test::nmt(0x81, 2));
  stage.run(1s);
  EXPECT_EQ(stage.x().device().dictionary().number(0x6081), 4711);
}

// A master gives up and disables the drive. The delayed write must not enable it afterwards.
TEST(ObjectRules, AWriteDoesNotOvertakeOneThatIsHeld) {
  Stage stage(held_enable);
  switch_on(stage);
  stage.write(0x6040, 0x0F, 2);
  stage.write(0x6040, 0x00, 2);
  stage.run(2s);
  EXPECT_EQ(stage.state(), drive::PowerState::switch_on_disabled);
}

TEST(ObjectRules, AnObjectThatTheDriveDoesNotHaveIsRefused) {
  line::Line line(line::test::settings_of(one_axis));
  EXPECT_THROW(Director(line, scenario_of("[[rule]]\ndo = \"show\"\nobject = \"5FFF\"\nvalue = 1")), ScenarioError);
}

TEST(ObjectRules, ANumberThatDoesNotFitIntoTheObjectIsRefused) {
  line::Line line(line::test::settings_of(one_axis));
  const auto is_refused = [&line](const std::string& action) {
    try {
      Director(line, scenario_of("[[rule]]\n" + action));
    } catch (const ScenarioError& error) {
      EXPECT_NE(std::string(error.what()).find("does not fit into 60"), std::string::npos) << error.what();
      return true;
    }
    return false;
  };
  const auto on = [](const char* action, const char* object, const char* number) {
    return fmt::format("do = \"{}\"\nobject = \"{}\"\n{}\n", action, object, number);
  };
  for (const char* action : {"set", "show"}) {
    EXPECT_FALSE(is_refused(on(action, "6060", "value = -128"))) << action;  // INTEGER8
    EXPECT_TRUE(is_refused(on(action, "6060", "value = -129"))) << action;
    EXPECT_TRUE(is_refused(on(action, "6060", "value = 255"))) << action;
    EXPECT_FALSE(is_refused(on(action, "6081", "value = 4294967295"))) << action;  // UNSIGNED32
    EXPECT_TRUE(is_refused(on(action, "6081", "value = 4294967296"))) << action;
    EXPECT_TRUE(is_refused(on(action, "6081", "value = -1"))) << action;
  }
  EXPECT_FALSE(is_refused(on("show", "6060", "set_bits = 0x80")));
  EXPECT_TRUE(is_refused(on("show", "6060", "set_bits = 0x100")));
  EXPECT_FALSE(is_refused(on("show", "6041", "flip_bits = 0x8000\nperiod_ms = 10")));
  EXPECT_TRUE(is_refused(on("show", "6041", "flip_bits = 0x10000\nperiod_ms = 10")));
  EXPECT_FALSE(is_refused(on("show", "6060", "add = 1000"))) << "the sum wraps around";
}

// Without a sub-index the rule would write the number of elements.
TEST(ObjectRules, SetOfAnArrayNeedsASubIndex) {
  line::Line line(line::test::settings_of(one_axis));
  const auto refusal = [&line](const char* object) {
    try {
      Director(line, scenario_of(fmt::format("[[rule]]\ndo = \"set\"\nobject = \"{}\"\nvalue = 2\n", object)));
    } catch (const ScenarioError& error) {
      return fmt::format("{}; {}", error.what(), error.hint());
    }
    return std::string();
  };
  EXPECT_EQ(refusal("607D"), "607Dh has several sub-indices, and `set` writes one; name it: object = \"607D:01\"");
  EXPECT_EQ(refusal("1018"), "1018h has several sub-indices, and `set` writes one; name it: object = \"1018:01\"");
  for (const char* object : {"6081", "6081:00", "607D:00", "607D:01"}) EXPECT_EQ(refusal(object), "") << object;
}

TEST(ObjectRules, SetWithoutASubIndexWritesSubIndexZero) {
  for (const char* object : {"6081", "6081:00"}) {
    Stage stage(fmt::format("[[rule]]\ndo = \"set\"\nobject = \"{}\"\nvalue = 4711\n", object));
    stage.run(1ms);
    EXPECT_EQ(stage.x().device().dictionary().number(0x6081), 4711) << object;
  }
}

}  // namespace
}  // namespace servodrome::scenario::test
