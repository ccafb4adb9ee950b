// Plans, or evaluates, N trajectories and prints a sum, for counting instructions. Run it with two values of N: the
// difference of the instructions, divided by the difference of the two values, is the cost of one trajectory. The start
// of the program cancels out.
//   valgrind --tool=callgrind callgrind_trajectory third 1000

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <vector>

#include "trajectory/trajectory.hpp"

namespace {

using servodrome::trajectory::MotionLimits;
using servodrome::trajectory::MotionState;
using servodrome::trajectory::RampShape;
using servodrome::trajectory::Trajectory;

struct Order {
  MotionState start;
  double target;
  MotionLimits limits;
};

/// New targets for a moving axis: each start state lies on a previous plan with the same limits.
std::vector<Order> draw_orders(RampShape shape, bool from_rest) {
  std::mt19937_64 engine{1};
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<>{0.0, 1.0}(engine);
  };
  std::vector<Order> orders(1000);
  Trajectory trajectory;
  MotionState state{0.0, 0.0, 0.0};
  for (Order& order : orders) {
    order.limits = {1e6, 1310720.0, 1310720.0, 2e7};
    order.start = from_rest ? MotionState{state.position, 0.0, 0.0} : state;
    order.target = uniform(-1.0, 1.0) * std::pow(10.0, uniform(1.0, 7.0));
    trajectory.plan_position(order.start, order.target, 0.0, order.limits, shape);
    state = trajectory.at(uniform(0.0, 1.0) * trajectory.duration_s());
  }
  return orders;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || argc > 4) {
    std::fprintf(stderr, "usage: %s linear|third|linear-at|third-at N [rest]\n", argv[0]);
    return 2;
  }
  const RampShape shape = std::strncmp(argv[1], "third", 5) == 0 ? RampShape::jerk_limited : RampShape::linear;
  const bool evaluate = std::strstr(argv[1], "-at") != nullptr;
  const long count = std::strtol(argv[2], nullptr, 10);
  const std::vector<Order> orders = draw_orders(shape, argc == 4);
  double sum = 0.0;
  Trajectory trajectory;
  if (evaluate) {
    trajectory.plan_position({0.0, 0.0, 0.0}, 2e6, 0.0, orders[0].limits, shape);
    for (long i = 0; i < count; ++i) {
      sum += trajectory.at(trajectory.duration_s() * static_cast<double>(i) / static_cast<double>(count)).position;
    }
  } else {
    for (long i = 0; i < count; ++i) {
      const Order& order = orders[static_cast<std::size_t>(i) % orders.size()];
      trajectory.plan_position(order.start, order.target, 0.0, order.limits, shape);
      sum += trajectory.duration_s();
    }
  }
  std::printf("%.9g\n", sum);
  return 0;
}
