#include "scenario/random_scenario.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "line/toml_text.hpp"
#include "links/disturbance_generator.hpp"
#include "links/time.hpp"
#include "scenario/document.hpp"
#include "scenario/parse.hpp"

namespace servodrome::scenario {
namespace {

struct Source {
  std::string stem;
  Scenario scenario;
  std::string text;
};

Source source_of(const std::string& path) {
  ScenarioFile file = load_scenario(path);
  if (!file.diagnostics.empty()) throw std::runtime_error(to_string(file.diagnostics.front()));
  std::ifstream stream(path);
  return {std::filesystem::path(path).stem().string(), std::move(file.scenario),
          std::string(std::istreambuf_iterator<char>(stream), {})};
}

// Puts the name of the file before the names of rules that conditions refer to.
void rename_references(toml::table& table, const std::string& stem) {
  for (auto&& [key, node] : table) {
    if (toml::table* inner = node.as_table()) rename_references(*inner, stem);
    if (auto* name = node.as_string(); name != nullptr && key.str() == "after")
      *name = fmt::format("{}: {}", stem, **name);
  }
}

// The text of all rules, with names that begin with the name of the file.
std::string rules_of(const Source& source) {
  toml::table document = table_of(source.text);
  const std::vector<toml::table*> rules = tables_at(document, "rule");
  for (std::size_t i = 0; i < rules.size(); ++i) {
    rename_references(*rules[i], source.stem);
    rules[i]->insert_or_assign("name", fmt::format("{}: {}", source.stem, source.scenario.rules.at(i).name));
  }
  for (const std::string_view key : keys_in_order(document)) {
    if (key != "rule") document.erase(key);
  }
  return text_of(document);
}

}  // namespace

std::string random_scenario(const std::vector<std::string>& files, std::uint64_t seed, std::uint64_t number,
                            const std::filesystem::path& folder) {
  links::DisturbanceGenerator draws(links::DisturbanceGenerator(seed).next() + number);
  const auto draw = [&draws](std::size_t below) { return static_cast<std::size_t>(draws.next() % below); };
  std::vector<Source> sources;
  for (const std::string& file : files) sources.push_back(source_of(file));
  const auto goes_with = [](const Source& one, const Source& other) {
    return one.scenario.line == other.scenario.line && one.stem != other.stem;
  };
  // Prefers a first file that can be combined with another one.
  std::vector<std::size_t> first;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const bool paired =
        std::any_of(sources.begin(), sources.end(), [&](const Source& other) { return goes_with(sources[i], other); });
    if (paired) first.push_back(i);
  }
  std::vector<Source> chosen{sources.at(first.empty() ? draw(sources.size()) : first[draw(first.size())])};
  std::vector<Source> others;
  std::copy_if(sources.begin(), sources.end(), std::back_inserter(others),
               [&](const Source& other) { return goes_with(chosen.front(), other); });
  for (std::size_t left = 1 + draw(2); left > 0 && !others.empty(); --left) {
    const std::size_t one = draw(others.size());
    chosen.push_back(std::move(others[one]));
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(one));
  }
  std::string rules;
  std::vector<std::string> stems;
  Time duration{};
  for (const Source& source : chosen) {
    rules += rules_of(source);
    stems.push_back(source.stem);
    duration = std::max(duration, source.scenario.duration);
  }
  const auto path = std::filesystem::relative(chosen.front().scenario.line, folder);
  return fmt::format("title = {}\nline = {}\nseed = {}\nduration_s = {}\n{}",
                     line::toml_quoted(fmt::format("Random: {}", fmt::join(stems, ", "))),
                     line::toml_quoted(path.generic_string()), draws.next() >> 2U, links::to_seconds(duration), rules);
}

}  // namespace servodrome::scenario
