#include "app/trial_minimise.hpp"

#include <algorithm>
#include <atomic>
#include <fmt/format.h>
#include <fstream>
#include <future>
#include <iterator>
#include <set>

#include "app/commands.hpp"
#include "app/interrupt_guard.hpp"
#include "app/temporary_folder.hpp"
#include "app/whole_file.hpp"
#include "line/toml_text.hpp"
#include "scenario/parse.hpp"
#include "scenario/reduce.hpp"

namespace servodrome::app {
namespace {

namespace fs = std::filesystem;
using scenario::TrialResult;

std::string content_of(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// The names of the expectations that failed; if there are none, the reason of the failure.
std::set<std::string> failures_of(const TrialResult& result) {
  std::set<std::string> failures;
  if (result.outcome != TrialResult::Outcome::failed) return failures;
  for (const scenario::Verdict& verdict : result.verdicts) {
    if (verdict.outcome == scenario::Outcome::failed) failures.insert(verdict.name);
  }
  if (failures.empty()) failures.insert(result.reason);
  return failures;
}

class Minimiser {
 public:
  Minimiser(const TrialRun& run, const std::string& path, unsigned most_runs, unsigned jobs, bool talks)
      : run_(run), path_(path), text_(content_of(path)), most_runs_(most_runs), jobs_(jobs), talks_(talks) {
    line_ = fs::absolute(scenario::load_scenario(path).scenario.line).lexically_normal().generic_string();
  }

  Minimised minimise() {
    const std::set<std::string> failures = failures_of(run_text(text_, 0));
    if (failures.empty()) throw Failure::did_not_work(fmt::format("{} does not fail with this master", path_));
    failure_ = *failures.begin();
    say(fmt::format("fails: {}", failure_));
    fix_draws();
    const std::string whole = text_;
    while (step()) {
    }
    Minimised result{"", failure_, runs_.load()};
    if (text_ != whole) result.path = write();
    return result;
  }

 private:
  void say(const std::string& what) const {
    if (!talks_) return;
    fmt::print("{:>4}/{} {}\n", runs_.load(), most_runs_, what);
    std::fflush(stdout);
  }

  // The line file stays in its folder, and the text gets a separate folder.
  TrialResult run_text(const std::string& text, unsigned job) {
    TrialRun run = run_;
    run.job = job;
    run.keep.clear();
    run.folder = temporary_.path() / std::to_string(job);
    fs::remove_all(run.folder);
    fs::create_directory(run.folder);
    const std::string path = (run.folder / fs::path(path_).filename()).string();
    write_whole_file(path, scenario::with_line(text, line_));
    ++runs_;
    return run_trial(run, path);
  }

  // The draws depend on the seed and the names of the rules. The smaller files state both, so that a rule draws the
  // same when another one is left out.
  void fix_draws() {
    text_ = scenario::with_seed(scenario::with_names(text_), scenario::load_scenario(path_).scenario.seed);
  }

  bool is_valid(const std::string& text) const { return scenario::parse_scenario(text, path_).diagnostics.empty(); }

  // Adopts the first reduction that fails in the same way. Returns false if there is none, or no run is left.
  bool step() {
    std::vector<scenario::Reduction> left = scenario::reductions(text_, failure_);
    std::erase_if(left, [this](const auto& one) { return tried_.contains(one.text) || !is_valid(one.text); });
    for (std::size_t begin = 0; begin < left.size() && runs_ < most_runs_; begin += jobs_) {
      if (InterruptGuard::interrupted()) return false;
      const std::size_t end = std::min({begin + jobs_, left.size(), begin + most_runs_ - runs_});
      std::vector<TrialResult> results(end - begin);
      std::vector<std::future<TrialResult>> runs;
      for (std::size_t i = begin; i < end; ++i) {
        runs.push_back(
            std::async(std::launch::async, &Minimiser::run_text, this, left[i].text, static_cast<unsigned>(i - begin)));
      }
      for (std::size_t i = begin; i < end; ++i) results[i - begin] = runs[i - begin].get();
      for (std::size_t i = begin; i < end; ++i) {
        tried_.insert(left[i].text);
        if (!failures_of(results[i - begin]).contains(failure_)) {
          say(fmt::format("{}: does not fail in this way", left[i].what));
          continue;
        }
        say(fmt::format("{}: still fails", left[i].what));
        text_ = left[i].text;
        return true;
      }
    }
    return false;
  }

  std::string write() const {
    const fs::path path(path_);
    fs::path target;
    for (unsigned n = 1; n == 1 || fs::exists(target); ++n) {
      target = path;
      target.replace_filename(
          fmt::format("{}.minimal{}.toml", path.stem().string(), n == 1 ? "" : fmt::format("-{}", n)));
    }
    write_whole_file(target.string(), fmt::format("# {}, made smaller in {} runs while this failed: {}\n{}",
                                                  path.filename().string(), runs_.load(), failure_, text_));
    return target.string();
  }

  TrialRun run_;
  std::string path_;
  std::string text_;
  std::string line_;
  unsigned most_runs_;
  unsigned jobs_;
  bool talks_;
  std::string failure_;
  std::atomic<unsigned> runs_{0};
  std::set<std::string> tried_;
  TemporaryFolder temporary_;
};

}  // namespace

Minimised minimise(const TrialRun& run, const std::string& path, unsigned most_runs, unsigned jobs, bool talks) {
  return Minimiser(run, path, most_runs, jobs, talks).minimise();
}

}  // namespace servodrome::app
