#include "scenario/trial_report.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <map>

#include "links/time.hpp"

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

constexpr std::array verdict_words{"passed", "failed", "not reached"};

std::string_view word_of(Outcome outcome) { return verdict_words[static_cast<std::size_t>(outcome)]; }

std::string text_of(const TrialJson& object, const char* key) { return object.value(key, std::string()); }

std::string found_of(const TrialJson& trial) {
  std::string text;
  for (const TrialJson& verdict : trial.value("expectations", TrialJson::array())) {
    if (text_of(verdict, "outcome") != word_of(Outcome::failed)) continue;
    text += fmt::format("{}at {:.3f} s {}: {}", text.empty() ? "" : "\n", verdict.value("at_s", 0.0),
                        text_of(verdict, "name"), text_of(verdict, "found"));
  }
  return text.empty() ? text_of(trial, "reason") : text;
}

TrialJson json_of(const BusExcerpt& bus) {
  TrialJson lines = TrialJson::array();
  for (const TrafficLine& line : bus.lines) {
    lines.push_back({{"at_s", links::to_seconds(line.at)},
                     {"kind", word_of(line.kind)},
                     {"from", line.from},
                     {"raw", line.raw},
                     {"text", line.text}});
  }
  return {{"bus", bus.bus}, {"lines", std::move(lines)}};
}

std::string traffic_of(const TrialResult& one) {
  std::string text;
  const bool open = one.outcome == TrialResult::Outcome::failed;
  for (const BusExcerpt& bus : one.traffic) {
    if (bus.lines.empty()) continue;
    text += fmt::format("<details{}><summary>Traffic of {} around the failure and the acts of the rules</summary>\n",
                        open ? " open" : "", escaped(bus.bus));
    text += "<table class=\"traffic\">\n";
    for (const TrafficLine& line : bus.lines) {
      text += fmt::format("<tr class=\"{}\"><td>{:.6f}<td>{}<td><code>{}</code><td>{}\n", word_of(line.kind),
                          links::to_seconds(line.at), escaped(line.from), escaped(line.raw), escaped(line.text));
    }
    text += "</table></details>\n";
  }
  if (one.captures.empty()) {
    return text + "<p>Run the trial with <code>--keep FOLDER</code> to keep its whole traffic.</p>\n";
  }
  for (const std::string& file : one.captures) {
    text += fmt::format("<p>The whole traffic: <code>servodrome sniff {}</code></p>\n", escaped(file));
  }
  return text;
}

constexpr std::string_view style =
    "body{font:15px/1.5 system-ui,sans-serif;max-width:90rem;margin:2rem auto;padding:0 1rem;color-scheme:light dark}"
    "table{border-collapse:collapse}td,th{text-align:left;padding:.1rem 1rem .1rem 0;vertical-align:top}"
    ".failed,.error{color:#b00020}.passed{color:#107c41}pre{overflow:auto;background:#8881;padding:.5rem}"
    "svg{max-width:100%;background:#fff;display:block}.traffic{font-size:13px}"
    ".traffic td{padding:0 .8rem 0 .2rem}.traffic code{white-space:pre-wrap}.traffic .act{background:#e69f0033}"
    ".traffic .moment{background:#d55e0055;font-weight:600}.traffic .gap{color:#888}";

}  // namespace

TrialJson json_of(const TrialResult& result) {
  TrialJson view{{"scenario", result.path},
                 {"title", result.scenario.title},
                 {"outcome", word_of(result.outcome)},
                 {"reason", result.reason},
                 {"exit_status", result.exit_status},
                 {"was_ended", result.was_ended},
                 {"seconds", links::to_seconds(result.duration)},
                 {"expectations", TrialJson::array()},
                 {"rules", TrialJson::array()}};
  for (const Verdict& verdict : result.verdicts) {
    view["expectations"].push_back({{"name", verdict.name},
                                    {"outcome", word_of(verdict.outcome)},
                                    {"at_s", links::to_seconds(verdict.at)},
                                    {"found", verdict.found}});
  }
  for (const RuleReport& rule : result.rules) view["rules"].push_back({{"name", rule.name}, {"acts", rule.acts}});
  view["output"] = result.master_output;
  view["captures"] = result.captures;
  view["traffic"] = TrialJson::array();
  if (result.outcome == TrialResult::Outcome::failed) {
    for (const BusExcerpt& bus : result.traffic) view["traffic"].push_back(json_of(bus));
  }
  return view;
}

std::string junit_of(const TrialJson& trials, const std::string& master) {
  std::map<std::string, std::vector<const TrialJson*>> suites;
  for (const TrialJson& trial : trials) suites[folder_of(text_of(trial, "scenario"))].push_back(&trial);
  std::string xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n";
  for (const auto& [name, cases] : suites) {
    const auto count = [&cases = cases](std::string_view outcome) {
      return std::count_if(cases.begin(), cases.end(),
                           [outcome](const auto* one) { return text_of(*one, "outcome") == outcome; });
    };
    xml += fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\">\n",
                       escaped(name), cases.size(), count("failed"), count("error"), count("not reached"));
    for (const TrialJson* one : cases) {
      xml += fmt::format("    <testcase classname=\"{}\" name=\"{}\" time=\"{:.3f}\">", escaped(master),
                         escaped(stem_of(text_of(*one, "scenario"))), one->value("seconds", 0.0));
      const std::string found = escaped(found_of(*one));
      const std::string outcome = text_of(*one, "outcome");
      if (outcome == "failed") {
        xml +=
            fmt::format("\n      <failure message=\"{}\">{}</failure>\n    ", escaped(text_of(*one, "title")), found);
      } else if (outcome == "error") {
        xml += fmt::format("\n      <error>{}</error>\n    ", found);
      } else if (outcome == "not reached") {
        xml += fmt::format("<skipped message=\"{}\"/>", found);
      }
      xml += "</testcase>\n";
    }
    xml += "  </testsuite>\n";
  }
  return xml + "</testsuites>\n";
}

std::string html_of(const TrialJson& trials, const std::vector<std::string>& sections, const std::string& master) {
  std::string page = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\"><title>Trial of {0}</title>\n<style>{1}</style>\n<h1>Trial of {0}</h1>\n"
      "<table>\n",
      escaped(master), style);
  for (const TrialJson& one : trials) {
    const std::string path = text_of(one, "scenario");
    page += fmt::format("<tr><td><a href=\"#{0}\">{1}/{2}</a><td class=\"{3}\">{3}<td>{4}\n", escaped(path),
                        escaped(folder_of(path)), escaped(stem_of(path)), escaped(text_of(one, "outcome")),
                        escaped(text_of(one, "title")));
  }
  return fmt::format("{}</table>\n{}</html>\n", page, fmt::join(sections, ""));
}

std::string html_section_of(const TrialResult& one) {
  std::string text = fmt::format("<h2 id=\"{}\">{}</h2>\n<p class=\"{}\">{}{}</p>\n<table>\n", escaped(one.path),
                                 escaped(one.scenario.title), word_of(one.outcome), word_of(one.outcome),
                                 one.reason.empty() ? "" : ": " + escaped(one.reason));
  for (const auto& [name, content] :
       {std::pair{"what breaks", &one.scenario.breaks}, std::pair{"clause", &one.scenario.clause},
        std::pair{"a good master", &one.scenario.good_master}, std::pair{"why it matters", &one.scenario.why}}) {
    text += fmt::format("<tr><th>{}<td>{}\n", name, escaped(*content));
  }
  text += "</table>\n<table><tr><th>expectation<th>verdict<th>at<th>found\n";
  for (const Verdict& verdict : one.verdicts) {
    text += fmt::format("<tr><td>{}<td class=\"{}\">{}<td>{:.3f} s<td>{}\n", escaped(verdict.name),
                        word_of(verdict.outcome), word_of(verdict.outcome), links::to_seconds(verdict.at),
                        escaped(verdict.found));
  }
  text += "</table>\n<table><tr><th>rule<th>acts<th>first\n";
  for (const RuleReport& rule : one.rules) {
    text += fmt::format("<tr><td>{}<td>{}<td>{}\n", escaped(rule.name), rule.acts,
                        rule.first_act ? fmt::format("{:.3f} s", links::to_seconds(*rule.first_act)) : "");
  }
  text += fmt::format("</table>\n{}\n", one.picture);
  text += traffic_of(one);
  if (!one.master_output.empty()) text += fmt::format("<pre>{}</pre>\n", escaped(one.master_output));
  return text;
}

}  // namespace servodrome::scenario
