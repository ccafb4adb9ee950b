#include <array>
#include <cmath>

#include "generator.hpp"

// The steps that move an axis, in each mode, and the steps that stop it.
namespace servodrome::motion {

using drive::Mode;

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

}  // namespace servodrome::motion
