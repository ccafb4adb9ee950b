#include "machine.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fmt/format.h>

#include "ethercat/slave/slave.hpp"

namespace servodrome::motion {
namespace {

using drive::Mode;

constexpr std::int64_t set_up_tick = 8;  // a node has booted by then
constexpr std::int64_t enable_limit = 600 * ticks_per_ms;
constexpr std::int64_t master_period = ticks_per_ms;
constexpr int longest_braking = 10'000 * ticks_per_ms;
constexpr std::int64_t crowd_window = 4 * ticks_per_ms;
constexpr std::int64_t stop_linger = ticks_per_ms;  // time for which a shaft may rebound from a hard stop
constexpr std::int64_t load_window = 50 * ticks_per_ms;

}  // namespace

class Life::Machine final : public FrameListener {
 public:
  Machine(const Sequence& sequence, const RunOptions& options)
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

  bool run_to(std::int64_t end) {
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

  void go_on_with(const Sequence& sequence) { sequence_ = sequence; }

  Outcome end(bool recovers) {
    run_to(sequence_.end_tick);
    if (!finding_ && recovers) recover();
    for (const auto& watch : watches_) {
      if (!finding_ && !watch->end()) finding_ = watch->finding();
    }
    return {finding_, fingerprint_, tick_};
  }

  std::int64_t ticks() const { return tick_; }

 private:
  struct Stream {
    std::uint16_t index = 0;
    std::int64_t step = 0;
    std::int64_t left = 0;
    std::int64_t gap = 0;
    std::int64_t sent = 0;
  };
  struct AxisState {
    Surroundings around;
    Stream stream;
    bool held = false;                    // the bench holds the rotor
    std::int64_t touched = -stop_linger;  // tick of the last contact with a hard stop
    bool enabling = false;
    std::int64_t enabling_until = 0;
    bool set_up = false;
    std::int64_t set_up_at = 0;  // tick at which the master sets the axis up again; 0: never
  };

  line::Axis& axis(std::size_t i) { return *line_.axes()[i]; }
  bool on_can() const { return can_ != nullptr; }

  void set_up(std::size_t i) {
    if (!axes_[i].around.powered) return;
    ProcessValues& values = master_->values(i);
    values = {};
    dictionary::Dictionary& objects = axis(i).device().bus_dictionary();
    // Starts with the actual position as the target, as a careful master does.
    values.position = static_cast<std::int32_t>(objects.number(0x6064));
    values.mode = static_cast<std::int8_t>(objects.number(0x6060));
    line_.changed();
    master_->set_up(i, sequence_.mapped);
    if (on_can()) axis(i).send_waiting(line_.now());
    watches_[i]->pdos_mapped();
    axes_[i].set_up = true;
  }

  bool one_tick() {
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
  void look_at_stops(std::size_t i) {
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
  void look_for_crowds() {
    const links::CanBus& bus = line_.buses().front()->bus;
    const std::uint64_t bits = bus.counters().bits;
    const bool quiet = static_cast<double>(bits - crowd_bits_) < 0.9 * 62.5e-6 * crowd_window * bus.bit_rate();
    crowd_bits_ = bits;
    for (AxisState& one : axes_) one.around.quiet_bus = quiet;
  }

  // Drives must not overload the bus. Checked only while the master itself sends few frames: it maps nothing and sends
  // no SYNC.
  bool look_at_load() {
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

  void mix(std::uint64_t value) { fingerprint_ = (std::rotl(fingerprint_, 13) ^ value) * 0x9E3779B97F4A7C15ULL; }

  void take_fingerprint() {
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

  // --- The master

  void run_cycle() {
    if (pause_ > 0) {
      --pause_;
      return;
    }
    if (!cycling_) return;
    for (std::size_t i = 0; i < axes_.size(); ++i) step_stream(i);
    master_->cycle(sequence_.sync);
    ++cycles_;
  }

  void step_stream(std::size_t i) {
    Stream& stream = axes_[i].stream;
    if (stream.left <= 0) return;
    streamed_ = true;
    --stream.left;
    ++stream.sent;
    ProcessValues& values = master_->values(i);
    std::int64_t value = values.get(stream.index) + stream.step;
    if (stream.index == 0x6071) {
      value = std::clamp<std::int64_t>(value, -32768, 32767);
    } else {
      value = static_cast<std::int32_t>(static_cast<std::uint32_t>(static_cast<std::uint64_t>(value)));
    }
    values.set(stream.index, value);
    if (stream.gap > 0 && stream.sent % stream.gap == 0) return;  // this value is not sent
    if (stream.index == 0x60C1) {
      write(i, stream.index, 1, value, Via::direct);
    } else if (on_can()) {
      write(i, stream.index, 0, value, Via::pdo);
    }
    axes_[i].around.commanded = tick_;
  }

  void write(std::size_t i, std::uint16_t index, std::uint8_t sub, std::int64_t value, Via via) {
    dictionary::Dictionary& objects = axis(i).device().bus_dictionary();
    line_.changed();
    if (index == 0x609A && value > 0) {
      std::uint32_t& gentlest = axes_[i].around.gentlest_homing_ramp;
      gentlest = static_cast<std::uint32_t>(gentlest == 0 ? value : std::min<std::int64_t>(gentlest, value));
    }
    if (via == Via::direct && !(master_->in_process_data(i, index) && !on_can())) {
      master_->values(i).set(index, value);
      objects.set_number(index, sub, value);
      if (on_can()) axis(i).send_waiting(line_.now());
      return;
    }
    const dictionary::Entry* entry = objects.find(index, sub);
    const unsigned bytes = entry == nullptr ? 4 : static_cast<unsigned>(dictionary::size_of(entry->type));
    master_->write(i, index, sub, value, bytes, via == Via::pdo);
  }

  void control(std::size_t i, std::uint16_t word) {
    write(i, 0x6040, 0, word, Via::pdo);
    axes_[i].around.commanded = tick_;
  }

  // The master brings an axis to Operation enabled, step by step.
  void poll_axis(std::size_t i) {
    AxisState& state = axes_[i];
    if (state.set_up_at != 0 && tick_ >= state.set_up_at) {
      state.set_up_at = 0;
      set_up(i);
    }
    if (!state.enabling || !state.around.powered) return;
    if (tick_ > state.enabling_until) {
      state.enabling = false;
      return;
    }
    switch (axis(i).device().drive().state()) {
      case drive::PowerState::fault:  // each level for two cycles, because process data carry only one value per cycle
        control(i, tick_ / (2 * std::max(cycle_ticks_, master_period)) % 2 == 0 ? 0x80 : 0x00);
        break;
      case drive::PowerState::switch_on_disabled: control(i, 0x06); break;
      case drive::PowerState::ready_to_switch_on: control(i, 0x07); break;
      case drive::PowerState::switched_on: control(i, 0x0F); break;
      case drive::PowerState::quick_stop_active: control(i, 0x00); break;
      case drive::PowerState::operation_enabled: state.enabling = false; break;
      default: break;
    }
  }

  void heard(std::size_t i, const canopen::Frame& frame, line::Time at) override {
    for (std::size_t byte = 0; byte < frame.length; ++byte) mix(std::uint64_t{frame.id} << 8 | frame.data[byte]);
    if (i < watches_.size()) watches_[i]->heard(frame, at);
  }

  // --- Events

  void carry_out(const Event& event) {
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

  void carry_out_masters(std::size_t i, const Event& event) {
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

  void carry_out_benchs(std::size_t i, const Event& event) {
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

  // --- Recovery

  // Removes all disturbances. Then every axis must get back to Operation enabled: first by commands over the bus, then
  // after a power cycle.
  void recover() {
    heal();
    if (!run_for(20) || !back_by_the_bus() || !run_for(1)) return;
    back_by_power();
  }

  void heal() {
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

  bool run_for(int milliseconds) {
    for (int t = 0; t < milliseconds * ticks_per_ms; ++t) {
      if (!one_tick()) return false;
    }
    return true;
  }
  bool all_enabled() const {
    return std::all_of(line_.axes().begin(), line_.axes().end(), [](const auto& one) {
      return one->device().drive().state() == drive::PowerState::operation_enabled;
    });
  }
  bool enable_all(int milliseconds) {
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
  bool brakes() {
    return std::any_of(line_.axes().begin(), line_.axes().end(), [](const auto& one) {
      const drive::Drive& drive = one->device().drive();
      const bool stops = drive.state() == drive::PowerState::fault_reaction_active ||
                         drive.state() == drive::PowerState::quick_stop_active;
      return stops && drive.axis().demand.velocity != 0.0F;
    });
  }

  // The master starts the node, clears its commands and resets the fault. A fault that only a power cycle resets may
  // stay.
  bool back_by_the_bus() {
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
            return drive.is_active(row.cause) &&
                   (row.reset != drive::ResetRule::when_cause_gone || lasts(i, row.cause));
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
  bool lasts(std::size_t i, drive::Cause cause) {
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
  bool is_hot(std::size_t i) {
    const drive::Drive& drive = axis(i).device().drive();
    constexpr double hot_c = 100.0;
    return drive.is_active(drive::Cause::motor_hot) && axis(i).plant().winding_temperature_c() > hot_c;
  }

  void back_by_power() {
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

  // --- Log

  void tell() {
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      const drive::Drive& drive = axis(i).device().drive();
      const drive::Objects& objects = drive.axis().objects;
      const bool changed =
          told_.size() <= i || told_[i] != std::pair(objects.statusword, static_cast<int>(drive.mode()));
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

  Sequence sequence_;
  std::size_t next_ = 0;  // index of the next event
  RunOptions options_;
  line::Line line_;
  std::vector<AxisState> axes_;
  std::unique_ptr<Master> master_;
  CanMaster* can_ = nullptr;
  std::vector<std::unique_ptr<Watch>> watches_;
  std::vector<double> rated_torque_nm_;
  std::vector<double> base_inertia_;
  std::vector<double> base_volts_;
  std::int64_t tick_ = 0;
  std::int64_t cycle_ticks_ = 16;
  std::int64_t pause_ = 0;
  std::int64_t cycles_ = 0;
  bool cycling_ = true;
  std::uint64_t fingerprint_ = 0;
  std::uint64_t bits_ = 0;
  std::uint64_t crowd_bits_ = 0;
  bool streamed_ = false;
  std::optional<Finding> finding_;
  std::vector<std::pair<std::uint16_t, int>> told_;
};

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
