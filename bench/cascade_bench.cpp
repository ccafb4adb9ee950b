// What the control cascade costs per base tick: of the cascade alone, fed with a sampled motion, and of cascade and
// plant together in closed loop.
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>

#include "drive/loops/cascade.hpp"
#include "plant/plant.hpp"

namespace {

using namespace servodrome;
using Clock = std::chrono::steady_clock;

constexpr std::uint32_t ticks = 16'000'000;

double nanoseconds_per_tick(Clock::time_point start) {
  return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / ticks;
}

// A second of feedback, replayed: the axis at 600 rpm with current.
std::array<drive::Feedback, 16000>& recorded() {
  static std::array<drive::Feedback, 16000> samples;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i].position_counts = static_cast<std::int64_t>(i) * 131072 * 10 / 16000;
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
  const auto start = Clock::now();
  for (std::uint32_t turn = 0; turn < ticks / samples.size(); ++turn) {
    for (const drive::Feedback& feedback : samples) {
      if (cascade.position_loop_due()) {
        demand.position = feedback.position_counts;
        cascade.set_demand(demand);
      }
      cascade.tick(feedback, actuation);
      sum += actuation.phase_voltage_v[0];
    }
  }
  std::printf("%-42s %6.1f ns per tick   (%g)\n", name, nanoseconds_per_tick(start), static_cast<double>(sum));
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
  const auto start = Clock::now();
  for (std::uint32_t tick = 0; tick < ticks; ++tick) {
    if (cascade.position_loop_due()) cascade.set_demand(demand);
    cascade.tick(feedback, actuation);
    plant.step(actuation, feedback);
  }
  std::printf("%-42s %6.1f ns per tick   (%g rpm)\n", "cascade and plant, closed loop", nanoseconds_per_tick(start),
              plant.velocity_rpm());
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
