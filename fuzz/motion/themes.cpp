#include <algorithm>
#include <cmath>

#include "generator.hpp"

// Themes of stops, limits and cyclic targets.
namespace servodrome::motion {

using drive::Mode;

// Sets a ramp or the profile velocity to 0, commands a motion or a stop, and perhaps sets another value.
void Generator::ramp_of_zero() {
  static constexpr std::array<std::uint16_t, 5> ramps{0x6081, 0x6083, 0x6084, 0x6085, 0x609A};
  const std::uint16_t index = random_.of(ramps);
  const bool far = random_.chance(40) && set_mode(Mode::profile_position);
  if (far) {
    add({.kind = Kind::enable});
    wait(10, 120);
    set_point_at_once(20.0 + 40.0 * random_.unit());
  } else if (random_.chance(50)) {
    move();
  }
  wait(1, 200);
  write(index, 0);
  wait(1, 20);
  if (far && random_.chance(60)) {
    set_point_at_once(20.0 + 40.0 * random_.unit());
  } else {
    random_.chance(60) ? move() : stop();
  }
  wait(50, 500);
  if (random_.chance(50)) write(index, ramp());
  wait(50, 300);
}

// A target velocity, then 0.
void Generator::speed_and_none() {
  if (!set_mode(Mode::profile_velocity)) return;
  enable();
  write(0x60FF, signed_speed());
  wait(50, 300);
  if (random_.chance(50)) write(random_.chance(50) ? 0x6083 : 0x6084, ramp());
  write(0x60FF, 0);
  wait(300, 700);
}

// The axis meets a limit switch, which opens again later.
void Generator::switch_that_opens_again() {
  enable();
  move();
  wait(20, 200);
  const line::SwitchWiring& wiring = variant().product->wiring;
  const std::int64_t wire = limit_wire();
  add({.kind = Kind::input, .value = 1, .count = wire});
  wait(200, 450);
  if (random_.chance(30)) move();
  if (mode() == Mode::profile_position && random_.chance(60)) {  // and a motion away from it
    wait(5, 50);
    const double way = (wire == wiring.negative_limit ? 1.0 : -1.0) * (0.4 + 4.0 * random_.unit());
    write(0x607A, position(way));
    now_ += 24;
    control(0x5F);
    now_ += 24;
    control(0x4F);
    wait(150, 500);
  }
  add({.kind = Kind::input, .value = 0, .count = wire});
  wait(50, 300);
}

// Sets software limits around the axis while it moves.
void Generator::software_limits_around() {
  static constexpr std::array modes{Mode::profile_position,     Mode::profile_position,      Mode::profile_velocity,
                                    Mode::cyclic_sync_position, Mode::interpolated_position, Mode::cyclic_sync_velocity,
                                    Mode::profile_torque,       Mode::cyclic_sync_torque};
  // Software limits act in a special way on buffered records, so this mode is drawn more often.
  const bool buffers = variant().records && variant().has(Mode::interpolated_position);
  if (!set_mode(buffers && random_.chance(30) ? Mode::interpolated_position : random_.of(modes))) return;
  enable();
  const bool record = mode() == Mode::interpolated_position && by_record() && random_.chance(80);
  if (mode() == Mode::profile_torque || mode() == Mode::cyclic_sync_torque) {
    write(0x6071, random_.within(20, 200) * (random_.chance(50) ? 1 : -1));
  } else if (record) {
    write(0x60C2, random_.within(100, 250), 1);  // a long period for the record
    write(0x60C2, -3, 2);
    wait(2, 10);
    control(0x1F);
    const double way = sign() * (2.0 + 6.0 * random_.unit());
    write_here(0x60C1, position(way), 1);
  } else if (mode() == Mode::cyclic_sync_position || mode() == Mode::interpolated_position) {
    stream();
  } else if (mode() == Mode::profile_position) {
    write_here(0x607A, position(sign() * (5.0 + 20.0 * random_.unit())), 0, via());
    now_ += 16;
    control(0x1F);
    now_ += 16;
    control(0x0F);
  } else {
    write(0x60FF, signed_speed());
  }
  wait(20, record ? 60 : 200);
  const double room = record ? 0.2 + random_.unit() : 0.5 + 4.0 * random_.unit();
  write_here(0x607D, position(-room), low_limit());
  write_here(0x607D, position(room), high_limit());
  if (random_.chance(40)) {  // and a slow stop before the limits
    write(0x6084, acceleration(10.0 + 90.0 * random_.unit()));
    wait(1, 60);
    static constexpr std::array<std::uint16_t, 3> words{0x10F, 0x07, 0x06};
    control(random_.of(words));
  }
  wait(200, 600);
}

// A jump of the target in a cyclic mode, and a stop shortly after it.
void Generator::jump_and_stop() {
  if (!set_mode(random_.chance(70) ? Mode::cyclic_sync_position : Mode::interpolated_position)) return;
  target_here(0);
  add({.kind = Kind::enable});
  wait(20, 140);
  if (mode() == Mode::interpolated_position) control(0x1F);
  target_here(distance());
  now_ += random_.within(8, 64);
  static constexpr std::array<std::uint16_t, 5> words{0x02, 0x06, 0x07, 0x10F, 0x0F};
  control(random_.of(words));
  wait(100, 500);
}

// A halt or a limit switch in the middle of a stream of targets.
void Generator::halt_in_stream() {
  if (!set_mode(random_.chance(70) ? Mode::cyclic_sync_position : Mode::interpolated_position)) return;
  target_here(0);
  add({.kind = Kind::enable});
  wait(20, 140);
  if (mode() == Mode::interpolated_position) control(0x1F);
  target_here(0);
  const double cycle_s = static_cast<double>(sequence_.cycle_us) * 1e-6;
  const std::int64_t step = position((random_.unit() - 0.5) * 20.0 * cycle_s);
  add({.kind = Kind::stream,
       .index = target_index(),
       .value = step,
       .count = random_.within(50, 500),
       .gap = random_.chance(30) ? 7 : 0});
  wait(10, 100);
  if (random_.chance(50)) {
    control(0x10F);
    wait(5, 150);
    control(mode() == Mode::interpolated_position ? 0x1F : 0x0F);
  } else {
    const line::SwitchWiring& wiring = variant().product->wiring;
    const std::int64_t wire = (step < 0) ? wiring.negative_limit : wiring.positive_limit;
    add({.kind = Kind::input, .value = 1, .count = wire});
    wait(20, 300);
    if (random_.chance(50)) {  // and a stream away from it
      const std::int64_t back = step < 0 ? 1 : -1;
      target_here(back * std::abs(position(0.2)));
      add({.kind = Kind::stream,
           .index = target_index(),
           .value = back * std::abs(position((2.0 + 6.0 * random_.unit()) * cycle_s)),
           .count = 200'000 / sequence_.cycle_us});
      wait(250, 600);
    }
    if (random_.chance(60)) add({.kind = Kind::input, .value = 0, .count = wire});
  }
  wait(50, 300);
}

// A single set-point, with time to reach it.
void Generator::lone_set_point() {
  if (!set_mode(Mode::profile_position)) return;
  add({.kind = Kind::enable});
  wait(50, 200);
  set_point();
  wait(100, 600);
}

// A target torque, and a stop while it turns the axis.
void Generator::torque_and_stop() {
  if (!set_mode(random_.chance(70) ? Mode::profile_torque : Mode::cyclic_sync_torque)) return;
  enable();
  write(0x6087, random_.chance(30) ? 0 : random_.within(300, 10000));
  write(0x6071, random_.within(50, 300) * (random_.chance(50) ? 1 : -1));
  wait(50, 200);
  static constexpr std::array<std::uint16_t, 6> words{0x10F, 0x10F, 0x10F, 0x02, 0x06, 0x07};
  control(random_.of(words));
  wait(50, 300);
  if (random_.chance(50)) add({.kind = Kind::enable});
  wait(50, 150);
}

// A halt that ends before the axis stands.
void Generator::halt_taken_back() {
  if (!set_mode(random_.chance(50) ? Mode::profile_position : Mode::profile_velocity)) return;
  write(0x605D, random_.within(1, 4));
  enable();
  if (mode() == Mode::profile_position) {
    set_point_at_once(10.0 + 40.0 * random_.unit());
  } else {
    write(0x60FF, signed_speed());
  }
  for (std::int64_t n = random_.within(1, 3); n > 0; --n) {
    wait(60, 200);
    control(0x10F);
    wait(4, 60);
    control(0x0F);
  }
  wait(50, 200);
}

// Enables the axis again after a motion and a stop.
void Generator::enable_twice() {
  move();
  wait(10, 200);
  stop();
  wait(1, 200);
  add({.kind = Kind::enable});
  wait(100, 400);
}

// A speed limit below the commanded speed, written while the axis turns or before.
void Generator::lowered_speed() {
  static constexpr std::array modes{Mode::profile_velocity, Mode::cyclic_sync_velocity, Mode::cyclic_sync_velocity,
                                    Mode::cyclic_sync_position, Mode::profile_position};
  if (!set_mode(random_.of(modes))) return;
  const double direction = sign();
  const double speed = variant().max_speed_rpm / 60.0 * (0.2 + 0.5 * random_.unit());
  const double limit = speed * (0.1 + 0.7 * random_.unit());
  const bool before = random_.chance(30);
  const auto lower = [&] {
    if (mode() == Mode::profile_velocity && random_.chance(50)) return write(0x607F, velocity(limit));
    write(0x6080, std::max<std::int64_t>(1, std::llround(limit * 60.0)));
  };
  if (before) lower();
  if (mode() == Mode::cyclic_sync_position) write_here(0x607A, 0, 0, Via::pdo);
  add({.kind = Kind::enable});
  wait(10, 120);
  if (mode() == Mode::cyclic_sync_position) {
    write_here(0x607A, 0, 0, Via::pdo);
    const double cycle_s = static_cast<double>(sequence_.cycle_us) * 1e-6;
    add({.kind = Kind::stream,
         .index = 0x607A,
         .value = position(direction * speed * cycle_s),
         .count = 700'000 / sequence_.cycle_us});
  } else if (mode() == Mode::profile_position) {
    write(0x6081, velocity(speed));
    set_point_at_once(60.0);
  } else {
    write(0x60FF, velocity(direction * speed));
  }
  wait(60, 200);
  if (!before) lower();
  wait(150, 450);
  if (random_.chance(30)) control(0x10F);
}

// A cyclic mode begins with a target away from the axis, so near that a fast axis could reach it in one period.
void Generator::far_first_target() {
  if (!set_mode(random_.chance(70) ? Mode::cyclic_sync_position : Mode::interpolated_position)) return;
  interpolation_period();
  add({.kind = Kind::enable});
  wait(60, 140);
  control(0x07);
  const double greatest = variant().max_speed_rpm / 60.0 * static_cast<double>(sequence_.cycle_us) * 1e-6;
  const double way = greatest * (0.2 + 0.7 * random_.unit()) * sign();
  wait(20, 60);
  target_here(position(way));
  wait(5, 20);
  control(mode() == Mode::interpolated_position ? 0x1F : 0x0F);
  wait(20, 140);
  add({.kind = Kind::stream, .index = target_index(), .value = 0, .count = random_.within(10, 50)});
  wait(50, 150);
}

// A master moves the axis from rest to rest in a cyclic mode, by steeper ramps than the profile's. At one point
// its targets pause (they are late or lost), and the drive must catch up with them.
void Generator::interrupted_travel() {
  if (!set_mode(random_.chance(70) ? Mode::cyclic_sync_position : Mode::interpolated_position)) return;
  const std::int64_t gentle = acceleration(5.0 + 45.0 * random_.unit());
  write(0x6083, gentle);
  write(0x6084, random_.chance(70) ? gentle : gentle * 4);
  add({.kind = Kind::enable});
  wait(20, 140);
  if (mode() == Mode::interpolated_position) control(0x1F);
  target_here(0);
  const double cycle_s = static_cast<double>(sequence_.cycle_us) * 1e-6;
  const double speed = variant().max_speed_rpm / 60.0 * (0.1 + 0.4 * random_.unit());
  const double step = variant().position(sign() * speed * cycle_s);
  const auto travel = [&](double share, std::int64_t milliseconds) {
    const std::int64_t cycles = std::max<std::int64_t>(1, milliseconds * 1000 / sequence_.cycle_us);
    add({.kind = Kind::stream, .index = target_index(), .value = std::llround(share * step), .count = cycles});
    now_ += cycles * sequence_.cycle_us * ticks_per_ms / 1000;
  };
  const std::int64_t stairs = random_.within(4, 12);
  const std::int64_t stair_ms = random_.within(2, 12);
  const auto pause = [&] {
    const std::int64_t cycles = random_.within(2, 60'000 / sequence_.cycle_us + 2);
    if (random_.chance(50)) add({.kind = Kind::cycle, .value = 2, .count = cycles});
    now_ += cycles * sequence_.cycle_us * ticks_per_ms / 1000;
  };
  const std::int64_t paused_at = random_.below(stairs + 2);
  for (std::int64_t i = 1; i < stairs; ++i) {
    travel(static_cast<double>(i) / static_cast<double>(stairs), stair_ms);
    if (i == paused_at) pause();
  }
  travel(1.0, random_.within(5, 60));
  if (paused_at >= stairs) pause();
  travel(1.0, random_.within(5, 250));
  for (std::int64_t i = stairs; --i > 0;) travel(static_cast<double>(i) / static_cast<double>(stairs), stair_ms);
  wait(100, 900);
}

}  // namespace servodrome::motion
