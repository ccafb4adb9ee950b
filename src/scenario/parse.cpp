#include "scenario/parse.hpp"

#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <set>

#include "line/toml_text.hpp"
#include "links/time.hpp"
#include "scenario/parse_parts.hpp"
#include "scenario/standard.hpp"
#include "scenario/words.hpp"

namespace servodrome::scenario {
namespace {

constexpr std::size_t most_rules = 256;
constexpr double longest_trial_s = 3600;

constexpr auto status_words = std::to_array<Word<MasterStatus>>({
    {"any", MasterStatus::any},
    {"success", MasterStatus::success},
    {"failure", MasterStatus::failure},
});

constexpr auto kind_words = std::to_array<Word<Expectation::Kind>>({
    {"eventually", Expectation::Kind::eventually},
    {"always", Expectation::Kind::always},
    {"never", Expectation::Kind::never},
});

class Reader {
 public:
  explicit Reader(const std::string& file) : folder_(std::filesystem::path(file).parent_path()) { report_.file = file; }

  // The keys that `read` asks for. It reads `table`, which has none of them, and the reader notes each key.
  static std::vector<line::KeyNote> notes(void (Reader::*read)(const toml::table&), const toml::table& table) {
    std::vector<line::KeyNote> notes;
    Reader reader("");
    reader.report_.notes = &notes;
    (reader.*read)(table);
    return notes;
  }
  static FormatKeys format() {
    FormatKeys keys;
    keys.tables["waive"] = notes(&Reader::read_waived, {});
    keys.tables["expect"] = notes(&Reader::read_expectation, {});
    keys.tables["rule"] = notes(&Reader::read_rule, {});
    for (const std::string_view action : action_names()) {
      keys.actions[std::string(action)] = notes(&Reader::read_rule, toml::table{{"do", action}});
    }
    keys.tables[""] = notes(&Reader::read_root, {});
    line::FileReport report;
    report.notes = &keys.tables["condition"];
    read_condition({}, "", report);
    report.notes = &keys.tables["message"];
    read_pattern({}, "", report);
    return keys;
  }

  ScenarioFile read(const toml::table& root) { return read(root, &Reader::read_root); }
  ScenarioFile read_rules(const toml::table& root) { return read(root, &Reader::read_rules_alone); }

 private:
  ScenarioFile read(const toml::table& root, void (Reader::*content)(const toml::table&)) {
    (this->*content)(root);
    check_references();
    std::stable_sort(report_.diagnostics.begin(), report_.diagnostics.end(), [](const auto& a, const auto& b) {
      return std::pair(a.line, a.column) < std::pair(b.line, b.column);
    });
    return {std::move(scenario_), std::move(report_.diagnostics)};
  }

  void read_rules_alone(const toml::table& root) {
    line::TableReader reader(root, "", report_);
    for (const toml::table* rule : reader.tables("rule", "rule")) read_rule(*rule);
    if (scenario_.rules.empty()) reader.complain("rule", "is missing", "write a table [[rule]]");
    reader.finish();
  }

  void read_root(const toml::table& root) {
    line::TableReader reader(root, "", report_);
    reader.read("title", scenario_.title);
    if (scenario_.title.empty()) reader.complain("title", "is missing", "say in a few words what goes wrong");
    for (const auto& [key, text] : {std::pair{"breaks", &scenario_.breaks}, std::pair{"clause", &scenario_.clause},
                                    std::pair{"good_master", &scenario_.good_master}, std::pair{"why", &scenario_.why},
                                    std::pair{"source", &scenario_.source}}) {
      reader.read(key, *text);
    }
    std::string path;
    reader.read("line", path);
    if (!path.empty()) scenario_.line = (folder_ / path).lexically_normal().string();
    reader.read("seed", scenario_.seed, 0, INT64_MAX);
    if (const auto status = read_word(reader, "master", status_words)) scenario_.master = *status;
    double seconds = links::to_seconds(scenario_.duration);
    reader.read("duration_s", seconds);
    if (seconds <= 0 || seconds > longest_trial_s) {
      reader.complain("duration_s", "is out of range", fmt::format("expected up to {} seconds", longest_trial_s));
    } else {
      scenario_.duration = links::from_seconds(seconds);
    }
    if (const toml::table* waive = reader.table("waive", "waive")) read_waived(*waive);
    for (const toml::table* rule : reader.tables("rule", "rule")) read_rule(*rule);
    for (const toml::table* expectation : reader.tables("expect", "expect")) read_expectation(*expectation);
    reader.finish();
  }

  void read_waived(const toml::table& table) {
    line::TableReader reader(table, "waive", report_);
    for (const Standard& standard : standards()) {
      std::optional<std::string> reason;
      reader.read(standard.word, reason);
      if (!reason) continue;
      if (reason->empty())
        reader.complain(standard.word, "has no reason", "say why: ends = \"it waits for the operator\"");
      scenario_.waived.emplace(standard.word, *reason);
    }
    reader.finish();
  }

  void read_rule(const toml::table& table) {
    Rule rule;
    rule.name = fmt::format("rule {}", scenario_.rules.size() + 1);
    line::TableReader reader(table, rule.name, report_);
    reader.read("name", rule.name);
    if (!names_.insert(rule.name).second) {
      reader.complain("name", fmt::format("there is a rule \"{}\" already", rule.name), "give each rule its own name");
    }
    if (scenario_.rules.size() == most_rules) {
      reader.complain("name", "exceeds the number of rules", fmt::format("a scenario has at most {}", most_rules));
      return;
    }
    reader.read("axis", rule.axis);
    reader.read("bus", rule.bus);
    if (!rule.axis.empty() && !rule.bus.empty()) reader.complain("bus", "comes with `axis`", "give one of them");
    if (const toml::table* when = reader.table("when", "condition")) rule.when = condition(*when, rule.name + ".when");
    if (const toml::table* until = reader.table("until", "condition")) {
      rule.until = condition(*until, rule.name + ".until");
    }
    reader.read("again", rule.again);
    rule.period = read_time_ms(reader, "every_ms");
    if (rule.period && table.get("for_ms") == nullptr) {
      reader.complain("every_ms", "needs `for_ms`", "say how long each run of the rule lasts");
    }
    // `on` selects messages; for actions that switch something it is a flag, which read_action reads.
    if (const toml::node* on = table.get("on"); on == nullptr || !on->is_boolean()) {
      if (const toml::table* pattern = reader.table("on", "message")) {
        rule.on = read_pattern(*pattern, rule.name + ".on", report_);
      }
    }
    reader.read("checksum", rule.checksum);
    read_limits(reader, rule);
    const auto action = read_action(reader);
    if (action) {
      reader.read("do", rule.word);
      rule.action = *action;
      if (acts_on_messages(*action) && !rule.on) {
        reader.complain("on", "is missing", "say on which messages it acts: on = { message = \"sdo_answer\" }");
      } else if (!acts_on_messages(*action) && !makes_messages(*action) && rule.on) {
        reader.complain("on", "does not belong to this action", "leave it out; `when` says when the action begins");
      }
      const auto* delay = std::get_if<Delay>(&*action);
      if (delay != nullptr && delay->frames != 0 && rule.on && !is_of_segment(rule.on->kind)) {
        reader.complain("frames", "is for frames of an EtherCAT segment", "give the time: ms = 5");
      }
    }
    reader.finish();
    scenario_.rules.push_back(std::move(rule));
  }

  static void read_limits(line::TableReader& reader, Rule& rule) {
    reader.read("times", rule.times, 1, 1'000'000'000);
    reader.read("skip", rule.skip, 0, 1'000'000'000);
    reader.read("every", rule.every, 1, 1'000'000'000);
    reader.read("chance", rule.chance);
    if (rule.chance < 0 || rule.chance > 1) reader.complain("chance", "is out of range", "expected 0 .. 1");
    rule.lasts = read_time_ms(reader, "for_ms");
  }

  void read_expectation(const toml::table& table) {
    Expectation expectation;
    expectation.name = fmt::format("expectation {}", scenario_.expectations.size() + 1);
    line::TableReader reader(table, expectation.name, report_);
    reader.read("name", expectation.name);
    reader.read("axis", expectation.axis);
    if (const toml::table* when = reader.table("when", "condition")) {
      expectation.when = condition(*when, expectation.name + ".when");
    }
    if (const toml::table* until = reader.table("until", "condition")) {
      expectation.until = condition(*until, expectation.name + ".until");
    }
    unsigned kinds = 0;
    for (const auto& word : kind_words) {
      const toml::table* what = reader.table(word.name, "condition");
      if (what == nullptr) continue;
      ++kinds;
      expectation.kind = word.value;
      expectation.what = condition(*what, fmt::format("{}.{}", expectation.name, word.name));
    }
    if (kinds != 1) {
      reader.complain("eventually", "is missing, or not alone",
                      "give one of eventually, always and never: always = { at_rest = true }");
    }
    expectation.within = read_time_ms(reader, "within_ms");
    expectation.lasts = read_time_ms(reader, "for_ms");
    if (expectation.within && expectation.kind != Expectation::Kind::eventually) {
      reader.complain("within_ms", "belongs to `eventually`", "use `until` to end the watch");
    }
    reader.finish();
    scenario_.expectations.push_back(std::move(expectation));
  }

  Condition condition(const toml::table& table, const std::string& path) {
    Condition result = read_condition(table, path, report_);
    if (!result.after.empty()) references_.push_back({result.after, table.source().begin});
    return result;
  }

  void check_references() {
    const std::vector<std::string_view> names(names_.begin(), names_.end());
    for (const auto& [name, place] : references_) {
      if (names_.contains(name)) continue;
      report_.complain(place, fmt::format("after: there is no rule \"{}\"", name), links::suggestion(name, names));
    }
  }

  struct Reference {
    std::string name;
    toml::source_position place;
  };

  std::filesystem::path folder_;
  line::FileReport report_;
  Scenario scenario_;
  std::set<std::string, std::less<>> names_;
  std::vector<Reference> references_;
};

}  // namespace

FormatKeys format_keys() { return Reader::format(); }

ScenarioFile parse_scenario(std::string_view text, const std::string& file) {
  ScenarioFile failed;
  const auto root = line::parse_toml(text, file, failed.diagnostics);
  return root ? Reader(file).read(*root) : failed;
}

ScenarioFile parse_rules(std::string_view text, const std::string& file) {
  ScenarioFile failed;
  const auto root = line::parse_toml(text, file, failed.diagnostics);
  return root ? Reader(file).read_rules(*root) : failed;
}

ScenarioFile load_scenario(const std::string& path) {
  ScenarioFile failed;
  const auto text = line::read_text_file(path, "a scenario file", failed.diagnostics);
  return text ? parse_scenario(*text, path) : failed;
}

}  // namespace servodrome::scenario
