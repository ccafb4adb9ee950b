// Measures the cost of a cycle of an EtherCAT segment in one process: frames with an LRW of 16 bytes out and 16 bytes
// in per slave, the first frame with a BRD. The frames pass through the slave controllers alone, and through complete
// drives in Operation enabled (CSP, one frame per millisecond, all loops active); the share of the control loops is
// known from tick_bench. Virtual time, one thread, processor time, the fastest of several runs.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>

#include "controller_line.hpp"
#include "drive/drive.hpp"
#include "drive_line.hpp"
#include "master/ethercat/coe_objects.hpp"

namespace {

using namespace servodrome;
using namespace std::chrono_literals;

double processor_ns() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) * 1e9 + static_cast<double>(time.tv_nsec);
}

template <typename Action>
double quickest_ns(int runs, const Action& action) {
  double best = 1e300;
  for (int i = 0; i < runs; ++i) {
    const double start = processor_ns();
    action();
    best = std::min(best, processor_ns() - start);
  }
  return best;
}

double controllers_ns(std::size_t slaves) {
  constexpr int cycles = 2000;
  ethercat::ControllerLine line(slaves);
  const std::size_t frames = (slaves + ethercat::slaves_per_datagram - 1) / ethercat::slaves_per_datagram;
  return quickest_ns(15,
                     [&] {
                       for (int i = 0; i < cycles; ++i) line.cycle();
                     }) /
         cycles / static_cast<double>(slaves * frames);  // each frame passes all slaves
}

void map_sixteen_bytes(master::CoeClient& coe) {
  for (const std::uint16_t pdo : {std::uint16_t{0x1600}, std::uint16_t{0x1A00}}) {
    coe.write<std::uint8_t>(pdo, 0, 0);
    coe.write<std::uint32_t>(pdo, 7, 0x00000010);
    coe.write<std::uint8_t>(pdo, 0, 7);
  }
}

// Returns a negative value on failure.
double drives_ns(std::size_t slaves) {
  constexpr int cycles = 200;
  line::Line line = bench::make_drive_line(slaves);
  links::EthercatBus& bus = line.ethercat_buses().front()->bus;
  master::EthercatMaster master(std::make_unique<links::MemoryEthercatClient>(bus, line));
  const auto found = master::scan_slaves(master);
  std::vector<std::unique_ptr<master::EthercatSlave>> owned;
  std::vector<master::EthercatSlave*> all;
  for (const master::FoundSlave& slave : found) {
    owned.push_back(std::make_unique<master::EthercatSlave>(master, slave));
    all.push_back(owned.back().get());
    all.back()->to_pre_operational();
    map_sixteen_bytes(all.back()->coe());
  }
  bench::Cycle cycle;
  bus.add_observer(cycle);
  master::EthercatOperation operation(master, found, all, {.cyclic = {.period = 1ms}, .distributed_clocks = true});
  master::CyclicExchange& exchange = operation.exchange();
  for (const std::uint16_t word : {std::uint16_t{0x06}, std::uint16_t{0x07}, std::uint16_t{0x0F}}) {
    for (std::size_t i = 0; i < slaves; ++i) {
      exchange.output(i, {0x6060, 0})->set<std::int8_t>(8);
      exchange.output(i, {0x6040, 0})->set(word);
    }
    master.wait(word == 0x07 ? 300ms : 10ms);
  }
  bus.remove_observer(cycle);
  links::Time at = cycle.time;  // the master's usual distance from SYNC0
  while (at + 1ms < line.now()) at += 1ms;
  const double cost = quickest_ns(7,
                                  [&] {
                                    for (int i = 0; i < cycles; ++i) cycle.exchange(line, at += 1ms);
                                  }) /
                      cycles / static_cast<double>(slaves);
  for (const auto& axis : line.axes()) {
    if (axis->device().ethercat_slave()->state() != ethercat::AlState::operational) return -1;
    if (axis->device().drive().state() != drive::PowerState::operation_enabled) return -1;
  }
  return cost;
}

}  // namespace

int main() {
  std::printf("%-8s%26s%34s%22s\n", "slaves", "controllers, ns per slave", "drives enabled, us per slave and ms",
              "of real time");
  for (const std::size_t slaves : {1U, 8U, 32U, 64U}) {
    const double controllers = controllers_ns(slaves);
    const double drives = drives_ns(slaves);
    if (drives < 0) {
      std::fprintf(stderr, "a drive of %zu is not enabled any more\n", slaves);
      return 1;
    }
    std::printf("%-8zu%28.1f%38.3f%14.1f %%\n", slaves, controllers, drives / 1e3,
                drives * static_cast<double>(slaves) / 1e4);
  }
  return 0;
}
