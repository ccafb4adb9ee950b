#include <algorithm>
#include <array>

#include "generator.hpp"

// The start of an axis, the choice of a step, and the steps that set modes, limits and the state of the network.
namespace servodrome::motion {

using drive::Mode;

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

}  // namespace servodrome::motion
