// A machine of function blocks on CAN or EtherCAT: takes the present position as home, then moves three revolutions
// there and back, twice.
// `servodrome trial` runs it as a master (docs/trials.md).
//
//   08_there_and_back [LINK]                            node 1, or all slaves
#include <algorithm>
#include <array>
#include <cstdlib>
#include <deque>
#include <fmt/format.h>
#include <span>

#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/plcopen/controller.hpp"
#include "connection.hpp"
#include "master/canopen/sdo_client.hpp"

using namespace servodrome;
using namespace servodrome::master::plcopen;
using namespace std::chrono_literals;

namespace {

constexpr std::int8_t home_is_here = 35;

// The drives of this machine, by 1018h or the SII. It moves no other drive, since a spare part of another type has
// other units and limits.
struct Drive {
  std::uint32_t vendor_id;
  std::uint32_t product_code;
  double counts_per_revolution;
};
constexpr std::array drives{
    Drive{0x53455256, 0x34303252, 131072},  // reference drive, CANopen
    Drive{0x53455256, 0x34303245, 131072},  // reference drive, EtherCAT
    Drive{0x53455256, 0x49534D43, 131072},  // ISMC
    Drive{0x66668888, 0x45430502, 4000},    // JMC, IHSV57-30-18-36-EC
};

// `servodrome trial` names the drives of the machine, with commas between them. If one is missing, nothing may move.
void require_number(std::size_t found) {
  const char* const expected = std::getenv("SERVODROME_PRODUCTS");
  if (expected == nullptr) return;
  const std::string_view names(expected);
  const auto number = static_cast<std::size_t>(std::count(names.begin(), names.end(), ',')) + 1;
  if (found != number) throw std::runtime_error(fmt::format("{} drives answer, the machine has {}", found, number));
}

AxisConfiguration configuration_of(std::uint32_t vendor_id, std::uint32_t product_code, std::string_view where) {
  for (const Drive& drive : drives) {
    if (drive.vendor_id == vendor_id && drive.product_code == product_code) {
      return {.counts_per_unit = drive.counts_per_revolution};
    }
  }
  throw std::runtime_error(
      fmt::format("{}: vendor {:08X}h, product {:08X}h is no drive of this machine", where, vendor_id, product_code));
}

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

  // Stops and disables the axes at the end, also after an error.
  void run() {
    controller_.run([this] { there_and_back(); }, 100.0);
  }

 private:
  void there_and_back() {
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
  }

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
    throw std::runtime_error(std::string(name) + ": " +
                             (came ? text_of((machines_[number].*block).ErrorID) : "it takes too long"));
  }

  Controller& controller_;
  std::deque<Machine> machines_;
};

void run(master::CyclicBus& bus, std::span<const AxisConfiguration> configurations) {
  Controller controller(bus, configurations);
  Program(controller).run();
}

void run_on_can(std::string_view link) {
  examples::Can can(link, "default.toml");
  master::SdoClient sdo(can.bus(), 1);
  const std::array configurations{
      configuration_of(sdo.read<std::uint32_t>(0x1018, 1), sdo.read<std::uint32_t>(0x1018, 2), sdo.where())};
  sdo.write<std::int8_t>(0x6098, 0, home_is_here);
  master::CanCyclicBus bus(can.bus(), {master::synchronous_drive(1)}, {.period = 4ms});
  run(bus, configurations);
  bus.close();  // throws if the drive does not get its mapping back
}

void run_on_ethercat(std::string_view link) {
  examples::Ethercat ethercat(link, "cyclic-axes.toml");
  master::EthercatMaster& master = ethercat.master();
  const std::vector<master::FoundSlave> found = master::scan_slaves(master);
  if (found.empty()) throw std::runtime_error("there is no slave; check cable and power");
  require_number(found.size());
  std::deque<master::EthercatSlave> slaves;
  std::vector<master::EthercatSlave*> all;
  std::vector<AxisConfiguration> configurations;
  for (const master::FoundSlave& one : found) {
    master::EthercatSlave& slave = slaves.emplace_back(master, one);
    configurations.push_back(configuration_of(one.sii.identity.vendor_id, one.sii.identity.product_code, slave.where()));
    slave.to_pre_operational();
    master::set_up_cyclic_axis(slave, {.period = 4ms});
    slave.coe().write<std::int8_t>(0x6098, 0, home_is_here);
    all.push_back(&slave);
  }
  master::EthercatOperation operation(master, found, all, {.cyclic = {.period = 4ms}});
  master::EthercatCyclicBus bus(master, operation);
  run(bus, configurations);
}

}  // namespace

int main(int argc, char** argv) {
  return examples::run(argc, argv, "usage: 08_there_and_back [LINK]", [](std::string_view link) {
    const bool is_ethercat = link.starts_with("udp:") || link.starts_with("raw:");
    is_ethercat ? run_on_ethercat(link) : run_on_can(link);
  });
}
