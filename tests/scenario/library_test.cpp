// Every scenario of the library is valid and fits its line.
#include <filesystem>
#include <set>

#include "line/line_file.hpp"
#include "scenario/support.hpp"
#include "source_dir.hpp"

namespace servodrome::scenario::test {
namespace {

std::vector<std::string> library() {
  std::set<std::string> paths;
  const std::filesystem::path folder = std::filesystem::path(SERVODROME_SOURCE_DIR) / "scenarios";
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const bool is_line = entry.path().parent_path().filename() == "lines";
    if (entry.path().extension() == ".toml" && !is_line) paths.insert(entry.path().string());
  }
  return {paths.begin(), paths.end()};
}

TEST(ScenarioLibrary, FitsItsLines) {
  const std::vector<std::string> paths = library();
  EXPECT_GE(paths.size(), 150U);
  std::set<std::string> titles;
  for (const std::string& path : paths) {
    SCOPED_TRACE(path);
    ScenarioFile file = load_scenario(path);
    for (const auto& diagnostic : file.diagnostics) ADD_FAILURE() << to_string(diagnostic);
    if (!file.diagnostics.empty()) continue;
    const Scenario& scenario = file.scenario;
    const std::string folder = std::filesystem::path(path).parent_path().filename().string();
    EXPECT_TRUE(titles.insert(folder + ": " + scenario.title).second)
        << "this title is there twice: " << scenario.title;
    for (const std::string* text : {&scenario.breaks, &scenario.clause, &scenario.good_master, &scenario.why}) {
      EXPECT_FALSE(text->empty());
    }
    EXPECT_FALSE(scenario.expectations.empty());
    const line::LineFile line_file = line::load_line_file(scenario.line, line::all_products());
    ASSERT_TRUE(line_file.diagnostics.empty());
    for (const std::string& error : rehearse(line_file.settings, scenario)) ADD_FAILURE() << error;
  }
}

}  // namespace
}  // namespace servodrome::scenario::test
