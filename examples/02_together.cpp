// Two drives of different makers on one CAN bus, synchronised by SYNC. This program computes their trajectories and
// sends a set-point each 2 ms, so both start in the same cycle and arrive in the same cycle.
//
//   02_together [LINK]                                  nodes 1 and 2, as on the line that ./run starts
#include "axis/cyclic/can_cyclic_bus.hpp"
#include "axis/cyclic/motion_group.hpp"
#include "connection.hpp"

using namespace servodrome;
using namespace std::chrono_literals;

int main(int argc, char** argv) {
  return examples::run(argc, argv, "usage: 02_together [LINK]", [](std::string_view link) {
    examples::Can can(link, "default.toml");
    // Maps PDOs, starts the nodes and SYNC. Its destructor restores the previous settings.
    master::CanCyclicBus bus(can.bus(), {master::synchronous_position_drive(1), master::synchronous_position_drive(2)},
                             {.period = 2ms});
    master::MotionGroup axes(bus);
    axes.enable();

    constexpr double revolution = 131072;
    // Velocity, acceleration, deceleration, jerk: in counts and seconds.
    const master::MotionLimits limits{5 * revolution, 40 * revolution, 40 * revolution, 1000 * revolution};
    const double home[] = {axes.axis(0).set_point().position, axes.axis(1).set_point().position};
    const double targets[] = {home[0] + 5 * revolution, home[1] - 1 * revolution};
    const double duration = axes.start_together(targets, std::span(&limits, 1));
    axes.wait_until([&] { return axes.all_done(); }, 10s);
    axes.wait(100ms);

    std::printf("in %.3f s, following within %.1f counts\n", duration, std::abs(axes.axis(0).following_error()));
    examples::expect_near("first", (double(axes.axis(0).position()) - home[0]) / revolution, 5.0, 0.001);
    examples::expect_near("second", (double(axes.axis(1).position()) - home[1]) / revolution, -1.0, 0.001);
    bus.check();  // throws if too many cycles were missed
    axes.disable(limits);
  });
}
