// Carries out a routine of the JMC manual (chapter 'Routine') like the controller: PDOs, start-up list, scaling, homing
// by the drive or by the controller, and a program of function blocks, all from the routine's data.
//
//   04_controller_routine ROUTINE.toml [LINK]           the first slave; tests/interop/ethercat/routines
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fmt/format.h>

#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/plcopen/controller.hpp"
#include "connection.hpp"
#include "routine.hpp"

using namespace servodrome;
using namespace servodrome::master::plcopen;
using namespace std::chrono_literals;
using examples::Routine;

namespace {

constexpr double turn = 4000.0;  // counts; the factory setting of these drives
constexpr double tolerance_turns = 8.0 / turn;
constexpr master::Time patience = 120s;

// The manual's machine: the index is at whole turns, and the switches are where the routine expects them.
std::string line_of(const Routine& routine) {
  const bool homes_at_positive_limit = routine.homing && !routine.homing->by_drive && routine.homing->bit == 1;
  return fmt::format(R"(
[[bus]]
name = "ecat"
type = "ethercat"
[[axis]]
name = "drive"
product = "jmc_ec"
model = "{}"
[axis.travel]
counts_per_unit = 4000
start = 0
low_stop = -3
high_stop = 20
negative_limit = -2.1
positive_limit = {}
home = {{ from = 2.0, to = 3.0 }}
)",
                     routine.model, homes_at_positive_limit ? routine.home : 19.0);
}

void map(master::EthercatSlave& slave, std::uint16_t assignment, std::uint16_t index,
         const std::vector<std::uint32_t>& words) {
  if (words.empty()) return;
  master::Pdo pdo{.index = index};
  for (const std::uint32_t word : words) {
    pdo.entries.push_back({.object = {static_cast<std::uint16_t>(word >> 16), static_cast<std::uint8_t>(word >> 8)},
                           .bits = static_cast<std::uint8_t>(word)});
  }
  master::map_pdo(slave.coe(), pdo);
  master::assign_pdos(slave.coe(), assignment, std::array{index});
}

// The program's blocks, one at a time, like a sequence in the controller.
class Sequence {
 public:
  Sequence(Controller& controller, const Routine& routine, line::Line* line)
      : controller_(controller), axis_(controller.axis(0)), routine_(routine), line_(line) {
    power_.Enable = false;
    idle();
  }

  // Stops and disables the axis at the end, also after an error.
  void run() {
    controller_.run([this] { carry_out_program(); }, routine_.program.back().deceleration);
  }

 private:
  void carry_out_program() {
    for (const Routine::Step& step : routine_.program) {
      std::printf("%-16s", step.block.c_str());
      carry_out(step);
      settle();
      std::printf(" at %8.4f turns\n", turns());
      if (step.block == "MC_Home") {
        home_turns_ = turns();
        if (line_ != nullptr) examples::expect_near("home of the true shaft", home_turns_, routine_.home, 0.02);
      }
      if (step.at) examples::expect_near("turns from home", turns() - home_turns_, *step.at, tolerance_turns);
    }
  }

  // Position of the true shaft; known only for a line in this process.
  double turns() const {
    if (line_ != nullptr) return static_cast<double>(line_->axes()[0]->plant().position_counts()) / turn;
    return static_cast<double>(axis_.motion().position()) / turn;
  }

  void idle() {
    controller_.on_cycle([this] { power_(axis_); });
  }
  // Calls the block until it is finished or `until` returns true; then calls it with Execute FALSE.
  template <typename Block, typename Until>
  void call(Block& block, const char* name, Until until) {
    block.Execute = true;
    controller_.on_cycle([&] {
      power_(axis_);
      block(axis_);
    });
    const bool came = controller_.run_until(
        [&] { return examples::throw_if_interrupted(), block.Error || block.CommandAborted || until(); }, patience);
    if (!came || block.Error || block.CommandAborted) {
      idle();
      throw std::runtime_error(fmt::format("{}: {}; drive error {:04X}h", name,
                                           came ? text_of(block.ErrorID) : "it takes too long",
                                           axis_.drive_error_code()));
    }
    block.Execute = false;
    controller_.run_for(2 * controller_.bus().period());
    idle();
  }
  template <typename Block>
  void call(Block& block, const char* name) {
    call(block, name, [&] { return block.Done; });
  }
  template <typename Block>
  static void set_dynamics(Block& block, const Routine::Step& step) {
    block.Velocity = std::abs(step.velocity);
    block.Acceleration = step.acceleration;
    block.Deceleration = step.deceleration;
  }

  // Waits until the shaft is at rest, because some of these drives lag behind the demand.
  void settle() {
    if (axis_.state() == AxisState::ContinuousMotion) return;
    int still = 0;
    double before = turns();
    controller_.run_until(
        [&] {
          still = std::abs(turns() - before) * turn < 0.5 ? still + 1 : 0;
          before = turns();
          return still > 50;
        },
        patience);
  }

  void run_at(double velocity, double acceleration) {
    run_ = {};
    run_.Velocity = std::abs(velocity);
    run_.Direction = velocity < 0.0 ? Direction::Negative : Direction::Positive;
    run_.Acceleration = run_.Deceleration = acceleration;
  }
  void stop(double deceleration) {
    MC_Stop stop;
    stop.Deceleration = deceleration;
    call(stop, "MC_Stop");
  }

  // Moves to the switch, then off it at creep speed; the origin is the place where the switch changes.
  void home_by_controller(const Routine::Homing& how) {
    const auto input = [&] { return (axis_.digital_inputs() >> how.bit & 1U) != 0; };
    run_at(how.direction * how.speed, how.acceleration);
    call(run_, "to the switch", input);
    stop(how.acceleration);
    run_at(-how.direction * how.creep, how.acceleration);
    double edge = 0.0;
    call(run_, "off the switch", [&] {
      edge = axis_.actual_position();
      return !input();
    });
    stop(how.acceleration);
    MC_MoveAbsolute back;
    back.Position = edge;
    back.Velocity = 4.0 * how.creep;
    back.Acceleration = back.Deceleration = how.acceleration;
    call(back, "to the edge");
    MC_SetPosition origin;
    origin.Position = axis_.actual_position() - axis_.commanded_position();
    call(origin, "MC_SetPosition");
  }

  void reset_a_fault() {
    if (line_ == nullptr) return;  // a real drive is not disturbed on purpose
    line_->axes()[0]->inject(drive::Cause::following_error, true);
    controller_.run_until([&] { return axis_.state() == AxisState::ErrorStop; }, patience);
    line_->axes()[0]->inject(drive::Cause::following_error, false);
    controller_.run_for(100ms);
    MC_Reset reset;
    call(reset, "MC_Reset");
  }

  void carry_out(const Routine::Step& step) {
    if (step.block == "MC_Power") {
      power_.Enable = true;
      if (!controller_.run_until([&] { return power_.Status; }, 10s)) throw std::runtime_error("MC_Power: no Status");
    } else if (step.block == "MC_Home") {
      MC_Home home;
      if (routine_.homing->by_drive) {
        call(home, "MC_Home");
      } else {
        home_by_controller(*routine_.homing);
      }
    } else if (step.block == "MC_MoveAbsolute") {
      MC_MoveAbsolute move;
      set_dynamics(move, step);
      move.Position = step.position;
      call(move, "MC_MoveAbsolute");
    } else if (step.block == "MC_MoveRelative") {
      MC_MoveRelative move;
      set_dynamics(move, step);
      move.Distance = step.position;
      call(move, "MC_MoveRelative");
    } else if (step.block == "MC_MoveVelocity" || step.block == "MC_Jog") {
      const double begin = turns();
      run_at(step.direction * step.velocity, step.acceleration);
      call(run_, "MC_MoveVelocity", [&] { return run_.InVelocity && std::abs(turns() - begin) >= step.turns; });
      if (step.block == "MC_Jog") stop(step.deceleration);
    } else if (step.block == "MC_Stop") {
      stop(step.deceleration);
    } else if (step.block == "MC_Reset") {
      reset_a_fault();
    } else if (step.block != "Ready") {
      throw std::runtime_error(fmt::format("{}: this program does not have the block", step.block));
    }
  }

  Controller& controller_;
  Axis& axis_;
  const Routine& routine_;
  line::Line* line_;
  MC_Power power_;
  MC_MoveVelocity run_;
  double home_turns_ = 0.0;
};

void carry_out(const Routine& routine, std::string_view link) {
  std::printf("%s\n", routine.title.c_str());
  examples::Ethercat ethercat = examples::Ethercat::on_line(link, line_of(routine));
  master::EthercatMaster& master = ethercat.master();
  const std::vector<master::FoundSlave> found = master::scan_slaves(master);
  if (found.empty()) throw std::runtime_error("there is no slave; check cable and power");
  master::EthercatSlave drive(master, found.front());
  drive.to_pre_operational();
  map(drive, master::rx_assignment, 0x1600, routine.outputs);
  map(drive, master::tx_assignment, 0x1A00, routine.inputs);
  for (const Routine::StartUp& one : routine.start_up) {
    drive.coe().download({one.index, one.sub}, std::as_bytes(std::span(&one.value, 1)).first(one.bits / 8));
  }
  master::EthercatSlave* const slaves[] = {&drive};
  master::EthercatOperation operation(master, found, slaves, {.cyclic = {.period = 4ms}, .distributed_clocks = true});
  master::EthercatCyclicBus bus(master, operation);
  const AxisConfiguration configuration[] = {{.counts_per_unit = routine.counts_per_unit}};
  Controller controller(bus, configuration);
  Sequence(controller, routine, ethercat.line()).run();
}

}  // namespace

int main(int argc, char** argv) {
  constexpr const char* usage = "usage: 04_controller_routine ROUTINE.toml [LINK]";
  if (argc < 2) {
    std::fprintf(stderr, "%s\n", usage);
    return 2;
  }
  const std::string file = argv[1];
  if (file == "--help" || file == "-h") return examples::run(argc, argv, usage, {});
  argv[1] = argv[0];
  return examples::run(argc - 1, argv + 1, usage,
                       [&](std::string_view link) { carry_out(examples::load_routine(file), link); });
}
