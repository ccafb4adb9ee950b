// Measures the cost of the control cascade per base tick: the cascade alone with recorded feedback, and cascade and
// plant together in closed loop. Takes the fastest of many seconds of virtual time, to exclude other load on the
// machine.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>

#include "drive/loops/cascade.hpp"
#include "plant/plant.hpp"

namespace {

using namespace servodrome;
using Clock = std::chrono::steady_clock;

constexpr int seconds = 500;
constexpr std::uint32_t ticks_per_second = 16000;

// Nanoseconds per tick of the fastest call; each call is one second of virtual time.
template <typename Second>
double quickest(Second second) {
  double best = 1.0e9;
  for (int i = 0; i < seconds; ++i) {
    const auto start = Clock::now();
    second();
    const std::chrono::duration<double, std::nano> elapsed = Clock::now() - start;
    best = std::min(best, elapsed.count() / ticks_per_second);
  }
  return best;
}

// One second of recorded feedback: the axis turns at 600 rpm with current.
std::array<drive::Feedback, ticks_per_second>& recorded() {
  static std::array<drive::Feedback, ticks_per_second> samples;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].position_counts = static_cast<std::int64_t>(i) * 131072 * 10 / ticks_per_second;
    samples[i].single_turn_counts = static_cast<std::uint32_t>(samples[i].position_counts % 131072);
    samples[i].phase_current_a = {0.3F, -0.1F, -0.2F};
    samples[i].dc_link_v = 310.0F;
  }
  return samples;
}

drive::LoopDemand demand_of(drive::Loop loop) {
  drive::LoopDemand demand;
  demand.loop = loop;
  demand.velocity = 1.31072e6F;
  demand.torque_limit_positive = demand.torque_limit_negative = 3.0F;
  demand.velocity_limit_positive = demand.velocity_limit_negative = 1.0e8F;
  return demand;
}

void bench_cascade(const char* name, drive::Loop loop, drive::Rates rates, bool notches) {
  const drive::MotorData motor;
  drive::Gains gains = drive::default_gains(motor, rates, {});
  if (notches) gains.notches = {{{800.0F, 100.0F, 0.1F}, {1200.0F, 200.0F, 0.0F}}};
  drive::Cascade cascade;
  cascade.configure(motor, gains, rates);
  const auto& samples = recorded();
  drive::Actuation actuation;
  cascade.enable(samples[0]);
  drive::LoopDemand demand = demand_of(loop);
  float sum = 0.0F;
  const double cost = quickest([&] {
    for (const drive::Feedback& feedback : samples) {
      if (cascade.position_loop_due()) {
        demand.position = feedback.position_counts;
        cascade.set_demand(demand);
      }
      cascade.tick(feedback, actuation);
      sum += actuation.phase_voltage_v[0];
    }
  });
  std::printf("%-42s %6.1f ns per tick   (%g)\n", name, cost, static_cast<double>(sum));
}

void bench_axis() {
  plant::Parameters parameters;
  parameters.supply.charged_at_start = true;
  plant::Plant plant(parameters);
  const drive::MotorData motor;
  drive::Cascade cascade;
  cascade.configure(motor, drive::default_gains(motor, {}, {}), {});
  drive::Feedback feedback;
  drive::Actuation actuation;
  actuation.pwm_enabled = actuation.brake_released = actuation.dc_link_connected = true;
  plant.sample(feedback);
  cascade.enable(feedback);
  const drive::LoopDemand demand = demand_of(drive::Loop::velocity);
  const double cost = quickest([&] {
    for (std::uint32_t tick = 0; tick < ticks_per_second; ++tick) {
      if (cascade.position_loop_due()) cascade.set_demand(demand);
      cascade.tick(feedback, actuation);
      plant.step(actuation, feedback);
    }
  });
  std::printf("%-42s %6.1f ns per tick   (%g rpm)\n", "cascade and plant, closed loop", cost, plant.velocity_rpm());
}

}  // namespace

int main() {
  std::printf("sizeof(Cascade) = %zu bytes\n", sizeof(drive::Cascade));
  bench_cascade("off (measurement only)", drive::Loop::off, {2, 8}, false);
  bench_cascade("torque loop, 8 and 2 kHz", drive::Loop::torque, {2, 8}, false);
  bench_cascade("velocity loop, 8 and 2 kHz", drive::Loop::velocity, {2, 8}, false);
  bench_cascade("position loop, 8 and 2 kHz", drive::Loop::position, {2, 8}, false);
  bench_cascade("position loop, 4 and 1 kHz", drive::Loop::position, {4, 16}, false);
  bench_cascade("position loop, 8 and 2 kHz, two notches", drive::Loop::position, {2, 8}, true);
  bench_axis();
}
