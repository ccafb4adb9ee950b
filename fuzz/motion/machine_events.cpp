#include "life_machine.hpp"

// Carries the events of a sequence out: those of the master and those of the test bench.
namespace servodrome::motion {
namespace {

constexpr std::int64_t enable_limit = 600 * ticks_per_ms;

}  // namespace

void Life::Machine::carry_out(const Event& event) {
  const std::size_t i = event.axis;
  if (i >= axes_.size()) return;
  AxisState& state = axes_[i];
  if (options_.coverage != nullptr && state.around.powered) {
    const drive::Drive& drive = axis(i).device().drive();
    options_.coverage->of(sequence_.axes[i].product).count(drive.state(), event.kind, drive.mode());
  }
  if (options_.story != nullptr) *options_.story += to_text(event) + "\n";
  line_.changed();
  if (is_masters(event.kind)) {
    if (!state.around.powered || !state.set_up) return;
    carry_out_masters(i, event);
  } else {
    carry_out_benchs(i, event);
  }
}

void Life::Machine::carry_out_masters(std::size_t i, const Event& event) {
  AxisState& state = axes_[i];
  switch (event.kind) {
    case Kind::write:
      if (event.index == 0x6040) state.enabling = false;
      write(i, event.index, event.sub, event.value, event.via);
      state.around.commanded = tick_;
      break;
    case Kind::write_here: {
      const std::int64_t here = axis(i).device().bus_dictionary().number(0x6064);
      const auto value =
          static_cast<std::int32_t>(static_cast<std::uint32_t>(static_cast<std::uint64_t>(here + event.value)));
      write(i, event.index, event.sub, value, event.via);
      state.around.commanded = tick_;
      break;
    }
    case Kind::enable:
      state.enabling = true;
      state.enabling_until = tick_ + enable_limit;
      break;
    case Kind::stream: state.stream = {event.index, event.value, event.count, event.gap, 0}; break;
    case Kind::nmt:
    case Kind::al:
    case Kind::heartbeat:
      master_->command(i, event.kind, event.value);
      state.around.commanded = tick_;
      if (event.kind == Kind::nmt && event.value >= 0x81) {  // the node loses its mapping
        state.set_up_at = tick_ + 4 * ticks_per_ms;
        state.enabling = false;
      }
      break;
    case Kind::cycle:
      if (event.value == 2) {
        pause_ = event.count;
      } else {
        cycling_ = event.value != 0;
      }
      for (AxisState& one : axes_) one.around.commanded = tick_;
      break;
    default: break;
  }
}

void Life::Machine::carry_out_benchs(std::size_t i, const Event& event) {
  AxisState& state = axes_[i];
  plant::Plant& plant = axis(i).plant();
  Surroundings& around = state.around;
  switch (event.kind) {
    case Kind::input:  // a switch does not move the shaft
      axis(i).force_input(static_cast<int>(event.count),
                          event.value == 2 ? std::nullopt : std::optional<bool>(event.value != 0));
      return;
    case Kind::supply:
      plant.set_supply_v(base_volts_[i] * static_cast<double>(event.value) / 1000.0);
      around.supply_share = static_cast<double>(event.value) / 1000.0;
      break;
    case Kind::load:
      plant.set_external_torque_nm(rated_torque_nm_[i] * static_cast<double>(event.value) / 1000.0);
      around.load_share = static_cast<double>(event.value) / 1000.0;
      break;
    case Kind::inertia:
      plant.set_load_inertia_kgm2(base_inertia_[i] * static_cast<double>(event.value) / 100.0);
      around.inertia_factor = static_cast<double>(event.value) / 100.0;
      break;
    case Kind::lock:
      plant.lock_rotor(event.value != 0);
      state.held = around.locked = event.value != 0;
      break;
    case Kind::inject:
      plant.inject(static_cast<plant::Injection>(event.count), event.value != 0);
      if (event.value != 0) {
        around.injected |= 1u << event.count;
      } else {
        around.injected &= ~(1u << event.count);
      }
      break;
    case Kind::power:
      if (event.value != 0) {
        if (around.powered) return;
        axis(i).power_on(line_.now());
        around.powered = true;
        state.set_up_at = tick_ + set_up_tick;
      } else {
        if (!around.powered) return;
        axis(i).power_off(line_.now());
        master_->lost(i);
        around.powered = state.set_up = state.enabling = false;
        state.set_up_at = 0;
      }
      break;
    case Kind::cut:
      if (on_can()) {
        line_.buses().front()->bus.cut(axis(i).port(), event.value != 0);
      } else {
        line_.ethercat_buses().front()->bus.set_cable(i, event.value == 0);
      }
      around.cut = event.value != 0;
      if (!around.cut) around.joined = tick_;
      around.commanded = tick_;
      return;
    default: return;
  }
  around.disturbed = tick_;
}

}  // namespace servodrome::motion
