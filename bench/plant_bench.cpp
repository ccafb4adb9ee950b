// Nanoseconds per base tick of the plant: one machine after the other, and many of them in turn as in a large line.
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
  bool elastic;
  bool cogging;
  bool pwm;
  int plants;
};

double nanoseconds_per_tick(const Case& one) {
  Parameters parameters;
  parameters.supply.charged_at_start = true;
  parameters.load.elastic = one.elastic;
  if (one.cogging) parameters.motor.cogging_torque_nm = 0.01;
  std::vector<std::unique_ptr<Plant>> plants;
  for (int i = 0; i < one.plants; ++i) plants.push_back(std::make_unique<Plant>(parameters));
  std::vector<Feedback> feedback(plants.size());
  Actuation actuation;
  actuation.brake_released = true;
  actuation.dc_link_connected = true;
  actuation.pwm_enabled = one.pwm;
  actuation.phase_voltage_v = {0.0F, 20.0F, -20.0F};
  const int ticks = 4'000'000 / one.plants;
  double best = 1.0e9;
  for (int round = 0; round < 5; ++round) {
    const std::clock_t start = std::clock();  // processor time: the machine may be shared
    for (int tick = 0; tick < ticks; ++tick) {
      // A slowly turning field, so that the motor moves.
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
  for (const Case& one : {Case{"rigid", false, false, true, 1}, Case{"rigid, cogging", false, true, true, 1},
                          Case{"rigid, coasting", false, false, false, 1}, Case{"elastic", true, false, true, 1},
                          Case{"rigid, 256 in turn", false, false, true, 256}}) {
    std::printf("%-20s %6.1f ns per tick\n", one.name, nanoseconds_per_tick(one));
  }
  std::printf("%-20s %6zu bytes\n", "size of a plant", sizeof(Plant));
}
