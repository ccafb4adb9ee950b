#include "generate.hpp"

#include <algorithm>
#include <cmath>

#include "plant/injection.hpp"

namespace servodrome::motion {
namespace {

using drive::Mode;

constexpr unsigned least_steps = 3;  // of a sequence

// Draws one sequence: mostly what masters do in a sensible order, mixed with what none should do.
class Generator {
 public:
  Generator(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants, Tree tree)
      : random_(seed, number / tree.leaves()), variants_(variants), seed_(seed), number_(number), tree_(tree) {}

  Drawn draw() {
    const Variant& first = random_.of(variants_);
    const int count = random_.chance(85) ? 1 : static_cast<int>(random_.within(2, 3));
    const bool alike = random_.chance(35);
    for (int i = 0; i < count; ++i) add_axis(i == 0 || alike ? first : neighbour(first));
    static constexpr std::array<std::int64_t, 8> cycles{1000, 1000, 2000, 4000, 500, 250, 3333, 10000};
    sequence_.cycle_us = random_.of(cycles);
    sequence_.sync = random_.chance(50);
    // jmc_ec refuses a SYNC0 that is no multiple of 250 us.
    if (first.on_ethercat() && sequence_.cycle_us == 3333) sequence_.sync = false;
    sequence_.mapped = random_.chance(first.on_ethercat() ? 85 : 70);
    const auto axes = static_cast<std::uint8_t>(sequence_.axes.size());
    for (std::uint8_t i = 0; i < axes; ++i) begin(i);
    for (std::int64_t n = random_.within(least_steps, 14); n > 0; --n) {
      if (n <= static_cast<std::int64_t>(tree_.levels)) fork(tree_.levels - static_cast<unsigned>(n));
      axis_ = static_cast<std::uint8_t>(random_.below(axes));
      // Where a beginning is shared, the rest is most of the work: seldom a long story, and a look at what follows.
      const bool alone = tree_.levels > 0 && n == 1;
      if (random_.chance(alone ? 4 : 12)) {
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

 private:
  struct DrawnAxis {
    const Variant* variant = nullptr;
    Mode mode = Mode::none;
  };

  // From here on the numbers are those of this part of the tree.
  void fork(unsigned level) {
    random_ = Random(seed_ + (level + 1) * 0x9E3779B97F4A7C15ULL, number_ / tree_.leaves(level + 1));
    forks_.push_back(now_);
  }

  bool is_ismk() const { return std::string_view(variant().product->name).starts_with("ismk"); }
  std::uint8_t low_limit() const { return is_ismk() ? 2 : 1; }  // sub-index of 607Dh
  std::uint8_t high_limit() const { return is_ismk() ? 1 : 2; }
  const Variant& variant() const { return *drawn_[axis_].variant; }
  Mode& mode() { return drawn_[axis_].mode; }

  const Variant& neighbour(const Variant& first) {
    for (;;) {
      const Variant& other = random_.of(variants_);
      if (other.on_ethercat() == first.on_ethercat()) return other;
    }
  }

  void add_axis(const Variant& variant) {
    AxisSetup axis;
    axis.product = variant.product->name;
    axis.model = variant.model;
    const double turn = variant.units.counts_per_revolution;
    if (random_.chance(60)) axis.start_counts = std::llround(turn * (random_.unit() * 8.0 - 4.0));
    // A drive that is not told of the load's inertia has loops for one like its own: a much greater one makes them
    // swing.
    const bool told = variant.model.empty();
    static constexpr std::array<std::int64_t, 6> inertias{100, 100, 100, 20, 300, 1000};
    static constexpr std::array<std::int64_t, 5> frictions{100, 100, 0, 300, 1000};
    axis.inertia_percent = told ? random_.of(inertias) : std::min<std::int64_t>(random_.of(inertias), 150);
    axis.friction_percent = random_.of(frictions);
    if (random_.chance(25)) axis.travel_counts = std::llround(turn * (4.0 + random_.unit() * 8.0));
    sequence_.axes.push_back(axis);
    drawn_.push_back({&variant});
  }

  // --- Time

  void pause() {
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

  Event& add(Event event) {
    event.tick = now_;
    event.axis = axis_;
    sequence_.events.push_back(event);
    return sequence_.events.back();
  }
  Via via() { return random_.chance(55) ? Via::pdo : random_.chance(60) ? Via::sdo : Via::direct; }
  void write(std::uint16_t index, std::int64_t value, std::uint8_t sub = 0) {
    add({.kind = Kind::write, .via = via(), .index = index, .sub = sub, .value = value});
  }
  void control(std::uint16_t word) { write(0x6040, word); }

  static std::int64_t to_i32(double value) {
    return static_cast<std::int64_t>(std::clamp(value, -2147483648.0, 2147483647.0));
  }
  static std::int64_t to_u32(double value) { return static_cast<std::int64_t>(std::clamp(value, 0.0, 4294967295.0)); }

  // --- Values, in the drive's units

  std::int64_t distance() {
    static constexpr std::array revolutions{0.0, 0.001, 0.05, 0.3, 1.0, 2.0, 5.0, 20.0, 200.0};
    double value = random_.of(revolutions) * (0.5 + random_.unit());
    if (random_.chance(50)) value = -value;
    if (random_.chance(3)) return random_.chance(50) ? 2147483647 : -2147483648LL;
    return to_i32(variant().position(value));
  }
  std::int64_t speed() {
    static constexpr std::array shares{0.0, 0.001, 0.02, 0.1, 0.3, 0.6, 1.0, 1.5};
    const double value = random_.of(shares) * (0.5 + 0.5 * random_.unit()) * variant().max_speed_rpm / 60.0;
    if (random_.chance(3)) return 2147483647;
    return to_i32(variant().velocity(value));
  }
  std::int64_t signed_speed() {
    const std::int64_t value = speed();
    return random_.chance(50) ? -value : value;
  }
  std::int64_t ramp() {
    if (random_.chance(7)) return 0;
    if (random_.chance(3)) return 1;
    if (random_.chance(3)) return 0xFFFFFFFF;
    static constexpr std::array values{10.0, 50.0, 200.0, 500.0, 1000.0, 3000.0, 20000.0};
    return std::max<std::int64_t>(1, to_u32(variant().acceleration(random_.of(values) * (0.5 + random_.unit()))));
  }
  std::int64_t torque() {
    static constexpr std::array<std::int64_t, 8> values{0, 20, 100, 300, 600, 1000, 2000, 3000};
    const std::int64_t value = random_.of(values);
    return random_.chance(50) ? -value : value;
  }

  // --- What a master does

  void begin(std::uint8_t axis) {
    axis_ = axis;
    now_ = std::max<std::int64_t>(now_, 16);
    if (is_ismk()) wire_switches();
    if (random_.chance(92)) {  // quick enough to see something
      write(0x6081, to_u32(variant().velocity(variant().max_speed_rpm / 60.0 * (0.1 + 0.5 * random_.unit()))));
      const double acceleration = 100.0 + 900.0 * random_.unit();
      write(0x6083, to_u32(variant().acceleration(acceleration)));
      write(0x6084, to_u32(variant().acceleration(acceleration * (0.5 + random_.unit()))));
      write(0x6085, to_u32(variant().acceleration(acceleration * (0.8 + 2.0 * random_.unit()))));
      if (variant().product->name == "jmc_ec") {
        // Its factory limits forbid nearly all motion.
        write(0x607F, to_u32(variant().velocity(variant().max_speed_rpm / 60.0)));
        write(0x60C5, to_u32(variant().acceleration(4000.0)));
        write(0x60C6, to_u32(variant().acceleration(4000.0)));
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

  // The iSMK's inputs have no function from the factory, and its limit switches are active when open.
  void wire_switches() {
    struct Row {
      std::uint8_t sub;
      std::int64_t value;
    };
    static constexpr std::array rows{Row{1, 0xFFFC}, Row{3, 0x20}, Row{4, 0x10}, Row{5, 0x40}};
    for (const Row& row : rows)
      add({.kind = Kind::write, .via = Via::direct, .index = 0x2010, .sub = row.sub, .value = row.value});
  }

  // 60C2h as it is right for the master's cycle; one of 3.333 ms is rounded.
  void interpolation_period() {
    std::int64_t value = sequence_.cycle_us;
    std::int64_t exponent = -6;
    while (value > 255 || value % 10 == 0) {
      value = (value + 5) / 10;
      ++exponent;
    }
    write(0x60C2, value, 1);
    write(0x60C2, exponent, 2);
  }

  void change_mode() {
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

  void step() {
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

  void move() {
    switch (mode()) {
      case Mode::profile_position: return set_point();
      case Mode::profile_velocity:
      case Mode::immediate_velocity:
        if (random_.chance(20)) return write(0x60FF, 0);
        return write(0x60FF, signed_speed());
      case Mode::velocity: return write(0x6042, random_.within(-3000, 3000));
      case Mode::profile_torque: return write(0x6071, torque());
      case Mode::homing: return home();
      case Mode::interpolated_position:
      case Mode::cyclic_sync_position:
      case Mode::cyclic_sync_velocity:
      case Mode::cyclic_sync_torque: return stream();
      default: set_point();
    }
  }

  void set_point() {
    if (random_.chance(10)) write(0x6081, speed());
    std::uint16_t word = 0x0F;
    if (random_.chance(50)) word |= 0x20;  // at once
    if (random_.chance(40)) {
      word |= 0x40;
      write(0x607A, distance());
    } else if (random_.chance(75)) {
      add({.kind = Kind::write_here, .via = via(), .index = 0x607A, .value = distance()});
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

  void home() {
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

  // Interpolated position has an object of its own for it in some products.
  bool by_record() const { return drawn_[axis_].mode == Mode::interpolated_position && variant().records; }
  std::uint16_t target_index() const { return by_record() ? 0x60C1 : 0x607A; }
  std::uint8_t target_sub() const { return by_record() ? 1 : 0; }

  void stream() {
    const double cycle_s = static_cast<double>(sequence_.cycle_us) * 1e-6;
    std::uint16_t index = 0x607A;
    std::int64_t step = 0;
    if (mode() == Mode::cyclic_sync_velocity) {
      index = 0x60FF;
      step = to_i32(variant().velocity((random_.unit() - 0.5) * 400.0 * cycle_s));
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
      step = to_i32(variant().position(revolutions_per_s * cycle_s));
    }
    const std::int64_t length = random_.within(2, 300);
    static constexpr std::array<std::int64_t, 6> gaps{0, 0, 0, 2, 5, 17};
    add({.kind = Kind::stream, .index = index, .value = step, .count = length, .gap = random_.of(gaps)});
    if (random_.chance(60)) now_ += random_.within(1, 1 + length) * sequence_.cycle_us * ticks_per_ms / 1000;
    if (random_.chance(15)) add({.kind = Kind::cycle, .value = 2, .count = random_.within(1, 4)});
  }

  void stop() {
    switch (random_.below(12)) {
      case 0:
      case 1: control(0x02); break;  // quick stop
      case 2: control(0x06); break;  // shutdown
      case 3: control(0x07); break;  // disable operation
      case 4: control(0x00); break;  // disable voltage
      case 5:
      case 6:
      case 7: control(0x10F); break;  // halt
      case 8: control(0x0F); break;   // and on
      case 9: control(static_cast<std::uint16_t>(0x80 | (random_.chance(50) ? 0x0F : 0x00))); break;
      case 10: control(static_cast<std::uint16_t>(random_.below(0x200))); break;
      default:
        control(0x10F);
        now_ += random_.within(1, 100) * ticks_per_ms;
        control(0x0F);
    }
    if (random_.chance(50)) now_ += random_.within(1, 200) * ticks_per_ms;
  }

  void limit() {
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
      case 9: {  // around where it is, beside it, or swapped
        const std::int64_t one = distance();
        const std::int64_t other = distance();
        const bool swapped = random_.chance(8);
        const std::int64_t low = swapped ? std::max(one, other) : std::min(one, other);
        const std::int64_t high = swapped ? std::min(one, other) : std::max(one, other);
        add({.kind = Kind::write_here, .via = Via::sdo, .index = 0x607D, .sub = low_limit(), .value = low});
        add({.kind = Kind::write_here, .via = Via::sdo, .index = 0x607D, .sub = high_limit(), .value = high});
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

  void bench() {
    const line::SwitchWiring& wiring = variant().product->wiring;
    switch (random_.below(14)) {
      case 0:
      case 1:
      case 2:
      case 3: {  // a limit switch, with or without a bounce
        const std::int64_t wire = random_.chance(50) ? wiring.negative_limit : wiring.positive_limit;
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

  void network() {
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

  void wait(std::int64_t least, std::int64_t most) { now_ += random_.within(least, most) * ticks_per_ms; }
  bool set_mode(Mode wanted) {
    if (!variant().has(wanted)) return false;
    mode() = wanted;
    write(0x6060, static_cast<std::int8_t>(wanted));
    return true;
  }

  // Several steps that belong together, with time for what follows from them.
  void theme() {
    static constexpr std::array<int, 16> themes{0, 1, 2, 3, 3, 4, 5, 6, 7, 8, 8, 9, 10, 11, 12, 12};
    switch (random_.of(themes)) {
      case 0: {  // a ramp of zero, a motion, and the ramp restored
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
        return wait(50, 300);
      }
      case 1: {  // a speed, then none
        if (!set_mode(Mode::profile_velocity)) return;
        add({.kind = Kind::enable});
        wait(10, 120);
        write(0x60FF, signed_speed());
        wait(50, 300);
        if (random_.chance(50)) write(random_.chance(50) ? 0x6083 : 0x6084, ramp());
        write(0x60FF, 0);
        return wait(300, 700);
      }
      case 2: {  // a limit switch that is met and opens again
        add({.kind = Kind::enable});
        wait(10, 120);
        move();
        wait(20, 200);
        const line::SwitchWiring& wiring = variant().product->wiring;
        const std::int64_t wire = random_.chance(50) ? wiring.negative_limit : wiring.positive_limit;
        add({.kind = Kind::input, .value = 1, .count = wire});
        wait(200, 450);
        if (random_.chance(30)) move();
        if (mode() == Mode::profile_position && random_.chance(60)) {  // and a way off it
          wait(5, 50);
          const double way = (wire == wiring.negative_limit ? 1.0 : -1.0) * (0.4 + 4.0 * random_.unit());
          write(0x607A, to_i32(variant().position(way)));
          now_ += 24;
          control(0x5F);
          now_ += 24;
          control(0x4F);
          wait(150, 500);
        }
        add({.kind = Kind::input, .value = 0, .count = wire});
        return wait(50, 300);
      }
      case 3: {  // software limits around a running motion
        static constexpr std::array modes{
            Mode::profile_position,      Mode::profile_position,     Mode::profile_velocity, Mode::cyclic_sync_position,
            Mode::interpolated_position, Mode::cyclic_sync_velocity, Mode::profile_torque,   Mode::cyclic_sync_torque};
        // Records that are buffered have limits of their own kind.
        const bool buffers = variant().records && variant().has(Mode::interpolated_position);
        if (!set_mode(buffers && random_.chance(30) ? Mode::interpolated_position : random_.of(modes))) return;
        add({.kind = Kind::enable});
        wait(10, 120);
        const bool record = mode() == Mode::interpolated_position && by_record() && random_.chance(80);
        if (mode() == Mode::profile_torque || mode() == Mode::cyclic_sync_torque) {
          write(0x6071, random_.within(20, 200) * (random_.chance(50) ? 1 : -1));
        } else if (record) {
          write(0x60C2, random_.within(100, 250), 1);  // a record that is long under way
          write(0x60C2, -3, 2);
          wait(2, 10);
          control(0x1F);
          const double way = (random_.chance(50) ? 1.0 : -1.0) * (2.0 + 6.0 * random_.unit());
          add({.kind = Kind::write_here,
               .via = Via::sdo,
               .index = 0x60C1,
               .sub = 1,
               .value = to_i32(variant().position(way))});
        } else if (mode() == Mode::cyclic_sync_position || mode() == Mode::interpolated_position) {
          stream();
        } else if (mode() == Mode::profile_position) {
          add({.kind = Kind::write_here,
               .via = via(),
               .index = 0x607A,
               .value = to_i32(variant().position((random_.chance(50) ? 1.0 : -1.0) * (5.0 + 20.0 * random_.unit())))});
          now_ += 16;
          control(0x1F);
          now_ += 16;
          control(0x0F);
        } else {
          write(0x60FF, signed_speed());
        }
        wait(20, record ? 60 : 200);
        const double room = record ? 0.2 + random_.unit() : 0.5 + 4.0 * random_.unit();
        add({.kind = Kind::write_here,
             .via = Via::sdo,
             .index = 0x607D,
             .sub = low_limit(),
             .value = to_i32(variant().position(-room))});
        add({.kind = Kind::write_here,
             .via = Via::sdo,
             .index = 0x607D,
             .sub = high_limit(),
             .value = to_i32(variant().position(room))});
        if (random_.chance(40)) {  // and a gentle stop before them
          write(0x6084, std::max<std::int64_t>(1, to_u32(variant().acceleration(10.0 + 90.0 * random_.unit()))));
          wait(1, 60);
          static constexpr std::array<std::uint16_t, 3> words{0x10F, 0x07, 0x06};
          control(random_.of(words));
        }
        return wait(200, 600);
      }
      case 4: {  // a jump in a cyclic mode, and a stop at once
        if (!set_mode(random_.chance(70) ? Mode::cyclic_sync_position : Mode::interpolated_position)) return;
        add({.kind = Kind::write_here, .via = Via::pdo, .index = target_index(), .sub = target_sub(), .value = 0});
        add({.kind = Kind::enable});
        wait(20, 140);
        if (mode() == Mode::interpolated_position) control(0x1F);
        add({.kind = Kind::write_here,
             .via = Via::pdo,
             .index = target_index(),
             .sub = target_sub(),
             .value = distance()});
        now_ += random_.within(8, 64);
        static constexpr std::array<std::uint16_t, 5> words{0x02, 0x06, 0x07, 0x10F, 0x0F};
        control(random_.of(words));
        return wait(100, 500);
      }
      case 5: {  // a halt in the middle of a stream
        if (!set_mode(random_.chance(70) ? Mode::cyclic_sync_position : Mode::interpolated_position)) return;
        add({.kind = Kind::write_here, .via = Via::pdo, .index = target_index(), .sub = target_sub(), .value = 0});
        add({.kind = Kind::enable});
        wait(20, 140);
        if (mode() == Mode::interpolated_position) control(0x1F);
        add({.kind = Kind::write_here, .via = Via::pdo, .index = target_index(), .sub = target_sub(), .value = 0});
        const double cycle_s = static_cast<double>(sequence_.cycle_us) * 1e-6;
        const std::int64_t step = to_i32(variant().position((random_.unit() - 0.5) * 20.0 * cycle_s));
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
          if (random_.chance(50)) {  // and back off it
            const std::int64_t back = step < 0 ? 1 : -1;
            add({.kind = Kind::write_here,
                 .via = Via::pdo,
                 .index = target_index(),
                 .sub = target_sub(),
                 .value = back * std::abs(to_i32(variant().position(0.2)))});
            add({.kind = Kind::stream,
                 .index = target_index(),
                 .value = back * std::abs(to_i32(variant().position((2.0 + 6.0 * random_.unit()) * cycle_s))),
                 .count = 200'000 / sequence_.cycle_us});
            wait(250, 600);
          }
          if (random_.chance(60)) add({.kind = Kind::input, .value = 0, .count = wire});
        }
        return wait(50, 300);
      }
      case 6: {  // a set-point that is met alone
        if (!set_mode(Mode::profile_position)) return;
        add({.kind = Kind::enable});
        wait(50, 200);
        set_point();
        return wait(100, 600);
      }
      case 8: return lowered_speed();
      case 9: {  // a torque, and a stop while it turns the axis
        if (!set_mode(random_.chance(70) ? Mode::profile_torque : Mode::cyclic_sync_torque)) return;
        add({.kind = Kind::enable});
        wait(10, 120);
        write(0x6087, random_.chance(30) ? 0 : random_.within(300, 10000));
        write(0x6071, random_.within(50, 300) * (random_.chance(50) ? 1 : -1));
        wait(50, 200);
        static constexpr std::array<std::uint16_t, 6> words{0x10F, 0x10F, 0x10F, 0x02, 0x06, 0x07};
        control(random_.of(words));
        wait(50, 300);
        if (random_.chance(50)) add({.kind = Kind::enable});
        return wait(50, 150);
      }
      case 10: return far_first_target();
      case 12: return interrupted_travel();
      case 11: {  // a halt that is taken back before the axis rests
        if (!set_mode(random_.chance(50) ? Mode::profile_position : Mode::profile_velocity)) return;
        write(0x605D, random_.within(1, 4));
        add({.kind = Kind::enable});
        wait(10, 120);
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
        return wait(50, 200);
      }
      default: {  // enable after enable
        move();
        wait(10, 200);
        stop();
        wait(1, 200);
        add({.kind = Kind::enable});
        return wait(100, 400);
      }
    }
  }

  // So many revolutions away, in either direction. Process data have to carry bit 4 for a cycle.
  void set_point_at_once(double revolutions) {
    const std::int64_t cycle = (sequence_.cycle_us * ticks_per_ms + 999) / 1000 + 16;
    const double way = random_.chance(50) ? revolutions : -revolutions;
    add({.kind = Kind::write_here, .via = via(), .index = 0x607A, .value = to_i32(variant().position(way))});
    now_ += cycle;
    control(0x3F);
    now_ += cycle;
    control(0x0F);
  }

  // A speed, and a limit of it that is lower: while the axis turns, or already before.
  void lowered_speed() {
    static constexpr std::array modes{Mode::profile_velocity, Mode::cyclic_sync_velocity, Mode::cyclic_sync_velocity,
                                      Mode::cyclic_sync_position, Mode::profile_position};
    if (!set_mode(random_.of(modes))) return;
    const double sign = random_.chance(50) ? 1.0 : -1.0;
    const double speed = variant().max_speed_rpm / 60.0 * (0.2 + 0.5 * random_.unit());
    const double limit = speed * (0.1 + 0.7 * random_.unit());
    const bool before = random_.chance(30);
    const auto lower = [&] {
      if (mode() == Mode::profile_velocity && random_.chance(50))
        return write(0x607F, to_u32(variant().velocity(limit)));
      write(0x6080, std::max<std::int64_t>(1, std::llround(limit * 60.0)));
    };
    if (before) lower();
    if (mode() == Mode::cyclic_sync_position)
      add({.kind = Kind::write_here, .via = Via::pdo, .index = 0x607A, .value = 0});
    add({.kind = Kind::enable});
    wait(10, 120);
    if (mode() == Mode::cyclic_sync_position) {
      add({.kind = Kind::write_here, .via = Via::pdo, .index = 0x607A, .value = 0});
      const double cycle_s = static_cast<double>(sequence_.cycle_us) * 1e-6;
      add({.kind = Kind::stream,
           .index = 0x607A,
           .value = to_i32(variant().position(sign * speed * cycle_s)),
           .count = 700'000 / sequence_.cycle_us});
    } else if (mode() == Mode::profile_position) {
      write(0x6081, to_u32(variant().velocity(speed)));
      set_point_at_once(60.0);
    } else {
      write(0x60FF, to_i32(variant().velocity(sign * speed)));
    }
    wait(60, 200);
    if (!before) lower();
    wait(150, 450);
    if (random_.chance(30)) control(0x10F);
  }

  // The target that a cyclic mode begins with lies where the old one was: a fast axis could be there in one period.
  void far_first_target() {
    if (!set_mode(random_.chance(70) ? Mode::cyclic_sync_position : Mode::interpolated_position)) return;
    interpolation_period();
    add({.kind = Kind::enable});
    wait(60, 140);
    control(0x07);
    const double greatest = variant().max_speed_rpm / 60.0 * static_cast<double>(sequence_.cycle_us) * 1e-6;
    const double way = greatest * (0.2 + 0.7 * random_.unit()) * (random_.chance(50) ? 1.0 : -1.0);
    wait(20, 60);
    add({.kind = Kind::write_here,
         .via = Via::pdo,
         .index = target_index(),
         .sub = target_sub(),
         .value = to_i32(variant().position(way))});
    wait(5, 20);
    control(mode() == Mode::interpolated_position ? 0x1F : 0x0F);
    wait(20, 140);
    add({.kind = Kind::stream, .index = target_index(), .value = 0, .count = random_.within(10, 50)});
    wait(50, 150);
  }

  // A master's way from rest to rest in a cyclic mode, by steeper ramps than the profile's. A pause of its targets,
  // late or lost, has the drive catch up with them.
  void interrupted_travel() {
    if (!set_mode(random_.chance(70) ? Mode::cyclic_sync_position : Mode::interpolated_position)) return;
    const std::int64_t gentle = to_u32(variant().acceleration(5.0 + 45.0 * random_.unit()));
    write(0x6083, std::max<std::int64_t>(1, gentle));
    write(0x6084, std::max<std::int64_t>(1, random_.chance(70) ? gentle : gentle * 4));
    add({.kind = Kind::enable});
    wait(20, 140);
    if (mode() == Mode::interpolated_position) control(0x1F);
    add({.kind = Kind::write_here, .via = Via::pdo, .index = target_index(), .sub = target_sub(), .value = 0});
    const double cycle_s = static_cast<double>(sequence_.cycle_us) * 1e-6;
    const double speed = variant().max_speed_rpm / 60.0 * (0.1 + 0.4 * random_.unit());
    const double step = variant().position((random_.chance(50) ? speed : -speed) * cycle_s);
    const auto travel = [&](double share, std::int64_t milliseconds) {
      const std::int64_t cycles = std::max<std::int64_t>(1, milliseconds * 1000 / sequence_.cycle_us);
      add({.kind = Kind::stream, .index = target_index(), .value = to_i32(share * step), .count = cycles});
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

  // A value that no master should write, to an object that moves the axis.
  void anything() {
    static constexpr std::array<std::uint16_t, 24> objects{
        0x6040, 0x6060, 0x607A, 0x60FF, 0x6071, 0x6081, 0x6082, 0x6083, 0x6084, 0x6085, 0x6086, 0x607F,
        0x6080, 0x6072, 0x6065, 0x6066, 0x605A, 0x605D, 0x60B0, 0x60B1, 0x60B2, 0x607C, 0x60F2, 0x6007};
    static constexpr std::array<std::int64_t, 10> values{0,   1,     -1,    2,          127,
                                                         255, 32767, 65535, 2147483647, -2147483648LL};
    write(random_.of(objects), random_.of(values));
  }

  Random random_;
  const std::vector<Variant>& variants_;
  std::uint64_t seed_;
  std::uint64_t number_;
  Tree tree_;
  Sequence sequence_;
  std::vector<std::int64_t> forks_;
  std::vector<DrawnAxis> drawn_;
  std::uint8_t axis_ = 0;
  std::int64_t now_ = 16;
};

}  // namespace

Drawn draw(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants, Tree tree) {
  tree.levels = std::min(tree.levels, least_steps);
  return Generator(seed, number, variants, tree).draw();
}

}  // namespace servodrome::motion
