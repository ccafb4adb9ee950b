// A program of PLCopen function blocks on two EtherCAT axes: the first passes a position without a stop, the second
// follows it by a gear.
//
//   03_function_blocks [LINK]                           servodrome up lines/cyclic-axes.toml: its axes 5 and 6
#include "axis/cyclic/ethercat_cyclic_bus.hpp"
#include "axis/plcopen/controller.hpp"
#include "connection.hpp"

using namespace servodrome;
using namespace servodrome::master::plcopen;
using namespace std::chrono_literals;

int main(int argc, char** argv) {
  return examples::run(argc, argv, "usage: 03_function_blocks [LINK]", [](std::string_view link) {
    examples::Ethercat ethercat(link, "cyclic-axes.toml");
    master::EthercatMaster& master = ethercat.master();
    const std::vector<master::FoundSlave> found = master::scan_slaves(master);
    if (found.size() < 6) throw std::runtime_error("there are not six slaves; start lines/cyclic-axes.toml");
    master::EthercatSlave first(master, found[4]);
    master::EthercatSlave second(master, found[5]);
    master::EthercatSlave* const slaves[] = {&first, &second};
    for (master::EthercatSlave* slave : slaves) {
      slave->to_pre_operational();
      master::set_up_cyclic_axis(*slave, {.period = 2ms});
      slave->coe().write<std::int8_t>(0x6098, 0, 35);  // homing: the present position is home
    }
    master::EthercatOperation operation(master, found, slaves, {.cyclic = {.period = 2ms}});
    master::EthercatCyclicBus bus(master, operation);

    const AxisConfiguration in_revolutions[] = {{.counts_per_unit = 131072.0}};
    Controller controller(bus, in_revolutions);
    Axis& x = controller.axis(0);
    Axis& y = controller.axis(1);

    MC_Power x_power, y_power;
    MC_Home x_home, y_home;
    MC_GearIn gear;
    MC_MoveAbsolute there, on;
    gear.RatioNumerator = -1.0;
    gear.RatioDenominator = 2.0;
    gear.Acceleration = gear.Deceleration = 200.0;
    there.Position = 4.0;
    there.Velocity = 5.0;
    there.Acceleration = there.Deceleration = 40.0;
    on.Position = 6.0;
    on.Velocity = 2.0;
    on.Acceleration = on.Deceleration = 40.0;
    on.Mode = BufferMode::BlendingLow;  // passes 4.0 with 2 revolutions per second

    // Called once a cycle, as a controller calls its program.
    controller.on_cycle([&] {
      x_power.Enable = y_power.Enable = true;
      x_power(x);
      y_power(y);
      x_home.Execute = y_home.Execute = x_power.Status && y_power.Status;
      x_home(x);
      y_home(y);
      gear.Execute = x_home.Done && y_home.Done;
      gear(x, y);
      there.Execute = on.Execute = gear.InGear;
      there(x);
      on(x);
    });
    const auto program = [&] {
      const auto done = [&] { return examples::throw_if_interrupted(), on.Done; };
      if (!controller.run_until(done, 20s)) {
        throw std::runtime_error(std::string("it did not arrive: ") + text_of(x.error()) + "; " + text_of(y.error()));
      }
      controller.run_for(200ms);
      examples::expect_near("x in revolutions", x.actual_position(), 6.0, 0.001);
      examples::expect_near("y in revolutions", y.actual_position(), -3.0, 0.001);
    };
    controller.run(program, 40.0);  // stops and disables the axes at the end, also after an error or Ctrl-C
  });
}
