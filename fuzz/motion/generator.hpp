#pragma once

#include "generate.hpp"

namespace servodrome::motion {

// Draws one sequence: mostly sensible actions of masters in a sensible order, mixed with actions that no master should
// do. An event gets the time `now_`, which advances from event to event. Steps are in generate_steps.cpp,
// generate_moves.cpp and generate_bench.cpp, themes (groups of related steps) in themes.cpp and themes_objects.cpp.
class Generator {
 public:
  Generator(std::uint64_t seed, std::uint64_t number, const std::vector<Variant>& variants, Tree tree);
  Drawn draw();

 private:
  struct DrawnAxis {
    const Variant* variant = nullptr;
    drive::Mode mode = drive::Mode::none;
  };

  void fork(unsigned level);
  const Variant& neighbour(const Variant& first);
  void add_axis(const Variant& variant);
  std::int64_t start_position(const Variant& variant);

  const Variant& variant() const { return *drawn_[axis_].variant; }
  drive::Mode& mode() { return drawn_[axis_].mode; }
  bool is(std::string_view product) const { return variant().product->name.starts_with(product); }
  std::uint8_t low_limit() const { return is("ismk") ? 2 : 1; }  // sub-index of 607Dh
  std::uint8_t high_limit() const { return is("ismk") ? 1 : 2; }

  // --- Time
  void pause();
  void wait(std::int64_t least_ms, std::int64_t most_ms) { now_ += random_.within(least_ms, most_ms) * ticks_per_ms; }
  std::int64_t cycle_ticks() const { return (sequence_.cycle_us * ticks_per_ms + 999) / 1000; }

  // --- Events
  Event& add(Event event);
  Via via();
  void write(std::uint16_t index, std::int64_t value, std::uint8_t sub = 0);
  void write_here(std::uint16_t index, std::int64_t value, std::uint8_t sub = 0, Via via = Via::sdo);
  void control(std::uint16_t word) { write(0x6040, word); }
  bool set_mode(drive::Mode wanted);
  // Lets the master enable the axis, and waits.
  void enable();

  // --- Values, in the drive's units
  std::int64_t position(double revolutions) const;
  std::int64_t velocity(double revolutions_per_s) const;
  std::int64_t acceleration(double revolutions_per_s2) const;  // at least 1
  double sign() { return random_.chance(50) ? 1.0 : -1.0; }
  std::int64_t distance();
  std::int64_t speed();
  std::int64_t signed_speed();
  std::int64_t ramp();
  std::int64_t torque();

  // --- What a master does
  void begin(std::uint8_t axis);
  void wire_switches();
  void interpolation_period();
  void change_mode();
  void step();
  void move();
  void move_vl();
  void set_point();
  void set_point_at_once(double revolutions);
  void home();
  bool by_record() const { return drawn_[axis_].mode == drive::Mode::interpolated_position && variant().records; }
  std::uint16_t target_index() const { return by_record() ? 0x60C1 : 0x607A; }
  std::uint8_t target_sub() const { return by_record() ? 1 : 0; }
  void target_here(std::int64_t value) { write_here(target_index(), value, target_sub(), Via::pdo); }
  void stream();
  void stop();
  void limit();
  void bench();
  std::int64_t limit_wire();
  void network();
  void anything();

  // --- Themes
  using Theme = void (Generator::*)();
  void theme();
  void ramp_of_zero();
  void speed_and_none();
  void switch_that_opens_again();
  void software_limits_around();
  void jump_and_stop();
  void halt_in_stream();
  void lone_set_point();
  void enable_twice();
  void lowered_speed();
  void torque_and_stop();
  void far_first_target();
  void halt_taken_back();
  void interrupted_travel();

  void position_range();
  void position_change();
  void polarity();
  void end_velocity();
  void lost_master();
  void aborted_connection();
  void far_positions();
  void into_hard_stop();
  void touch_probes();
  void several_writes();
  void bit_4_before_enabling();
  void homing_not_started();
  void mode_of_none();
  void power_cut_in_reaction();

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

}  // namespace servodrome::motion
