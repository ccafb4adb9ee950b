#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "life_machine.hpp"

// The recovery after the last event of a sequence.
namespace servodrome::motion {

using drive::Mode;

namespace {

constexpr int longest_braking = 10'000 * ticks_per_ms;

}  // namespace

// Removes all disturbances. Then every axis must get back to Operation enabled: first by commands over the bus, then
// after a power cycle.
void Life::Machine::recover() {
  heal();
  if (!run_for(20) || !back_by_the_bus() || !run_for(1)) return;
  back_by_power();
}

void Life::Machine::heal() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    for (int wire = 0; wire < 8; ++wire) axis(i).force_input(wire, std::nullopt);
    for (std::int64_t injection = 0; injection < static_cast<std::int64_t>(plant::injection_names.size());
         ++injection) {
      if ((axes_[i].around.injected >> injection & 1u) != 0) {
        carry_out_benchs(i, {.kind = Kind::inject, .value = 0, .count = injection});
      }
    }
    for (const auto& [kind, value] :
         {std::pair{Kind::supply, 1000}, {Kind::load, 0}, {Kind::inertia, 100}, {Kind::lock, 0}, {Kind::cut, 0}}) {
      carry_out_benchs(i, {.kind = kind, .value = value});
    }
    axes_[i].stream = {};
    axes_[i].enabling = false;
  }
  cycling_ = true;
  pause_ = 0;
}

bool Life::Machine::run_for(int milliseconds) {
  for (int t = 0; t < milliseconds * ticks_per_ms; ++t) {
    if (!one_tick()) return false;
  }
  return true;
}

bool Life::Machine::all_enabled() const {
  return std::all_of(line_.axes().begin(), line_.axes().end(), [](const auto& one) {
    return one->device().drive().state() == drive::PowerState::operation_enabled;
  });
}

bool Life::Machine::enable_all(int milliseconds) {
  for (AxisState& state : axes_) {
    state.enabling = true;
    state.enabling_until = tick_ + (milliseconds + 600) * ticks_per_ms + longest_braking;
  }
  int braking = 0;  // ticks; a stop may take as long as its ramp
  for (int t = 0; t < milliseconds * ticks_per_ms && !all_enabled(); ++t) {
    if (brakes() && braking < longest_braking) --t, ++braking;
    if (!one_tick()) return false;
  }
  return true;
}

bool Life::Machine::brakes() {
  return std::any_of(line_.axes().begin(), line_.axes().end(), [](const auto& one) {
    const drive::Drive& drive = one->device().drive();
    const bool stops = drive.state() == drive::PowerState::fault_reaction_active ||
                       drive.state() == drive::PowerState::quick_stop_active;
    return stops && drive.axis().demand.velocity != 0.0F;
  });
}

// The master starts the node, clears its commands and resets the fault. A fault that only a power cycle resets may
// stay.
bool Life::Machine::back_by_the_bus() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (!axes_[i].around.powered) carry_out_benchs(i, {.kind = Kind::power, .value = 1});
    master_->command(i, on_can() ? Kind::nmt : Kind::al, on_can() ? 1 : 8);
  }
  if (!run_for(60)) return false;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    set_up(i);  // again, because a reset that waited for the cut bus may have been carried out since
    control(i, 0);
  }
  if (!run_for(60)) return false;
  for (const std::int64_t held : {1, 0}) {
    for (std::size_t i = 0; i < axes_.size(); ++i) carry_out_benchs(i, {.kind = Kind::lock, .value = held});
    if (!run_for(20)) return false;
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    // Sets mode and targets to valid values, because a fault that wrong values cause would come back.
    const auto mode = static_cast<std::int64_t>(Mode::profile_position);
    carry_out_masters(i, {.kind = Kind::write, .via = Via::pdo, .index = 0x6060, .value = mode});
    for (const std::uint16_t index : std::to_array<std::uint16_t>({0x60FF, 0x6071, 0x60B0, 0x60B1, 0x60B2})) {
      if (axis(i).device().bus_dictionary().find(index, 0) != nullptr)
        carry_out_masters(i, {.kind = Kind::write, .via = Via::sdo, .index = index, .value = 0});
    }
  }
  if (!run_for(100) || !enable_all(1500)) return false;
  const auto brakes = [](const auto& one) {
    return one->device().drive().state() == drive::PowerState::fault_reaction_active;
  };
  const bool braked = std::any_of(line_.axes().begin(), line_.axes().end(), brakes);
  if (!enable_all(300)) return false;  // for an axis whose fault has only just ended
  if (braked && !enable_all(1500)) return false;
  const auto is_on_its_way = [](const auto& one) { return one->device().drive().axis().objects.error_code == 0; };
  if (std::any_of(line_.axes().begin(), line_.axes().end(), is_on_its_way) && !enable_all(300)) return false;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const drive::Drive& drive = axis(i).device().drive();
    if (drive.state() == drive::PowerState::operation_enabled) continue;
    if (std::abs(axis(i).plant().velocity_rpm()) > 5.0 || drive.axis().demand.velocity != 0.0F)
      continue;  // it still brakes; the invariants of stops check that
    const bool by_power =
        std::any_of(drive.policy().faults.rows.begin(), drive.policy().faults.rows.end(), [&](const auto& row) {
          return drive.is_active(row.cause) && (row.reset != drive::ResetRule::when_cause_gone || lasts(i, row.cause));
        });
    if (by_power) continue;
    finding_ = Finding{"no-way-back", i, tick_,
                       fmt::format("{} after 1.5 s with everything whole and resets, 603Fh {:04X}h",
                                   drive::name(drive.state()), drive.axis().objects.error_code)};
    return false;
  }
  return true;
}

// Returns true for causes that last longer than recovery waits: heat, and the voltage of a DC link that nothing
// discharges.
bool Life::Machine::lasts(std::size_t i, drive::Cause cause) {
  const drive::Drive& drive = axis(i).device().drive();
  switch (cause) {
    case drive::Cause::over_voltage: {  // also if it has only just ended
      constexpr double just_gone = 0.98;
      return axis(i).plant().dc_link_v() >
             just_gone * static_cast<double>(drive.configuration().monitors.over_voltage_v);
    }
    case drive::Cause::i2t:
    case drive::Cause::stage_i2t:
    case drive::Cause::motor_hot:
    case drive::Cause::power_stage_hot: return true;
    default: return false;
  }
}

// A motor that a load drove far beyond its speed is heated by the current through the diodes, and takes minutes to
// cool. A power cycle does not change that.
bool Life::Machine::is_hot(std::size_t i) {
  const drive::Drive& drive = axis(i).device().drive();
  constexpr double hot_c = 100.0;
  return drive.is_active(drive::Cause::motor_hot) && axis(i).plant().winding_temperature_c() > hot_c;
}

void Life::Machine::back_by_power() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    axes_[i].enabling = false;
    carry_out_benchs(i, {.kind = Kind::power, .value = 0});
    carry_out_benchs(i, {.kind = Kind::lock, .value = 1});  // so that the shaft rests
  }
  if (!run_for(20)) return;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    // The start position, where no switch is active.
    if (axis(i).plant().position_counts() != sequence_.axes[i].start_counts)
      axis(i).place(sequence_.axes[i].start_counts);
    carry_out_benchs(i, {.kind = Kind::lock, .value = 0});
    carry_out_benchs(i, {.kind = Kind::power, .value = 1});
  }
  if (!run_for(30) || !enable_all(900)) return;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const drive::Drive& drive = axis(i).device().drive();
    if (drive.state() == drive::PowerState::operation_enabled) continue;
    if (is_hot(i)) continue;
    finding_ = Finding{"no-way-back", i, tick_,
                       fmt::format("{} after a power cycle with everything whole, 603Fh {:04X}h",
                                   drive::name(drive.state()), drive.axis().objects.error_code)};
    return;
  }
}

}  // namespace servodrome::motion
