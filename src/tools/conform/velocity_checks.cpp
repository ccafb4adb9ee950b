// Profile velocity and profile torque mode.
#include <cmath>

#include "axis/cia402_words.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/trial.hpp"

namespace servodrome::master::conform::velocity_group {
namespace {

using namespace std::chrono_literals;

void prepare(Trial& trial) {
  trial.units();
  trial.enable(OperationMode::profile_velocity);
  trial.gentle_profile();
  trial.objects().write<std::int32_t>(0x60FF, 0, 0);
  trial.control(command_word::enable_operation);
}

std::int32_t slow_velocity(Trial& trial) { return Trial::whole(trial.units().velocity * trial.slow_enough(0.5)); }

bool runs_at(Trial& trial, std::int32_t wanted, Time patience) {
  const Time deadline = trial.now() + patience;
  const double tolerance = std::abs(wanted) * 0.1 + trial.units().velocity * 0.02;
  while (std::abs(static_cast<double>(trial.velocity()) - wanted) > tolerance) {
    if (trial.now() >= deadline) return false;
    trial.wait(trial.settings().poll_interval);
  }
  return true;
}

// Runs in both directions, so that the axis ends about where it started.
void velocity_reached(Trial& trial, int) {
  prepare(trial);
  for (const std::int32_t sign : {1, -1}) {
    const std::int32_t wanted = sign * slow_velocity(trial);
    trial.objects().write<std::int32_t>(0x60FF, 0, wanted);
    trial.wait_for(status_bit::target_reached, 0, 50ms);
    const bool reached = trial.wait_for(status_bit::target_reached, status_bit::target_reached, 1s);
    const bool runs = runs_at(trial, wanted, 500ms);
    trial.expect(reached, fmt::format("60FFh = {}", wanted), "bit 10 of 6041h = 1, velocity reached",
                 fmt::format("{:04X}h", trial.statusword()));
    trial.expect(runs, fmt::format("60FFh = {}", wanted), "606Ch follows", fmt::format("606Ch = {}", trial.velocity()));
  }
  trial.objects().write<std::int32_t>(0x60FF, 0, 0);
  trial.expect(runs_at(trial, 0, 1s), "60FFh = 0", "606Ch = 0", fmt::format("606Ch = {}", trial.velocity()));
}

void zero_speed_bit(Trial& trial, int) {
  prepare(trial);
  const std::int32_t wanted = slow_velocity(trial);
  if (trial.objects().read_if_present<std::uint16_t>(0x606F).value_or(0) >= wanted)
    Trial::skip("606Fh is not below the velocity that --revolutions allows");
  const bool at_rest = trial.wait_for(speed_is_zero, speed_is_zero, 500ms);
  trial.expect(at_rest, "60FFh = 0 in profile velocity", "bit 12 of 6041h = 1, speed is zero",
               fmt::format("{:04X}h", trial.statusword()));
  trial.objects().write<std::int32_t>(0x60FF, 0, wanted);
  const bool moving = trial.wait_for(speed_is_zero, 0, 1s);
  trial.expect(moving, fmt::format("60FFh = {}", wanted), "bit 12 of 6041h = 0",
               fmt::format("{:04X}h", trial.statusword()));
  trial.objects().write<std::int32_t>(0x60FF, 0, 0);
  runs_at(trial, 0, 1s);
}

void halts(Trial& trial, int) {
  prepare(trial);
  const std::int32_t wanted = slow_velocity(trial);
  trial.objects().write<std::int32_t>(0x60FF, 0, wanted);
  trial.require(runs_at(trial, wanted, 1s), fmt::format("60FFh = {}", wanted), "606Ch follows",
                fmt::format("606Ch = {}", trial.velocity()));
  trial.control(0x010F);
  const bool stands = runs_at(trial, 0, 1s);
  trial.expect(stands, "6040h = 010Fh, halt", "606Ch = 0", fmt::format("606Ch = {}", trial.velocity()));
  trial.expect(trial.state() == PowerState::operation_enabled, "halted", "operation enabled, as before",
               text_of_state(trial.statusword()));
}

// With a torque demand of 0 the axis does not move, but bit 10 must still be set.
void torque_mode(Trial& trial, int) {
  trial.enable(OperationMode::profile_torque);
  const bool reached = trial.wait_for(status_bit::target_reached, status_bit::target_reached, 1s);
  trial.expect(reached, "6071h = 0 in profile torque", "bit 10 of 6041h = 1, torque reached",
               fmt::format("{:04X}h", trial.statusword()));
  const auto demand = trial.objects().read_if_present<std::int16_t>(0x6074);
  if (demand) trial.expect(*demand == 0, "read 6074h", "0", fmt::format("{}", *demand));
}

constexpr auto bits = "CiA 402-2, profile velocity mode, statusword";

constexpr std::array rows{
    Check{"pv.target-reached", bits, "Velocity reached is set at the velocity", Demand::motion, buses::all,
          velocity_reached},
    Check{"pv.zero-speed", bits, "Bit 12 is set when the speed is zero, and only then", Demand::motion, buses::all,
          zero_speed_bit},
    Check{"pv.halt", "CiA 402-2, controlword bit 8, object 605Dh", "Halt stops the axis", Demand::motion, buses::all,
          halts},
    Check{"pt.target-reached", "CiA 402-2, profile torque mode, statusword", "Torque reached is set at the torque",
          Demand::enable, buses::all, torque_mode},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::velocity_group
