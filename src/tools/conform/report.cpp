#include "tools/conform/report.hpp"

#include <algorithm>
#include <fmt/format.h>

#include "links/time.hpp"

namespace servodrome::master::conform {
namespace {

std::string text_of(const Observation& one, std::string_view indent) {
  return fmt::format("{0}sent      {1}\n{0}expected  {2}\n{0}seen      {3}\n", indent, one.sent, one.expected,
                     one.seen);
}

// Escapes a text for XML 1.0, for attributes and content.
std::string escaped(std::string_view text) {
  std::string result;
  for (const char character : text) {
    switch (character) {
      case '&': result += "&amp;"; break;
      case '<': result += "&lt;"; break;
      case '>': result += "&gt;"; break;
      case '"': result += "&quot;"; break;
      case '\n': result += '\n'; break;
      default:
        if (static_cast<unsigned char>(character) >= 0x20) result += character;
    }
  }
  return result;
}

std::string test_case_of(const Outcome& outcome) {
  const Check& check = *outcome.check;
  std::string content;
  std::string seen;
  for (const Observation& one : outcome.observations) {
    if (!one.met) seen += text_of(one, "");
  }
  const std::string clause = escaped(check.clause);
  if (outcome.verdict == Verdict::fail) {
    content =
        fmt::format("<failure type=\"{}\" message=\"{}\">{}</failure>", clause, escaped(check.title), escaped(seen));
  } else if (outcome.verdict == Verdict::skipped) {
    content = fmt::format("<skipped message=\"{}\"/>", escaped(outcome.reason));
  } else if (outcome.verdict == Verdict::departure) {
    content = fmt::format("<system-out>departure from {}: {}\n{}</system-out>", clause, escaped(outcome.reason),
                          escaped(seen));
  } else if (!outcome.reason.empty()) {
    content = fmt::format("<system-out>{}</system-out>", escaped(outcome.reason));
  }
  return fmt::format("    <testcase classname=\"conform.{}\" name=\"{}\" time=\"{:.3f}\">{}</testcase>\n",
                     check.group(), check.id, links::to_seconds(outcome.duration), content);
}

}  // namespace

std::string text_of(const Outcome& outcome, bool all) {
  constexpr std::string_view indent = "             ";
  const Check& check = *outcome.check;
  std::string text = fmt::format("  {:<9}  {:<36}{}\n", name(outcome.verdict), check.id, check.title);
  const bool told = outcome.verdict == Verdict::fail || outcome.verdict == Verdict::departure;
  if (told || all) text += fmt::format("{}{}\n", indent, check.clause);
  if (!outcome.reason.empty()) {
    text += fmt::format("{}{}{}\n", indent, outcome.verdict == Verdict::departure ? "manual    " : "", outcome.reason);
  }
  for (const Observation& one : outcome.observations) {
    if (all || !one.met) text += text_of(one, indent);
  }
  return text;
}

std::string summary_of(const Report& report) {
  return fmt::format("{} checks: {} passed, {} failed, {} departures, {} skipped", report.outcomes.size(),
                     report.count(Verdict::pass), report.count(Verdict::fail), report.count(Verdict::departure),
                     report.count(Verdict::skipped));
}

std::string junit_of(const Report& report, const std::string& drive) {
  std::vector<std::string_view> groups;
  for (const Outcome& outcome : report.outcomes) {
    const std::string_view group = outcome.check->group();
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
  }
  std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  text += fmt::format("<testsuites name=\"{}\" tests=\"{}\" failures=\"{}\" skipped=\"{}\">\n", escaped(drive),
                      report.outcomes.size(), report.count(Verdict::fail), report.count(Verdict::skipped));
  for (const std::string_view group : groups) {
    std::string cases;
    std::size_t tests = 0;
    std::size_t failures = 0;
    std::size_t skipped = 0;
    Time duration{};
    for (const Outcome& outcome : report.outcomes) {
      if (outcome.check->group() != group) continue;
      ++tests;
      failures += outcome.verdict == Verdict::fail ? 1U : 0U;
      skipped += outcome.verdict == Verdict::skipped ? 1U : 0U;
      duration += outcome.duration;
      cases += test_case_of(outcome);
    }
    text += fmt::format(
        "  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" skipped=\"{}\" time=\"{:.3f}\">\n{}  </testsuite>\n",
        group, tests, failures, skipped, links::to_seconds(duration), cases);
  }
  return text + "</testsuites>\n";
}

}  // namespace servodrome::master::conform
