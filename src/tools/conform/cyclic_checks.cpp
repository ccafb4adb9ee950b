// The modes with a target in each cycle: cyclic synchronous position, velocity and torque, and interpolated position.
#include <array>
#include <cmath>

#include "axis/cia402_words.hpp"
#include "axis/cyclic/set_point_generator.hpp"
#include "links/time.hpp"
#include "tools/conform/check_tables.hpp"
#include "tools/conform/cyclic_run.hpp"

namespace servodrome::master::conform::cyclic_group {
namespace {

using namespace std::chrono_literals;

constexpr double torque_window = 5.0;  // in 0.1 % of rated torque
constexpr double slow = 0.5;           // revolutions per second, for motions that are stopped on the way
constexpr double acceleration = 10.0;  // revolutions per second squared
constexpr double lag_s = 0.15;         // maximum time by which the position lags behind its target
constexpr OperationMode refuge = OperationMode::profile_position;  // mode to change to: it does not move without an
                                                                   // edge of bit 4

constexpr std::array modes{
    CyclicMode{.mode = OperationMode::cyclic_synchronous_position, .target = {{0x607A, 0}, 32}, .is_position = true},
    CyclicMode{.mode = OperationMode::cyclic_synchronous_velocity,
               .target = {{0x60FF, 0}, 32},
               .actual = PdoObject{{0x606C, 0}, 32}},
    CyclicMode{.mode = OperationMode::cyclic_synchronous_torque,
               .target = {{0x6071, 0}, 16},
               .actual = PdoObject{{0x6077, 0}, 16}},
    CyclicMode{.mode = OperationMode::interpolated_position,
               .target = {{0x60C1, 1}, 32},
               .is_position = true,
               .other_target = PdoObject{{0x607A, 0}, 32},
               .enable_bits = enable_interpolation},
};
enum Row : int { csp, csv, cst, ip };

const CyclicMode& mode_of(int row) { return modes[static_cast<std::size_t>(row)]; }

std::string text_of_bit(const CyclicRun& axis) { return fmt::format("{:04X}h", axis.statusword()); }

// Tolerance of positions: a hundredth of a revolution.
double window(Trial& trial) { return trial.units().position / 100.0; }

// Limits for a profile between the two ends of the permitted motion, in the position units of this axis.
MotionLimits limits_of(Trial& trial, double speed) {
  const double unit = trial.units().position;
  return {.velocity = unit * speed,
          .acceleration = unit * acceleration,
          .deceleration = unit * acceleration,
          .jerk = unit * 1000.0};
}

// ---- Bit 12 ----

void follows_when_enabled(Trial& trial, int row) {
  CyclicRun axis(trial, mode_of(row));
  trial.expect((axis.statusword() & follows_target) == 0, "not enabled", "bit 12 of 6041h = 0", text_of_bit(axis));
  axis.enable();
  const bool came = axis.run(500ms, [&] { return (axis.statusword() & follows_target) != 0; });
  trial.expect(came, "operation enabled, a target in each cycle", "bit 12 of 6041h = 1", text_of_bit(axis));
  const bool went = axis.run(200ms, [&] { return (axis.statusword() & follows_target) == 0; });
  trial.expect(!came || !went, "the same for 200 ms", "bit 12 of 6041h stays 1", text_of_bit(axis));
  if (mode_of(row).enable_bits != 0) {
    axis.control(command_word::enable_operation);
    const bool inactive = axis.run(500ms, [&] { return (axis.statusword() & follows_target) == 0; });
    trial.expect(inactive, "6040h = 000Fh, bit 4 taken away", "bit 12 of 6041h = 0", text_of_bit(axis));
  }
  axis.control(0x0000);
  axis.run(trial.settings().patience, [&] { return axis.state() == PowerState::switch_on_disabled; });
  trial.expect((axis.statusword() & follows_target) == 0, text_of_controlword(0x0000), "bit 12 of 6041h = 0",
               text_of_bit(axis));
}

// ---- At rest ----

// The target is the present position, or 0, in each cycle: the axis must not move.
void stands(Trial& trial, int row) {
  CyclicRun axis(trial, mode_of(row));
  axis.enable();
  const std::int32_t start = axis.position();
  const std::int32_t target = axis.target();
  double furthest = 0.0;
  const bool left = axis.run(500ms, [&] {
    furthest = std::max(furthest, std::abs(static_cast<double>(axis.position()) - start));
    return furthest > trial.units().position * trial.settings().revolutions;
  });
  trial.expect(!left && furthest <= window(trial), fmt::format("the target {} in each cycle for 500 ms", target),
               fmt::format("6064h = {}, within {:.0f}", start, window(trial)), fmt::format("{:.0f} away", furthest));
  trial.expect(axis.state() == PowerState::operation_enabled, "the same", "operation enabled",
               text_of_state(axis.statusword()));
}

// Without SYNC and PDOs: Trial::control() writes the target once, before it enables the axis; the axis must not move.
void waits(Trial& trial, int row) {
  const CyclicMode& mode = mode_of(row);
  trial.units();
  trial.bring_to(PowerState::switch_on_disabled);
  trial.set_mode(mode.mode);
  const std::int32_t start = trial.position();
  if (mode.other_target) trial.write_if_present<std::int32_t>(mode.target.object.index, mode.target.object.sub, start);
  trial.bring_to(PowerState::operation_enabled);
  if (mode.enable_bits != 0)
    trial.control(static_cast<std::uint16_t>(command_word::enable_operation | mode.enable_bits));
  double furthest = 0.0;
  const double allowed = trial.units().position * trial.settings().revolutions;
  for (const Time end = trial.now() + 500ms; trial.now() < end && furthest <= allowed;) {
    trial.wait(trial.settings().poll_interval);
    furthest = std::max(furthest, std::abs(trial.way(start, trial.position())));
  }
  trial.expect(furthest <= window(trial), "enabled, and 500 ms without a new target",
               fmt::format("6064h = {}, within {:.0f}", start, window(trial)), fmt::format("{:.0f} away", furthest));
}

// ---- Following ----

void tracks_position(Trial& trial, int row) {
  CyclicRun axis(trial, mode_of(row));
  const double speed = std::min(1.0, 2.0 * trial.settings().revolutions);
  axis.enable();
  const std::int32_t start = axis.position();
  SetPointGenerator generator(axis.period_s());
  generator.reset({0.0, 0.0, 0.0});
  double greatest_lag = 0.0;
  for (const double distance : {static_cast<double>(trial.distance()), 0.0}) {
    generator.move_to(distance, 0.0, limits_of(trial, speed));
    const bool given = axis.run(
        trial.settings().patience + 2 * Time(std::chrono::seconds(1)) + links::from_seconds(generator.duration_s()),
        [&] {
          generator.advance();
          axis.set_target(start + generator.state().position);
          greatest_lag = std::max(greatest_lag, std::abs(static_cast<double>(axis.target()) - axis.position()));
          return generator.done() || axis.state() != PowerState::operation_enabled;
        });
    trial.require(given && axis.state() == PowerState::operation_enabled, "targets along a profile, one in each cycle",
                  "operation enabled", text_of_state(axis.statusword()));
    // The last target is repeated: the axis must stand still.
    axis.run(300ms);
    const std::int32_t there = axis.position();
    trial.expect(std::abs(there - start - distance) <= window(trial),
                 fmt::format("targets up to {:.0f} at {:.2f} revolutions per second", start + distance, speed),
                 fmt::format("6064h = {:.0f} at the end", start + distance), fmt::format("{}", there));
    double moved = 0.0;
    axis.run(300ms, [&] {
      moved = std::max(moved, std::abs(static_cast<double>(axis.position()) - there));
      return false;
    });
    trial.expect(moved <= window(trial), "the last target on and on", "no motion", fmt::format("{:.0f} away", moved));
  }
  const double allowed = trial.units().position * speed * lag_s + window(trial);
  trial.expect(greatest_lag <= allowed, "targets along a profile",
               fmt::format("6064h less than {:.0f} ms behind, {:.0f}", lag_s * 1000.0, allowed),
               fmt::format("{:.0f}", greatest_lag));
}

// Mean of the values that were added.
struct Mean {
  double sum = 0.0;
  unsigned count = 0;
  void add(double value) {
    sum += value;
    ++count;
  }
  double value() const { return count == 0 ? 0.0 : sum / count; }
};

void tracks_velocity(Trial& trial, int row) {
  CyclicRun axis(trial, mode_of(row));
  const AxisUnits unit = trial.units();
  const double speed = trial.slow_enough(slow);
  const double half_way_s = 0.5 * trial.settings().revolutions / speed;
  axis.enable();
  SetPointGenerator generator(axis.period_s());
  generator.reset({0.0, 0.0, 0.0});
  for (const double wanted : {speed, -speed, 0.0}) {
    generator.run_at(wanted * unit.velocity, {.velocity = unit.velocity,
                                              .acceleration = unit.velocity * acceleration,
                                              .deceleration = unit.velocity * acceleration,
                                              .jerk = unit.velocity * 1000.0});
    Mean velocity;
    Mean by_position;
    const double settled_s = generator.duration_s() + 0.1;
    const auto span = links::from_seconds(std::max(half_way_s, 0.2) + settled_s);
    double elapsed_s = 0.0;
    const bool failed = axis.run(span, [&] {
      generator.advance();
      axis.set_target(generator.state().velocity);
      elapsed_s += axis.period_s();
      if (elapsed_s > settled_s) {
        velocity.add(axis.actual());
        by_position.add(axis.speed());
      }
      return axis.state() != PowerState::operation_enabled;
    });
    const std::string sent = fmt::format("60FFh = {:.0f}, by a ramp, one in each cycle", wanted * unit.velocity);
    trial.require(!failed, sent, "operation enabled", text_of_state(axis.statusword()));
    if (axis.shows_actual()) {
      trial.expect(std::abs(velocity.value() - wanted * unit.velocity) <= unit.velocity * (0.1 * speed + 0.02), sent,
                   "606Ch follows", fmt::format("606Ch = {:.0f}", velocity.value()));
    }
    trial.expect(std::abs(by_position.value() - wanted * unit.position) <= unit.position * (0.1 * speed + 0.02), sent,
                 fmt::format("6064h goes on at {:.0f} per second", wanted * unit.position),
                 fmt::format("{:.0f}", by_position.value()));
  }
}

// ---- Torque: the smallest one that moves the axis ----

// Increases the torque until the axis turns.
class TorqueRamp {
 public:
  TorqueRamp(Trial& trial, CyclicRun& axis, double direction)
      : axis_(axis),
        direction_(direction),
        start_(axis.position()),
        speed_(trial.units().position * slow),
        way_(trial.distance() / 4.0) {}

  // Called in each cycle. Returns true when the axis turns or the ramp has reached its maximum.
  bool step() {
    given_ = std::min(given_ + torque_per_s * axis_.period_s(), most_torque);
    axis_.set_target(direction_ * given_);
    // Skips the first cycles, because demand and actual value are delayed by a round trip.
    if (++cycles_ > 6) {
      wanted_.add(direction_ * given_);
      actual_.add(axis_.actual());
    }
    return turns() || given_ >= most_torque;
  }
  bool turns() const {
    return std::abs(axis_.speed()) > speed_ || std::abs(static_cast<double>(axis_.position()) - start_) > way_;
  }
  const Mean& wanted() const { return wanted_; }
  const Mean& actual() const { return actual_; }

 private:
  static constexpr double torque_per_s = 200.0;  // in 0.1 % of rated torque
  static constexpr double most_torque = 200.0;

  CyclicRun& axis_;
  double direction_;
  std::int32_t start_;
  double speed_;
  double way_;
  double given_ = 0.0;
  unsigned cycles_ = 0;
  Mean wanted_{};
  Mean actual_{};
};

void brake(Trial& trial, CyclicRun& axis, double torque) {
  const double sign = axis.speed() > 0.0 ? -1.0 : 1.0;
  axis.set_target(sign * std::abs(torque));
  axis.run(300ms, [&] { return axis.speed() * sign > -0.05 * trial.units().position; });
  axis.set_target(0);
}

void tracks_torque(Trial& trial, int row) {
  CyclicRun axis(trial, mode_of(row));
  if (!axis.shows_actual()) Trial::skip("it has no 6077h to see the torque");
  axis.enable();
  for (const double direction : {1.0, -1.0}) {
    TorqueRamp ramp(trial, axis, direction);
    axis.run(2s, [&] { return ramp.step() || axis.state() != PowerState::operation_enabled; });
    const std::string sent = fmt::format("6071h from 0 to {}, by a ramp, one in each cycle", axis.target());
    trial.require(axis.state() == PowerState::operation_enabled, sent, "operation enabled",
                  text_of_state(axis.statusword()));
    brake(trial, axis, axis.target());
    axis.comes_to_rest(1s);
    if (ramp.actual().count == 0) Trial::skip("the axis turns too easily to see a torque");
    const double wanted = ramp.wanted().value();
    trial.expect(std::abs(ramp.actual().value() - wanted) <= torque_window + std::abs(wanted) / 4.0, sent,
                 fmt::format("6077h follows, {:.1f} in the mean", wanted),
                 fmt::format("6077h = {:.1f} in the mean", ramp.actual().value()));
  }
  Mean at_rest;
  axis.run(100ms);
  axis.run(100ms, [&] {
    at_rest.add(axis.actual());
    return false;
  });
  trial.expect(std::abs(at_rest.value()) <= torque_window, "6071h = 0",
               fmt::format("6077h = 0, within {:.0f}", torque_window), fmt::format("6077h = {:.1f}", at_rest.value()));
}

// ---- Stops during a motion ----

struct Motion {
  std::int32_t start = 0;
  double end = 0.0;
  std::optional<SetPointGenerator> generator{};
};

// Starts a motion in this direction and returns when the axis has covered a quarter of the way to `end`.
Motion set_off(Trial& trial, CyclicRun& axis, int row, double direction) {
  const double speed = trial.slow_enough(slow);
  Motion motion{.start = axis.position(), .end = axis.position() + direction * trial.distance()};
  motion.generator.emplace(axis.period_s());
  motion.generator->reset({0.0, 0.0, 0.0});
  std::optional<TorqueRamp> push;
  if (row == cst) {
    push.emplace(trial, axis, direction);
  } else if (row == csv) {
    motion.generator->run_at(direction * speed * trial.units().velocity,
                             {.velocity = trial.units().velocity,
                              .acceleration = trial.units().velocity * acceleration,
                              .deceleration = trial.units().velocity * acceleration,
                              .jerk = trial.units().velocity * 1000.0});
  } else {
    motion.generator->move_to(direction * trial.distance(), 0.0, limits_of(trial, speed));
  }
  bool moves = false;
  axis.run(trial.patience_of_way(), [&] {
    if (push) {
      const bool ended = push->step();
      moves = push->turns();
      return ended;
    }
    motion.generator->advance();
    axis.set_target(row == csv ? motion.generator->state().velocity
                               : motion.start + motion.generator->state().position);
    moves = std::abs(static_cast<double>(axis.position()) - motion.start) > trial.distance() / 4.0;
    return moves;
  });
  if (!moves && row == cst) Trial::skip(fmt::format("a torque of {} does not move the axis", axis.target()));
  trial.require(moves, fmt::format("targets in {}", master::name(mode_of(row).mode)), "the axis moves",
                fmt::format("6064h = {} from {}", axis.position(), motion.start));
  return motion;
}

// Continues to send targets. Returns true when the axis has come to rest, false when it reaches the end of the
// permitted way, or after `span`.
bool go_on(Trial& trial, CyclicRun& axis, int row, Motion& motion, Time span) {
  double last = axis.position();
  unsigned still = 0;
  unsigned cycles = 0;
  bool away = false;
  const bool ended = axis.run(span, [&] {
    if (row != cst) {
      motion.generator->advance();
      axis.set_target(row == csv ? motion.generator->state().velocity
                                 : motion.start + motion.generator->state().position);
    }
    away = std::abs(static_cast<double>(axis.position()) - motion.start) > trial.distance() * 0.95;
    if (++cycles % 10 == 0) {
      still = std::abs(axis.position() - last) <= trial.units().position / 2000.0 + 1.0 ? still + 1 : 0;
      last = axis.position();
    }
    return away || still >= 5;
  });
  return ended && !away;
}

void halts(Trial& trial, int row) {
  CyclicRun axis(trial, mode_of(row));
  axis.enable();
  Motion motion = set_off(trial, axis, row, 1.0);
  axis.control(axis.enabled_word() | control_bit::halt);
  const bool stopped = go_on(trial, axis, row, motion, trial.settings().patience);
  const std::uint16_t word = axis.statusword();
  trial.expect(stopped,
               fmt::format("6040h = {:04X}h under way, targets go on", axis.enabled_word() | control_bit::halt),
               "the axis stops", fmt::format("6064h = {} from {}", axis.position(), motion.start));
  if (!stopped) return;
  trial.expect(state_of(word) == PowerState::operation_enabled, "halted", "operation enabled, as before",
               text_of_state(word));
  if (row == ip) return;
  trial.expect((word & follows_target) == 0, "halted", "bit 12 of 6041h = 0, the target is ignored",
               fmt::format("{:04X}h", word));
}

void leaves(Trial& trial, int row) {
  if (!trial.has_mode(refuge)) Trial::skip("it has no profile position mode, into which it would be taken");
  CyclicRun axis(trial, mode_of(row));
  axis.enable();
  Motion motion = set_off(trial, axis, row, -1.0);
  // Clears bit 4 first: in profile position it would be a new set-point.
  if (mode_of(row).enable_bits != 0) {
    axis.control(command_word::enable_operation);
    go_on(trial, axis, row, motion, 50ms);
  }
  const std::string sent = fmt::format("6060h = {} under way", static_cast<int>(refuge));
  const auto refusal =
      Trial::refusal_of([&] { trial.objects().write<std::int8_t>(0x6060, 0, static_cast<std::int8_t>(refuge)); });
  trial.require(!refusal, sent, "taken", text_of(refusal));
  const bool stopped = go_on(trial, axis, row, motion, trial.settings().patience);
  trial.expect(stopped, sent + ", targets go on", "the axis stops",
               fmt::format("6064h = {} from {}", axis.position(), motion.start));
  if (!stopped) return;
  const auto shown = trial.objects().read<std::int8_t>(0x6061);
  trial.expect(shown == static_cast<std::int8_t>(refuge), sent, fmt::format("6061h = {}", static_cast<int>(refuge)),
               fmt::format("6061h = {}", shown));
  const std::int32_t there = axis.position();
  axis.run(300ms);
  trial.expect(std::abs(static_cast<double>(axis.position()) - there) <= window(trial), "300 ms later",
               fmt::format("6064h = {}, no motion", there), fmt::format("{}", axis.position()));
}

void data_record(Trial& trial, int) {
  trial.bring_to(PowerState::switch_on_disabled);
  trial.set_mode(OperationMode::interpolated_position);
  const auto record = trial.objects().read_if_present<std::int32_t>(0x60C1, 1);
  trial.expect(record.has_value(), "read 60C1h sub 1", "a position, the object is mandatory with the mode",
               record ? fmt::format("{}", *record) : "it is not there");
}

constexpr unsigned with_cycles = buses::can | buses::ethercat;
constexpr auto position_mode = "CiA 402-2, ETG.6010, cyclic synchronous position mode";
constexpr auto position_bits = "CiA 402-2, ETG.6010, cyclic synchronous position mode, statusword";
constexpr auto velocity_mode = "CiA 402-2, ETG.6010, cyclic synchronous velocity mode";
constexpr auto velocity_bits = "CiA 402-2, ETG.6010, cyclic synchronous velocity mode, statusword";
constexpr auto torque_mode = "CiA 402-2, ETG.6010, cyclic synchronous torque mode";
constexpr auto torque_bits = "CiA 402-2, ETG.6010, cyclic synchronous torque mode, statusword";
constexpr auto interpolation = "CiA 402-2, interpolated position mode";
constexpr auto interpolation_bits = "CiA 402-2, interpolated position mode, statusword";
constexpr auto halting = "CiA 402-2, controlword bit 8, object 605Dh";
constexpr auto changing = "CiA 402-2, object 6060h";

constexpr auto bit_12 = "Bit 12 is set while the target is followed, and only then";
constexpr auto rest = "A target that does not change leaves the axis at rest";
constexpr auto nothing_new = "Without new targets the axis does not move";
constexpr auto stops = "Halt stops the axis, whatever the targets";
constexpr auto out = "Another mode of operation stops the axis, whatever the targets";

constexpr std::array rows{
    Check{"csp.follows", position_bits, bit_12, Demand::enable, with_cycles, follows_when_enabled, csp},
    Check{"csp.at-rest", position_mode, rest, Demand::enable, with_cycles, stands, csp},
    Check{"csp.no-targets", position_mode, nothing_new, Demand::enable, buses::all, waits, csp},
    Check{"csp.tracks", position_mode, "The position follows the targets, and ends with the last", Demand::motion,
          with_cycles, tracks_position, csp},
    Check{"csp.halt", halting, stops, Demand::motion, with_cycles, halts, csp},
    Check{"csp.leave", changing, out, Demand::motion, with_cycles, leaves, csp},
    Check{"csv.follows", velocity_bits, bit_12, Demand::enable, with_cycles, follows_when_enabled, csv},
    Check{"csv.at-rest", velocity_mode, "A target of 0 leaves the axis at rest", Demand::enable, with_cycles, stands,
          csv},
    Check{"csv.no-targets", velocity_mode, nothing_new, Demand::enable, buses::all, waits, csv},
    Check{"csv.tracks", velocity_mode, "The velocity follows the targets", Demand::motion, with_cycles, tracks_velocity,
          csv},
    Check{"csv.halt", halting, stops, Demand::motion, with_cycles, halts, csv},
    Check{"csv.leave", changing, out, Demand::motion, with_cycles, leaves, csv},
    Check{"cst.follows", torque_bits, bit_12, Demand::enable, with_cycles, follows_when_enabled, cst},
    Check{"cst.at-rest", torque_mode, "A target of 0 leaves the axis at rest", Demand::enable, with_cycles, stands,
          cst},
    Check{"cst.no-targets", torque_mode, nothing_new, Demand::enable, buses::all, waits, cst},
    Check{"cst.tracks", torque_mode, "The torque follows the targets", Demand::motion, with_cycles, tracks_torque, cst},
    Check{"cst.leave", changing, out, Demand::motion, with_cycles, leaves, cst},
    Check{"ip.data-record", "CiA 402-2, object 60C1h", "The data record of the mode exists", Demand::nothing,
          with_cycles, data_record},
    Check{"ip.active", interpolation_bits, "Bit 12 is set while interpolation is active (bit 4), and only then",
          Demand::enable, with_cycles, follows_when_enabled, ip},
    Check{"ip.at-rest", interpolation, rest, Demand::enable, with_cycles, stands, ip},
    Check{"ip.no-targets", interpolation, nothing_new, Demand::enable, buses::all, waits, ip},
    Check{"ip.tracks", interpolation, "The position follows the targets, and ends with the last", Demand::motion,
          with_cycles, tracks_position, ip},
    Check{"ip.halt", halting, stops, Demand::motion, with_cycles, halts, ip},
    Check{"ip.leave", changing, out, Demand::motion, with_cycles, leaves, ip},
};

}  // namespace

std::span<const Check> checks() { return rows; }

}  // namespace servodrome::master::conform::cyclic_group
