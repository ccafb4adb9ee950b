// Motion scripts: error messages of invalid ones, and execution of valid ones with every product on every bus it has.
#include <fstream>
#include <gmock/gmock.h>
#include <iterator>
#include <sstream>

#include "axis/axis_rig.hpp"
#include "source_dir.hpp"
#include "tools/script/run.hpp"

namespace servodrome::master::script {
namespace script_test {
namespace {

using namespace std::chrono_literals;
using test::AxisRig;
using test::RigCase;
using testing::HasSubstr;

Script parsed(std::string_view text) { return parse(text, "a.script", ObjectCatalogue::standard()); }

std::string mistakes_of(std::string_view text) {
  try {
    parsed(text);
  } catch (const ScriptMistakes& mistakes) {
    return mistakes.what();
  }
  return "";
}

TEST(Script, ObjectsAreThoseOfTheProductThatAnAxisIsDeclaredWith) {
  std::istringstream eds(
      "[2001]\nParameterName=P01-02 Adjustment\nDataType=6\n[6080]\nParameterName=Speed\nDataType=6\n");
  const auto own = ObjectCatalogue::read_eds(eds, "x.eds");
  const CatalogueOf catalogue_of = [&](const std::string& product) { return product == "mine" ? &own : nullptr; };
  const auto parsed_with = [&](std::string_view text) {
    return parse(text, "a.script", ObjectCatalogue::standard(), catalogue_of);
  };
  const Script script = parsed_with("axis a 1 product mine\naxis b 2\nget P01-02\na set 6080 1\nb set 6080 1\n");
  EXPECT_EQ(script.steps[0].subject.object, (ObjectAddress{0x2001, 0}));
  EXPECT_EQ(script.steps[1].subject.type, dictionary::Type::unsigned16);
  EXPECT_EQ(script.steps[2].subject.type, dictionary::Type::unsigned32);
  EXPECT_THROW(parsed_with("axis a 1 product mine\naxis b 2\nb get P01-02\n"), ScriptMistakes);
  EXPECT_THROW(parsed_with("axis a 1 product other\n"), ScriptMistakes);
  for (const char* line : {"get 6041", "set 6081 1", "expect 6041 has 1", "wait 1", "print x"}) {
    EXPECT_FALSE(needs_axis(parsed(line).steps.front())) << line;
  }
  for (const char* line : {"enable", "get position", "expect state == fault", "move by 1", "stop"}) {
    EXPECT_TRUE(needs_axis(parsed(line).steps.front())) << line;
  }
}

TEST(Script, AnAxisThatIsOnlyReadIsNotCommanded) {
  const Script script = parsed(
      "axis a 1\naxis b 2\naxis c 3\naxis d 4\nrepeat 2\na get 6041\nb set 6040 15\nend\n"
      "a expect state == fault\na arm-probe 1\na wait-probe 1\nc stop\nwait 1\nprint x\n");
  EXPECT_EQ(commanded_axes(script), (std::vector<bool>{false, true, true, false}));
}

TEST(ScriptMistake, IsToldWithFileLineAndColumn) {
  struct Row {
    const char* text;
    const char* says;
  };
  const Row rows[] = {
      {"enabel", "a.script:1:1: \"enabel\" is neither a command nor an axis; commands are reset, enable"},
      {"# a comment\n\n  move", "a.script:3:3: `move` needs either `to POSITION` or `by DISTANCE`"},
      {"move to 1 by 2", "a.script:1:1: `move` needs"},
      {"move to", "a.script:1:8: here a number is missing"},
      {"move to far", "a.script:1:9: \"far\" is not a number"},
      {"move to nan", "a.script:1:9: \"nan\" is not a number"},
      {"move to 1e400", "a.script:1:9: \"1e400\" is not a number"},
      {"move to 1 speed 3", "a.script:1:11: `move` does not know \"speed\"; it knows to, by, velocity"},
      {"move to 1 to 2", "a.script:1:11: `to` is given twice"},
      {"move to 1 velocity -3", "a.script:1:20: `velocity` cannot be below 0"},
      {"home method 2.5", "a.script:1:1: a homing method is a whole number"},
      {"home method -129", "a.script:1:1: a homing method is a whole number from -128 to 127"},
      {"enable now", "a.script:1:8: unexpected word \"now\""},
      {"lift enable", "a.script:1:1: \"lift\" is neither a command nor an axis"},
      {"axis lift 1\nlift wait 3", "a.script:2:6: `wait` cannot have an axis before it"},
      {"axis move 1", "a.script:1:6: \"move\" is a command, and no name for an axis"},
      {"axis a 1\naxis a 2", "a.script:2:6: there is an axis \"a\" already"},
      {"axis a 1\naxis b 1", "a.script:2:8: another axis is node 1 already"},
      {"axis a 0", "a.script:1:8: 0 is not a node-ID, station or position, 1 to 65535"},
      {"enable\naxis a 1", "a.script:2:1: axes are declared before the first command"},
      {"use b", "a.script:1:5: there is no axis \"b\"; declare it"},
      {"units miles",
       "a.script:1:7: units \"miles\" are not known; write drive, counts, revolutions, rpm, degrees, mm"},
      {"units mm", "a.script:1:9: here the feed per motor revolution in mm is missing"},
      {"units mm 0", "a.script:1:10: the feed per revolution must be 0.000001 to 1e6 mm"},
      {"units mm 5 nan", "a.script:1:12: \"nan\" is not a number"},
      {"units counts 3", "a.script:1:14: unexpected word \"3\""},
      {"units revolutions 0", "a.script:1:19: the units per revolution must be 0.001 to 1e9"},
      {"units drive 3", "a.script:1:13: unexpected word \"3\""},
      {"timeout -1", "a.script:1:9: -1 s is not a time"},
      {"wait", "a.script:1:5: here a number is missing"},
      {"repeat 0\nend", "a.script:1:8: 0 is not a number of times, 1 to 1000000"},
      {"repeat 2\nwait 1", "a.script:1:1: this `repeat` has no `end`"},
      {"end", "a.script:1:1: this `end` has no `repeat`"},
      {"print \"hello", "a.script:1:7: a quote that does not end"},
      {"set 6040", "a.script:1:9: here a value is missing"},
      {"set 6040 65536", "a.script:1:10: "},
      {"set position 3", "a.script:1:5: `position` is read-only"},
      {"set nonsense 1", "a.script:1:5: "},
      {"expect 6041 is 3", "a.script:1:13: \"is\" is not a comparison; they are ==, !="},
      {"expect state == resting", "a.script:1:17: \"resting\" is not a state; states are \"not ready to switch on\""},
      {"expect state < fault", "a.script:1:14: a state is == or != another"},
      {"expect position has 3", "a.script:1:17: `has` is for the bits of an object"},
      {"expect 6064 == 0 tolerance -1", "a.script:1:28: `tolerance` cannot be below 0"},
      {"torque", "a.script:1:7: here a number is missing"},
      {"jog 3", "a.script:1:6: here `for` is missing"},
      {"arm-probe 3", "a.script:1:1: there are touch probes 1 and 2"},
      {"\x01\x02", "a.script:1:1: \"??\" is neither"},
  };
  for (const Row& row : rows) EXPECT_THAT(mistakes_of(row.text), HasSubstr(row.says)) << row.text;
}

TEST(ScriptMistake, AllOfThemAreTold) {
  EXPECT_EQ(mistakes_of("move\nenable\nwait soon\nend\n"),
            "a.script:1:1: `move` needs either `to POSITION` or `by DISTANCE`\na.script:3:6: \"soon\" is not a number; "
            "a time in seconds is needed\na.script:4:1: this `end` has no `repeat`");
}

TEST(ScriptText, IsReadAsItIsWritten) {
  const Script script = parsed(
      "axis lift 1 # the first\r\naxis slide 4 product ismk\n\nuse slide\nunits revolutions\ntimeout 5\n"
      "move by -2.5 velocity 3 nowait\nlift home within 7\nrepeat 3\n  repeat 2\n    wait .5\n  end\nend\n"
      "expect \"Position actual value\" <= 0x10 tolerance 2\nwait-until 6041 has 0400h\nprint \"a # b\"");
  ASSERT_EQ(script.axes.size(), 2U);
  EXPECT_EQ(script.axes[1].product, "ismk");
  ASSERT_EQ(script.steps.size(), 6U);
  EXPECT_EQ(script.count_steps(), 8U);
  const Step& move = script.steps[0];
  EXPECT_EQ(move.axis, 1U);
  EXPECT_EQ(move.number("by"), -2.5);
  EXPECT_EQ(move.timeout_s, 5);
  EXPECT_TRUE(move.units.system == UnitSystem::revolutions && move.has("nowait"));
  EXPECT_EQ(script.steps[1].axis, 0U);
  EXPECT_EQ(script.steps[1].timeout_s, 7);
  EXPECT_EQ(script.steps[2].body[0].body[0].number(""), 0.5);
  EXPECT_EQ(script.steps[3].subject.object, (ObjectAddress{0x6064, 0}));
  EXPECT_EQ(script.steps[3].timeout_s, 0) << "looks once";
  EXPECT_EQ(script.steps[4].timeout_s, 5) << "waits";
  EXPECT_EQ(script.steps[5].text, "a # b");
  EXPECT_EQ(parsed("").axes.size(), 1U) << "the drive of the command";
}

TEST(ScriptText, TheExampleOfTheManualIsOne) {
  std::ifstream file(SERVODROME_SOURCE_DIR "/docs/script.md");
  const std::string page{std::istreambuf_iterator<char>(file), {}};
  const std::size_t begin = page.find("# two-axes.script");
  ASSERT_NE(begin, std::string::npos);
  const Script script = parsed(std::string_view(page).substr(begin, page.find("```", begin) - begin));
  EXPECT_EQ(script.axes.size(), 2U);
  EXPECT_GT(script.count_steps(), 10U);
}

// Random sequences of script words: the parser must either accept them or report mistakes.
TEST(ScriptText, NothingMakesTheParserFail) {
  const char* const words[] = {"axis", "a",  "1",       "use",      "units", "revolutions", "timeout", "move",  "to",
                               "by",   "-1", "repeat",  "end",      "\n",    "expect",      "6041",    "==",    "\"",
                               "set",  "#",  "product", "velocity", "wait",  "state",       "fault",   "within"};
  std::uint32_t random = 1;
  std::size_t scripts = 0;
  for (int round = 0; round < 3000; ++round) {
    std::string text;
    for (int i = 0; i < 20; ++i) {
      random = random * 1664525U + 1013904223U;
      text += std::string(words[(random >> 16U) % std::size(words)]) + ((random >> 8U) % 4 == 0 ? "\n" : " ");
    }
    try {
      parsed(text);
      ++scripts;
    } catch (const ScriptMistakes& mistakes) {
      EXPECT_FALSE(mistakes.mistakes().empty());
    }
  }
  EXPECT_LT(scripts, 3000U);
}

class ScriptRun : public testing::TestWithParam<RigCase> {
 protected:
  explicit ScriptRun(unsigned axes = 1) : rig(GetParam(), axes) {
    for (std::size_t i = 0; i < axes; ++i) {
      AxisOptions axis_options = rig.options();
      axis_options.cancelled = std::ref(cancellation);
      opened.push_back(std::make_unique<Axis402>(rig.objects(i), axis_options));
      pointers.push_back(opened.back().get());
    }
    options.cancellation = &cancellation;
    options.done = [this](const Step&, Time, const std::string& text) {
      if (!text.empty()) said.push_back(text);
    };
  }
  // An ISMC has no object with the units of a revolution, so the script must give the number.
  static Script of_product(std::string_view text) {
    std::string own(text);
    constexpr std::string_view units = "units revolutions";
    const std::size_t at = own.find(units);
    if (at != std::string::npos && std::string_view(GetParam().product) == "ismc")
      own.insert(at + units.size(), " 131072");
    return parsed(own);
  }
  // The error message of the script; "" if it succeeds.
  std::string problem_of(std::string_view text) {
    try {
      run(of_product(text), pointers, options);
    } catch (const ScriptFailure& failure) {
      return failure.what();
    }
    return "";
  }
  double shaft(std::size_t axis = 0) {
    return rig.shaft_counts(axis) / rig.drive(axis).plant().parameters().encoder.counts_per_revolution;
  }
  double speed(std::size_t axis = 0) {
    rig.line.run_until(rig.line.now() + 200ms);
    const double before = shaft(axis);
    rig.line.run_until(rig.line.now() + 100ms);
    return (shaft(axis) - before) / 0.1;
  }
  // Calls `what` once, when the axis has moved by `turns`.
  void when(double turns, std::function<void()> what) {
    options.progress = [this, turns, what = std::move(what), done = false](const AxisStatus&) mutable {
      if (done || std::abs(shaft()) < turns) return;
      done = true;
      what();
    };
  }

  // Calls `what` at the given check of the runner for a cancellation: one at each step, and one at each poll of a wait.
  void at_check(int number, std::function<void()> what) {
    counting.emplace([what = std::move(what), number, checks = 0]() mutable {
      if (++checks == number) what();
      return false;
    });
    options.cancellation = &*counting;
  }
  // Ends a motion that would last for ever in virtual time.
  void give_up_after(Time span) {
    options.progress = [this, end = rig.line.now() + span](const AxisStatus&) {
      if (rig.line.now() > end) throw std::runtime_error("it does not end");
    };
  }
  AxisUnits units_of(Axis402& axis) { return axis.units().value_or(AxisUnits{131072, 131072, 131072}); }

  AxisRig rig;
  bool cancelled = false;
  Cancellation cancellation{[this] { return cancelled; }};
  std::optional<Cancellation> counting;
  std::vector<std::unique_ptr<Axis402>> opened;
  std::vector<Axis402*> pointers;
  RunOptions options;
  std::vector<std::string> said;
};
INSTANTIATE_TEST_SUITE_P(Every, ScriptRun, testing::ValuesIn(test::every_product),
                         [](const auto& row) { return row.param.name(); });

// A revolution at two per second, in every unit.
TEST_P(ScriptRun, TakesEveryUnit) {
  struct Row {
    std::string units;
    double revolution;
    double per_second;
  };
  const double counts = rig.drive().plant().parameters().encoder.counts_per_revolution;
  const Row rows[] = {
      {"revolutions", 1, 1}, {"rpm", 1, 60}, {"degrees", 360, 360}, {"mm 5", 5, 5}, {"counts", counts, counts}};
  double turns = 0;
  for (const Row& row : rows) {
    const bool says = std::string_view(GetParam().product) != "ismc" || row.units == "counts";
    Time took{};
    options.done = [&](const Step& step, Time time, const std::string&) {
      if (step.verb == Verb::move) took = time;
    };
    const std::string script =
        fmt::format("units {}{}\nenable\nmove by {} velocity {} acceleration {}\nwait 0.2", row.units,
                    says ? "" : " 131072", row.revolution, 2 * row.per_second, 50 * row.per_second);
    run(parsed(script), pointers, options);
    EXPECT_NEAR(shaft(), ++turns, 0.02) << script;
    EXPECT_NEAR(std::chrono::duration<double>(took).count(), 0.6, 0.15) << script;
  }
}

TEST(ScriptUnits, AreReadAgainWhenTheScriptChangesTheFactors) {
  AxisRig rig({"generic402"});
  Axis402 axis(rig.objects(), rig.options());
  Axis402* const axes[] = {&axis};
  const double before = rig.shaft_counts();
  run(parsed("units revolutions\nset 6092:01 1000\nenable\nmove by 1 velocity 1 acceleration 10\nwait 0.3\n"
             "expect position == 1 tolerance 0.02"),
      axes);
  const double revolution = rig.drive().plant().parameters().encoder.counts_per_revolution;
  EXPECT_NEAR((rig.shaft_counts() - before) / revolution, 1.0, 0.02);
  axis.disable();
  // A number that fits only with the factors of before.
  std::string problem;
  try {
    run(parsed("units revolutions\nset 6092:01 1000000000\nmove by 3"), axes);
  } catch (const ScriptFailure& failure) {
    problem = failure.what();
  }
  EXPECT_THAT(problem, HasSubstr("a.script:3:1: `move by 3`: by: 3 is 3e+09 units, which are not within"));
}

TEST_P(ScriptRun, MovesWaitsAndExpects) {
  EXPECT_EQ(problem_of(R"(
units revolutions
enable
expect state == "operation enabled"
move to 1 velocity 2 acceleration 50 within 5
expect position == 1 tolerance 0.02 within 1
move to 3 velocity 2 nowait
wait-until position > 2 within 3
halt
wait 0.1
resume
arrive within 5
expect position == 3 tolerance 0.02 within 1
repeat 3
  move by -1 velocity 3
end
wait 0.3
expect position == 0 tolerance 0.02
velocity -2 acceleration 50
wait-until position < -1 within 3
stop
expect velocity == 0 tolerance 0.05 within 1
jog 2 for 0.25 acceleration 50
get 6041
print "that is all"
wait-until 6041 has 0x0027
expect 6041 lacks 8
disable
expect state != "operation enabled"
)"),
            "");
  EXPECT_NEAR(speed(), 0, 0.02);
  ASSERT_GE(said.size(), 3U);
  EXPECT_THAT(said, testing::Contains("that is all"));
  EXPECT_THAT(said, testing::Contains(HasSubstr("6041 = ")));
}

TEST_P(ScriptRun, AJogEndsAfterItsTimeAlsoIfTheRampIsLonger) {
  EXPECT_EQ(problem_of("units revolutions\nenable\njog 10 for 0.5 acceleration 5"), "");
  EXPECT_GT(std::abs(shaft()), 0.4);
  EXPECT_LT(std::abs(shaft()), 3.0) << "the ramp to the full velocity takes 2 s and 10 revolutions";
  EXPECT_NEAR(speed(), 0, 0.02);
}

TEST_P(ScriptRun, WhatDoesNotHoldIsToldWithItsLineAndTheAxisStands) {
  EXPECT_THAT(problem_of("units revolutions\nenable\nvelocity 2 acceleration 50\nexpect position > 100 within 0.4"),
              testing::AllOf(HasSubstr("a.script:4:1: `expect position > 100 within 0.4`: position is "),
                             HasSubstr(" after 0.4 s")));
  EXPECT_NEAR(speed(), 0, 0.05);
  EXPECT_EQ(pointers[0]->state(), PowerState::operation_enabled);
}

TEST_P(ScriptRun, WhatCannotBeIsToldBeforeAnythingMoves) {
  EXPECT_THAT(problem_of("enable\nmove by 10000\nmove to 3e9"), HasSubstr("a.script:3:1: `move to 3e9`"));
  EXPECT_NEAR(shaft(), 0, 1e-3);
  EXPECT_NE(pointers[0]->state(), PowerState::operation_enabled);
  EXPECT_THAT(problem_of("enable\nset 5FFE 1"), HasSubstr("a.script:2:1: `set 5FFE 1`")) << "no such object";
  EXPECT_NE(pointers[0]->state(), PowerState::operation_enabled);
}

TEST_P(ScriptRun, CtrlCBringsItToRest) {
  when(0.5, [this] { cancelled = true; });
  EXPECT_THAT(problem_of("units revolutions\nenable\nmove to 100 velocity 2 acceleration 50"),
              testing::AllOf(HasSubstr("a.script:3:1: "), HasSubstr("was cancelled; the axis stands")));
  EXPECT_NEAR(speed(), 0, 0.02);
}

TEST_P(ScriptRun, AFaultInTheMiddleOfAMoveOrAWaitEndsIt) {
  when(0.5, [this] { rig.drive().inject(drive::Cause::over_voltage, true); });
  EXPECT_THAT(problem_of("units revolutions\nenable\nmove to 100 velocity 2 acceleration 50"),
              testing::AllOf(HasSubstr("a.script:3:1: "), HasSubstr("left operation enabled")));
  AxisRig another(GetParam());
  Axis402 axis(another.objects(), another.options());
  Axis402* const its_axis[] = {&axis};
  another.drive().inject(drive::Cause::over_voltage, false);
  int looks = 0;
  RunOptions its_options;
  Cancellation its_cancellation([&] {
    if (++looks == 50) another.drive().inject(drive::Cause::over_voltage, true);
    return false;
  });
  its_options.cancellation = &its_cancellation;
  std::string problem;
  try {
    run(parsed("enable\nwait 60"), its_axis, its_options);
  } catch (const ScriptFailure& failure) {
    problem = failure.what();
  }
  EXPECT_THAT(problem, testing::AllOf(HasSubstr("a.script:2:1: `wait 60`"), HasSubstr("left operation enabled")));
  EXPECT_LT(another.line.now(), 10s);
}

TEST_P(ScriptRun, ACutBusAndALostSupplyEndIt) {
  for (const bool power : {true, false}) {
    AxisRig another(GetParam());
    Axis402 axis(another.objects(), another.options());
    Axis402* const its_axis[] = {&axis};
    int looks = 0;
    RunOptions its_options;
    its_options.progress = [&](const AxisStatus&) {
      if (++looks == 20) power ? another.power_off() : another.cut();
    };
    std::string problem;
    try {
      run(of_product("units revolutions\nenable\nmove to 100 velocity 2 acceleration 50"), its_axis, its_options);
    } catch (const ScriptFailure& failure) {
      problem = failure.what();
    }
    EXPECT_THAT(problem, HasSubstr("a.script:3:1: `move to 100 velocity 2 acceleration 50`: mem:"));
    EXPECT_LT(another.line.now(), 20s);
  }
}

TEST_P(ScriptRun, AnAxisThatAnotherProgramEnabledIsStoppedAtTheEnd) {
  Axis402 other(rig.objects(), rig.options());
  other.enable();
  EXPECT_EQ(problem_of("units revolutions\nvelocity 2 acceleration 50\nwait 0.2"), "");
  EXPECT_GT(std::abs(shaft()), 0.2) << "it moved";
  EXPECT_NEAR(speed(), 0, 0.02);
  EXPECT_EQ(other.state(), PowerState::operation_enabled);
}

TEST_P(ScriptRun, AFaultOfAnAxisThatAnotherProgramEnabledEndsAWait) {
  Axis402 other(rig.objects(), rig.options());
  other.enable();
  at_check(50, [this] { rig.drive().inject(drive::Cause::over_voltage, true); });
  EXPECT_THAT(problem_of("units revolutions\nvelocity 2 acceleration 50\nwait 60"),
              testing::AllOf(HasSubstr("a.script:3:1: `wait 60`"), HasSubstr("left operation enabled")));
  EXPECT_LT(rig.line.now(), 20s);
}

// An axis without power coasts for longer than `disable` takes.
TEST_P(ScriptRun, DisableFirstStopsAnAxisThatAnotherProgramRuns) {
  constexpr double turns_per_s = 3.0;  // below the factory limit of each product
  Axis402 other(rig.objects(), rig.options());
  const AxisUnits units = units_of(other);
  const auto ramp = static_cast<std::uint32_t>(50 * units.acceleration);
  other.enable();
  other.run_at(static_cast<std::int32_t>(turns_per_s * units.velocity), {.acceleration = ramp, .deceleration = ramp},
               5s);
  EXPECT_EQ(problem_of("disable"), "");
  const double at_end = shaft();
  rig.objects().wait(300ms);
  EXPECT_NEAR(shaft(), at_end, 0.05) << "it is at rest before the power is off";
  EXPECT_NE(other.state(), PowerState::operation_enabled);
}

TEST_P(ScriptRun, AHaltedAxisCanBeHomed) {
  give_up_after(60s);
  EXPECT_EQ(problem_of(fmt::format("units revolutions\nenable\nhalt\n"
                                   "home method {} speed 0.5 zero-speed 0.5 acceleration 50 within 20",
                                   rig.options().product->dialect.cautious_homing_method)),
            "");
}

TEST_P(ScriptRun, AHaltedMoveIsNotWaitedFor) {
  give_up_after(60s);
  EXPECT_THAT(problem_of("units revolutions\nenable\nmove by 5 velocity 2 acceleration 50 nowait\nwait 0.2\nhalt\n"
                         "arrive within 1"),
              HasSubstr("a.script:6:1: `arrive within 1`: the move is halted; `resume` it first"));
  EXPECT_NEAR(speed(), 0, 0.02);
}

class ScriptOfTwo : public ScriptRun {
 protected:
  ScriptOfTwo() : ScriptRun(2) {}
  // The axes run at 5 revolutions per second, and stop with 2 revolutions per second squared.
  static constexpr double longest_stop = 1.3 * 5.0 * 5.0 / (2 * 2.0);
  static constexpr const char* both_run =
      "axis left 1\naxis right 2\nunits revolutions\nleft enable\nright enable\n"
      "right velocity 5 acceleration 50 deceleration 2\n";
  void note_places() { places = {shaft(0), shaft(1)}; }
  double distance(std::size_t axis) { return std::abs(shaft(axis) - places[axis]); }

  std::array<double, 2> places{};
};
INSTANTIATE_TEST_SUITE_P(Some, ScriptOfTwo,
                         testing::Values(RigCase{"generic402"}, RigCase{"ismk", RigCase::BusKind::modbus},
                                         RigCase{"generic402-ec", RigCase::BusKind::ethercat}),
                         [](const auto& row) { return row.param.name(); });

TEST_P(ScriptOfTwo, MovesBothAtOnceAndBringsBothToRest) {
  EXPECT_EQ(problem_of(R"(
axis left 1
axis right 2
units revolutions
left enable
right enable
left move to 2 velocity 1 acceleration 50 nowait
right move to -3 velocity 1.5 acceleration 50 nowait
left arrive
right arrive
wait 0.3
left expect position == 2 tolerance 0.02
right expect position == -3 tolerance 0.02
)"),
            "");
  EXPECT_NEAR(shaft(0), 2, 0.02);
  EXPECT_NEAR(shaft(1), -3, 0.02);
  EXPECT_LT(rig.line.now(), 6s) << "at once, not one after another";
  EXPECT_THAT(problem_of("axis left 1\naxis right 2\nunits revolutions\nleft enable\nright enable\nleft velocity 2\n"
                         "right velocity 1\nwait 0.2\nuse right\nexpect 6041 == 0"),
              HasSubstr("a.script:10:1: "));
  EXPECT_NEAR(speed(0), 0, 0.05);
  EXPECT_NEAR(speed(1), 0, 0.05);
}

TEST_P(ScriptOfTwo, WhenOneLosesItsSupplyTheOtherStops) {
  when(0.5, [this] { rig.power_off(0); });
  EXPECT_THAT(problem_of("axis left 1\naxis right 2\nunits revolutions\nleft enable\nright enable\n"
                         "right velocity 1 acceleration 50\nleft move to 100 velocity 2 acceleration 50"),
              HasSubstr("a.script:7:1: `left move to 100"));
  EXPECT_GT(shaft(1), 0.2);
  EXPECT_NEAR(speed(1), 0, 0.05);
}

TEST_P(ScriptOfTwo, AFailureStopsBothAtTheSameTime) {
  options.began = [this](const Step& step) {
    if (step.verb == Verb::expect) note_places();
  };
  EXPECT_THAT(
      problem_of(std::string(both_run) + "left velocity 5 acceleration 50 deceleration 2\nright expect 6041 == 0"),
      HasSubstr("a.script:8:1: "));
  for (const std::size_t axis : {0U, 1U}) {
    EXPECT_NEAR(speed(axis), 0, 0.05) << axis;
    EXPECT_LT(distance(axis), longest_stop) << axis;
  }
}

TEST_P(ScriptOfTwo, CtrlCStopsBothAtTheSameTime) {
  when(5.0, [this] {
    note_places();
    cancelled = true;
  });
  EXPECT_THAT(problem_of(std::string(both_run) + "left move to 1000 velocity 5 acceleration 50 deceleration 2"),
              testing::AllOf(HasSubstr("a.script:7:1: "), HasSubstr("was cancelled")));
  for (const std::size_t axis : {0U, 1U}) {
    EXPECT_NEAR(speed(axis), 0, 0.05) << axis;
    EXPECT_LT(distance(axis), longest_stop) << axis;
  }
}

// The silent axis is the first of those that the script stops.
TEST_P(ScriptOfTwo, ASilentAxisDoesNotDelayTheStopOfTheOther) {
  options.began = [this](const Step& step) {
    if (step.verb != Verb::expect) return;
    note_places();
    rig.power_off(1);
  };
  EXPECT_THAT(problem_of("axis left 1\naxis right 2\nunits revolutions\nleft enable\nright enable\n"
                         "left velocity 5 acceleration 50\nright velocity 1 acceleration 50\nleft expect 6041 == 0"),
              HasSubstr("a.script:8:1: "));
  EXPECT_LT(distance(0), 0.3 * 5.0 + 1.3 * 5.0 * 5.0 / (2 * 50.0));
}

// A wait has no axis of its own. Over CAN the master needs 2 s to notice that a drive is silent; another access to this
// drive before the stop of the other axis would cost 2 s more.
TEST_P(ScriptOfTwo, WhenOneLosesItsSupplyInAWaitTheOtherStopsAtOnce) {
  constexpr double supervision_s = 2.5;
  at_check(50, [this] {
    note_places();
    rig.power_off(1);
  });
  EXPECT_THAT(problem_of("axis left 1\naxis right 2\nunits revolutions\nleft enable\nright enable\n"
                         "left velocity 5 acceleration 50\nright velocity 1 acceleration 50\nwait 60"),
              HasSubstr("a.script:8:1: `wait 60`: mem:"));
  rig.line.run_until(rig.line.now() + 2s);  // on EtherCAT no slave is served any more; its watchdog stops the axis
  EXPECT_NEAR(speed(0), 0, 0.05);
  EXPECT_LT(distance(0), supervision_s * 5.0 + 1.3 * 5.0 * 5.0 / (2 * 50.0));
}

}  // namespace
}  // namespace script_test
}  // namespace servodrome::master::script
