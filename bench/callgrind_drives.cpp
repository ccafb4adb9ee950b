// Sends frames at intervals of 10 us through a segment of SLAVES generic402-ec drives in Operational, until each slave
// has been passed N times. A frame has an LRW with the process data of all slaves, and the other datagrams that a
// master sends in a cycle in free run. The interval is shorter than the minimum cycle time 1C32h:05, so each control
// loop uses the outputs of the last frame. The count includes the ticks of 62.5 us between the frames. Instructions per
// slave and frame: see callgrind_sdo.cpp.
// Usage: callgrind_drives SLAVES [--ideal] N
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "drive_line.hpp"

int main(int argc, char** argv) {
  using namespace servodrome;
  using namespace std::chrono_literals;
  const std::size_t count = argc > 1 ? static_cast<std::size_t>(std::atol(argv[1])) : 8;
  const long frames = (argc > 2 ? std::atol(argv[argc - 1]) : 1000) / static_cast<long>(count);
  line::Line line = bench::make_drive_line(count, argc > 3 && std::string_view(argv[2]) == "--ideal");
  links::EthercatBus& bus = line.ethercat_buses().front()->bus;
  master::EthercatMaster master(std::make_unique<links::MemoryEthercatClient>(bus, line));
  const auto found = master::scan_slaves(master);
  std::vector<std::unique_ptr<master::EthercatSlave>> owned;
  std::vector<master::EthercatSlave*> all;
  for (const master::FoundSlave& slave : found) {
    owned.push_back(std::make_unique<master::EthercatSlave>(master, slave));
    all.push_back(owned.back().get());
    all.back()->to_pre_operational();
  }
  master::EthercatOperation operation(master, found, all);
  bench::Cycle cycle;
  bus.add_observer(cycle);
  master.wait(10ms);
  bus.remove_observer(cycle);
  links::Time at = line.now();
  const auto start = std::chrono::steady_clock::now();
  for (long i = 0; i < frames; ++i) {
    cycle.exchange(line, at += 10us);
  }
  const std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - start;
  std::printf("%ld frames, %.1f ns per slave and frame\n", frames * static_cast<long>(cycle.frames.size()),
              took.count() / static_cast<double>(frames) / static_cast<double>(count));
  for (const auto& axis : line.axes()) {
    if (axis->device().ethercat_slave()->state() != ethercat::AlState::operational) return 1;
  }
  return cycle.frames.size() == 1 ? 0 : 1;
}
