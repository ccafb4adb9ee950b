// `trial`: runs a master through scenarios in which drives and buses misbehave.
#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <thread>

#include "app/commands.hpp"
#include "app/interrupt_guard.hpp"
#include "app/number_options.hpp"
#include "app/temporary_folder.hpp"
#include "app/trial_minimise.hpp"
#include "app/trial_run.hpp"
#include "app/whole_file.hpp"
#include "links/time.hpp"
#include "scenario/parse.hpp"
#include "scenario/random_scenario.hpp"
#include "scenario/schema.hpp"
#include "scenario/trial_report.hpp"

namespace servodrome::app {
namespace trial_command {

namespace fs = std::filesystem;
using scenario::TrialResult;

struct Options {
  std::vector<std::string> scenarios;
  std::vector<std::string> master;
  std::vector<std::string> links;
  std::string only;
  std::string junit;
  std::string html;
  std::string keep;
  unsigned random = 0;
  std::uint64_t seed = 1;
  unsigned runs = 100;
  double after_s = 3;
  unsigned jobs = 4;
  bool list = false;
  bool schema = false;
  bool minimise = false;
  bool json = false;
};

// The scenario files of folders and files, in alphabetical order. Line files lie in folders called `lines`.
std::vector<std::string> files_of(const Options& options) {
  std::set<std::string> files;
  for (const std::string& place : options.scenarios) {
    if (!fs::is_directory(place)) {
      files.insert(place);
      continue;
    }
    for (const auto& entry : fs::recursive_directory_iterator(place)) {
      const fs::path& path = entry.path();
      if (path.extension() == ".toml" && path.parent_path().filename() != "lines") files.insert(path.string());
    }
  }
  if (!options.only.empty() && options.random == 0) {
    std::erase_if(files, [&options](const std::string& file) { return file.find(options.only) == std::string::npos; });
  }
  if (files.empty()) {
    throw Failure::wrong_use("there are no scenarios; name a folder or files with --scenarios, and check --only");
  }
  return {files.begin(), files.end()};
}

// Writes scenarios that combine rules of the files into `folder`. The same seed gives the same scenarios.
std::vector<std::string> drawn_from(const Options& options, std::vector<std::string> files, const fs::path& folder) {
  std::vector<std::string> drawn;
  for (unsigned n = 1; n <= options.random; ++n) {
    const fs::path path = folder / fmt::format("random-{}-{}.toml", options.seed, n);
    write_whole_file(path.string(), scenario::random_scenario(files, options.seed, n, fs::absolute(folder)));
    drawn.push_back(path.string());
  }
  return drawn;
}

void print(const TrialResult& result, std::size_t done, std::size_t of) {
  fmt::print("{:>4}/{} {:<12} {}\n", done, of, word_of(result.outcome), result.path);
  std::fflush(stdout);
  if (result.outcome == TrialResult::Outcome::passed) return;
  if (!result.reason.empty()) fmt::print("              {}\n", result.reason);
  for (const scenario::Verdict& verdict : result.verdicts) {
    if (verdict.outcome != scenario::Outcome::failed) continue;
    fmt::print("              {}: at {:.3f} s {}\n", verdict.name, links::to_seconds(verdict.at), verdict.found);
  }
  std::fflush(stdout);
}

// The kept result of a trial, without pictures and traffic: those of many trials would fill the memory.
struct Done {
  std::optional<TrialResult::Outcome> outcome{};  // nullopt: the user ended the trial, or all, before
  scenario::TrialJson view;
  std::string section;
};

TrialRun run_of(const Options& options) {
  TrialRun run;
  run.master = options.master;
  run.links = options.links;
  run.keep = options.keep;
  run.after = links::from_seconds(options.after_s);
  return run;
}

std::vector<Done> run_all(const Options& options, const std::vector<std::string>& files) {
  const TemporaryFolder temporary;
  std::vector<Done> results(files.size());
  std::atomic<std::size_t> next{0};
  std::mutex printing;
  std::size_t done = 0;
  const auto work = [&](unsigned job) {
    for (std::size_t n = next++; n < files.size() && !InterruptGuard::interrupted(); n = next++) {
      TrialRun run = run_of(options);
      run.job = job;
      run.folder = temporary.path() / std::to_string(n);
      const TrialResult result = run_trial(run, files[n]);
      if (result.interrupted) continue;
      results[n] = {result.outcome, scenario::json_of(result),
                    options.html.empty() ? "" : scenario::html_section_of(result)};
      const std::lock_guard lock(printing);
      if (!options.json) print(result, ++done, files.size());
    }
  };
  std::vector<std::thread> threads;
  for (unsigned n = 0; n < std::min<std::size_t>(options.jobs, files.size()); ++n) threads.emplace_back(work, n);
  for (std::thread& thread : threads) thread.join();
  return results;
}

// Checks the scenarios as far as that is possible without their lines running.
void list(const std::vector<std::string>& files) {
  std::size_t wrong = 0;
  for (const std::string& file : files) {
    const scenario::TrialResult checked = check_trial(file);
    fmt::print("{:<60} {}\n", file, checked.reason.empty() ? checked.scenario.title : "");
    if (checked.reason.empty()) continue;
    ++wrong;
    std::fflush(stdout);
    warn(checked.reason);
  }
  if (wrong > 0) throw Failure::did_not_work(fmt::format("{} of {} scenarios have errors", wrong, files.size()));
}

// The captures of two scenarios of one name in folders of one name would replace each other.
void require_different_captures(const std::vector<std::string>& files) {
  std::map<std::string, const std::string*> names;
  for (const std::string& file : files) {
    const auto [other, is_new] = names.emplace(capture_name(file), &file);
    if (is_new) continue;
    throw Failure::wrong_use(
        fmt::format("--keep: the captures of {} and {} would have the same names; run them one after "
                    "the other, into different folders",
                    *other->second, file));
  }
}

void run_minimise(const Options& options, const std::vector<std::string>& files) {
  if (files.size() != 1) {
    throw Failure::wrong_use(
        fmt::format("--minimise is for one scenario, and there are {}; choose one with --only", files.size()));
  }
  const InterruptGuard guard;
  const Minimised done = minimise(run_of(options), files.front(), options.runs, options.jobs, !options.json);
  std::string words;
  for (const std::string& word : options.master) words += " " + word;
  const std::string again = fmt::format("servodrome trial --scenarios {} --{}", done.path, words);
  if (InterruptGuard::interrupted()) {
    throw Failure::did_not_work(
        done.path.empty() ? std::string("the search was interrupted before anything could be left out")
                          : fmt::format("the search was interrupted; the smallest scenario so far is {}", done.path));
  }
  if (options.json) {
    const nlohmann::ordered_json view{{"path", done.path}, {"failure", done.failure}, {"runs", done.runs}};
    fmt::print("{}\n", view.dump(2));
  } else if (done.path.empty()) {
    fmt::print("nothing can be left out\n");
  } else {
    fmt::print("{}\nthe same again: {}\n", done.path, again);
  }
}

void run(const Options& options) {
  if (options.schema) return fmt::print("{}\n", scenario::json_schema().dump(2));
  if (options.scenarios.empty())
    throw Failure::wrong_use("no scenarios are given; name a folder or files with --scenarios");
  std::vector<std::string> files = files_of(options);
  if (!options.keep.empty()) fs::create_directories(options.keep);
  const TemporaryFolder temporary;
  if (options.random > 0) {
    const fs::path folder = options.keep.empty() ? temporary.path() : fs::path(options.keep);
    try {
      files = drawn_from(options, files, folder);
    } catch (const std::runtime_error& error) {
      throw Failure::wrong_use(error.what());
    }
    std::erase_if(files, [&options](const std::string& file) { return file.find(options.only) == std::string::npos; });
  }
  if (options.list) return list(files);
  if (options.master.empty()) {
    throw Failure::wrong_use(
        "no master is given; write its command behind --: servodrome trial ... -- ./my-master {link}");
  }
  if (!options.keep.empty()) require_different_captures(files);
  if (options.minimise) return run_minimise(options, files);
  for (const std::string* path : {&options.junit, &options.html}) {
    if (!path->empty()) require_writable(*path);
  }
  const InterruptGuard guard;
  const std::vector<Done> results = run_all(options, files);
  scenario::TrialJson all = scenario::TrialJson::array();
  std::vector<std::string> sections;
  for (const Done& one : results) {
    if (!one.outcome) continue;
    all.push_back(one.view);
    sections.push_back(one.section);
  }
  const std::string master = fmt::format("{}", fmt::join(options.master, " "));
  if (!options.junit.empty()) write_whole_file(options.junit, scenario::junit_of(all, master));
  if (!options.html.empty()) write_whole_file(options.html, scenario::html_of(all, sections, master));
  const auto count = [&results](TrialResult::Outcome outcome) {
    return std::count_if(results.begin(), results.end(), [outcome](const auto& one) { return one.outcome == outcome; });
  };
  const auto failed = count(TrialResult::Outcome::failed);
  const auto errors = count(TrialResult::Outcome::error);
  if (options.json) {
    fmt::print("{}\n", all.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  } else {
    fmt::print("{} passed, {} failed, {} not reached, {} errors\n", count(TrialResult::Outcome::passed), failed,
               count(TrialResult::Outcome::not_reached), errors);
  }
  if (all.size() < files.size()) {
    throw Failure::did_not_work(fmt::format("interrupted: {} of {} trials are done", all.size(), files.size()));
  }
  if (failed > 0) throw Failure::did_not_work("the master does not pass all scenarios");
  if (errors > 0) throw Failure::did_not_work("some scenarios could not be run");
}

}  // namespace trial_command

void add_trial(CLI::App& app) {
  const auto [command, options] = add_command(
      app, "trial", "Run your master through scenarios in which drives and buses misbehave", trial_command::run);
  command->add_option("--scenarios", options->scenarios, "Folders with scenario files, or scenario files")
      ->allow_extra_args(false);
  command->add_option(
      "MASTER", options->master,
      "Command of the master, behind --; {link}, {products} (of the drives on it), {host}, {port}, {api}, "
      "{scenario} and {job} are replaced, and the same are in SERVODROME_LINK and so on");
  command
      ->add_option(
          "--bus", options->links,
          "NAME=LINK: a link of this bus in place of the links in the scenario's line file; {job} is replaced by "
          "the number of the job, from 0")
      ->allow_extra_args(false);
  command->add_option("--only", options->only, "Only scenarios whose path contains this text");
  command->add_option("--jobs", options->jobs, "Number of trials that run at the same time, each with its own line")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_option("--after", options->after_s, "Seconds for which the line runs on after the master has ended")
      ->check(number_within(0.0, 60.0))
      ->capture_default_str();
  command->add_option("--junit", options->junit, "Write the outcomes to this file, as JUnit XML");
  command->add_option("--html", options->html,
                      "Write a page with all outcomes, pictures of the shafts, and the traffic around failures");
  command->add_option("--keep", options->keep, "Keep the whole traffic of each trial as captures in this folder");
  command->add_option("--random", options->random, "Run this number of random combinations of the rules in --scenarios")
      ->check(CLI::Range(1, 100'000));
  command->add_option("--seed", options->seed, "Of --random: the same seed gives the same scenarios")
      ->capture_default_str();
  command
      ->add_flag(
          "--minimise", options->minimise,
          "Remove from one failing scenario what its failure does not need, and write the smaller scenario beside it")
      ->excludes("--junit", "--html", "--keep");
  command->add_option("--runs", options->runs, "Of --minimise: greatest number of trials")
      ->check(CLI::Range(2, 100'000))
      ->capture_default_str();
  command->add_flag("--schema", options->schema,
                    "Print a JSON Schema of scenario files, for editors that complete and check TOML");
  command->add_flag("--list", options->list, "List the scenarios, check them, and run nothing");
  command->add_flag("--json", options->json, "Print JSON");
}

}  // namespace servodrome::app
