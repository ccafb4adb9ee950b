#include <gtest/gtest.h>

#include "line/support.hpp"
#include "plant/energy_balance.hpp"

// Complete drives on machines with every effect that docs/line-file.md lists: the energy balance must be correct, and
// two runs must be equal to the last bit.
namespace servodrome::line {
namespace everything_on_test {
namespace {

using namespace std::chrono_literals;

constexpr const char* effects = R"(
[axis.motor]
quadrature_saturation_a = 25
magnet_temperature_coefficient = 0.0011
iron_hysteresis_nm = 0.008
iron_eddy_nms = 3e-5
cogging_torque_nm = 0.01
brake_torque_nm = 1.5
brake_rise_ms = 10
brake_half_torque_j = 1e4
[[axis.motor.cogging]]
torque_nm = 0.003
periods = 60
phase_turns = 0.3
[axis.load]
inertia_kgm2 = 1e-4
viscous_friction_nms = 1e-4
coulomb_friction_nm = 0.03
static_friction_nm = 0.05
stribeck_speed_rad_s = 3
cycle_revolutions = 5
arm_torque_nm = 0.1
crank_inertia_kgm2 = 5e-5
crank_torque_nm = 0.05
crank_ratio = 0.2
)";
constexpr const char* belt =
    "elastic = true\nstiffness_nm_per_rad = 200\ndamping_nms = 0.02\nbelt_length_revolutions = 200\n";

std::string line_of(const char* product, bool elastic) {
  return fmt::format("clock=\"virtual\"\n[[bus]]\nname=\"can0\"\n[[axis]]\nname=\"x\"\nproduct=\"{}\"\nnode=1\n{}{}",
                     product, effects, elastic ? belt : "") +
         "[axis.supply]\nmains_phases = 1\n";
}

// Three seconds to and fro at 1500 rpm and -1500 rpm, by profile velocity. Ends with the brake closed.
struct Ended {
  plant::Energy end;
  std::int64_t position;
  double fraction;
};
Ended run(const char* product, bool elastic, bool balance) {
  Line line(test::settings_of(line_of(product, elastic)));
  links::MemoryPort master(line.buses()[0]->bus);
  line.run_until(300ms);
  const plant::Plant& plant = line.axes()[0]->plant();
  const plant::Energy start = plant.energy();
  plant::test::Dissipation friction(plant);
  struct Write {
    int ms;
    std::uint16_t index;
    std::int32_t value;
    unsigned size;
  };
  const std::array writes{Write{0, 0x6060, 3, 1},
                          Write{10, 0x6083, 131072 * 200, 4},
                          Write{20, 0x6084, 131072 * 200, 4},
                          Write{30, 0x60FF, 0, 4},
                          Write{40, 0x6040, 6, 2},
                          Write{50, 0x6040, 7, 2},
                          Write{60, 0x6040, 15, 2},
                          Write{300, 0x60FF, 131072 * 25, 4},
                          Write{1100, 0x60FF, -131072 * 25, 4},
                          Write{1900, 0x60FF, 131072 * 25, 4},
                          Write{2500, 0x60FF, 0, 4},
                          Write{2800, 0x6040, 7, 2}};
  auto next = writes.begin();
  for (int tick = 0; tick < 48000; ++tick) {
    if (next != writes.end() && tick == next->ms * 16) {
      master.send(test::sdo_write(1, next->index, 0, static_cast<std::uint32_t>(next->value), next->size), line.now());
      ++next;
    }
    line.run_until(line.now() + tick_length);
    friction.add(plant);
  }
  if (balance) plant::test::expect_energy_balance(start, plant.energy(), friction, 15.0);
  return {plant.energy(), plant.position_counts(), plant.position_fraction()};
}

TEST(EverythingOn, TheBooksOfWholeDrivesBalance) {
  for (const char* product : {"generic402", "ismc", "pronet"}) {
    for (const bool elastic : {false, true}) {
      SCOPED_TRACE(fmt::format("{} {}", product, elastic));
      run(product, elastic, true);
    }
  }
}

TEST(EverythingOn, TwoRunsGiveTheSameBits) {
  const Ended first = run("generic402", true, false);
  const Ended second = run("generic402", true, false);
  EXPECT_EQ(first.position, second.position);
  EXPECT_EQ(first.fraction, second.fraction);
  EXPECT_EQ(0, std::memcmp(&first.end, &second.end, sizeof(plant::Energy)));
}

}  // namespace
}  // namespace everything_on_test
}  // namespace servodrome::line
