// Errors in scenario files, with their places.
#include <gmock/gmock.h>

#include "scenario/support.hpp"

namespace servodrome::scenario::test {
namespace {

using testing::HasSubstr;

std::string first_error(const std::string& text) {
  const ScenarioFile file = parse_scenario(text, "s.toml");
  return file.diagnostics.empty() ? "" : to_string(file.diagnostics.front());
}

TEST(ScenarioFileErrors, AreToldWithLineAndColumn) {
  struct Case {
    const char* text;
    const char* error;
  };
  const Case cases[] = {
      {"", "s.toml:1:1: title: is missing"},
      {"title = 3", "s.toml:1:9: title: is an integer; expected a string"},
      {"title = \"t\"\n[[rule]]\ndo = \"withold\"\n", "s.toml:3:6: rule 1.do: there is no action \"withold\""},
      {"title = \"t\"\n[[rule]]\n", "rule 1.do: is missing"},
      {"title = \"t\"\n[[rule]]\ndo = \"withhold\"\n", "rule 1.on: is missing"},
      {"title = \"t\"\n[[rule]]\ndo = \"power\"\non = { message = \"nmt\" }\n", "rule 1.on"},
      {"title = \"t\"\n[[rule]]\ndo = \"delay\"\non = { message = \"sdo_answer\" }\nms = -1\n",
       "rule 1.ms: -1 is out of"},
      {"title = \"t\"\n[[rule]]\ndo = \"withhold\"\non = { message = \"sdo\" }\n",
       "there is no \"sdo\"; known here: sdo_answer"},
      {"title = \"t\"\n[[rule]]\ndo = \"show\"\nobject = \"60G1\"\nfreeze = true\n", "\"60G1\" is no object"},
      {"title = \"t\"\n[[rule]]\ndo = \"show\"\nobject = \"6041\"\n", "give one of value, set_bits"},
      {"title = \"t\"\n[[rule]]\ndo = \"al_drop\"\nto = \"operational\"\ncode = 0\n", "there is no \"operational\""},
      {"title = \"t\"\n[[rule]]\ndo = \"sync0\"\nhow = \"late\"\n", "late_us: is missing"},
      {"title = \"t\"\n[[rule]]\ndo = \"sync0\"\nhow = \"twice\"\nlate_us = 5\n", "late_us: belongs to late"},
      {"title = \"t\"\n[[rule]]\ndo = \"withhold\"\nstep = 3\non = { message = \"nmt\" }\n",
       "unknown key `step` in rule 1"},
      {"title = \"t\"\n[[rule]]\ndo = \"alter\"\non = { message = \"nmt\" }\nbyte = 0\nset = 300\n",
       "s.toml:6:7: rule 1.set: 300 is out of range; expected 0 .. 255"},
      {"title = \"t\"\n[[rule]]\ndo = \"alter\"\non = { message = \"nmt\" }\nbyte = 0\nxor = -1\n",
       "s.toml:6:7: rule 1.xor: -1 is out of range"},
      {"title = \"t\"\n[[rule]]\ndo = \"repeat\"\non = { message = \"nmt\" }\nbyte = 0\nadd = 256\n",
       "s.toml:6:7: rule 1.add: 256 is out of range"},
      {"title = \"t\"\n[[rule]]\ndo = \"delay\"\non = { message = \"frame\" }\nframes = 1\njitter_ms = 5\n",
       "s.toml:6:13: rule 1.jitter_ms: belongs to `ms`"},
      {"title = \"t\"\n[[rule]]\ndo = \"delay\"\non = { message = \"sdo_answer\" }\nframes = 1\n",
       "s.toml:5:10: rule 1.frames: is for frames of an EtherCAT segment"},
      {"title = \"t\"\n[[expect]]\nwhen = { after = \"x\" }\nalways = { at_rest = true }\n",
       "s.toml:3:8: after: there is no rule \"x\""},
      {"title = \"t\"\n[[expect]]\n", "give one of eventually, always and never"},
      {"title = \"t\"\n[[expect]]\nalways = { state = \"on\" }\n", "there is no \"on\""},
      {"title = \"t\"\n[[rule]]\nname = \"a\"\ndo = \"power\"\n[[rule]]\nname = \"a\"\ndo = \"power\"\n",
       "there is a rule \"a\" already"},
      {"title = \"t\"\nchance = 1\n", "unknown key `chance`"},
      {"title = \"t\"\nduration_s = 0\n", "duration_s: is out of range"},
      {"title = \"t\n", "correct the TOML here"},
  };
  for (const Case& each : cases) EXPECT_THAT(first_error(each.text), HasSubstr(each.error)) << each.text;
}

TEST(ScenarioFileErrors, AxesAndBusesAreCheckedWithTheLine) {
  line::Line line(line::test::settings_of(line::test::two_axes));
  const auto where = [&line](const std::string& text) -> std::string {
    try {
      const Director director(line, scenario_of(text));
    } catch (const ScenarioError& error) {
      return error.where() + ": " + error.what() + "; " + error.hint();
    }
    return "";
  };
  EXPECT_EQ(where("[[rule]]\ndo = \"power\"\n"), "rule 1: the line has several axes; name one: axis = \"NAME\"");
  EXPECT_THAT(where("[[rule]]\naxis = \"lefd\"\ndo = \"power\"\n"), HasSubstr("did you mean `left`?"));
  EXPECT_THAT(where("[[rule]]\nbus = \"can7\"\ndo = \"send\"\nid = 1\n"), HasSubstr("there is no bus \"can7\""));
  EXPECT_EQ(where("[[rule]]\naxis = \"left\"\ndo = \"power\"\n"), "");
  for (const std::string action :
       {"do = \"error_state\"\nstate = \"bus_off\"", "do = \"al_drop\"\nto = \"init\"\ncode = 0x1E",
        "do = \"sii\"\nword = 8\nvalue = 1", "do = \"clock\"\njump_ns = 5", "do = \"watchdog\"",
        "do = \"al_refuse\"\nto = \"operational\"\ncode = 0x1E", "do = \"sync0\"\nhow = \"missing\"",
        "do = \"stale_inputs\"", "do = \"power\"", "do = \"emergency\"", "do = \"ignore\"\nobject = \"6040\""}) {
    EXPECT_THAT(where("[[rule]]\nbus = \"can0\"\n" + action + "\n"), HasSubstr("the action needs an axis")) << action;
  }
}

TEST(ScenarioFileErrors, ObjectsOfConditionsAreCheckedWithTheLine) {
  line::Line line(line::test::settings_of(one_axis));
  const auto problem = [&line](const std::string& condition) -> std::string {
    std::string problems;
    for (const std::string& text :
         {"[[expect]]\nalways = " + condition + "\n", "[[expect]]\nalways = {}\nwhen = " + condition + "\n",
          "[[rule]]\ndo = \"power\"\nwhen = " + condition + "\n",
          "[[rule]]\ndo = \"power\"\nuntil = " + condition + "\n"}) {
      try {
        const Director director(line, scenario_of(text));
      } catch (const ScenarioError& error) {
        if (!problems.empty() && problems != error.what()) ADD_FAILURE() << problems << error.what();
        problems = error.what();
        continue;
      }
      EXPECT_EQ(problems, "") << text;
    }
    return problems;
  };
  EXPECT_EQ(problem("{ object = \"9999\", value = 1 }"), "the drive has no object 9999h:00");
  EXPECT_EQ(problem("{ object = \"1008\", value = 1 }"), "1008h:00 is not a whole number");
  EXPECT_EQ(problem("{ object = \"6041\", value = 65536 }"), "65536 does not fit into 6041h:00, 0 .. 65535");
  EXPECT_EQ(problem("{ object = \"6041\", mask = 65536, value = 1 }"), "65536 does not fit into 6041h:00, 0 .. 65535");
  EXPECT_EQ(problem("{ object = \"6060\", value = -1 }"), "");
  EXPECT_EQ(problem("{ object = \"6060\", value = 255 }"), "");
}

TEST(ScenarioFiles, ALatePulseIsWrittenWithOrWithoutItsWord) {
  for (const std::string how : {"", "how = \"late\"\n"}) {
    const Scenario scenario = scenario_of("[[rule]]\ndo = \"sync0\"\n" + how + "late_us = 5\n");
    const auto sync0 = std::get<DisturbSync0>(scenario.rules.front().action);
    EXPECT_EQ(sync0.how, DisturbSync0::How::late);
    EXPECT_EQ(sync0.late, 5us);
  }
}

TEST(ScenarioFiles, HaveDefaults) {
  const Scenario scenario = scenario_of("[[rule]]\ndo = \"power\"\n");
  EXPECT_EQ(scenario.seed, 1U);
  EXPECT_EQ(scenario.duration, 10s);
  EXPECT_EQ(scenario.rules.front().name, "rule 1");
  EXPECT_EQ(scenario.rules.front().every, 1U);
}

}  // namespace
}  // namespace servodrome::scenario::test
