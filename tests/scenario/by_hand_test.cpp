// Rules that a user adds to and removes from a running scenario, and the catalogue of actions for this.
#include <gmock/gmock.h>
#include <set>

#include "api/error.hpp"
#include "scenario/catalogue.hpp"
#include "scenario/parse_parts.hpp"
#include "scenario/routes.hpp"
#include "scenario/schema.hpp"
#include "scenario/support.hpp"

namespace servodrome::scenario::test {
namespace {

using testing::HasSubstr;
using Json = nlohmann::ordered_json;

std::string body(const std::string& text) { return Json{{"text", text}}.dump(); }

std::string refusal(const std::function<void()>& call) {
  try {
    call();
  } catch (const api::ApiError& error) {
    return error.what;
  }
  return "";
}

struct Bench {
  line::Line line{line::test::settings_of(line::test::two_axes)};
  Routes routes{line};
};

const char* const hides = "[[rule]]\nname = \"hides\"\naxis = \"left\"\ndo = \"show\"\nobject = \"1000\"\nvalue = 7\n";

TEST(RulesByHand, BeginAScenarioAndJoinIt) {
  Bench bench;
  EXPECT_TRUE(bench.routes.rules()["rules"].empty());
  const Json first = bench.routes.add_rules(body(hides));
  EXPECT_EQ(first["rules"][0]["phase"], "active");
  EXPECT_EQ(first["rules"][0]["do"], "show");
  EXPECT_EQ(first["rules"][0]["where"], "left");
  bench.line.run_until(10ms);
  EXPECT_THAT(refusal([&] { bench.routes.add_rules(body(hides)); }), HasSubstr("a rule of this name"));
  const Json second = bench.routes.add_rules(
      body("[[rule]]\nname = \"waits\"\naxis = \"right\"\nwhen = { time_ms = 50 }\ndo = \"power\"\n"));
  EXPECT_EQ(second["rules"].size(), 2U);
  EXPECT_EQ(second["rules"][0]["first_act_s"], 0.0) << "the first rule goes on";
  EXPECT_EQ(second["rules"][1]["phase"], "waiting");
  bench.line.run_until(100ms);
  EXPECT_FALSE(bench.line.find_axis("right")->powered());
}

// The master received an acknowledgement of this write and of the following ones.
TEST(RulesByHand, ARemovedHoldLosesNoWrite) {
  for (const bool whole : {false, true}) {
    Bench bench;
    bench.routes.add_rules(
        body("[[rule]]\nname = \"slow\"\naxis = \"left\"\ndo = \"hold\"\nobject = \"6083\"\nms = 4000\n"));
    bench.line.run_until(10ms);
    dictionary::Dictionary& seen = bench.line.find_axis("left")->device().bus_dictionary();
    const auto write = [&seen](std::int64_t value) {
      const auto bytes = dictionary::encode_number(value);
      return seen.write(*seen.find(0x6083, 0), std::span(bytes).first(4));
    };
    const std::int64_t before = seen.number(0x6083);
    EXPECT_EQ(write(2000), dictionary::AbortCode::none);
    EXPECT_EQ(seen.number(0x6083), before);
    if (whole) {
      bench.routes.end();
    } else {
      bench.routes.remove_rule("slow");
    }
    EXPECT_EQ(seen.number(0x6083), 2000);
    EXPECT_EQ(write(3000), dictionary::AbortCode::none);
    EXPECT_EQ(seen.number(0x6083), 3000);
    bench.line.run_until(5s);
    EXPECT_EQ(seen.number(0x6083), 3000);
  }
}

TEST(RulesByHand, ARefusedRuleLeavesTheFormerScenario) {
  Bench bench;
  bench.routes.begin("title = \"former\"\n", "s.toml", Routes::Extra::none);
  bench.routes.end();
  EXPECT_FALSE(refusal([&] { bench.routes.add_rules(body("[[rule]]\naxis = \"nobody\"\ndo = \"power\"\n")); }).empty());
  EXPECT_EQ(bench.routes.show()["title"], "former");
}

TEST(RulesByHand, LeaveAndTakeTheirEffectBack) {
  Bench bench;
  bench.routes.begin("title = \"t\"\n[[rule]]\nname = \"off\"\naxis = \"right\"\ndo = \"power\"\n", "s.toml",
                     Routes::Extra::none);
  bench.routes.add_rules(body(hides));
  EXPECT_FALSE(bench.line.find_axis("right")->powered());
  EXPECT_EQ(bench.routes.remove_rule("off")["rules"].size(), 1U);
  EXPECT_TRUE(bench.line.find_axis("right")->powered());
  EXPECT_THAT(refusal([&] { bench.routes.remove_rule("off"); }), HasSubstr("there is no rule"));
  EXPECT_TRUE(bench.routes.remove_rule("hides")["rules"].empty());
  const Json again = bench.routes.add_rules(body(hides));  // the name is free
  EXPECT_EQ(again["rules"][0]["acts"], 1U);
}

// Settings from before the rules, or from a user since then, are kept.
TEST(RulesByHand, ARemovedRuleLeavesWhatItDidNotSwitch) {
  const auto rule = [](const std::string& name, const std::string& rest) {
    return body("[[rule]]\nname = \"" + name + "\"\naxis = \"left\"\n" + rest + "\n");
  };
  Bench bench;
  line::Axis& left = *bench.line.find_axis("left");
  left.power_off(bench.line.now());
  bench.routes.add_rules(rule("off", "do = \"power\""));
  bench.routes.remove_rule("off");
  EXPECT_FALSE(left.powered()) << "it was off before";
  bench.routes.add_rules(rule("on", "do = \"power\"\non = true"));
  EXPECT_TRUE(left.powered());
  left.power_off(bench.line.now());
  bench.routes.remove_rule("on");
  EXPECT_FALSE(left.powered()) << "somebody switched it off meanwhile";
  left.power_on(bench.line.now());

  left.force_input(0, true);
  bench.routes.add_rules(rule("input", "do = \"input\"\nwire = \"DI0\"\nlevel = false"));
  EXPECT_FALSE(left.forced_inputs().at(0));
  bench.routes.remove_rule("input");
  EXPECT_TRUE(left.forced_inputs().at(0)) << "forced by hand before";
  left.force_input(0, std::nullopt);
  bench.routes.add_rules(rule("input", "do = \"input\"\nwire = \"DI0\"\nlevel = false"));
  bench.routes.remove_rule("input");
  EXPECT_TRUE(left.forced_inputs().empty());
}

// Frames that a rule has delayed pass at the end of the scenario; the next scenario does not throw them away.
TEST(RulesByHand, AReplacementLosesNoDelayedFrame) {
  Bench bench;
  links::MemoryPort port(bench.line.buses().front()->bus);
  bench.routes.begin(
      "title = \"t\"\n[[rule]]\naxis = \"right\"\non = { message = \"sdo_answer\" }\ndo = \"delay\"\nms = 500\n",
      "s.toml", Routes::Extra::none);
  bench.line.run_until(10ms);
  for (int n = 0; n < 3; ++n) {
    port.send(line::test::sdo_read(2, 0x1000, 0), bench.line.now());
    bench.line.run_until(bench.line.now() + 10ms);
  }
  bench.routes.begin("title = \"next\"\n", "s.toml", Routes::Extra::none);
  bench.line.run_until(bench.line.now() + 10ms);
  unsigned answers = 0;
  while (const auto frame = port.receive()) answers += frame->frame.id == 0x582 ? 1U : 0U;
  EXPECT_EQ(answers, 3U);
}

TEST(RulesByHand, DuringATrialNoScenarioReplacesItAndNoneOfItsRulesLeaves) {
  Bench bench;
  bench.routes.begin("title = \"trial\"\n[[rule]]\nname = \"off\"\naxis = \"right\"\ndo = \"power\"\n", "s.toml",
                     Routes::Extra::standard_expectations);
  bench.routes.begin_trial();
  EXPECT_THAT(refusal([&] { bench.routes.begin(body("title = \"other\"\n")); }), HasSubstr("a trial runs"));
  EXPECT_THAT(refusal([&] { bench.routes.end(); }), HasSubstr("a trial runs"));
  EXPECT_EQ(bench.routes.show()["title"], "trial");
  EXPECT_EQ(bench.routes.add_rules(body(hides))["rules"].size(), 2U);
  EXPECT_THAT(refusal([&] { bench.routes.remove_rule("off"); }), HasSubstr("a trial runs"));
  EXPECT_FALSE(bench.line.find_axis("right")->powered());
  EXPECT_EQ(bench.routes.remove_rule("hides")["rules"].size(), 1U);  // was added by hand
  bench.routes.director()->finish();
  bench.routes.end_trial();
  EXPECT_EQ(bench.routes.begin(body("title = \"other\"\n"))["title"], "other");
}

// A fault by its cause and by its code is one state.
TEST(RulesByHand, OneFaultUnderTwoWordsEndsWithItsLastRule) {
  for (const bool first_ends_first : {true, false}) {
    Bench bench;
    line::Axis& right = *bench.line.find_axis("right");
    const drive::FaultRow* row = nullptr;  // the first one whose cause is not a fault of the plant, too
    for (unsigned cause = 1; row == nullptr; ++cause) {
      row = right.device().drive().row(static_cast<drive::Cause>(cause));
      if (row != nullptr && plant::injection_from_name(drive::name(row->cause))) row = nullptr;
    }
    const auto add = [&](const std::string& name, const std::string& fault) {
      bench.routes.add_rules(
          body("[[rule]]\nname = \"" + name + "\"\naxis = \"right\"\ndo = \"inject\"\nfault = \"" + fault + "\"\n"));
    };
    add("first", std::string(drive::name(row->cause)));
    add("second", fmt::format("0x{:04X}", row->code));
    EXPECT_TRUE(right.injected(row->cause));
    bench.routes.remove_rule(first_ends_first ? "first" : "second");
    EXPECT_TRUE(right.injected(row->cause));
    bench.routes.remove_rule(first_ends_first ? "second" : "first");
    EXPECT_FALSE(right.injected(row->cause));
  }
}

// Two rules of one state, ended in both orders: the state returns when the last rule ends.
TEST(RulesByHand, TwoOfOneStateEndOneAfterTheOther) {
  const std::vector<std::pair<std::string, std::function<bool(line::Line&)>>> states{
      {"do = \"power\"", [](line::Line& line) { return line.find_axis("left")->powered(); }},
      {"do = \"cable\"",
       [](line::Line& line) {
         line::Axis& axis = *line.find_axis("left");
         return !line.buses()[*axis.settings().bus]->bus.is_cut(axis.port());
       }},
      {"do = \"input\"\nwire = \"DI0\"",
       [](line::Line& line) { return line.find_axis("left")->forced_inputs().empty(); }},
      {"do = \"inject\"\nfault = \"encoder_loss\"",
       [](line::Line& line) { return !line.find_axis("left")->plant().injected(plant::Injection::encoder_loss); }},
      {"do = \"plant\"\nkey = \"locked_rotor\"",
       [](line::Line& line) { return !line.find_axis("left")->plant().rotor_locked(); }}};
  for (const auto& [text, is_usual] : states) {
    for (const bool first_ends_first : {true, false}) {
      Bench bench;
      const auto add = [&, &rule_text = text](const std::string& name) {
        bench.routes.add_rules(body("[[rule]]\nname = \"" + name + "\"\naxis = \"left\"\n" + rule_text + "\n"));
      };
      EXPECT_TRUE(is_usual(bench.line)) << text;
      add("first");
      add("second");
      EXPECT_FALSE(is_usual(bench.line)) << text;
      bench.routes.remove_rule(first_ends_first ? "first" : "second");
      EXPECT_FALSE(is_usual(bench.line)) << text;
      bench.routes.remove_rule(first_ends_first ? "second" : "first");
      EXPECT_TRUE(is_usual(bench.line)) << text;
    }
  }
}

TEST(RulesByHand, OneThatCannotActIsRefused) {
  Bench bench;
  for (const auto& [text, words] : std::vector<std::pair<std::string, std::string>>{
           {"do = \"inject\"\nfault = \"encoder_los\"", "has no fault"},
           {"do = \"input\"\nwire = \"DI99\"", "has no input"},
           {"do = \"plant\"\nkey = \"load_torque\"\nvalue = 1", "has no quantity"},
           {"do = \"plant\"\nkey = \"load_inertia_kgm2\"\nvalue = -1", "load.inertia_kgm2"}}) {
    EXPECT_THAT(
        refusal([&, &rest = text] { bench.routes.add_rules(body("[[rule]]\naxis = \"left\"\n" + rest + "\n")); }),
        HasSubstr(words));
    EXPECT_TRUE(bench.routes.rules()["rules"].empty());
  }
}

TEST(RulesByHand, TheTextHasNothingButRulesAndItsOwnLines) {
  Bench bench;
  EXPECT_THAT(refusal([&] { bench.routes.add_rules(body("seed = 7\n" + std::string(hides))); }), HasSubstr("seed"));
  EXPECT_THAT(refusal([&] { bench.routes.add_rules(body("")); }), HasSubstr("rule"));
  try {
    bench.routes.add_rules(body("[[rule]]\ndo = \"fly\"\n"));
    FAIL();
  } catch (const api::ApiError& error) {
    EXPECT_THAT(error.where, HasSubstr("rules:2:"));
  }
}

// Removed rules do not count, and their pending actions are cancelled.
TEST(RulesByHand, ComeAndGoWithoutLimit) {
  Bench bench;
  for (int i = 0; i < 5000; ++i) {
    bench.routes.add_rules(
        body("[[rule]]\nname = \"storm\"\naxis = \"left\"\ndo = \"emergency\"\ncode = 0x1000\ntimes = "
             "100\nperiod_ms = 10\n"));
    bench.routes.remove_rule("storm");
  }
  EXPECT_TRUE(bench.routes.rules()["rules"].empty());
  bench.line.run_until(2s);
}

TEST(RulesByHand, OneThatDoesNotFitLetsNoneJoin) {
  Bench bench;
  const std::string wrong = "[[rule]]\nname = \"wrong\"\naxis = \"nobody\"\ndo = \"power\"\n";
  EXPECT_THAT(refusal([&] { bench.routes.add_rules(body(hides + wrong)); }), HasSubstr("there is no axis"));
  EXPECT_TRUE(bench.routes.rules()["rules"].empty());
  EXPECT_THAT(refusal([&] { bench.routes.add_rules(body("[[rule]]\ndo = \"fly\"\n")); }),
              HasSubstr("there is no action"));
}

// ---- The catalogue

TEST(ActionCatalogue, HasEachActionAndEachMessage) {
  std::set<std::string> actions, messages;
  const Json catalogue = action_catalogue();
  for (const Json& group : catalogue["groups"]) {
    for (const Json& action : group["actions"]) {
      actions.insert(action["do"]);
      EXPECT_FALSE(action["text"].get<std::string>().empty()) << action;
      EXPECT_TRUE(action["use"] == "message" || !action["clause"].get<std::string>().empty()) << action;
    }
    for (const Json& message : group["messages"]) messages.insert(message["message"]);
  }
  for (const std::string_view name : action_names()) EXPECT_TRUE(actions.contains(std::string(name))) << name;
  const Json schema = json_schema();
  for (const Json& name : schema["definitions"]["message"]["properties"]["message"]["enum"])
    EXPECT_TRUE(messages.contains(name.get<std::string>())) << name;
}

// The rule that a page creates from an action and its example.
std::string rule_of(const Json& action, const std::string& message) {
  std::string text = "[[rule]]\ndo = \"" + action["do"].get<std::string>() + "\"\n";
  if (!message.empty()) text += "on = { message = \"" + message + "\" }\n";
  for (const auto& [key, value] : action["example"].items()) {
    const Json& type = action["keys"].at(key);
    const bool is_text = type.value("type", "") == "string";
    text += key + " = " + (is_text ? value.dump() : value.get<std::string>()) + "\n";
  }
  return text;
}

TEST(ActionCatalogue, ExamplesAreRules) {
  const Json catalogue = action_catalogue();
  for (const Json& group : catalogue["groups"]) {
    for (const Json& action : group["actions"]) {
      const bool on_messages = action["use"] == "message";
      std::vector<std::string> messages(on_messages ? 0 : 1);
      for (const Json& message : group["messages"]) {
        if (on_messages) messages.push_back(message["message"]);
      }
      for (const std::string& message : messages) {
        const std::string text = rule_of(action, message);
        const ScenarioFile file = parse_scenario("title = \"t\"\n" + text, "s.toml");
        ASSERT_TRUE(file.diagnostics.empty()) << text << to_string(file.diagnostics.front());
        EXPECT_EQ(acts_on_messages(file.scenario.rules.front().action), on_messages) << text;
      }
    }
  }
}

}  // namespace
}  // namespace servodrome::scenario::test
