#include <algorithm>
#include <cmath>
#include <numeric>

#include "generator.hpp"
#include "plant/injection.hpp"

namespace servodrome::motion {

using drive::Mode;

namespace {

constexpr unsigned least_steps = 3;  // of a sequence

std::int64_t to_i32(double value) { return static_cast<std::int64_t>(std::clamp(value, -2147483648.0, 2147483647.0)); }
std::int64_t to_u32(double value) { return static_cast<std::int64_t>(std::clamp(value, 0.0, 4294967295.0)); }

}  // namespace

Generator::Generator(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants, Tree tree)
    : random_(seed, number / tree.leaves()), variants_(variants), seed_(seed), number_(number), tree_(tree) {}

Drawn Generator::draw() {
  const Variant& first = random_.of(variants_);
  const int count = random_.chance(85) ? 1 : static_cast<int>(random_.within(2, 3));
  const bool alike = random_.chance(35);
  for (int i = 0; i < count; ++i) add_axis(i == 0 || alike ? first : neighbour(first));
  static constexpr std::array<std::int64_t, 8> cycles{1000, 1000, 2000, 4000, 500, 250, 3333, 10000};
  sequence_.cycle_us = random_.of(cycles);
  sequence_.sync = random_.chance(50);
  // jmc_ec only accepts a SYNC0 period that is a multiple of 250 us.
  if (first.on_ethercat() && sequence_.cycle_us == 3333) sequence_.sync = false;
  sequence_.mapped = random_.chance(first.on_ethercat() ? 85 : 70);
  const auto axes = static_cast<std::uint8_t>(sequence_.axes.size());
  for (std::uint8_t i = 0; i < axes; ++i) begin(i);
  for (std::int64_t n = random_.within(least_steps, 14); n > 0; --n) {
    if (n <= static_cast<std::int64_t>(tree_.levels)) fork(tree_.levels - static_cast<unsigned>(n));
    axis_ = static_cast<std::uint8_t>(random_.below(axes));
    // If sequences share a beginning, most of the work is in their ends, so the ends are short: rarely a theme, and
    // less time after the last event.
    const bool alone = tree_.levels > 0 && n == 1;
    if (random_.chance(alone ? 5 : 15)) {
      theme();
    } else {
      step();
    }
  }
  pause();
  const bool looks_long = tree_.levels == 0 || random_.chance(25);
  now_ += (looks_long ? random_.within(20, 300) : random_.within(10, 80)) * ticks_per_ms;
  sequence_.end_tick = now_;
  std::stable_sort(sequence_.events.begin(), sequence_.events.end(),
                   [](const Event& a, const Event& b) { return a.tick < b.tick; });
  return {std::move(sequence_), std::move(forks_)};
}

// Draws a theme: several related steps, with waiting times.
void Generator::theme() {
  struct Row {
    Theme draws;
    int weight;
    std::uint16_t needs = 0;  // an object that the product must have; 0: none
  };
  static constexpr std::array rows{
      Row{&Generator::ramp_of_zero, 2},
      Row{&Generator::speed_and_none, 2},
      Row{&Generator::switch_that_opens_again, 2},
      Row{&Generator::software_limits_around, 4},
      Row{&Generator::jump_and_stop, 2},
      Row{&Generator::halt_in_stream, 2},
      Row{&Generator::lone_set_point, 2},
      Row{&Generator::enable_twice, 2},
      Row{&Generator::lowered_speed, 4},
      Row{&Generator::torque_and_stop, 2},
      Row{&Generator::far_first_target, 2},
      Row{&Generator::halt_taken_back, 2},
      Row{&Generator::interrupted_travel, 4},
      Row{&Generator::position_range, 2, 0x607B},
      Row{&Generator::polarity, 2, 0x607E},
      Row{&Generator::end_velocity, 2, 0x6082},
      Row{&Generator::lost_master, 1, 0x1016},
      Row{&Generator::aborted_connection, 1, 0x6007},
      Row{&Generator::far_positions, 2, 0x607C},
      Row{&Generator::into_hard_stop, 2},
      Row{&Generator::touch_probes, 1},
      Row{&Generator::several_writes, 2},
      Row{&Generator::bit_4_before_enabling, 1},
      Row{&Generator::homing_not_started, 2},
      Row{&Generator::mode_of_none, 2},
      Row{&Generator::power_cut_in_reaction, 1},
  };
  constexpr int weights =
      std::accumulate(rows.begin(), rows.end(), 0, [](int sum, const Row& row) { return sum + row.weight; });
  for (;;) {
    std::int64_t dice = random_.below(weights);
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const Row& one) { return (dice -= one.weight) < 0; });
    if (row->needs != 0 && !variant().has_object(row->needs)) continue;
    return (this->*row->draws)();
  }
}

// From here on the random numbers are those of this branch of the tree.
void Generator::fork(unsigned level) {
  random_ = Random(seed_ + (level + 1) * 0x9E3779B97F4A7C15ULL, number_ / tree_.leaves(level + 1));
  forks_.push_back(now_);
}

const Variant& Generator::neighbour(const Variant& first) {
  for (;;) {
    const Variant& other = random_.of(variants_);
    if (other.on_ethercat() == first.on_ethercat()) return other;
  }
}

void Generator::add_axis(const Variant& variant) {
  AxisSetup axis;
  axis.product = variant.product->name;
  axis.model = variant.model;
  const double turn = variant.units.counts_per_revolution;
  if (random_.chance(60)) axis.start_counts = std::llround(turn * (random_.unit() * 8.0 - 4.0));
  if (random_.chance(4)) {  // near an end of the 32-bit range of 6064h
    const double half = 2147483648.0 * variant.units.position.value();
    axis.start_counts +=
        std::llround(half * static_cast<double>(random_.within(-2, 1) * 2 + 1) / (random_.chance(80) ? 1.0 : 2.0));
  }
  // `told`: the drive knows the load's inertia. Otherwise its loops are set for a load like its own rotor, and would
  // oscillate with a much greater one.
  const bool told = variant.model.empty();
  static constexpr std::array<std::int64_t, 6> inertias{100, 100, 100, 20, 300, 1000};
  static constexpr std::array<std::int64_t, 5> frictions{100, 100, 0, 300, 1000};
  axis.inertia_percent = told ? random_.of(inertias) : std::min<std::int64_t>(random_.of(inertias), 150);
  axis.friction_percent = random_.of(frictions);
  if (random_.chance(25)) axis.travel_counts = std::llround(turn * (4.0 + random_.unit() * 8.0));
  if (axis.travel_counts != 0 ? random_.chance(30)
                              : random_.chance(8)) {  // hard stops, beyond the limit switches if there are any
    const auto least = axis.travel_counts != 0 ? axis.travel_counts : std::llround(turn * 4.0);
    axis.stop_counts = least + std::llround(turn * (0.1 + 3.0 * random_.unit()));
  }
  if (std::abs(axis.start_counts) >= axis.stop_counts) axis.stop_counts = 0;
  sequence_.axes.push_back(axis);
  drawn_.push_back({&variant});
}

// --- Time

void Generator::pause() {
  switch (random_.below(8)) {
    case 0: break;
    case 1: now_ += random_.within(1, 8); break;
    case 2:
    case 3: now_ += random_.within(8, 64); break;
    case 4:
    case 5: now_ += random_.within(2, 40) * ticks_per_ms; break;
    case 6: now_ += random_.within(20, 120) * ticks_per_ms; break;
    default: now_ += random_.within(50, 300) * ticks_per_ms; break;
  }
}

// --- Events

Event& Generator::add(Event event) {
  event.tick = now_;
  event.axis = axis_;
  sequence_.events.push_back(event);
  return sequence_.events.back();
}

Via Generator::via() { return random_.chance(55) ? Via::pdo : random_.chance(60) ? Via::sdo : Via::direct; }

void Generator::write(std::uint16_t index, std::int64_t value, std::uint8_t sub) {
  add({.kind = Kind::write, .via = via(), .index = index, .sub = sub, .value = value});
}

bool Generator::set_mode(Mode wanted) {
  if (!variant().has(wanted)) return false;
  mode() = wanted;
  write(0x6060, static_cast<std::int8_t>(wanted));
  return true;
}

void Generator::write_here(std::uint16_t index, std::int64_t value, std::uint8_t sub, Via way) {
  add({.kind = Kind::write_here, .via = way, .index = index, .sub = sub, .value = value});
}

void Generator::enable() {
  add({.kind = Kind::enable});
  wait(10, 120);
}

// --- Values, in the drive's units

std::int64_t Generator::position(double revolutions) const { return to_i32(variant().position(revolutions)); }
std::int64_t Generator::velocity(double revolutions_per_s) const {
  return to_i32(variant().velocity(revolutions_per_s));
}
std::int64_t Generator::acceleration(double revolutions_per_s2) const {
  return std::max<std::int64_t>(1, to_u32(variant().acceleration(revolutions_per_s2)));
}

std::int64_t Generator::distance() {
  static constexpr std::array revolutions{0.0, 0.001, 0.05, 0.3, 1.0, 2.0, 5.0, 20.0, 200.0};
  double value = random_.of(revolutions) * (0.5 + random_.unit());
  if (random_.chance(50)) value = -value;
  if (random_.chance(3)) return random_.chance(50) ? 2147483647 : -2147483648LL;
  return position(value);
}

std::int64_t Generator::speed() {
  static constexpr std::array shares{0.0, 0.001, 0.02, 0.1, 0.3, 0.6, 1.0, 1.5};
  const double value = random_.of(shares) * (0.5 + 0.5 * random_.unit()) * variant().max_speed_rpm / 60.0;
  if (random_.chance(3)) return 2147483647;
  return velocity(value);
}

std::int64_t Generator::signed_speed() {
  const std::int64_t value = speed();
  return random_.chance(50) ? -value : value;
}

std::int64_t Generator::ramp() {
  if (random_.chance(7)) return 0;
  if (random_.chance(3)) return 1;
  if (random_.chance(3)) return 0xFFFFFFFF;
  static constexpr std::array values{10.0, 50.0, 200.0, 500.0, 1000.0, 3000.0, 20000.0};
  return acceleration(random_.of(values) * (0.5 + random_.unit()));
}

std::int64_t Generator::torque() {
  static constexpr std::array<std::int64_t, 8> values{0, 20, 100, 300, 600, 1000, 2000, 3000};
  const std::int64_t value = random_.of(values);
  return random_.chance(50) ? -value : value;
}

// --- What a master does

void Generator::begin(std::uint8_t axis) {
  axis_ = axis;
  now_ = std::max<std::int64_t>(now_, 16);
  if (is("ismk")) wire_switches();
  if (random_.chance(92)) {  // speeds and ramps that give visible motion within the sequence
    write(0x6081, velocity(variant().max_speed_rpm / 60.0 * (0.1 + 0.5 * random_.unit())));
    const double gain = 100.0 + 900.0 * random_.unit();
    write(0x6083, acceleration(gain));
    write(0x6084, acceleration(gain * (0.5 + random_.unit())));
    write(0x6085, acceleration(gain * (0.8 + 2.0 * random_.unit())));
    if (is("jmc_ec")) {
      // Its factory limits forbid nearly all motion.
      write(0x607F, velocity(variant().max_speed_rpm / 60.0));
      write(0x60C5, acceleration(4000.0));
      write(0x60C6, acceleration(4000.0));
    }
  }
  if (random_.chance(60)) interpolation_period();
  now_ += 4 * ticks_per_ms;
  if (random_.chance(90)) change_mode();
  if (random_.chance(15)) write(0x607A, distance());
  if (random_.chance(80)) {
    now_ += random_.within(0, 10) * ticks_per_ms;
    add({.kind = Kind::enable});
    now_ += random_.chance(70) ? random_.within(120, 260) * ticks_per_ms : random_.within(4, 60) * ticks_per_ms;
  }
}

// By default the iSMK's inputs have no functions, and its limit switches are active when open.
void Generator::wire_switches() {
  struct Row {
    std::uint8_t sub;
    std::int64_t value;
  };
  static constexpr std::array rows{Row{1, 0xFFFC}, Row{3, 0x20}, Row{4, 0x10}, Row{5, 0x40}};
  for (const Row& row : rows)
    add({.kind = Kind::write, .via = Via::direct, .index = 0x2010, .sub = row.sub, .value = row.value});
}

// Writes the master's cycle to 60C2h; 3.333 ms is rounded.
void Generator::interpolation_period() {
  std::int64_t value = sequence_.cycle_us;
  std::int64_t exponent = -6;
  while (value > 255 || value % 10 == 0) {
    value = (value + 5) / 10;
    ++exponent;
  }
  write(0x60C2, value, 1);
  write(0x60C2, exponent, 2);
}

void Generator::change_mode() {
  for (int i = 0; i < 20; ++i) {
    static constexpr std::array modes{Mode::profile_position,
                                      Mode::profile_position,
                                      Mode::profile_position,
                                      Mode::profile_velocity,
                                      Mode::profile_velocity,
                                      Mode::cyclic_sync_position,
                                      Mode::cyclic_sync_position,
                                      Mode::homing,
                                      Mode::profile_torque,
                                      Mode::interpolated_position,
                                      Mode::cyclic_sync_velocity,
                                      Mode::cyclic_sync_torque,
                                      Mode::velocity,
                                      Mode::immediate_velocity,
                                      Mode::pulse,
                                      Mode::none};
    const Mode chosen = random_.of(modes);
    if (!variant().has(chosen) && chosen != Mode::none) continue;
    if (chosen == Mode::none && !random_.chance(20)) continue;
    mode() = chosen;
    write(0x6060, static_cast<std::int8_t>(chosen));
    return;
  }
}

void Generator::step() {
  pause();
  const std::int64_t dice = random_.below(100);
  if (dice < 38) {
    move();
  } else if (dice < 54) {
    stop();
  } else if (dice < 66) {
    limit();
  } else if (dice < 72) {
    change_mode();
  } else if (dice < 79) {
    add({.kind = Kind::enable});
    if (random_.chance(60)) now_ += random_.within(5, 150) * ticks_per_ms;
  } else if (dice < 93) {
    bench();
  } else if (dice < 97) {
    network();
  } else {
    anything();
  }
}

void Generator::move() {
  switch (mode()) {
    case Mode::profile_position: return set_point();
    case Mode::profile_velocity:
    case Mode::immediate_velocity:
      if (random_.chance(20)) return write(0x60FF, 0);
      return write(0x60FF, signed_speed());
    case Mode::velocity: return move_vl();
    case Mode::profile_torque: return write(0x6071, torque());
    case Mode::homing: return home();
    case Mode::interpolated_position:
    case Mode::cyclic_sync_position:
    case Mode::cyclic_sync_velocity:
    case Mode::cyclic_sync_torque: return stream();
    default: set_point();
  }
}

// vl velocity mode: bits 4 to 6 of the controlword let the ramp run, lock it, or ramp down to 0. The mode has its own
// ramps, in rpm and s.
void Generator::move_vl() {
  if (random_.chance(30)) {
    static constexpr std::array<std::uint16_t, 3> ramps{0x6048, 0x6049, 0x604A};
    const std::uint16_t index = random_.of(ramps);
    write(index, random_.chance(8) ? 0 : random_.within(100, 30000), 1);
    write(index, random_.chance(8) ? 0 : random_.within(1, 3), 2);
  }
  if (random_.chance(80)) write(0x6042, random_.chance(15) ? 0 : random_.within(-3000, 3000));
  static constexpr std::array<std::uint16_t, 8> words{0x7F, 0x7F, 0x7F, 0x7F, 0x7F, 0x1F, 0x3F, 0x0F};
  control(random_.of(words));
}

void Generator::set_point() {
  if (random_.chance(10)) write(0x6081, speed());
  if (variant().has_object(0x60F2) && random_.chance(10)) write(0x60F2, random_.below(3) | random_.below(4) << 6);
  std::uint16_t word = 0x0F;
  if (random_.chance(50)) word |= 0x20;  // change set immediately
  if (random_.chance(40)) {
    word |= 0x40;
    write(0x607A, distance());
  } else if (random_.chance(75)) {
    write_here(0x607A, distance(), 0, via());
  } else {
    write(0x607A, distance());
  }
  if (random_.chance(10)) word |= 0x200;
  now_ += random_.within(0, 24);
  control(static_cast<std::uint16_t>(word | 0x10));
  now_ += random_.within(8, 60);
  if (random_.chance(90)) control(word);
  if (random_.chance(50)) now_ += random_.within(5, 200) * ticks_per_ms;
}

// A set-point with immediate effect, at this distance in either direction. Bit 4 stays set for more than a cycle, so
// that process data carry it.
void Generator::set_point_at_once(double revolutions) {
  const std::int64_t cycle = (sequence_.cycle_us * ticks_per_ms + 999) / 1000 + 16;
  const double way = random_.chance(50) ? revolutions : -revolutions;
  write_here(0x607A, position(way), 0, via());
  now_ += cycle;
  control(0x3F);
  now_ += cycle;
  control(0x0F);
}

void Generator::home() {
  if (!variant().homing_methods.empty() && random_.chance(80))
    write(0x6098, static_cast<std::int8_t>(random_.of(variant().homing_methods)));
  if (random_.chance(60)) {
    write(0x6099, std::abs(speed()), 1);
    write(0x6099, std::abs(speed()), 2);
    write(0x609A, ramp());
  }
  if (random_.chance(10)) write(0x607C, distance());
  now_ += 4 * ticks_per_ms;
  control(0x1F);
  now_ += random_.within(1, 200) * ticks_per_ms;
  if (random_.chance(30)) control(0x0F);
}

void Generator::stream() {
  const double cycle_s = static_cast<double>(sequence_.cycle_us) * 1e-6;
  std::uint16_t index = 0x607A;
  std::int64_t step = 0;
  if (mode() == Mode::cyclic_sync_velocity) {
    index = 0x60FF;
    step = velocity((random_.unit() - 0.5) * 400.0 * cycle_s);
    if (random_.chance(30)) return write(0x60FF, signed_speed());
  } else if (mode() == Mode::cyclic_sync_torque) {
    index = 0x6071;
    step = random_.within(-20, 20);
    if (random_.chance(50)) return write(0x6071, torque());
  } else {
    if (mode() == Mode::interpolated_position && random_.chance(60)) control(0x1F);
    const std::uint8_t sub = target_sub();
    index = target_index();
    if (random_.chance(70)) {
      add({.kind = Kind::write_here,
           .via = Via::pdo,
           .index = index,
           .sub = sub,
           .value = random_.chance(75) ? 0 : distance()});
    }
    if (random_.chance(20)) return write(index, distance(), sub);
    const double revolutions_per_s = (random_.unit() - 0.5) * (random_.chance(80) ? 20.0 : 200.0);
    step = position(revolutions_per_s * cycle_s);
  }
  const std::int64_t length = random_.within(2, 300);
  static constexpr std::array<std::int64_t, 6> gaps{0, 0, 0, 2, 5, 17};
  add({.kind = Kind::stream, .index = index, .value = step, .count = length, .gap = random_.of(gaps)});
  if (random_.chance(60)) now_ += random_.within(1, 1 + length) * sequence_.cycle_us * ticks_per_ms / 1000;
  if (random_.chance(15)) add({.kind = Kind::cycle, .value = 2, .count = random_.within(1, 4)});
}

void Generator::stop() {
  switch (random_.below(12)) {
    case 0:
    case 1: control(0x02); break;  // quick stop
    case 2: control(0x06); break;  // shutdown
    case 3: control(0x07); break;  // disable operation
    case 4: control(0x00); break;  // disable voltage
    case 5:
    case 6:
    case 7: control(0x10F); break;  // halt
    case 8: control(0x0F); break;   // end of the halt
    case 9: control(static_cast<std::uint16_t>(0x80 | (random_.chance(50) ? 0x0F : 0x00))); break;
    case 10: control(static_cast<std::uint16_t>(random_.below(0x200))); break;
    default:
      control(0x10F);
      now_ += random_.within(1, 100) * ticks_per_ms;
      control(0x0F);
  }
  if (random_.chance(50)) now_ += random_.within(1, 200) * ticks_per_ms;
}

void Generator::limit() {
  switch (random_.below(17)) {
    case 0: return write(0x6081, random_.chance(25) ? 0 : speed());
    case 1:
    case 2: return write(0x6083, ramp());
    case 3:
    case 4: return write(0x6084, ramp());
    case 5: return write(0x6085, ramp());
    case 6: return write(0x607F, speed());
    case 7: return write(0x6080, random_.chance(20) ? 0 : random_.within(50, 6000));
    case 8:
    case 9: {  // limits around the axis, beside it, or exchanged
      const std::int64_t one = distance();
      const std::int64_t other = distance();
      const bool swapped = random_.chance(8);
      const std::int64_t low = swapped ? std::max(one, other) : std::min(one, other);
      const std::int64_t high = swapped ? std::min(one, other) : std::max(one, other);
      write_here(0x607D, low, low_limit());
      write_here(0x607D, high, high_limit());
      return;
    }
    case 10: return write(0x60C5, ramp());
    case 11: return write(0x60C6, ramp());
    case 12:
      return write(random_.chance(50) ? 0x6072 : random_.chance(50) ? 0x60E0 : 0x60E1, random_.within(0, 10) * 300);
    case 13: {
      static constexpr std::array<std::uint16_t, 5> codes{0x605A, 0x605B, 0x605C, 0x605D, 0x605E};
      return write(random_.of(codes), random_.within(0, 8));
    }
    case 14: return write(0x6086, random_.within(0, 3));
    case 15: return random_.chance(50) ? write(0x60C2, random_.within(1, 250), 1) : interpolation_period();
    default: return write(0x6087, random_.chance(30) ? 0 : random_.within(100, 100000));
  }
}

void Generator::bench() {
  const line::SwitchWiring& wiring = variant().product->wiring;
  switch (random_.below(14)) {
    case 0:
    case 1:
    case 2:
    case 3: {  // a limit switch, with or without a bounce
      const std::int64_t wire = limit_wire();
      add({.kind = Kind::input, .value = 1, .count = wire});
      if (random_.chance(40)) {
        now_ += random_.within(1, 40);
        add({.kind = Kind::input, .value = 0, .count = wire});
        now_ += random_.within(1, 16);
        add({.kind = Kind::input, .value = 1, .count = wire});
      }
      now_ += random_.within(1, 350) * ticks_per_ms;
      if (random_.chance(80)) add({.kind = Kind::input, .value = random_.chance(50) ? 0 : 2, .count = wire});
      return;
    }
    case 4: {
      add({.kind = Kind::input,
           .value = random_.below(2),
           .count = random_.chance(50) ? wiring.home : random_.below(4)});
      return;
    }
    case 5: {  // a dip of the supply, or another voltage
      static constexpr std::array<std::int64_t, 6> levels{0, 300, 600, 850, 1100, 1000};
      add({.kind = Kind::supply, .value = random_.of(levels)});
      if (random_.chance(70)) {
        now_ += random_.within(1, 120) * ticks_per_ms;
        add({.kind = Kind::supply, .value = 1000});
      }
      return;
    }
    case 6:
    case 7: {
      static constexpr std::array<std::int64_t, 8> loads{0, 100, 300, 500, -100, -300, -500, 1500};
      add({.kind = Kind::load, .value = random_.of(loads)});
      return;
    }
    case 8: {
      static constexpr std::array<std::int64_t, 4> inertias{100, 50, 150, 200};
      const std::int64_t most = variant().model.empty() ? 200 : 100;
      add({.kind = Kind::inertia, .value = std::min(random_.of(inertias), most)});
      return;
    }
    case 9:
    case 10: {
      add({.kind = Kind::lock, .value = 1});
      now_ += random_.within(1, 150) * ticks_per_ms;
      add({.kind = Kind::lock, .value = 0});
      return;
    }
    case 11: {
      const auto injection = random_.below(static_cast<std::int64_t>(plant::injection_names.size()));
      add({.kind = Kind::inject, .value = 1, .count = injection});
      now_ += random_.within(1, 60) * ticks_per_ms;
      if (random_.chance(85)) add({.kind = Kind::inject, .value = 0, .count = injection});
      return;
    }
    case 12: {
      add({.kind = Kind::power, .value = 0});
      now_ += random_.within(1, 60) * ticks_per_ms;
      add({.kind = Kind::power, .value = 1});
      now_ += random_.within(2, 20) * ticks_per_ms;
      return;
    }
    default: {
      add({.kind = Kind::cut, .value = 1});
      now_ += random_.within(1, 60) * ticks_per_ms;
      add({.kind = Kind::cut, .value = 0});
      return;
    }
  }
}

std::int64_t Generator::limit_wire() {
  const line::SwitchWiring& wiring = variant().product->wiring;
  return random_.chance(50) ? wiring.negative_limit : wiring.positive_limit;
}

void Generator::network() {
  if (variant().on_ethercat()) {
    static constexpr std::array<std::int64_t, 4> states{1, 2, 4, 8};
    add({.kind = Kind::al, .value = random_.of(states)});
    if (random_.chance(70)) {
      now_ += random_.within(1, 50) * ticks_per_ms;
      add({.kind = Kind::al, .value = 8});
    }
  } else {
    static constexpr std::array<std::int64_t, 5> commands{1, 2, 0x80, 0x81, 0x82};
    add({.kind = Kind::nmt, .value = random_.of(commands)});
    if (random_.chance(70)) {
      now_ += random_.within(1, 50) * ticks_per_ms;
      add({.kind = Kind::nmt, .value = 1});
    }
  }
  if (random_.chance(20)) add({.kind = Kind::cycle, .value = random_.below(2)});
}

// Writes a value that no master should write, to an object that affects motion.
void Generator::anything() {
  static constexpr std::array<std::uint16_t, 26> objects{
      0x6040, 0x6060, 0x607A, 0x60FF, 0x6071, 0x6081, 0x6082, 0x6083, 0x6084, 0x6085, 0x6086, 0x607F, 0x6080,
      0x6072, 0x6065, 0x6066, 0x605A, 0x605D, 0x60B0, 0x60B1, 0x60B2, 0x607C, 0x607E, 0x60B8, 0x60F2, 0x6007};
  static constexpr std::array<std::int64_t, 10> values{0, 1, -1, 2, 127, 255, 32767, 65535, 2147483647, -2147483648LL};
  write(random_.of(objects), random_.of(values));
}

Drawn draw(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants, Tree tree) {
  tree.levels = std::min(tree.levels, least_steps);
  return Generator(seed, number, variants, tree).draw();
}

}  // namespace servodrome::motion
