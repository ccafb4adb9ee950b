// A line in operation for some time: all slaves are taken to Operational and their process data exchanged in a fixed
// period, as a controller does. Prints what became of the cycles.
// Usage: ethercat_cycle LINK SECONDS PERIOD_US
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "host/ethercat/operation.hpp"

int main(int argc, char** argv) {
  using namespace servodrome;
  using std::chrono::microseconds;
  if (argc < 4) {
    std::fprintf(stderr, "usage: ethercat_cycle LINK SECONDS PERIOD_US\n");
    return 2;
  }
  try {
    const auto master = host::EthercatMaster::open(argv[1]);
    const std::vector<host::FoundSlave> found = host::scan_slaves(*master);
    std::vector<std::unique_ptr<host::EthercatSlave>> slaves;
    std::vector<host::EthercatSlave*> members;
    for (const host::FoundSlave& slave : found) {
      slaves.push_back(std::make_unique<host::EthercatSlave>(*master, slave));
      slaves.back()->to_pre_operational();
      members.push_back(slaves.back().get());
    }
    host::OperationOptions options;
    options.cyclic.period = microseconds(std::atoi(argv[3]));
    options.cyclic.tolerated_losses = 1'000'000;
    host::EthercatOperation operation(*master, found, members, options);
    operation.exchange().forget_statistics();
    master->wait(std::chrono::seconds(std::atoi(argv[2])));
    const host::CyclicStatistics& statistics = operation.exchange().statistics();
    operation.exchange().check();
    const auto count = [](std::uint64_t value) { return static_cast<unsigned long long>(value); };
    std::printf(
        "%zu slaves, %zu frames a cycle: %llu cycles, %llu lost, %llu with wrong counters, %llu skipped, worst "
        "lateness %.1f us\n",
        found.size(), operation.exchange().frames_with_data(), count(statistics.cycles), count(statistics.lost),
        count(statistics.wrong_counters), count(statistics.skipped),
        std::chrono::duration<double, std::micro>(statistics.worst_lateness).count());
    return statistics.lost == 0 && statistics.wrong_counters == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ethercat_cycle: %s\n", error.what());
    return 1;
  }
}
