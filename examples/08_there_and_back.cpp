// A machine of function blocks on CAN or EtherCAT: takes the present position as home, then moves three revolutions
// there and back, twice.
// `servodrome trial` runs it as a master (docs/trials.md).
//
//   08_there_and_back [LINK]                            node 1, or all slaves
#include <algorithm>
#include <deque>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/plcopen/controller.hpp"
#include "connection.hpp"
#include "master/canopen/sdo_client.hpp"

using namespace servodrome;
using namespace servodrome::master::plcopen;
using namespace std::chrono_literals;

namespace {

constexpr double counts_per_revolution = 131072;
constexpr std::int8_t home_is_here = 35;

struct Machine {
  MC_Power power;
  MC_Home home;
  MC_MoveAbsolute move;
};

// Calls the blocks of all axes once per cycle, until `done` returns true for each axis.
class Program {
 public:
  explicit Program(Controller& controller) : controller_(controller), machines_(controller.size()) {
    controller_.on_cycle([this] {
      for (std::size_t i = 0; i < machines_.size(); ++i) {
        Axis& axis = controller_.axis(i);
        machines_[i].power(axis);
        machines_[i].home(axis);
        machines_[i].move(axis);
      }
    });
  }

  void run() {
    all(&Machine::power, "MC_Power", [](MC_Power& power) { power.Enable = true; });
    all(&Machine::home, "MC_Home", [](MC_Home& home) { home.Execute = true; });
    for (const double target : {3.0, 0.0, 3.0, 0.0}) {
      all(&Machine::move, "MC_MoveAbsolute", [target](MC_MoveAbsolute& move) {
        move.Position = target;
        move.Velocity = 10.0;
        move.Acceleration = move.Deceleration = 100.0;
        move.Execute = true;
      });
      for (Machine& machine : machines_) machine.move.Execute = false;
      controller_.run_for(300ms);
      for (std::size_t i = 0; i < machines_.size(); ++i) {
        examples::expect_near("revolutions", controller_.axis(i).actual_position(), target, 0.01);
      }
    }
    controller_.shut_down(100.0);
  }

 private:
  static bool is_done(const MC_Power& power) { return power.Status; }
  template <typename Block>
  static bool is_done(const Block& block) {
    return block.Done;
  }

  template <typename Block, typename Start>
  void all(Block Machine::* block, const char* name, Start start) {
    for (Machine& machine : machines_) start(machine.*block);
    const auto failed = [&] {
      return std::find_if(machines_.begin(), machines_.end(), [&](Machine& one) { return (one.*block).Error; });
    };
    const bool came = controller_.run_until(
        [&] {
          examples::throw_if_interrupted();
          return failed() != machines_.end() || std::all_of(machines_.begin(), machines_.end(), [&](Machine& machine) {
                   return is_done(machine.*block);
                 });
        },
        10s);
    if (came && failed() == machines_.end()) return;
    const auto number = static_cast<std::size_t>(failed() - machines_.begin());
    const Axis& axis = controller_.axis(came ? number : 0);
    throw std::runtime_error(std::string(name) + ": " + (came ? text_of(axis.error()) : "it takes too long"));
  }

  Controller& controller_;
  std::deque<Machine> machines_;
};

void run(master::CyclicBus& bus) {
  const AxisConfiguration in_revolutions[] = {{.counts_per_unit = counts_per_revolution}};
  Controller controller(bus, in_revolutions);
  Program(controller).run();
}

void run_on_can(std::string_view link) {
  examples::Can can(link, "default.toml");
  master::SdoClient(can.bus(), 1).write<std::int8_t>(0x6098, 0, home_is_here);
  master::CanCyclicBus bus(can.bus(), {master::synchronous_drive(1)}, {.period = 4ms});
  run(bus);
}

void run_on_ethercat(std::string_view link) {
  examples::Ethercat ethercat(link, "cyclic-axes.toml");
  master::EthercatMaster& master = ethercat.master();
  const std::vector<master::FoundSlave> found = master::scan_slaves(master);
  if (found.empty()) throw std::runtime_error("there is no slave; check cable and power");
  std::deque<master::EthercatSlave> slaves;
  std::vector<master::EthercatSlave*> all;
  for (const master::FoundSlave& one : found) {
    master::EthercatSlave& slave = slaves.emplace_back(master, one);
    slave.to_pre_operational();
    master::set_up_cyclic_axis(slave, {.period = 4ms});
    slave.coe().write<std::int8_t>(0x6098, 0, home_is_here);
    all.push_back(&slave);
  }
  master::EthercatOperation operation(master, found, all, {.cyclic = {.period = 4ms}});
  master::EthercatCyclicBus bus(master, operation);
  run(bus);
}

}  // namespace

int main(int argc, char** argv) {
  return examples::run(argc, argv, "usage: 08_there_and_back [LINK]", [](std::string_view link) {
    const bool is_ethercat = link.starts_with("udp:") || link.starts_with("raw:");
    is_ethercat ? run_on_ethercat(link) : run_on_can(link);
  });
}
