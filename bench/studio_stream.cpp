// Measures the cost of monitoring for a line: processor time per tick of a line of eight axes without clients, with the
// server's own monitoring (events, moments of faults), and with ten pages of 16 channels at 16 kHz each, with equal or
// different channels. Also prints the longest duration of 10 ms of line time.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <fmt/format.h>
#include <memory>
#include <vector>

#include "line/bench/scope/line_scope.hpp"
#include "line/line_file.hpp"

namespace {

using namespace servodrome;
using namespace servodrome::line;
using namespace std::chrono_literals;

// Reads all data at once and discards them.
class Reader final : public api::Outbox {
 public:
  void text(std::string) override {}
  void binary(std::string message) override { bytes += message.size(); }
  std::size_t queued() const override { return 0; }
  void close(const std::string&) override {}
  std::size_t bytes = 0;
};

double now_ns() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) * 1e9 + static_cast<double>(time.tv_nsec);
}

std::string eight_axes() {
  std::string text = "clock = \"virtual\"\n[api]\nenabled = false\n[[bus]]\nname = \"can0\"\n";
  for (int i = 1; i <= 8; ++i) {
    text += fmt::format("[[axis]]\nname = \"a{}\"\nproduct = \"{}\"\nbus = \"can0\"\nnode = {}\n", i,
                        i % 2 != 0 ? "ismc" : "generic402", i);
  }
  return text;
}

std::string subscription(int page, bool shared) {
  constexpr std::array what{R"("signal":"position_counts")", R"("signal":"velocity_rpm")", R"("signal":"torque_nm")",
                            R"("signal":"current_a")",       R"("signal":"supply_v")",     R"("object":"6041:00")",
                            R"("object":"6064:00")",         R"("object":"606C:00")"};
  std::string channels;
  for (int i = 0; i < 16; ++i) {
    const int n = shared ? i : page * 6 + i;
    channels += fmt::format(R"({}{{"axis":"a{}",{}}})", i == 0 ? "" : ",", n / 8 % 8 + 1,
                            what[static_cast<std::size_t>(n) % what.size()]);
  }
  return fmt::format(R"({{"subscribe":{{"id":1,"channels":[{}],"rate_hz":16000}}}})", channels);
}

struct Cost {
  double tick_ns = 1e12;     // all axes together, the fastest of several runs
  double longest_ms = 1e12;  // 10 ms of line time: the longest of a run, in the best run
  std::size_t bytes = 0;
};

Cost measure(bool watched, int pages, bool shared) {
  Line line(parse_line_file(eight_axes(), "eight.toml", all_products()).settings);
  std::unique_ptr<bench::LineScope> scope;
  std::vector<std::unique_ptr<Reader>> readers;
  std::vector<std::unique_ptr<api::StreamSession>> sessions;
  if (watched) scope = std::make_unique<bench::LineScope>(line);
  for (int page = 0; page < pages; ++page) {
    readers.push_back(std::make_unique<Reader>());
    sessions.push_back(std::make_unique<api::StreamSession>(scope->scope(), *readers.back()));
    sessions.back()->receive(subscription(page, shared), std::chrono::steady_clock::now());
  }
  line.run_until(100ms);
  Cost cost;
  for (int run = 0; run < 5; ++run) {
    constexpr int pieces = 50;
    double longest = 0;
    const double start = now_ns();
    for (int n = 0; n < pieces; ++n) {
      const double before = now_ns();
      line.run_until(line.now() + 10ms);
      longest = std::max(longest, now_ns() - before);
    }
    cost.tick_ns = std::min(cost.tick_ns, (now_ns() - start) / (pieces * 160.0));
    cost.longest_ms = std::min(cost.longest_ms, longest / 1e6);
  }
  for (const auto& reader : readers) cost.bytes += reader->bytes;
  return cost;
}

void print(const char* what, const Cost& cost, double baseline) {
  std::printf("%-44s %8.0f ns per tick of 62500, %5.2f x nobody, %5.1f %% of a core; longest 10 ms: %6.2f ms; %zu MB\n",
              what, cost.tick_ns, cost.tick_ns / baseline, cost.tick_ns / 625.0, cost.longest_ms, cost.bytes / 1000000);
}

}  // namespace

int main() {
  const Cost nobody = measure(false, 0, false);
  print("eight axes, nobody looks", nobody, nobody.tick_ns);
  print("with events and fault moments", measure(true, 0, false), nobody.tick_ns);
  print("ten pages, the same 16 channels at 16 kHz", measure(true, 10, true), nobody.tick_ns);
  print("ten pages, other channels each", measure(true, 10, false), nobody.tick_ns);
}
