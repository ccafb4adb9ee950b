#include <algorithm>
#include <cmath>
#include <numeric>

#include "generator.hpp"

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

Drawn draw(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants, Tree tree) {
  tree.levels = std::min(tree.levels, least_steps);
  return Generator(seed, number, variants, tree).draw();
}

}  // namespace servodrome::motion
