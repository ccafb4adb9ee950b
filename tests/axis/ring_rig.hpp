#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "line/line.hpp"
#include "line/support.hpp"
#include "links/ethercat/memory_client.hpp"

namespace servodrome::master::test {

// A reference drive and a JMC on EtherCAT, in virtual time, and their master.
struct RingRig {
  // In Pre-Operational.
  void set_up(const EthercatAxisSetUp& set_up) {
    for (const FoundSlave& one : found) slaves.push_back(std::make_unique<EthercatSlave>(master, one));
    for (const auto& slave : slaves) {
      all.push_back(slave.get());
      slave->to_pre_operational();
      set_up_cyclic_axis(*slave, set_up);
    }
  }
  void operate(Time period) {
    operation.emplace(master, found, all, OperationOptions{.cyclic = {.period = period}});
    bus.emplace(master, *operation);
  }

  line::Line line{line::test::settings_of(R"(
clock = "virtual"
[[bus]]
name = "ring"
type = "ethercat"
[[axis]]
name = "x"
product = "generic402-ec"
bus = "ring"
[[axis]]
name = "y"
product = "jmc_ec"
bus = "ring"
)")};
  EthercatMaster master{std::make_unique<links::MemoryEthercatClient>(line.ethercat_buses()[0]->bus, line)};
  std::vector<FoundSlave> found = scan_slaves(master);
  std::vector<std::unique_ptr<EthercatSlave>> slaves{};
  std::vector<EthercatSlave*> all{};
  std::optional<EthercatOperation> operation{};
  std::optional<EthercatCyclicBus> bus{};
};

}  // namespace servodrome::master::test
