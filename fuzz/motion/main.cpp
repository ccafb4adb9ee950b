// Runs random sequences on complete drives in virtual time and checks invariants after each tick: see README.md of this
// folder.
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <set>
#include <span>
#include <sstream>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "generate.hpp"
#include "machine.hpp"
#include "shrink.hpp"

namespace {

using namespace servodrome::motion;
using Clock = std::chrono::steady_clock;

constexpr const char* help = R"(motion_fuzz [OPTION ...]

Draws sequences of what masters and benches do to drives, carries them out in virtual time and checks after every tick
what must hold whatever was done. What fails is shrunk to a short sequence and printed.

  --sequences N     so many (10000 if nothing is said)
  --seconds N       or as many as fit into so many seconds
  --seed N          of the run (1)
  --first N         number of the first sequence (0); with --forks the run begins with the first one of its tree
  --forks N         the last N steps (at most 3) of each beginning are drawn 4 ways each: the beginning is carried out once
                    for 4^N sequences (0). It belongs to a sequence's number as the seed does
  --product NAME    this product alone; --model NAME its size
  --jobs N          processes (1)
  --sequence N      that one of the seed alone, told tick by tick; --print: only its text
  --replay FILE ... carries out the sequences in these files; with --story told by state
  --each N          ... and every N ms (10)
  --only NAME       only this invariant counts
  --without NAME    this invariant does not count; may be given more than once
  --known FILE      lines "INVARIANT PRODUCT reason": counted, and no failure
  --keep FOLDER     what was found is written there, one file each
  --until-found     ends with the first finding
  --no-shrink       what was found is printed as it was drawn
  --coverage        prints which events met which states in which modes
  --invariants      lists what is checked
  --json            the result as one JSON document
  --help

Ctrl-C or SIGTERM ends the run early. It prints the findings so far, and the number to continue with (--first).

Exit status: 0 nothing found, 1 something found, 2 wrong usage.
)";

struct Options {
  std::uint64_t sequences = 10000;
  double seconds = 0;
  std::uint64_t seed = 1;
  std::uint64_t first = 0;
  Tree tree;
  std::string product;
  std::string model;
  int jobs = 1;
  std::optional<std::uint64_t> one;
  bool print = false;
  bool story = false;
  std::int64_t each_ms = 10;
  std::vector<std::string> replays;
  std::string only;
  std::set<std::string> without;
  std::set<std::string> known;  // "invariant product"
  std::string keep;
  bool until_found = false;
  bool shrinks = true;
  bool coverage = false;
  bool json = false;
};

struct Found {
  std::uint64_t number = 0;  // of the first such sequence
  std::uint64_t count = 0;
  std::string text;
};
using Groups = std::map<std::pair<std::string, std::string>, Found>;  // by invariant and product

[[noreturn]] void wrong_usage(const std::string& what) {
  std::fprintf(stderr, "motion_fuzz: %s\nTry motion_fuzz --help.\n", what.c_str());
  std::exit(2);
}

std::uint64_t number(const char* option, const char* text) {
  char* end = nullptr;
  const std::uint64_t value = std::strtoull(text, &end, 10);
  if (*text == '\0' || *end != '\0' || *text == '-')
    wrong_usage(fmt::format("{} takes a number, not \"{}\"", option, text));
  return value;
}

void read_known(const std::string& path, std::set<std::string>& known) {
  std::ifstream file(path);
  if (!file) wrong_usage(fmt::format("cannot read {}", path));
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string invariant;
    std::string product;
    if (words >> invariant >> product) known.insert(invariant + " " + product);
  }
}

Options parse(int argc, char** argv) {
  Options options;
  bool until = false;
  for (int i = 1; i < argc; ++i) {
    const std::string option = argv[i];
    const auto value = [&] {
      if (i + 1 >= argc) wrong_usage(option + " needs a value");
      return argv[++i];
    };
    if (option == "--help") {
      std::fputs(help, stdout);
      std::exit(0);
    } else if (option == "--invariants") {
      for (const InvariantRow& row : invariants()) std::printf("%-26s %s\n", row.name, row.meaning);
      std::exit(0);
    } else if (option == "--sequences") {
      options.sequences = number("--sequences", value());
      until = true;
    } else if (option == "--seconds") {
      options.seconds = static_cast<double>(number("--seconds", value()));
    } else if (option == "--seed") {
      options.seed = number("--seed", value());
    } else if (option == "--first") {
      options.first = number("--first", value());
    } else if (option == "--forks") {
      options.tree.levels = static_cast<unsigned>(std::min<std::uint64_t>(number("--forks", value()), 3));
    } else if (option == "--product") {
      options.product = value();
    } else if (option == "--model") {
      options.model = value();
    } else if (option == "--jobs") {
      options.jobs = static_cast<int>(std::clamp<std::uint64_t>(number("--jobs", value()), 1, 256));
    } else if (option == "--sequence") {
      options.one = number("--sequence", value());
    } else if (option == "--print") {
      options.print = true;
    } else if (option == "--story") {
      options.story = true;
    } else if (option == "--each") {
      options.each_ms = std::max<std::int64_t>(1, static_cast<std::int64_t>(number("--each", value())));
    } else if (option == "--replay") {
      while (i + 1 < argc && std::strncmp(argv[i + 1], "--", 2) != 0) options.replays.emplace_back(argv[++i]);
      if (options.replays.empty()) wrong_usage("--replay needs a file");
    } else if (option == "--only") {
      options.only = value();
    } else if (option == "--without") {
      options.without.insert(value());
    } else if (option == "--known") {
      read_known(value(), options.known);
    } else if (option == "--keep") {
      options.keep = value();
    } else if (option == "--until-found") {
      options.until_found = true;
    } else if (option == "--no-shrink") {
      options.shrinks = false;
    } else if (option == "--coverage") {
      options.coverage = true;
    } else if (option == "--json") {
      options.json = true;
    } else {
      wrong_usage(fmt::format("there is no option {}", option));
    }
  }
  if (const std::uint64_t first = options.tree.first_leaf(options.first); first != options.first) {
    std::fprintf(stderr,
                 "motion_fuzz: begins with %llu, the first of the %llu sequences that share a beginning with %llu\n",
                 static_cast<unsigned long long>(first), static_cast<unsigned long long>(options.tree.leaves()),
                 static_cast<unsigned long long>(options.first));
    options.first = first;
  }
  if (options.seconds > 0 && !until) options.sequences = std::uint64_t{1} << 62;
  return options;
}

// One sequence in 16 must get back to Operation enabled at its end, and one in 16 is run twice. With trees both are
// rarer, because either takes as long as many leaves.
bool recovers(std::uint64_t number, Tree tree) { return number % std::max<std::uint64_t>(16, tree.leaves()) == 5; }
bool runs_twice(std::uint64_t number, Tree tree) { return number % (16 * tree.leaves()) == 9; }

class Judge {
 public:
  explicit Judge(const Options& options) : options_(options) {}
  bool counts(const std::string& invariant) const {
    if (!options_.only.empty() && invariant != options_.only) return false;
    return !options_.without.contains(invariant);
  }

 private:
  const Options& options_;
};

std::string product_of(const Sequence& sequence, const Finding& finding) { return sequence.axes[finding.axis].product; }

Outcome run_number(const Options& options, std::uint64_t number, const Sequence& sequence, RunOptions run_options) {
  run_options.recover = recovers(number, options.tree);
  return run_checked(sequence, run_options, runs_twice(number, options.tree));
}

volatile std::sig_atomic_t interrupted = 0;

struct Shared {
  std::atomic<bool> ends{false};
  std::atomic<std::uint64_t> done{0};
  std::atomic<std::uint64_t> ticks{0};
  std::atomic<std::uint64_t> current{0};
  std::atomic<std::uint64_t> next{0};  // all sequences of this job with lower numbers are done
  std::atomic<bool> found{false};
};

// The work of one process and of those that it forks. It reports in lines: "F number invariant product text" for a
// finding, "X number signal" for a process that a signal ended, "C product ..." for the coverage at the end.
class Worker {
 public:
  Worker(const Options& options, const std::vector<Variant>& variants, int job, int out, std::span<Shared> all,
         Clock::time_point end)
      : options_(options),
        variants_(variants),
        job_(static_cast<std::uint64_t>(job)),
        out_(out),
        all_(all),
        end_(end),
        shared_(all[static_cast<std::size_t>(job)]),
        coverage_(variants),
        judge_(options) {}

  void work() {
    const std::uint64_t leaves = options_.tree.leaves();
    const auto jobs = static_cast<std::uint64_t>(options_.jobs);
    for (std::uint64_t i = job_ * leaves;; i += jobs * leaves) {
      const std::uint64_t number = options_.first + i;
      shared_.next = number;
      if (i >= options_.sequences || is_over()) break;
      shared_.current = number;
      const Drawn drawn = draw(options_.seed, number, variants_, options_.tree);
      if (drawn.forks.empty()) {
        const Outcome outcome = run_number(options_, number, drawn.sequence, {.coverage = &coverage_});
        shared_.ticks += static_cast<std::uint64_t>(outcome.ticks);
        judge(number, drawn.sequence, outcome);
      } else {
        Life life(drawn.sequence, {.coverage = &coverage_});
        live(life, number, drawn, 0);
      }
    }
    tell_coverage();
  }

 private:
  bool is_over() const {
    if (shared_.ends) return true;
    if (options_.seconds > 0 && Clock::now() >= end_) return true;
    return options_.until_found &&
           std::any_of(all_.begin(), all_.end(), [](const Shared& one) { return one.found.load(); });
  }

  // Runs `life` up to the fork of this level and then each continuation: the last one in this process, the others in
  // processes of their own.
  void live(Life& life, std::uint64_t number, const Drawn& drawn, unsigned level) {
    const std::int64_t began = life.ticks();
    const bool whole = level < drawn.forks.size();
    if (!whole) {
      const Outcome outcome = life.end(recovers(number, options_.tree));
      shared_.ticks += static_cast<std::uint64_t>(outcome.ticks - began);
      return judge(number, drawn.sequence, again(number, drawn.sequence, outcome));
    }
    const bool well = life.run_to(drawn.forks[level]);
    shared_.ticks += static_cast<std::uint64_t>(life.ticks() - began);
    if (!well) return judge(number, drawn.sequence, life.end(false));
    const std::uint64_t each = options_.tree.leaves(level + 1);
    for (std::uint64_t way = 0; way < Tree::ways && !is_over(); ++way) {
      const std::uint64_t next = number + way * each;
      const bool last = way + 1 == Tree::ways;
      const pid_t process = last ? 0 : fork();
      if (process < 0) return tell(fmt::format("X {} cannot fork\n", next));
      if (process == 0) {
        shared_.current = next;
        const Drawn branch = draw(options_.seed, next, variants_, options_.tree);
        life.go_on_with(branch.sequence);
        live(life, next, branch, level + 1);
        if (!last) std::_Exit(0);
      } else {
        int status = 0;
        waitpid(process, &status, 0);
        if (WIFSIGNALED(status)) tell(fmt::format("X {} {}\n", shared_.current.load(), strsignal(WTERMSIG(status))));
      }
    }
  }

  // Runs some leaves from their beginning as well. Both results must agree to the last bit.
  Outcome again(std::uint64_t number, const Sequence& sequence, Outcome outcome) {
    if (outcome.finding || !runs_twice(number, options_.tree)) return outcome;
    const Outcome alone = run(sequence, {.recover = recovers(number, options_.tree)});
    if (alone.fingerprint != outcome.fingerprint || alone.ticks != outcome.ticks)
      outcome.finding = Finding{"not-deterministic", 0, outcome.ticks, "the same sequence from its beginning differs"};
    return outcome;
  }

  void judge(std::uint64_t number, const Sequence& sequence, const Outcome& outcome) {
    ++shared_.done;
    if (!outcome.finding || !judge_.counts(outcome.finding->invariant)) return;
    tell(fmt::format("F {} {} {} {}\n", number, outcome.finding->invariant, product_of(sequence, *outcome.finding),
                     outcome.finding->text));
    shared_.found = true;
  }

  void tell_coverage() {
    for (const auto& [product, one] : coverage_.copy()) {
      for (std::size_t s = 0; s < power_states; ++s) {
        for (std::size_t k = 0; k < kinds; ++k) {
          for (std::size_t m = 0; m < all_modes.size(); ++m) {
            if (one.counts[s][k][m] != 0)
              tell(fmt::format("C {} {} {} {} {}\n", product, s, k, m, one.counts[s][k][m]));
          }
        }
      }
    }
  }

  // Writes a line with one call, so that the lines of several processes do not mix.
  void tell(const std::string& line) const {
    if (write(out_, line.data(), line.size()) < 0) std::_Exit(1);
  }

  const Options& options_;
  const std::vector<Variant>& variants_;
  std::uint64_t job_;
  int out_;
  std::span<Shared> all_;
  Clock::time_point end_;
  Shared& shared_;
  CoverageBook coverage_;
  Judge judge_;
};

struct Result {
  Groups groups;
  std::map<std::string, Coverage> coverage;
  std::uint64_t done = 0;
  std::uint64_t ticks = 0;
  std::uint64_t next = 0;  // all sequences with lower numbers are done
  double seconds = 0;
  std::vector<std::string> crashes;
};

void take_line(const std::string& line, Result& result) {
  std::istringstream words(line);
  char kind = 0;
  words >> kind;
  if (kind == 'F') {
    std::uint64_t number = 0;
    std::string invariant;
    std::string product;
    words >> number >> invariant >> product;
    std::string text;
    std::getline(words >> std::ws, text);
    Found& found = result.groups[{invariant, product}];
    if (found.count == 0) {
      std::fprintf(stderr, "sequence %llu: %s on %s: %s\n", static_cast<unsigned long long>(number), invariant.c_str(),
                   product.c_str(), text.c_str());
    }
    if (found.count++ == 0 || number < found.number) {
      found.number = number;
      found.text = text;
    }
  } else if (kind == 'X') {
    result.crashes.push_back("sequence " + line.substr(2));
  } else if (kind == 'C') {
    std::string product;
    std::size_t s = 0;
    std::size_t k = 0;
    std::size_t m = 0;
    std::uint32_t count = 0;
    words >> product >> s >> k >> m >> count;
    if (s < power_states && k < kinds && m < all_modes.size()) result.coverage[product].counts[s][k][m] += count;
  }
}

Result explore(const Options& options, const std::vector<Variant>& variants) {
  Result result;
  const Clock::time_point begin = Clock::now();
  const auto end = begin + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options.seconds));
  const auto jobs = static_cast<std::size_t>(options.jobs);
  void* memory = mmap(nullptr, sizeof(Shared) * jobs, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) wrong_usage("no memory");
  auto* shared = static_cast<Shared*>(memory);
  std::vector<pid_t> processes;
  std::vector<pollfd> pipes;
  std::fflush(nullptr);
  for (std::size_t job = 0; job < jobs; ++job) {
    new (&shared[job]) Shared;
    std::array<int, 2> ends{};
    if (pipe(ends.data()) != 0) wrong_usage("no pipe");
    const pid_t process = fork();
    if (process < 0) wrong_usage("no process");
    if (process == 0) {
      close(ends[0]);
      std::signal(SIGINT, SIG_IGN);  // the first process ends the others
      std::signal(SIGTERM, SIG_DFL);
      Worker(options, variants, static_cast<int>(job), ends[1], std::span(shared, jobs), end).work();
      std::_Exit(0);
    }
    close(ends[1]);
    processes.push_back(process);
    pipes.push_back({ends[0], POLLIN, 0});
  }
  std::vector<std::string> rest(jobs);
  std::size_t open = jobs;
  Clock::time_point told = begin;
  while (open > 0) {
    if (interrupted != 0) {
      for (std::size_t i = 0; i < jobs; ++i) shared[i].ends = true;
    }
    if (poll(pipes.data(), pipes.size(), 1000) < 0) continue;
    for (std::size_t i = 0; i < pipes.size(); ++i) {
      if (pipes[i].fd < 0 || pipes[i].revents == 0) continue;
      std::array<char, 65536> buffer;
      const ssize_t got = read(pipes[i].fd, buffer.data(), buffer.size());
      if (got <= 0) {
        close(pipes[i].fd);
        pipes[i].fd = -1;
        --open;
        continue;
      }
      rest[i].append(buffer.data(), static_cast<std::size_t>(got));
      for (std::size_t line = 0; (line = rest[i].find('\n')) != std::string::npos;) {
        take_line(rest[i].substr(0, line), result);
        rest[i].erase(0, line + 1);
      }
    }
    if (Clock::now() - told > std::chrono::seconds(30)) {
      told = Clock::now();
      std::uint64_t done = 0;
      for (std::size_t i = 0; i < jobs; ++i) done += shared[i].done;
      const double seconds = std::chrono::duration<double>(told - begin).count();
      std::fprintf(stderr, "%llu sequences, %.0f/s, %zu kinds of findings\n", static_cast<unsigned long long>(done),
                   static_cast<double>(done) / seconds, result.groups.size());
    }
  }
  for (std::size_t i = 0; i < jobs; ++i) {
    int status = 0;
    waitpid(processes[i], &status, 0);
    result.done += shared[i].done;
    result.ticks += shared[i].ticks;
    result.next = i == 0 ? shared[i].next.load() : std::min(result.next, shared[i].next.load());
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
      result.crashes.push_back(fmt::format("sequence {} of seed {} ends the process ({})", shared[i].current.load(),
                                           options.seed,
                                           WIFSIGNALED(status) ? strsignal(WTERMSIG(status)) : "exit status"));
    }
  }
  munmap(memory, sizeof(Shared) * jobs);
  result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  return result;
}

// Returns a finding as the text of a case file that replays it.
std::string case_text(const Options& options, const std::pair<std::string, std::string>& group, const Found& found,
                      const std::vector<Variant>& variants) {
  Sequence sequence = draw(options.seed, found.number, variants, options.tree).sequence;
  const RunOptions run_options{.recover = recovers(found.number, options.tree)};
  const bool twice = group.first == "not-deterministic";
  if (options.shrinks) {
    sequence = shrink(sequence, [&](const Sequence& candidate) {
      const Outcome outcome = run_checked(candidate, run_options, twice);
      return outcome.finding && outcome.finding->invariant == group.first &&
             product_of(candidate, *outcome.finding) == group.second;
    });
  }
  const Outcome outcome = run_checked(sequence, run_options, twice);
  std::string text =
      fmt::format("# {} on {}: {}\n", group.first, group.second, outcome.finding ? outcome.finding->text : found.text);
  if (outcome.finding)
    text += fmt::format("# at {:.4f} ms, axis a{}; found by motion_fuzz --seed {} --sequence {}{}{}\n",
                        static_cast<double>(outcome.finding->tick) / ticks_per_ms, outcome.finding->axis, options.seed,
                        found.number, options.tree.levels == 0 ? "" : fmt::format(" --forks {}", options.tree.levels),
                        options.product.empty() ? "" : " --product " + options.product);
  if (run_options.recover) text += "# recover\n";
  return text + to_text(sequence);
}

std::string file_text(const std::string& path) {
  std::ifstream file(path);
  if (!file) wrong_usage(fmt::format("cannot read {}", path));
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

int replay(const Options& options) {
  int status = 0;
  for (const std::string& path : options.replays) {
    const std::string text = file_text(path);
    const ParsedSequence parsed = parse_sequence(text);
    if (!parsed.error.empty()) {
      std::fprintf(stderr, "motion_fuzz: %s:%s\n", path.c_str(), parsed.error.c_str());
      return 2;
    }
    Story story;
    RunOptions run_options{.story = options.story ? &story : nullptr,
                           .story_ticks = options.each_ms * ticks_per_ms,
                           .recover = text.find("# recover") != std::string::npos};
    try {
      const Outcome outcome = run_checked(parsed.sequence, run_options, true);
      std::fputs(story.c_str(), stdout);
      if (outcome.finding) {
        std::printf("%s: FAILED %s at %.4f ms, axis a%zu: %s\n", path.c_str(), outcome.finding->invariant.c_str(),
                    static_cast<double>(outcome.finding->tick) / ticks_per_ms, outcome.finding->axis,
                    outcome.finding->text.c_str());
        status = 1;
      } else {
        std::printf("%s: ok\n", path.c_str());
      }
    } catch (const std::exception& error) {
      std::fprintf(stderr, "motion_fuzz: %s: %s\n", path.c_str(), error.what());
      return 2;
    }
  }
  return status;
}

int run_one(const Options& options, const std::vector<Variant>& variants) {
  const Sequence sequence = draw(options.seed, *options.one, variants, options.tree).sequence;
  std::fputs(to_text(sequence).c_str(), stdout);
  if (options.print) return 0;
  Story story;
  const Outcome outcome =
      run_number(options, *options.one, sequence, {.story = &story, .story_ticks = options.each_ms * ticks_per_ms});
  std::fputs(story.c_str(), stdout);
  if (!outcome.finding) return 0;
  std::printf("FAILED %s at %.4f ms, axis a%zu: %s\n", outcome.finding->invariant.c_str(),
              static_cast<double>(outcome.finding->tick) / ticks_per_ms, outcome.finding->axis,
              outcome.finding->text.c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = parse(argc, argv);
  if (!options.replays.empty()) return replay(options);
  std::vector<Variant> list = variants(options.product);
  if (!options.model.empty()) std::erase_if(list, [&](const Variant& one) { return one.model != options.model; });
  if (list.empty()) wrong_usage(fmt::format("there is no product \"{}\" {}", options.product, options.model));
  if (options.one) return run_one(options, list);
  std::signal(SIGINT, [](int) { interrupted = 1; });
  std::signal(SIGTERM, [](int) { interrupted = 1; });
  const Result result = explore(options, list);
  int status = result.crashes.empty() ? 0 : 1;
  nlohmann::json document{{"seed", options.seed},
                          {"sequences", result.done},
                          {"next", result.next},
                          {"seconds", result.seconds},
                          {"drive_seconds", static_cast<double>(result.ticks) / 16000.0},
                          {"crashes", result.crashes}};
  document["findings"] = nlohmann::json::array();
  for (const auto& [group, found] : result.groups) {
    const bool known = options.known.contains(group.first + " " + group.second);
    if (!known) status = 1;
    const std::string text = known ? "" : case_text(options, group, found, list);
    document["findings"].push_back({{"invariant", group.first},
                                    {"product", group.second},
                                    {"count", found.count},
                                    {"sequence", found.number},
                                    {"known", known},
                                    {"text", found.text},
                                    {"case", text}});
    if (!options.keep.empty() && !known) {
      std::filesystem::create_directories(options.keep);
      std::ofstream(fmt::format("{}/{}-{}.case", options.keep, group.first, group.second)) << text;
    }
    if (!options.json)
      std::printf("%s %s on %s, %llu times, first in sequence %llu: %s\n%s\n", known ? "known" : "FOUND",
                  group.first.c_str(), group.second.c_str(), static_cast<unsigned long long>(found.count),
                  static_cast<unsigned long long>(found.number), found.text.c_str(), text.c_str());
  }
  if (options.json) {
    std::printf("%s\n", document.dump(2).c_str());
    return status;
  }
  for (const std::string& crash : result.crashes) std::printf("CRASH %s\n", crash.c_str());
  if (options.coverage) std::fputs(report(result.coverage, list).c_str(), stdout);
  if (interrupted != 0)
    std::printf("ended early: go on with --first %llu\n", static_cast<unsigned long long>(result.next));
  std::printf("%llu sequences, %.0f s of drives' time in %.1f s (%.0f sequences/s): %zu kinds of findings\n",
              static_cast<unsigned long long>(result.done), static_cast<double>(result.ticks) / 16000.0, result.seconds,
              static_cast<double>(result.done) / result.seconds, result.groups.size());
  return status;
}
