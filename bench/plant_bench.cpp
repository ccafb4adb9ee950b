// Measures the nanoseconds per base tick of the plant: one machine alone, and many machines in turn as in a large line.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <memory>
#include <vector>

#include "plant/plant.hpp"

namespace {

using servodrome::drive::Actuation;
using servodrome::drive::Feedback;
using servodrome::plant::Parameters;
using servodrome::plant::Plant;

struct Case {
  const char* name;
  void (*change)(Parameters&);  // of the default machine
  bool pwm = true;
  int plants = 1;
};

void with_arm(Parameters& parameters) {
  parameters.load.arm_torque_nm = 0.1;
  parameters.load.cycle_revolutions = 10.0;
}
void with_every_effect(Parameters& parameters) {
  with_arm(parameters);
  parameters.load.crank_inertia_kgm2 = 1.0e-5;
  parameters.load.stribeck_speed_rad_s = 3.0;
  parameters.motor.quadrature_saturation_a = 30.0;
  parameters.motor.magnet_temperature_coefficient = 1.1e-3;
  parameters.motor.iron_hysteresis_nm = 0.01;
  parameters.motor.cogging_torque_nm = 0.01;
  parameters.supply.mains_phases = 1;
  parameters.stage.ideal = parameters.sensors.ideal = false;
}

double nanoseconds_per_tick(const Case& one) {
  Parameters parameters;
  parameters.supply.charged_at_start = true;
  one.change(parameters);
  std::vector<std::unique_ptr<Plant>> plants;
  for (int i = 0; i < one.plants; ++i) plants.push_back(std::make_unique<Plant>(parameters));
  std::vector<Feedback> feedback(plants.size());
  Actuation actuation;
  actuation.brake_released = true;
  actuation.dc_link_connected = true;
  actuation.pwm_enabled = one.pwm;
  actuation.phase_voltage_v = {0.0F, 20.0F, -20.0F};
  const int ticks = 400'000 / one.plants;
  double best = 1.0e9;
  for (int round = 0; round < 5; ++round) {
    const std::clock_t start = std::clock();  // processor time: the machine may be shared
    for (int tick = 0; tick < ticks; ++tick) {
      // A voltage vector that turns slowly, so that the motor moves.
      const float swing = 20.0F * static_cast<float>((tick / 64) % 64 - 32) / 32.0F;
      actuation.phase_voltage_v = {swing, 20.0F - swing, -20.0F};
      for (std::size_t i = 0; i < plants.size(); ++i) plants[i]->step(actuation, feedback[i]);
    }
    const double spent_ns = static_cast<double>(std::clock() - start) * (1.0e9 / CLOCKS_PER_SEC);
    best = std::min(best, spent_ns / ticks / one.plants);
  }
  return best;
}

}  // namespace

int main() {
  const auto nothing = [](Parameters&) {};
  for (const Case& one :
       {Case{"rigid", nothing}, Case{"rigid, coasting", nothing, false}, Case{"rigid, 256 in turn", nothing, true, 256},
        Case{"cogging", [](Parameters& p) { p.motor.cogging_torque_nm = 0.01; }}, Case{"arm", with_arm},
        Case{"Stribeck friction", [](Parameters& p) { p.load.stribeck_speed_rad_s = 3.0; }},
        Case{"iron loss", [](Parameters& p) { p.motor.iron_hysteresis_nm = 0.01; }},
        Case{"mains", [](Parameters& p) { p.supply.mains_phases = 1; }},
        Case{"saturation", [](Parameters& p) { p.motor.quadrature_saturation_a = 30.0; }},
        Case{"every effect", with_every_effect}, Case{"elastic", [](Parameters& p) { p.load.elastic = true; }},
        Case{"belt", [](Parameters& p) {
               p.load.elastic = true;
               p.load.belt_length_revolutions = 20.0;
             }}}) {
    std::printf("%-20s %6.1f ns per tick\n", one.name, nanoseconds_per_tick(one));
  }
  std::printf("%-20s %6zu bytes\n", "size of a plant", sizeof(Plant));
}
