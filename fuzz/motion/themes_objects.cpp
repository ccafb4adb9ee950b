#include <cmath>

#include "generator.hpp"
#include "plant/injection.hpp"

// Themes of rare objects and situations: position ranges, polarity, lost masters, hard stops, unusual orders of
// commands.
namespace servodrome::motion {

using drive::Mode;

// A range 607Bh in which positions wrap around, with each direction to a target that 60F2h can select, across the ends
// of the range and back.
void Generator::position_range() {
  if (is("jmc_ec")) return position_change();
  const double below = random_.chance(30) ? 0.0 : 0.3 + 6.0 * random_.unit();
  const double above = 0.3 + 6.0 * random_.unit();
  const bool swapped = random_.chance(4);
  write(0x607B, position(swapped ? above : -below), 1);
  write(0x607B, position(swapped ? -below : above), 2);
  if (variant().has_object(0x60F2)) write(0x60F2, random_.below(4) << 6 | random_.below(3));
  if (random_.chance(25)) {  // software limits within the range
    write(0x607D, position(-below * (0.3 + 0.6 * random_.unit())), low_limit());
    write(0x607D, position(above * (0.3 + 0.6 * random_.unit())), high_limit());
  }
  static constexpr std::array modes{Mode::profile_position, Mode::profile_position, Mode::profile_position,
                                    Mode::profile_velocity, Mode::cyclic_sync_position};
  if (!set_mode(random_.of(modes))) return;
  if (mode() == Mode::cyclic_sync_position) target_here(0);
  enable();
  if (mode() == Mode::profile_velocity) {
    write(0x60FF, signed_speed());
    wait(100, 400);
    return stop();
  }
  if (mode() == Mode::cyclic_sync_position) {
    target_here(0);
    stream();
    wait(50, 300);
    if (random_.chance(50)) stop();
    return wait(20, 200);
  }
  for (std::int64_t n = random_.within(1, 4); n > 0; --n) {
    // Mostly within the range, sometimes beyond one of its ends.
    const double beyond = random_.chance(20) ? 1.5 : 1.0;
    write(0x607A, position(random_.chance(50) ? above * random_.unit() * beyond : -below * random_.unit() * beyond));
    const auto how =
        static_cast<std::uint16_t>(0x0F | (random_.chance(50) ? 0x20 : 0) | (random_.chance(25) ? 0x40 : 0));
    now_ += cycle_ticks() + 16;
    control(static_cast<std::uint16_t>(how | 0x10));
    now_ += cycle_ticks() + 16;
    control(how);
    wait(20, 400);
    if (random_.chance(15)) write(0x60F2, random_.below(4) << 6);
    if (random_.chance(15)) stop();
    if (random_.chance(10)) write(0x607B, position(above + random_.unit()), 2);
  }
  wait(50, 300);
}

// In jmc_ec, 607Bh limits the step from one cyclic target to the next.
void Generator::position_change() {
  if (!set_mode(Mode::cyclic_sync_position)) return;
  target_here(0);
  enable();
  target_here(0);
  stream();
  const std::int64_t most = position(random_.unit() * 0.2);
  write(0x607B, random_.chance(10) ? most : -most, 1);
  write(0x607B, most, 2);
  wait(20, 200);
  if (random_.chance(40)) target_here(distance());
  wait(20, 200);
  stop();
  wait(50, 200);
  write(0x607B, -2147483648LL, 1);
  write(0x607B, 2147483647, 2);
}

// Reverses the direction of positions, of velocities, or of both (607Eh), while the motor has no power or while it
// has.
void Generator::polarity() {
  if (random_.chance(75)) {
    control(random_.chance(50) ? 0x06 : 0x00);
    wait(60, 300);
  }
  if (is("ismk")) {
    write(0x607E, random_.below(2));
  } else {
    static constexpr std::array<std::int64_t, 6> directions{0xC0, 0xC0, 0xC0, 0x80, 0x40, 0x00};
    write(0x607E, random_.of(directions));
  }
  wait(1, 10);
  if (random_.chance(70)) change_mode();
  if (mode() == Mode::cyclic_sync_position || mode() == Mode::interpolated_position) target_here(0);
  enable();
  move();
  wait(20, 200);
  switch (random_.below(5)) {
    case 0:
      write_here(0x607D, position(-0.5 - 4.0 * random_.unit()), low_limit());
      write_here(0x607D, position(0.5 + 4.0 * random_.unit()), high_limit());
      break;
    case 1: {
      const std::int64_t wire = limit_wire();
      add({.kind = Kind::input, .value = 1, .count = wire});
      wait(50, 300);
      move();
      wait(50, 200);
      add({.kind = Kind::input, .value = 0, .count = wire});
      break;
    }
    case 2: stop(); break;
    case 3: change_mode(); break;
    default: break;
  }
  wait(50, 300);
}

// Targets with an end velocity, one after the other in both directions, and events that end such a motion.
void Generator::end_velocity() {
  if (!set_mode(Mode::profile_position)) return;
  enable();
  const double fast = variant().max_speed_rpm / 60.0 * (0.05 + 0.4 * random_.unit());
  write(0x6081, velocity(fast));
  for (std::int64_t n = random_.within(1, 4); n > 0; --n) {
    write(0x6082, random_.chance(20) ? 0 : velocity(fast * random_.unit() * (random_.chance(10) ? 2.0 : 1.0)));
    const double way = sign() * (0.2 + 8.0 * random_.unit());
    write_here(0x607A, position(way), 0, via());
    const auto how = static_cast<std::uint16_t>(0x0F | (random_.chance(40) ? 0x20 : 0));
    now_ += cycle_ticks() + 16;
    control(static_cast<std::uint16_t>(how | 0x10));
    now_ += cycle_ticks() + 16;
    control(how);
    wait(10, 250);
    switch (random_.below(8)) {
      case 0: stop(); break;
      case 1: limit(); break;
      case 2: bench(); break;
      default: break;
    }
  }
  write(0x6082, 0);
  if (random_.chance(50)) set_point();
  wait(50, 300);
}

// The master's heartbeat (1016h) stops while the axis moves, and starts again.
void Generator::lost_master() {
  constexpr std::int64_t master = 127;
  const std::int64_t period = random_.within(5, 20);
  add({.kind = Kind::heartbeat, .value = period});
  write(0x1016, master << 16 | period * random_.within(2, 4), 1);
  if (variant().has_object(0x6007) && random_.chance(70)) write(0x6007, random_.within(0, 3));
  if (random_.chance(40)) write(0x605E, random_.within(0, 4));
  enable();
  move();
  wait(30, 200);
  add({.kind = Kind::heartbeat, .value = 0});
  wait(10, 200);
  if (random_.chance(40)) move();
  if (random_.chance(30)) stop();
  add({.kind = Kind::heartbeat, .value = period});
  wait(20, 150);
  add({.kind = Kind::enable});
  wait(50, 200);
  if (random_.chance(70)) {
    write(0x1016, 0, 1);
    wait(2, 20);
    add({.kind = Kind::heartbeat, .value = 0});
  }
}

// 6007h, and a change of the bus state while the axis moves.
void Generator::aborted_connection() {
  write(0x6007, random_.within(0, 3));
  if (random_.chance(30)) write(0x605E, random_.within(0, 4));
  enable();
  move();
  wait(20, 200);
  network();
  if (random_.chance(30)) {
    wait(1, 40);
    move();
  }
  wait(20, 200);
  add({.kind = Kind::enable});
  wait(50, 200);
}

// Homing without motion presets a position near an end of the 32-bit range of 6064h; motions then cross that end.
void Generator::far_positions() {
  static constexpr std::array<std::int8_t, 2> on_the_spot{35, 37};
  std::int64_t method = 0;
  for (const std::int8_t one : on_the_spot) {
    for (const std::uint16_t has : variant().homing_methods) {
      if (static_cast<std::int8_t>(has) == one) method = one;
    }
  }
  if (method == 0 || !set_mode(Mode::homing)) return;
  const std::int64_t beside = position(random_.unit() * (random_.chance(30) ? 0.1 : 4.0));
  write(0x607C, random_.chance(50) ? 2147483647 - beside : -2147483648LL + beside);
  write(0x6098, method);
  enable();
  control(0x1F);
  wait(10, 60);
  control(0x0F);
  static constexpr std::array modes{Mode::profile_position,     Mode::profile_position,      Mode::profile_velocity,
                                    Mode::cyclic_sync_position, Mode::interpolated_position, Mode::homing};
  if (const Mode chosen = random_.of(modes); !set_mode(chosen)) return;
  wait(5, 60);
  if (random_.chance(30)) {
    write_here(0x607D, position(-0.5 - 4.0 * random_.unit()), low_limit());
    write_here(0x607D, position(0.5 + 4.0 * random_.unit()), high_limit());
  }
  if (mode() == Mode::cyclic_sync_position || mode() == Mode::interpolated_position) {
    target_here(0);
    add({.kind = Kind::enable});
  }
  for (std::int64_t n = random_.within(1, 3); n > 0; --n) {
    if (mode() == Mode::profile_position && random_.chance(60)) {
      set_point_at_once(1.0 + 6.0 * random_.unit());
    } else {
      move();
    }
    wait(50, 300);
    if (random_.chance(25)) stop();
  }
  wait(20, 200);
}

// Drives the axis against a hard stop in different modes, and away again.
void Generator::into_hard_stop() {
  static constexpr std::array modes{Mode::profile_position,    Mode::profile_position, Mode::profile_velocity,
                                    Mode::profile_torque,      Mode::homing,           Mode::cyclic_sync_position,
                                    Mode::cyclic_sync_velocity};
  const bool ends = sequence_.axes[axis_].stop_counts != 0;
  if (!ends || !set_mode(random_.of(modes))) return;
  if (random_.chance(40)) write(0x6072, random_.within(1, 10) * 100);
  enable();
  const double direction = sign();
  switch (mode()) {
    case Mode::profile_position:
      write(0x6081, velocity(variant().max_speed_rpm / 60.0 * (0.05 + 0.3 * random_.unit())));
      set_point_at_once(10.0 + 20.0 * random_.unit());
      break;
    case Mode::profile_velocity:
    case Mode::cyclic_sync_velocity:
      write(0x60FF, velocity(direction * variant().max_speed_rpm / 60.0 * (0.05 + 0.3 * random_.unit())));
      break;
    default: move();
  }
  wait(100, 600);
  random_.chance(50) ? stop() : move();
  wait(50, 300);
  add({.kind = Kind::enable});
  wait(20, 200);
  move();
  wait(50, 200);
}

// Arms touch probes, once or continuously, for edges of an input or of the index, while the axis moves.
void Generator::touch_probes() {
  const std::int64_t first_wire = 3;  // the first of two probe inputs
  if (is("generic402") && random_.chance(70)) {
    write(0x2030, static_cast<std::int64_t>(drive::Signal::probe_1), static_cast<std::uint8_t>(first_wire + 1));
    write(0x2030, static_cast<std::int64_t>(drive::Signal::probe_2), static_cast<std::uint8_t>(first_wire + 2));
  }
  add({.kind = Kind::enable});
  const auto arm = [&] {
    // The byte of a probe in 60B8h: on, once or continuously, input or index, edges.
    const auto one = [&] {
      return 1 | random_.below(2) << 1 | (random_.chance(40) ? 1 : 0) << 2 | random_.below(4) << 4;
    };
    write(0x60B8, random_.chance(10) ? 0 : one() | (random_.chance(50) ? one() : 0) << 8);
  };
  arm();
  wait(5, 120);
  move();
  for (std::int64_t n = random_.within(2, 6); n > 0; --n) {
    pause();
    switch (random_.below(6)) {
      case 0: arm(); break;
      case 1: move(); break;
      case 2: stop(); break;
      default: add({.kind = Kind::input, .value = random_.below(2), .count = first_wire + random_.below(2)});
    }
  }
  wait(10, 100);
}

// Writes the same objects several times within a cycle of the drive.
void Generator::several_writes() {
  if (random_.chance(60)) add({.kind = Kind::enable});
  if (random_.chance(60)) wait(20, 140);
  for (std::int64_t rounds = random_.within(1, 4); rounds > 0; --rounds) {
    if (random_.chance(50)) now_ += 8 - now_ % 8;  // at a position-loop cycle, or between two
    for (std::int64_t n = random_.within(2, 6); n > 0; --n) {
      static constexpr std::array<std::uint16_t, 12> words{0x0F, 0x1F, 0x3F, 0x0F, 0x10F, 0x07,
                                                           0x06, 0x02, 0x1F, 0x5F, 0x00,  0x8F};
      switch (random_.below(7)) {
        case 0:
        case 1:
        case 2: control(random_.of(words)); break;
        case 3: write_here(0x607A, distance(), 0, via()); break;
        case 4: write(0x60FF, signed_speed()); break;
        case 5: change_mode(); break;
        default: limit();
      }
      if (random_.chance(25)) now_ += random_.within(1, 3);
    }
    wait(1, 120);
  }
  wait(20, 200);
}

// Bit 4 of the controlword is set before the axis has power: with the word that enables it, or with an earlier one.
void Generator::bit_4_before_enabling() {
  static constexpr std::array modes{Mode::profile_position, Mode::profile_position, Mode::homing,
                                    Mode::interpolated_position};
  if (!set_mode(random_.of(modes))) return;
  control(0x06);
  wait(20, 200);
  if (mode() == Mode::profile_position) write_here(0x607A, distance(), 0, via());
  if (mode() == Mode::interpolated_position) target_here(random_.chance(50) ? 0 : distance());
  now_ += cycle_ticks() + 16;
  static constexpr std::array<std::uint16_t, 3> before{0x16, 0x17, 0x07};
  control(random_.of(before));
  wait(5, 40);
  if (random_.chance(50)) {
    control(0x17);
    wait(1, 20);
  }
  control(0x1F);
  wait(10, 200);
  if (random_.chance(50)) {
    control(0x0F);
    now_ += cycle_ticks() + 16;
    control(0x1F);
  }
  wait(20, 150);
  if (random_.chance(40)) stop();
  wait(20, 150);
}

// Homing mode is selected while the axis moves, and not started. The axis must come to rest within its limits.
void Generator::homing_not_started() {
  static constexpr std::array modes{Mode::profile_position, Mode::profile_velocity, Mode::profile_velocity,
                                    Mode::cyclic_sync_velocity, Mode::profile_torque};
  if (!variant().has(Mode::homing) || !set_mode(random_.of(modes))) return;
  if (random_.chance(50)) write(0x609A, ramp());
  enable();
  mode() == Mode::profile_position ? set_point_at_once(5.0 + 30.0 * random_.unit()) : move();
  wait(30, 200);
  const bool limits = random_.chance(50);
  const auto around = [&] {
    write_here(0x607D, position(-0.2 - 3.0 * random_.unit()), low_limit());
    write_here(0x607D, position(0.2 + 3.0 * random_.unit()), high_limit());
  };
  if (limits && random_.chance(50)) around();
  set_mode(Mode::homing);
  wait(1, 60);
  if (limits) around();
  const std::int64_t wire = limit_wire();
  const bool meets = random_.chance(40);
  if (meets) add({.kind = Kind::input, .value = 1, .count = wire});
  wait(20, 300);
  if (random_.chance(40)) control(0x1F);
  wait(1, 100);
  if (random_.chance(40)) stop();
  if (meets) add({.kind = Kind::input, .value = 0, .count = wire});
  wait(20, 200);
}

// Mode 0 while the axis moves, and another mode before or after the axis stands.
void Generator::mode_of_none() {
  if (mode() == Mode::none || random_.chance(40)) change_mode();
  enable();
  mode() == Mode::profile_position ? set_point_at_once(5.0 + 30.0 * random_.unit()) : move();
  wait(20, 200);
  if (random_.chance(30)) {
    write_here(0x607D, position(-0.2 - 3.0 * random_.unit()), low_limit());
    write_here(0x607D, position(0.2 + 3.0 * random_.unit()), high_limit());
  }
  write(0x6060, 0);
  wait(1, 200);
  if (random_.chance(30)) stop();
  if (random_.chance(30)) bench();
  const Mode before = mode();
  random_.chance(60) && before != Mode::none ? write(0x6060, static_cast<std::int8_t>(before)) : change_mode();
  wait(20, 200);
  if (random_.chance(50)) move();
  wait(20, 200);
}

// A fault with a long reaction, during which the supply of the electronics or of the motor fails.
void Generator::power_cut_in_reaction() {
  using plant::Injection;
  static constexpr std::array modes{Mode::profile_velocity, Mode::profile_position, Mode::cyclic_sync_velocity};
  static constexpr std::array faults{Injection::winding_overheat, Injection::stage_overheat,
                                     Injection::encoder_overheat, Injection::ambient_hot};
  if (!set_mode(random_.of(modes))) return;
  write(0x605E, random_.within(1, 2));
  write(0x6084, acceleration(20.0 + 100.0 * random_.unit()));
  write(0x6085, acceleration(20.0 + 100.0 * random_.unit()));
  enable();
  mode() == Mode::profile_position ? set_point_at_once(10.0 + 30.0 * random_.unit()) : write(0x60FF, signed_speed());
  wait(60, 300);
  const auto fault = static_cast<std::int64_t>(random_.of(faults));
  add({.kind = Kind::inject, .value = 1, .count = fault});
  wait(1, 60);
  const bool whole = random_.chance(40);  // the fault ends before the supply fails
  if (whole) add({.kind = Kind::inject, .value = 0, .count = fault});
  if (random_.chance(30)) add({.kind = Kind::enable});
  wait(0, 20);
  if (random_.chance(80)) {
    add({.kind = Kind::power, .value = 0});
    wait(1, 80);
    if (!whole) add({.kind = Kind::inject, .value = 0, .count = fault});
    add({.kind = Kind::power, .value = 1});
    wait(2, 40);
  } else {
    add({.kind = Kind::supply, .value = 0});
    wait(20, 200);
    if (!whole) add({.kind = Kind::inject, .value = 0, .count = fault});
    add({.kind = Kind::supply, .value = 1000});
    wait(20, 100);
  }
  add({.kind = Kind::enable});
  wait(50, 300);
  if (random_.chance(50)) move();
  wait(20, 200);
}

}  // namespace servodrome::motion
