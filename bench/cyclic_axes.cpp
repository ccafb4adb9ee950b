// Moves all EtherCAT drives of a line to and fro in cyclic synchronous position, with set-points of the master's own
// trajectories in each cycle. Prints following errors, the jitter of the cycle, and faulty cycles: "late" are cycles
// whose frame came back after the end of the period, with all working counters; "skipped" are cycles for which this
// program itself was too late. The line runs in another process, for example `servodrome up lines/cyclic-axes.toml`.
// Usage: cyclic_axes LINK [SECONDS [PERIOD_US]]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/cyclic/motion_group.hpp"
#include "master/ethercat/coe_objects.hpp"

namespace {

using namespace servodrome;
using std::chrono::microseconds;
using std::chrono::seconds;

constexpr double turns_each_way = 3.0;
constexpr double turns_per_s = 5.0;
constexpr double turns_per_s2 = 40.0;
constexpr double turns_per_s3 = 1000.0;

double percentile(std::vector<double>& sorted, double part) {
  return sorted[std::min(sorted.size() - 1, static_cast<std::size_t>(part * static_cast<double>(sorted.size())))];
}

int run(const char* link, seconds duration, microseconds period) {
  const auto master = master::EthercatMaster::open(link);
  const std::vector<master::FoundSlave> found = master::scan_slaves(*master);
  std::vector<std::unique_ptr<master::EthercatSlave>> slaves;
  std::vector<master::EthercatSlave*> members;
  std::vector<master::MotionLimits> limits;
  std::vector<double> turn;  // in counts
  for (const master::FoundSlave& one : found) {
    slaves.push_back(std::make_unique<master::EthercatSlave>(*master, one));
    members.push_back(slaves.back().get());
    slaves.back()->to_pre_operational();
    master::set_up_cyclic_axis(*slaves.back(), {.period = period});
    master::CoeObjects objects(*slaves.back());
    const auto units = master::Axis402(objects).units();
    turn.push_back(units ? units->position : 4000.0);
    limits.push_back({turns_per_s * turn.back(), turns_per_s2 * turn.back(), turns_per_s2 * turn.back(),
                      turns_per_s3 * turn.back()});
  }
  master::EthercatOperation operation(*master, found, members,
                                      {.cyclic = {.period = period, .tolerated_losses = 1'000'000}});
  master::EthercatCyclicBus bus(*master, operation);
  // Counts errors of the cycle. They do not stop the motion.
  const master::MotionAxisOptions patient[] = {{.tolerated_losses = 1'000'000}};
  master::MotionGroup group(bus, patient);
  group.enable();
  operation.exchange().forget_statistics();

  std::vector<double> worst(group.size());
  std::vector<double> intervals_us;
  intervals_us.reserve(static_cast<std::size_t>(duration / period) + 1000);
  std::optional<master::Time> before;
  group.on_cycle([&] {
    const master::Time now = bus.now();
    if (before) intervals_us.push_back(std::chrono::duration<double, std::micro>(now - *before - period).count());
    before = now;
    for (std::size_t i = 0; i < group.size(); ++i) {
      worst[i] = std::max(worst[i], std::abs(group.axis(i).following_error()) / turn[i]);
    }
  });
  std::vector<double> home;
  for (std::size_t i = 0; i < group.size(); ++i) home.push_back(group.axis(i).set_point().position);
  const master::Time end = bus.now() + duration;
  for (bool out = true; bus.now() < end; out = !out) {
    std::vector<double> targets = home;
    for (std::size_t i = 0; out && i < targets.size(); ++i) targets[i] += turns_each_way * turn[i];
    group.start_together(targets, limits);
    group.wait_until([&] { return group.all_done(); }, seconds(10));
  }
  group.on_cycle({});
  const master::CyclicStatistics counters = operation.exchange().statistics();
  bus.check();

  const auto count = [](std::uint64_t value) { return static_cast<unsigned long long>(value); };
  std::printf("%zu axes at %.0f Hz: %llu cycles, %llu wrong working counters, %llu lost, %llu late, %llu skipped\n",
              group.size(), 1e6 / static_cast<double>(period.count()), count(counters.cycles),
              count(counters.wrong_counters), count(counters.lost), count(counters.late), count(counters.skipped));
  for (std::size_t i = 0; i < group.size(); ++i) {
    std::printf("  %-28s following error at most %.5f turns\n", found[i].sii.name.c_str(), worst[i]);
  }
  for (double& interval : intervals_us) interval = std::abs(interval);
  std::sort(intervals_us.begin(), intervals_us.end());
  if (!intervals_us.empty()) {
    std::printf(
        "  from cycle to cycle off the period by: 50 %% %.1f us, 90 %% %.1f us, 99 %% %.1f us, 99.9 %% %.1f us, most "
        "%.1f us\n",
        percentile(intervals_us, 0.5), percentile(intervals_us, 0.9), percentile(intervals_us, 0.99),
        percentile(intervals_us, 0.999), intervals_us.back());
  }
  group.disable(limits.front());
  return counters.wrong_counters + counters.lost == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || argc > 4) {
    std::fprintf(stderr, "usage: cyclic_axes LINK [SECONDS [PERIOD_US]]\n");
    return 2;
  }
  const int duration = argc > 2 ? std::atoi(argv[2]) : 60;
  const int period = argc > 3 ? std::atoi(argv[3]) : 1000;
  if (duration < 1 || period < 250) {
    std::fprintf(stderr, "cyclic_axes: give at least 1 s and 250 us\n");
    return 2;
  }
  try {
    return run(argv[1], seconds(duration), microseconds(period));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cyclic_axes: %s\n", error.what());
    return 1;
  }
}
