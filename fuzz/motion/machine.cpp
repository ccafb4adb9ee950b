#include <algorithm>
#include <bit>
#include <cmath>
#include <fmt/format.h>

#include "ethercat/slave/slave.hpp"
#include "life_machine.hpp"

namespace servodrome::motion {
namespace {

constexpr std::int64_t crowd_window = 4 * ticks_per_ms;
constexpr std::int64_t load_window = 50 * ticks_per_ms;

}  // namespace

Life::Machine::Machine(const Sequence& sequence, const RunOptions& options)
    : sequence_(sequence), options_(options), line_(line_settings(sequence)), axes_(sequence.axes.size()) {
  if (line_.ethercat_buses().empty()) {
    auto master = std::make_unique<CanMaster>(line_, *this);
    can_ = master.get();
    master_ = std::move(master);
  } else {
    master_ = std::make_unique<EthercatMaster>(line_, sequence.cycle_us, sequence.sync);
  }
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    watches_.push_back(std::make_unique<Watch>(*line_.axes()[i], i));
    rated_torque_nm_.push_back(line_.axes()[i]->plant().parameters().motor.rated_torque_nm);
    base_inertia_.push_back(line_.axes()[i]->plant().parameters().load.inertia_kgm2);
    base_volts_.push_back(line_.axes()[i]->plant().parameters().supply.volts);
  }
  cycle_ticks_ = std::max<std::int64_t>(1, (sequence.cycle_us * ticks_per_ms + 500) / 1000);
}

bool Life::Machine::run_to(std::int64_t end) {
  while (tick_ < end && !finding_) {
    if (tick_ == set_up_tick) {
      for (std::size_t i = 0; i < axes_.size(); ++i) set_up(i);
    }
    while (next_ < sequence_.events.size() && sequence_.events[next_].tick <= tick_)
      carry_out(sequence_.events[next_++]);
    one_tick();
  }
  return !finding_;
}

Outcome Life::Machine::end(bool recovers) {
  run_to(sequence_.end_tick);
  if (!finding_ && recovers) recover();
  for (const auto& watch : watches_) {
    if (!finding_ && !watch->end()) finding_ = watch->finding();
  }
  return {finding_, fingerprint_, tick_};
}

bool Life::Machine::one_tick() {
  if (tick_ >= set_up_tick) {
    if (tick_ % master_period == 0) {
      for (std::size_t i = 0; i < axes_.size(); ++i) poll_axis(i);
      if (master_->poll()) {
        for (AxisState& one : axes_) one.around.last_heartbeat = tick_;
      }
    }
    if (tick_ % cycle_ticks_ == 0) run_cycle();
  }
  ++tick_;
  line_.run_until(tick_ * line::tick_length);
  for (std::size_t i = 0; i < watches_.size(); ++i) {
    if (sequence_.axes[i].stop_counts != 0) look_at_stops(i);
    if (!watches_[i]->tick(tick_, axes_[i].around)) {
      finding_ = watches_[i]->finding();
      return false;
    }
  }
  if (tick_ % ticks_per_ms == 0) take_fingerprint();
  if (on_can() && tick_ % crowd_window == 0) look_for_crowds();
  if (on_can() && tick_ % load_window == 0 && !look_at_load()) return false;
  if (options_.story != nullptr) tell();
  return true;
}

// A hard stop holds the shaft like a locked rotor, and the shaft rebounds from it, perhaps within one tick.
void Life::Machine::look_at_stops(std::size_t i) {
  AxisState& state = axes_[i];
  const plant::Plant& plant = axis(i).plant();
  const double counts_per_tick =
      std::abs(plant.velocity_rpm()) / 60.0 * drive::tick_seconds * plant.parameters().encoder.counts_per_revolution;
  const double reach = std::abs(static_cast<double>(plant.position_counts())) + 4.0 * counts_per_tick + 2.0;
  if (reach >= static_cast<double>(sequence_.axes[i].stop_counts)) state.touched = tick_;
  const bool touches = tick_ - state.touched < stop_linger;
  if (touches) state.around.disturbed = tick_;
  state.around.locked = state.held || touches;
}

// The frames that the master maps and sends may overload the bus. Then any frame may have to wait.
void Life::Machine::look_for_crowds() {
  const links::CanBus& bus = line_.buses().front()->bus;
  const std::uint64_t bits = bus.counters().bits;
  const bool quiet = static_cast<double>(bits - crowd_bits_) < 0.9 * 62.5e-6 * crowd_window * bus.bit_rate();
  crowd_bits_ = bits;
  for (AxisState& one : axes_) one.around.quiet_bus = quiet;
}

// Drives must not overload the bus. Checked only while the master itself sends few frames: it maps nothing and sends
// no SYNC.
bool Life::Machine::look_at_load() {
  const links::CanBus& bus = line_.buses().front()->bus;
  const std::uint64_t bits = bus.counters().bits;
  const double share = static_cast<double>(bits - bits_) / (62.5e-6 * load_window * bus.bit_rate());
  bits_ = bits;
  const bool streamed = streamed_;  // by SDO: a load that the master causes
  streamed_ = false;
  const bool whole = !streamed && std::none_of(axes_.begin(), axes_.end(), [this](const AxisState& one) {
    return one.around.cut || tick_ - one.around.joined < 2 * load_window || one.stream.left > 0;
  });
  if (sequence_.mapped || sequence_.sync || share < 0.9 || !whole) return true;
  finding_ = Finding{"bus-overloaded", 0, tick_,
                     fmt::format("{:.0f} % of the bus in {} ms", 100.0 * share, load_window / ticks_per_ms)};
  return false;
}

void Life::Machine::take_fingerprint() {
  for (const auto& axis : line_.axes()) {
    mix(static_cast<std::uint64_t>(axis->plant().position_counts()));
    mix(std::bit_cast<std::uint64_t>(axis->plant().position_fraction()));
    mix(std::bit_cast<std::uint64_t>(axis->plant().current_a()));
    const drive::Drive& drive = axis->device().drive();
    const drive::Objects& objects = drive.axis().objects;
    mix(std::uint64_t{objects.statusword} << 32 | std::uint64_t{objects.error_code} << 16 |
        static_cast<std::uint8_t>(objects.modes_of_operation_display));
    mix(static_cast<std::uint64_t>(drive.axis().demand.position));
    mix(std::bit_cast<std::uint32_t>(drive.axis().demand.velocity));
    mix(std::bit_cast<std::uint64_t>(axis->plant().dc_link_v()));
  }
}

void Life::Machine::tell() {
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    const drive::Drive& drive = axis(i).device().drive();
    const drive::Objects& objects = drive.axis().objects;
    const bool changed = told_.size() <= i || told_[i] != std::pair(objects.statusword, static_cast<int>(drive.mode()));
    if (!changed && tick_ % options_.story_ticks != 0) continue;
    if (told_.size() <= i) told_.resize(i + 1);
    told_[i] = {objects.statusword, static_cast<int>(drive.mode())};
    const plant::Plant& plant = axis(i).plant();
    *options_.story += fmt::format(
        "  {:>9.4f} a{} {:22} 6041 {:04X} mode {:2} pwm {} x {:>12} v {:>8.1f} rpm demand {:>12} {:>8.1f} rpm torque "
        "{:>6.2f} Nm "
        "link {:>5.1f} V 603F {:04X} in {:02X} {}\n",
        static_cast<double>(tick_) / ticks_per_ms, i, drive::name(drive.state()), objects.statusword,
        static_cast<int>(drive.mode()), axis(i).actuation().pwm_enabled ? 1 : 0, plant.position_counts(),
        plant.velocity_rpm(), drive.axis().demand.position,
        static_cast<double>(drive.axis().demand.velocity) / drive.axis().units.counts_per_revolution * 60.0,
        plant.torque_nm(), plant.dc_link_v(), objects.error_code, axis(i).feedback().inputs,
        on_can() ? static_cast<int>(axis(i).device().can_node()->nmt_state())
                 : static_cast<int>(axis(i).device().ethercat_slave()->state()));
  }
}

Life::Life(const Sequence& sequence, const RunOptions& options)
    : machine_(std::make_unique<Machine>(sequence, options)) {}
Life::~Life() = default;
bool Life::run_to(std::int64_t tick) { return machine_->run_to(tick); }
void Life::go_on_with(const Sequence& sequence) { machine_->go_on_with(sequence); }
Outcome Life::end(bool recover) { return machine_->end(recover); }
std::int64_t Life::ticks() const { return machine_->ticks(); }

Outcome run(const Sequence& sequence, const RunOptions& options) {
  return Life(sequence, options).end(options.recover);
}

Outcome run_checked(const Sequence& sequence, const RunOptions& options, bool twice) {
  Outcome outcome = run(sequence, options);
  if (!twice || outcome.finding) return outcome;
  RunOptions quiet = options;
  quiet.coverage = nullptr;
  quiet.story = nullptr;
  const Outcome again = run(sequence, quiet);
  if (again.fingerprint != outcome.fingerprint || again.ticks != outcome.ticks) {
    outcome.finding = Finding{"not-deterministic", 0, outcome.ticks, "the second run of the same sequence differs"};
  }
  return outcome;
}

}  // namespace servodrome::motion
