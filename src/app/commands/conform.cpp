// `conform`: checks from outside, clause by clause, whether a drive meets the standards.
#include <algorithm>
#include <cstdio>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/bus_options.hpp"
#include "app/commands.hpp"
#include "app/drive_link.hpp"
#include "app/number_options.hpp"
#include "app/whole_file.hpp"
#include "catalogue/product.hpp"
#include "links/nearest_name.hpp"
#include "links/time.hpp"
#include "tools/conform/report.hpp"

namespace servodrome::app {
namespace conform_command {

namespace conform = master::conform;
using conform::Check;
using conform::Outcome;
using conform::Verdict;

struct Options {
  BusOptions bus;
  std::vector<std::string> only;
  std::string junit;
  std::string foe_file;
  bool safe = false;
  bool list = false;
  bool verbose = false;
  double revolutions = 0.5;
  double units_per_revolution = 0.0;
};

std::string text_of_buses(unsigned set) {
  std::string text;
  const auto add = [&](unsigned bus, const char* word) {
    if ((set & bus) != 0) text += fmt::format("{}{}", text.empty() ? "" : ",", word);
  };
  add(conform::buses::can, "can");
  add(conform::buses::ethercat, "ethercat");
  add(conform::buses::modbus, "modbus");
  return text;
}

void list_checks(bool json) {
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  std::string_view group;
  for (const Check& check : conform::all_checks()) {
    if (json) {
      all.push_back({{"id", check.id},
                     {"clause", check.clause},
                     {"title", check.title},
                     {"needs", conform::name(check.demand)},
                     {"buses", text_of_buses(check.buses)}});
      continue;
    }
    if (check.group() != group) fmt::print("{}{}\n", group.empty() ? "" : "\n", check.group());
    group = check.group();
    fmt::print("  {:<36}{}\n  {:<36}{}; needs {}; {}\n", check.id, check.title, "", check.clause,
               conform::name(check.demand), text_of_buses(check.buses));
  }
  if (json) fmt::print("{}\n", all.dump(2));
}

void refuse_unknown(const std::vector<std::string>& words) {
  for (const std::string& word : words) {
    if (conform::is_check_or_group(word)) continue;
    // Suggest checks of the same group; if the group is unknown, list all groups, since there are few.
    const std::string_view group = std::string_view(word).substr(0, word.find('.'));
    const bool has_group = conform::is_check_or_group(group);
    std::vector<std::string_view> known;
    for (const Check& check : conform::all_checks()) {
      if (has_group && check.group() == group) known.push_back(check.id);
      if (!has_group && std::find(known.begin(), known.end(), check.group()) == known.end()) {
        known.push_back(check.group());
      }
    }
    throw Failure::wrong_use(fmt::format("--only {}: there is no such check or group; {}; --list shows all", word,
                                         links::suggestion(word, known)));
  }
}

nlohmann::ordered_json json_of(const Outcome& outcome) {
  nlohmann::ordered_json observations = nlohmann::ordered_json::array();
  for (const conform::Observation& one : outcome.observations) {
    observations.push_back({{"sent", one.sent}, {"expected", one.expected}, {"seen", one.seen}, {"met", one.met}});
  }
  const char* verdict = outcome.verdict == Verdict::fail ? "fail" : conform::name(outcome.verdict);
  return {{"id", outcome.check->id},
          {"clause", outcome.check->clause},
          {"title", outcome.check->title},
          {"verdict", verdict},
          {"reason", outcome.reason},
          {"seconds", links::to_seconds(outcome.duration)},
          {"observations", std::move(observations)}};
}

// Prints outcomes as they arrive, by groups; on a terminal also the check that is running.
class Screen {
 public:
  Screen(const Options& options, std::size_t checks)
      : shows_(!options.bus.json), progress_(shows_ && on_terminal()), verbose_(options.verbose), checks_(checks) {}

  void begin(const Check& check) {
    ++number_;
    if (!progress_) return;
    fmt::print("\r\x1B[K  {}/{}  {}", number_, checks_, check.id);
    std::fflush(stdout);
  }
  void end(const Outcome& outcome) {
    if (!shows_) return;
    if (progress_) fmt::print("\r\x1B[K");
    if (outcome.check->group() != group_) fmt::print("{}\n", outcome.check->group());
    group_ = outcome.check->group();
    fmt::print("{}", conform::text_of(outcome, verbose_));
    std::fflush(stdout);
  }

 private:
  bool shows_;
  bool progress_;
  bool verbose_;
  std::size_t checks_;
  std::size_t number_ = 0;
  std::string_view group_;
};

void run(const Options& options) {
  refuse_unknown(options.only);
  if (options.list) return list_checks(options.bus.json);
  if (!options.junit.empty()) require_writable(options.junit);
  const InterruptGuard guard;
  DriveLink link(options.bus, true);
  const line::Product* product = link.product();
  conform::SubjectSettings settings{
      .revolutions = options.revolutions, .foe_file = options.foe_file, .cancelled = InterruptGuard::interrupted};
  if (product != nullptr) settings.product = &catalogue::product_of(product->name);
  if (options.units_per_revolution > 0) settings.units_per_revolution = options.units_per_revolution;
  const auto subject = link.open_subject(settings, options.bus);
  conform::RunOptions run_options{.safe = options.safe, .watch = !options.bus.no_watch, .only = options.only};
  if (product != nullptr) run_options.departures = settings.product->departures;
  const auto checks = conform::all_checks();
  const auto wanted = std::count_if(checks.begin(), checks.end(), [&](const Check& check) {
    return conform::is_wanted(check, run_options, subject->bus_kind());
  });
  if (wanted == 0) {
    throw Failure::wrong_use(
        fmt::format("--only: none of these checks applies to this bus; --list shows the buses of each check"));
  }
  const std::string drive =
      fmt::format("{}{}", subject->where(), product != nullptr ? fmt::format(" ({})", product->name) : "");
  if (!options.bus.json) fmt::print("{}\n", drive);
  Screen screen(options, static_cast<std::size_t>(wanted));
  run_options.before = [&](const Check& check) { screen.begin(check); };
  run_options.after = [&](const Outcome& outcome) { screen.end(outcome); };
  const conform::Report report = conform::run_checks(*subject, run_options);
  if (options.bus.json) {
    nlohmann::ordered_json list = nlohmann::ordered_json::array();
    for (const Outcome& outcome : report.outcomes) list.push_back(json_of(outcome));
    fmt::print("{}\n", nlohmann::ordered_json{{"drive", subject->where()},
                                              {"product", product != nullptr ? product->name : ""},
                                              {"safe", options.safe},
                                              {"passed", report.count(Verdict::pass)},
                                              {"failed", report.count(Verdict::fail)},
                                              {"departures", report.count(Verdict::departure)},
                                              {"skipped", report.count(Verdict::skipped)},
                                              {"checks", std::move(list)},
                                              {"problems", report.problems}}
                           .dump(2));
  } else {
    fmt::print("{}\n", conform::summary_of(report));
  }
  for (const std::string& problem : report.problems) fmt::print(stderr, "servodrome: {}\n", problem);
  if (!options.junit.empty()) write_whole_file(options.junit, conform::junit_of(report, drive));
  if (report.lost) throw Failure::did_not_work(fmt::format("{}: the link is lost", subject->where()));
  if (!report.at_rest) {
    throw Failure::did_not_work(fmt::format("{}: the axis may be on or move; switch its power off", subject->where()));
  }
  if (report.cancelled) throw Failure::did_not_work(fmt::format("interrupted: {} is at rest", subject->where()));
  const std::size_t failures = report.count(Verdict::fail);
  if (failures != 0) {
    throw Failure::did_not_work(
        fmt::format("{}: {} of {} checks failed, see above", drive, failures, report.outcomes.size()));
  }
}

}  // namespace conform_command

void add_conform(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "conform", "Check a drive against CiA 301 and 402, ETG.1000, 1020 and 6010, or Modbus, clause by clause",
      conform_command::run);
  add_drive_options(*command, options->bus, "Seconds to wait for each answer");
  add_cycle_options(*command, options->bus);
  add_watch_option(*command, options->bus);
  command->add_flag("--safe", options->safe, "Skip checks that enable or move the axis");
  command->add_option("--only", options->only, "Check or group of checks to run; may be given again")
      ->allow_extra_args(false);
  command->add_flag("--list", options->list, "List the checks without running them");
  command->add_flag("--verbose", options->verbose, "Also show what was sent and received in checks that passed");
  command->add_option("--junit", options->junit, "Write the outcomes to this file, as JUnit XML");
  command->add_option("--foe-file", options->foe_file,
                      "Name of a file that the EtherCAT slave offers by FoE, to be read");
  command->add_option("--revolutions", options->revolutions, "Maximum travel in each direction, in motor revolutions")
      ->check(number_within(0.01, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--units-per-revolution", options->units_per_revolution,
                   "Position units per motor revolution; from 6091h and 6092h, or 608Fh, if not given")
      ->check(number_within(1e-3, 1e9));
}

}  // namespace servodrome::app
