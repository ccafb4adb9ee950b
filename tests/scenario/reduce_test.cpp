// A scenario is made smaller step by step; random ones combine the rules of files.
#include "scenario/reduce.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include "scenario/document.hpp"
#include "scenario/random_scenario.hpp"
#include "scenario/support.hpp"
#include "source_dir.hpp"

namespace servodrome::scenario::test {
namespace {

// The default name of a rule depends on its place, and its draws depend on its name.
TEST(Reductions, StartFromRulesWithNames) {
  const std::string text =
      "title = \"t\"\n[[rule]]\ndo = \"power\"\n[[rule]]\nname = \"own\"\n[[rule]]\ndo = \"cable\"\n";
  EXPECT_EQ(with_names(text),
            "title = \"t\"\n\n[[rule]]\nname = \"rule 1\"\ndo = \"power\"\n\n[[rule]]\nname = \"own\"\n\n"
            "[[rule]]\nname = \"rule 3\"\ndo = \"cable\"\n");
}

constexpr const char* big = R"(title = "big"
line = "can.toml"
seed = 3
duration_s = 20

[[rule]]
name = "first"
when = { state = "operation_enabled", speed_above_rpm = 60 }
on = { message = "sdo_answer", object = "6041" }
do = "delay"
ms = 40
jitter_ms = 5
chance = 0.5
skip = 2

[[rule]]
name = "second"
on = { message = "heartbeat" }
do = "withhold"
times = 9

[[expect]]
name = "kept"
always = { at_rest = true }

[[expect]]
name = "other"
always = { powered = true }
)";

std::vector<std::string> steps(const std::string& text) {
  std::vector<std::string> all;
  for (const Reduction& one : reductions(text, "kept")) all.push_back(one.what);
  return all;
}

TEST(Reductions, TheLargestStepsComeFirst) {
  const std::vector<std::string> expected{
      "without the other expectations",        "without the rule \"first\"",
      "without the rule \"second\"",           "the rule \"first\" without when",
      "the rule \"first\" without when.state", "the rule \"first\" without when.speed_above_rpm",
      "the rule \"first\" without jitter_ms",  "the rule \"first\" without chance",
      "the rule \"first\" without skip",       "the rule \"first\" with times = 1",
      "the rule \"first\" with ms = 1",        "the rule \"first\" with ms = 20",
      "the rule \"second\" with times = 1",    "the rule \"second\" with times = 4",
  };
  EXPECT_EQ(steps(big), expected);
}

// The notation of TOML does not matter: indented and aligned lines, dotted keys, arrays over several lines, comments.
TEST(Reductions, AreTheSameForAnyNotation) {
  const std::string other = R"(title       = 'big'
line        = 'can.toml'   # not [[rule]]
seed        = 3
duration_s  = 20

  [[ rule ]]
    name                   = 'first'
    when.state             = "operation_enabled"
    when.speed_above_rpm   = 60
    on                     = { message = "sdo_answer", object = "6041" }
    do                     = "delay"
    ms = 40 # name = "third"
    jitter_ms = 5
    chance = 0.5
    skip = 2
  [[ rule ]]
    name = """second"""
    on = { message = "heartbeat" }
    do = "withhold"
    times = 9

  [[ expect ]]
  name = "kept"
  always = { at_rest = true }
  [[ expect ]]
  name = "other"
  always.powered = true
)";
  const std::vector<Reduction> expected = reductions(big, "kept");
  const std::vector<Reduction> found = reductions(other, "kept");
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].what, expected[i].what);
    EXPECT_EQ(found[i].text, expected[i].text);
  }
}

TEST(Reductions, OfATextThatIsNoTomlAreRefused) { EXPECT_THROW(reductions("title = ", "kept"), std::runtime_error); }

// What the library's files state survives reading and writing.
TEST(Reductions, WriteEveryFileOfTheLibrary) {
  unsigned files = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(std::filesystem::path(SERVODROME_SOURCE_DIR) / "scenarios")) {
    if (entry.path().extension() != ".toml") continue;
    const std::string path = entry.path().string();
    std::ifstream stream(path);
    const std::string text(std::istreambuf_iterator<char>(stream), {});
    if (text.find("[[rule]]") == std::string::npos) continue;
    SCOPED_TRACE(path);
    const toml::table read = table_of(text);
    const std::string written = text_of(read);
    EXPECT_EQ(table_of(written), read);
    EXPECT_TRUE(parse_scenario(written, path).diagnostics.empty()) << written;
    ++files;
  }
  EXPECT_GT(files, 200U);
}

// Line and seed are set, wherever and however the file states them.
TEST(Reductions, SetLineAndSeed) {
  EXPECT_EQ(with_line("line   = 'a.toml'\ntitle = \"t\"\n", "/b c.toml"), "line = \"/b c.toml\"\ntitle = \"t\"\n");
  EXPECT_EQ(with_seed("title = \"t\"\n", 7), "seed = 7\ntitle = \"t\"\n");
  EXPECT_EQ(with_seed("title = \"t\"\n seed=0x10\n", 7), "title = \"t\"\nseed = 0x10\n");
}

// A master that is only slow would fail in less time.
TEST(Reductions, KeepTheTimeOfTheTrial) {
  for (const Reduction& one : reductions(big, "kept"))
    EXPECT_NE(one.text.find("\nduration_s = 20\n"), std::string::npos) << one.what;
}

TEST(Reductions, EachIsAValidScenarioThatDiffers) {
  const Scenario whole = parse_scenario(big, "big.toml").scenario;
  for (const Reduction& one : reductions(big, "kept")) {
    SCOPED_TRACE(one.what);
    const ScenarioFile file = parse_scenario(one.text, "big.toml");
    for (const auto& diagnostic : file.diagnostics) ADD_FAILURE() << to_string(diagnostic);
    EXPECT_NE(one.text, big);
    const bool has_kept = std::any_of(file.scenario.expectations.begin(), file.scenario.expectations.end(),
                                      [](const Expectation& its) { return its.name == "kept"; });
    EXPECT_TRUE(has_kept);
    EXPECT_FALSE(file.scenario.rules.empty());
  }
}

TEST(Reductions, EndWhenNothingCanBeLeftOut) {
  std::string text = big;
  unsigned taken = 0;
  for (auto all = reductions(text, "kept"); !all.empty(); all = reductions(text, "kept")) {
    text = all.front().text;
    ASSERT_LT(++taken, 50U);
  }
  EXPECT_EQ(parse_scenario(text, "t.toml").scenario.rules.size(), 1U);
  EXPECT_EQ(parse_scenario(text, "t.toml").scenario.rules.front().times, 1U);
}

TEST(RandomScenarios, CombineRulesAndDependOnTheirSeedOnly) {
  std::vector<std::string> files;
  const std::filesystem::path folder = std::filesystem::path(SERVODROME_SOURCE_DIR) / "scenarios/canopen";
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path().string());
  std::sort(files.begin(), files.end());
  std::set<std::string> titles;
  for (std::uint64_t n = 1; n <= 40; ++n) {
    const std::string text = random_scenario(files, 7, n, folder);
    SCOPED_TRACE(text);
    EXPECT_EQ(text, random_scenario(files, 7, n, folder));
    const ScenarioFile file = parse_scenario(text, (folder / "random.toml").string());
    for (const auto& diagnostic : file.diagnostics) ADD_FAILURE() << to_string(diagnostic);
    EXPECT_TRUE(std::filesystem::exists(file.scenario.line)) << file.scenario.line;
    EXPECT_GE(file.scenario.rules.size(), 2U);
    EXPECT_TRUE(file.scenario.expectations.empty());
    titles.insert(file.scenario.title);
  }
  EXPECT_GT(titles.size(), 35U);
  EXPECT_NE(random_scenario(files, 7, 1, folder), random_scenario(files, 8, 1, folder));
}

}  // namespace
}  // namespace servodrome::scenario::test
