#pragma once

#include <cmath>
#include <cstring>
#include <deque>
#include <set>
#include <vector>

#include "axis/cyclic/cyclic_axis.hpp"
#include "axis/cyclic/cyclic_bus.hpp"

// Drives without control loops and motors, to test the logic that commands them: they reach each target within one
// cycle.
namespace servodrome::master::test {

class SimulatedDrive final : public ProcessImage {
 public:
  std::optional<ProcessObject> output(ObjectAddress object) override { return find(outputs_, output_bytes_, object); }
  std::optional<ProcessObject> input(ObjectAddress object) override { return find(inputs_, input_bytes_, object); }
  std::string where() const override { return "simulated drive"; }

  // ---- State ----
  PowerState state = PowerState::switch_on_disabled;
  std::int64_t position = 0;
  double velocity = 0.0;  // counts/s
  int mode = 0;
  std::uint32_t digital_inputs = 0;

  // ---- Faults and settings ----
  bool is_silent = false;
  bool is_blocked = false;
  bool homing_fails = false;
  int homing_cycles = 40;
  int mode_delay = 0;                       // cycles from a new 6060h to 6061h
  bool ignores_halt = false;                // in homing
  bool is_homing_moving = false;            // the shaft turns in homing
  bool stays_broken = false;                // a fault cannot be reset
  bool ignores_target = false;              // as at a limit switch: bit 12 is 0, and the shaft stands
  int quick_stop_cycles = 0;                // above 0: a quick stop takes so long, and ends in quick stop active
  std::vector<std::uint16_t> controlwords;  // all different ones in a row
  std::set<int> modes{6, 8, 9, 10};
  void break_down(std::uint16_t code) {
    state = PowerState::fault;
    error_code_ = code;
  }
  void switch_off_by_itself() { state = PowerState::switch_on_disabled; }
  // Simulates an edge at touch probe 1, at the present position.
  void touch(bool rising) {
    const std::uint16_t function = take<std::uint16_t>(0x60B8);
    const unsigned armed = rising ? 0x10U : 0x20U;
    if ((function & 1) == 0 || (function & armed) == 0 || (probe_status_ & (rising ? 2U : 4U)) != 0) return;
    probe_status_ = static_cast<std::uint16_t>(probe_status_ | (rising ? 2U : 4U));
    set<std::int32_t>(rising ? 0x60BA : 0x60BB, static_cast<std::int32_t>(position));
  }

  void cycle(double period_s) {
    const auto controlword = take<std::uint16_t>(0x6040);
    if (controlwords.empty() || controlwords.back() != controlword) controlwords.push_back(controlword);
    follow(controlword);
    change_mode();
    const double before = static_cast<double>(position);
    if (state == PowerState::operation_enabled && !is_blocked && !ignores_target) move(controlword, period_s);
    if (state == PowerState::quick_stop_active && quick_stop_left_ > 0) position += quick_stop_left_--;
    if (mode != 10 && mode != 9) velocity = (static_cast<double>(position) - before) / period_s;
    if ((take<std::uint16_t>(0x60B8) & 1) == 0) probe_status_ = 0;
    if ((take<std::uint16_t>(0x60B8) & 1) != 0) probe_status_ |= 1;
    controlword_before_ = controlword;
    show();
  }
  void show() {
    std::uint16_t word = drive::state_bits(state);
    if (mode == 6) word = static_cast<std::uint16_t>(word | homing_bits_);
    const bool follows = mode >= 8 && state == PowerState::operation_enabled && !ignores_target;
    if (follows) word = static_cast<std::uint16_t>(word | 0x1000);
    set<std::uint16_t>(0x6041, word);
    set<std::int8_t>(0x6061, static_cast<std::int8_t>(mode));
    set<std::int32_t>(0x6064, static_cast<std::int32_t>(static_cast<std::uint32_t>(position)));
    set<std::int32_t>(0x606C, static_cast<std::int32_t>(std::lround(velocity)));
    set<std::int16_t>(
        0x6077, state == PowerState::operation_enabled && mode == 10 ? take<std::int16_t>(0x6071) : std::int16_t{0});
    set<std::uint16_t>(0x603F, state == PowerState::fault ? error_code_ : std::uint16_t{0});
    set<std::uint32_t>(0x60FD, digital_inputs);
    set<std::uint16_t>(0x60B9, probe_status_);
  }

 private:
  struct Place {
    std::uint16_t index;
    unsigned offset;
    unsigned bytes;
  };
  static constexpr std::array<Place, 6> outputs_{Place{0x6040, 0, 2}, Place{0x6060, 2, 1},  Place{0x607A, 4, 4},
                                                 Place{0x60FF, 8, 4}, Place{0x6071, 12, 2}, Place{0x60B8, 14, 2}};
  static constexpr std::array<Place, 10> inputs_{
      Place{0x6041, 0, 2},  Place{0x6061, 2, 1},  Place{0x6064, 4, 4},  Place{0x606C, 8, 4},  Place{0x6077, 12, 2},
      Place{0x603F, 14, 2}, Place{0x60FD, 16, 4}, Place{0x60B9, 20, 2}, Place{0x60BA, 24, 4}, Place{0x60BB, 28, 4}};

  static std::optional<ProcessObject> find(std::span<const Place> places, std::span<std::uint8_t> bytes,
                                           ObjectAddress object) {
    for (const Place& place : places) {
      if (place.index == object.index) return ProcessObject(bytes.data(), {place.offset * 8, place.bytes * 8});
    }
    return std::nullopt;
  }
  template <typename T>
  T take(std::uint16_t index) {
    return output({index, 0})->get<T>();
  }
  template <typename T>
  void set(std::uint16_t index, T value) {
    input({index, 0})->set<T>(value);
  }

  void follow(std::uint16_t controlword) {
    const bool reset = (controlword & 0x80) != 0 && (controlword_before_ & 0x80) == 0;
    if (state == PowerState::fault) {
      if (reset && !stays_broken) state = PowerState::switch_on_disabled;
      return;
    }
    const bool is_on = state == PowerState::operation_enabled || state == PowerState::quick_stop_active;
    if ((controlword & 0x06) == 0x02 && is_on && quick_stop_cycles > 0) {
      if (state == PowerState::operation_enabled) quick_stop_left_ = quick_stop_cycles;
      state = PowerState::quick_stop_active;
    } else if ((controlword & 0x02) == 0 || (controlword & 0x06) == 0x02) {
      state = PowerState::switch_on_disabled;
    } else if ((controlword & 0x07) == 0x06) {
      state = PowerState::ready_to_switch_on;
    } else if ((controlword & 0x0F) == 0x07 && state != PowerState::switch_on_disabled) {
      state = PowerState::switched_on;
    } else if ((controlword & 0x0F) == 0x0F && state == PowerState::switched_on) {
      state = PowerState::operation_enabled;
    }
  }

  void change_mode() {
    const int wanted = take<std::int8_t>(0x6060);
    mode_left_ = wanted == wanted_mode_ ? mode_left_ - 1 : mode_delay;
    wanted_mode_ = wanted;
    if (mode_left_ <= 0 && modes.count(wanted) != 0) mode = wanted;
  }

  void move(std::uint16_t controlword, double period_s) {
    // 607Ah is 32 bits wide, so the difference is taken modulo 2^32.
    const auto target = take<std::uint32_t>(0x607A);
    constexpr double counts_per_s2_per_permille = 200.0;
    switch (mode) {
      case 8: position += static_cast<std::int32_t>(target - static_cast<std::uint32_t>(position)); break;
      case 9:
        velocity = take<std::int32_t>(0x60FF);
        glide(period_s);
        break;
      case 10:
        velocity += take<std::int16_t>(0x6071) * counts_per_s2_per_permille * period_s;
        glide(period_s);
        break;
      case 6: home(controlword); break;
      default: break;
    }
  }
  void glide(double period_s) {
    rest_ += velocity * period_s;
    const double whole = std::floor(rest_);
    position += static_cast<std::int64_t>(whole);
    rest_ -= whole;
  }
  void home(std::uint16_t controlword) {
    if ((controlword & 0x10) == 0) {
      homing_left_ = homing_cycles;
      return;
    }
    if ((controlword & 0x100) != 0 && !ignores_halt) {
      homing_bits_ = 0x0400;
      return;
    }
    homing_bits_ = 0;
    if (is_homing_moving) position += 10;
    if (homing_left_ > 0) {
      --homing_left_;
    } else {
      if (!homing_fails) position = 0;
      homing_bits_ = homing_fails ? 0x2400 : 0x1400;
    }
  }

  std::array<std::uint8_t, 16> output_bytes_{};
  std::array<std::uint8_t, 32> input_bytes_{};
  std::uint16_t controlword_before_ = 0;
  std::uint16_t error_code_ = 0;
  std::uint16_t homing_bits_ = 0;
  std::uint16_t probe_status_ = 0;
  int homing_left_ = 0;
  int quick_stop_left_ = 0;
  int wanted_mode_ = 0;
  int mode_left_ = 0;
  double rest_ = 0.0;
};

// A bus in virtual time: one cycle each period, whenever the caller waits.
class SimulatedBus final : public CyclicBus {
 public:
  explicit SimulatedBus(std::size_t drives, Time period = std::chrono::milliseconds(1))
      : period_(period), drives_(drives) {
    for (SimulatedDrive& drive : drives_) drive.show();
  }

  SimulatedDrive& drive(std::size_t number) { return drives_[number]; }
  void run_cycles(unsigned count) {
    for (unsigned i = 0; i < count; ++i) {
      now_ += period_;
      ++counters_.cycles;
      for (SimulatedDrive& drive : drives_) {
        if (!drive.is_silent) drive.cycle(std::chrono::duration<double>(period_).count());
      }
      if (action_) action_();
    }
  }

  Time period() const override { return period_; }
  Time now() const override { return now_; }
  void wait(Time span) override { run_cycles(static_cast<unsigned>((span + period_ - Time{1}) / period_)); }
  std::size_t size() const override { return drives_.size(); }
  ProcessImage& image(std::size_t drive) override { return drives_[drive]; }
  bool is_fresh(std::size_t drive) const override { return !drives_[drive].is_silent; }
  void on_cycle(std::function<void()> action) override { action_ = std::move(action); }
  void check() const override {}
  CycleCounters counters() const override { return counters_; }

 private:
  Time period_;
  Time now_{};
  std::deque<SimulatedDrive> drives_;
  std::function<void()> action_;
  CycleCounters counters_;
};

}  // namespace servodrome::master::test
