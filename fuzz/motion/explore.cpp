#include "explore.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fmt/format.h>
#include <new>
#include <poll.h>
#include <span>
#include <sstream>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "run_number.hpp"

namespace servodrome::motion {

volatile std::sig_atomic_t interrupted = 0;

namespace {

using Clock = std::chrono::steady_clock;

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

}  // namespace

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

}  // namespace servodrome::motion
