#include "scenario/random_scenario.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "line/toml_text.hpp"
#include "links/disturbance_generator.hpp"
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

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
}

// The name of the rule in the new scenario, as a string of TOML.
std::string name_of(const Source& source, const Rule& rule) {
  return line::toml_quoted(fmt::format("{}: {}", source.stem, rule.name));
}

// The lines of all rules, with names that begin with the name of the file.
std::string rules_of(const Source& source) {
  std::string rules;
  bool inside = false;
  std::size_t number = 0;
  std::string_view rest = source.text;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find('\n'), rest.size());
    std::string text(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (text.starts_with('[')) {
      inside = text.starts_with("[[rule]]");
      if (inside) {
        rules += fmt::format("\n[[rule]]\nname = {}\n", name_of(source, source.scenario.rules.at(number++)));
        continue;
      }
    }
    if (!inside || text.empty() || text.starts_with('#') || text.starts_with("name =")) continue;
    for (const Rule& rule : source.scenario.rules) {
      replace_all(text, fmt::format("after = {}", line::toml_quoted(rule.name)),
                  fmt::format("after = {}", name_of(source, rule)));
    }
    rules += text + "\n";
  }
  return rules;
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
                     line::toml_quoted(path.generic_string()), draws.next() >> 2U,
                     std::chrono::duration<double>(duration).count(), rules);
}

}  // namespace servodrome::scenario
