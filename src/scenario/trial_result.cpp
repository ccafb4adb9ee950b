#include "scenario/trial_result.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fmt/format.h>
#include <map>

namespace servodrome::scenario {
namespace {

std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&': result += "&amp;"; break;
      case '<': result += "&lt;"; break;
      case '>': result += "&gt;"; break;
      case '"': result += "&quot;"; break;
      case '\n': result += '\n'; break;
      default: result += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return result;
}

std::string folder_of(const std::string& path) { return std::filesystem::path(path).parent_path().filename().string(); }

std::string stem_of(const std::string& path) { return std::filesystem::path(path).stem().string(); }

double seconds(Time time) { return std::chrono::duration<double>(time).count(); }

constexpr std::array verdict_words{"passed", "failed", "not reached"};

std::string_view word_of(Outcome outcome) { return verdict_words[static_cast<std::size_t>(outcome)]; }

std::string found_of(const TrialResult& result) {
  std::string text;
  for (const Verdict& verdict : result.verdicts) {
    if (verdict.outcome != Outcome::failed) continue;
    text +=
        fmt::format("{}at {:.3f} s {}: {}", text.empty() ? "" : "\n", seconds(verdict.at), verdict.name, verdict.found);
  }
  return text.empty() ? result.reason : text;
}

}  // namespace

std::string_view word_of(TrialResult::Outcome outcome) {
  constexpr std::array<std::string_view, 4> words{"passed", "failed", "not reached", "error"};
  return words[static_cast<std::size_t>(outcome)];
}

void judge(TrialResult& result) {
  using Result = TrialResult::Outcome;
  for (const RuleReport& rule : result.rules) {
    if (rule.error.empty()) continue;
    result.outcome = Result::error;
    result.reason = fmt::format("{}: {}", rule.name, rule.error);
    return;
  }
  const bool acted =
      std::any_of(result.rules.begin(), result.rules.end(), [](const auto& rule) { return rule.acts > 0; });
  if (!acted && !result.rules.empty()) {
    result.outcome = Result::not_reached;
    result.reason = "no rule has acted: the master did not do what the scenario waits for";
    return;
  }
  const bool failed = std::any_of(result.verdicts.begin(), result.verdicts.end(),
                                  [](const Verdict& verdict) { return verdict.outcome == Outcome::failed; });
  const bool succeeded = !result.was_ended && result.exit_status == 0;
  result.outcome = failed ? Result::failed : Result::passed;
  if (result.scenario.master == MasterStatus::success && !succeeded) {
    result.outcome = Result::failed;
    result.reason = result.was_ended ? "the master did not end in time"
                                     : fmt::format("the master ended with status {}", result.exit_status);
  } else if (result.scenario.master == MasterStatus::failure && succeeded) {
    result.outcome = Result::failed;
    result.reason = "the master ended with status 0, as if nothing had happened";
  }
}

std::vector<Expectation> standard_expectations(const std::vector<std::string>& axes) {
  std::vector<Expectation> expectations;
  for (const std::string& axis : axes) {
    Expectation rest;
    rest.name = fmt::format("{} rests after the master has ended", axis);
    rest.axis = axis;
    rest.kind = Expectation::Kind::always;
    rest.when.ended = std::chrono::seconds(2);
    rest.what.at_rest = true;
    expectations.push_back(std::move(rest));
  }
  return expectations;
}

std::string junit_of(const std::vector<TrialResult>& results, const std::string& master) {
  std::map<std::string, std::vector<const TrialResult*>> suites;
  for (const TrialResult& result : results) suites[folder_of(result.path)].push_back(&result);
  std::string xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n";
  for (const auto& [name, cases] : suites) {
    const auto count = [&cases = cases](TrialResult::Outcome outcome) {
      return std::count_if(cases.begin(), cases.end(), [outcome](const auto* one) { return one->outcome == outcome; });
    };
    xml += fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\">\n",
                       escaped(name), cases.size(), count(TrialResult::Outcome::failed),
                       count(TrialResult::Outcome::error), count(TrialResult::Outcome::not_reached));
    for (const TrialResult* one : cases) {
      xml += fmt::format("    <testcase classname=\"{}\" name=\"{}\" time=\"{:.3f}\">", escaped(master),
                         escaped(stem_of(one->path)), seconds(one->duration));
      const std::string found = escaped(found_of(*one));
      switch (one->outcome) {
        case TrialResult::Outcome::passed: break;
        case TrialResult::Outcome::failed:
          xml += fmt::format("\n      <failure message=\"{}\">{}</failure>\n    ", escaped(one->scenario.title), found);
          break;
        case TrialResult::Outcome::error: xml += fmt::format("\n      <error>{}</error>\n    ", found); break;
        case TrialResult::Outcome::not_reached: xml += fmt::format("<skipped message=\"{}\"/>", found); break;
      }
      xml += "</testcase>\n";
    }
    xml += "  </testsuite>\n";
  }
  return xml + "</testsuites>\n";
}

std::string html_of(const std::vector<TrialResult>& results, const std::string& master) {
  std::string page = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\">"
      "<title>Trial of {0}</title>\n<style>body{{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;"
      "padding:0 1rem;color-scheme:light dark}}table{{border-collapse:collapse}}td,th{{text-align:left;padding:.1rem "
      "1rem .1rem 0;vertical-align:top}}.failed,.error{{color:#b00020}}.passed{{color:#107c41}}pre{{overflow:auto;"
      "background:#8881;padding:.5rem}}svg{{max-width:100%;background:#fff}}</style>\n<h1>Trial of {0}</h1>\n<table>\n",
      escaped(master));
  for (std::size_t i = 0; i < results.size(); ++i) {
    const TrialResult& one = results[i];
    page += fmt::format("<tr><td><a href=\"#{0}\">{1}/{2}</a><td class=\"{3}\">{3}<td>{4}\n", i,
                        escaped(folder_of(one.path)), escaped(stem_of(one.path)), word_of(one.outcome),
                        escaped(one.scenario.title));
  }
  page += "</table>\n";
  for (std::size_t i = 0; i < results.size(); ++i) {
    const TrialResult& one = results[i];
    page +=
        fmt::format("<h2 id=\"{}\">{}</h2>\n<p class=\"{}\">{}{}</p>\n<table>\n", i, escaped(one.scenario.title),
                    word_of(one.outcome), word_of(one.outcome), one.reason.empty() ? "" : ": " + escaped(one.reason));
    for (const auto& [name, text] :
         {std::pair{"what breaks", &one.scenario.breaks}, std::pair{"clause", &one.scenario.clause},
          std::pair{"a good master", &one.scenario.good_master}, std::pair{"why it matters", &one.scenario.why}}) {
      page += fmt::format("<tr><th>{}<td>{}\n", name, escaped(*text));
    }
    page += "</table>\n<table><tr><th>expectation<th>verdict<th>at<th>found\n";
    for (const Verdict& verdict : one.verdicts) {
      page +=
          fmt::format("<tr><td>{}<td class=\"{}\">{}<td>{:.3f} s<td>{}\n", escaped(verdict.name),
                      word_of(verdict.outcome), word_of(verdict.outcome), seconds(verdict.at), escaped(verdict.found));
    }
    page += "</table>\n<table><tr><th>rule<th>acts<th>first\n";
    for (const RuleReport& rule : one.rules) {
      page += fmt::format("<tr><td>{}<td>{}<td>{}\n", escaped(rule.name), rule.acts,
                          rule.first_act ? fmt::format("{:.3f} s", seconds(*rule.first_act)) : "");
    }
    page += fmt::format("</table>\n{}\n", one.picture);
    if (!one.master_output.empty()) page += fmt::format("<pre>{}</pre>\n", escaped(one.master_output));
  }
  return page + "</html>\n";
}

}  // namespace servodrome::scenario
