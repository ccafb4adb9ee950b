// Homing and profile position.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fmt/format.h>
#include <limits>

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"
#include "catalogue/product.hpp"
#include "links/time.hpp"

namespace servodrome::master {
namespace {

constexpr Time standing = std::chrono::milliseconds(500);

}  // namespace

void Axis402::require_enabled(const char* doing) {
  if (state() != PowerState::operation_enabled) {
    fail(fmt::format("the drive is not enabled and cannot {}", doing), "enable it first");
  }
  // Another master may have left the halt bit set, and this bit would stop the move. controlword_ keeps the bit so that
  // hand_over() replaces the halted move.
  if (controlword_ == 0) controlword_ = objects_.read<std::uint16_t>(0x6040);
  const unsigned halt = present_controlword() & unsigned{control_bit::halt};
  controlword_ = static_cast<std::uint16_t>((controlword_ & ~unsigned{control_bit::halt}) | halt);
}

// Another client may have commanded a stop since require_enabled(). A word that starts a motion would interrupt it.
void Axis402::require_no_stop(const char* doing) {
  const bool is_enabled = state() == PowerState::operation_enabled;
  const std::uint16_t word = present_controlword();
  const bool is_halted = (word & ~controlword_ & control_bit::halt) != 0;
  if (is_enabled && is_ordered_to_operate(word) && !is_halted) return;
  fail(fmt::format("another client has stopped the axis before it could {}", doing), "order the motion again");
}

// Bits 10, 12 and 13 of the statusword have another meaning in another mode.
void Axis402::require_mode(const std::string& doing) {
  if (!mode_ || mode() == *mode_) return;
  objects_.wait(options_.poll_interval);
  const std::int8_t present = mode();
  if (present == *mode_) return;
  const std::string problem = try_to_stop();
  fail(fmt::format("{}: the mode of operation (6061h) is {} now and no longer {}{}", doing, present, *mode_,
                   problem.empty() ? "" : "; " + problem),
       "check which other client writes 6060h");
}

void Axis402::write_profile(const MotionProfile& profile) {
  // With a ramp of 0 the axis never reaches its target: some drives report a fault, others accept the set-point and
  // report the target as reached.
  if (profile.acceleration == 0U || profile.deceleration == 0U) {
    fail(fmt::format("with {} of 0 the axis cannot reach its target",
                     profile.acceleration == 0U ? "an acceleration" : "a deceleration"),
         "give a value above 0, or none to keep the drive's value");
  }
  write_if_given(0x6081, 0, profile.velocity);
  write_if_given(0x6083, 0, profile.acceleration);
  write_if_given(0x6084, 0, profile.deceleration);
}

void Axis402::follow(Time timeout, const Progress& progress, const std::string& doing,
                     const std::function<bool(std::uint16_t)>& done) {
  Time deadline = objects_.now() + timeout;
  ordered_ = objects_.now();
  for (Time last = ordered_;; objects_.wait(options_.poll_interval)) {
    leave_if_cancelled(doing);
    std::uint16_t word = 0;
    if (progress) {
      const AxisStatus present = status();
      progress(present);
      word = present.statusword;
    } else {
      word = statusword();
    }
    const Time now = objects_.now();
    if (halted_) deadline += now - last;  // the time of a halt does not count
    last = now;
    if (state_of(word) != PowerState::operation_enabled) {
      fail(fmt::format("the drive left operation enabled while {}", doing),
           "look at the error code; then reset the fault and enable again");
    }
    if (!halted_ && now - ordered_ >= settling && done(word)) return require_mode(doing);
    if (now >= deadline) {
      const std::int32_t at = position();
      const std::string problem = try_to_stop();
      fail(fmt::format("{} took longer than {:g} s and {}; position was {}", doing, links::to_seconds(timeout),
                       problem.empty() ? "was stopped" : fmt::format("could not be stopped ({})", problem), at),
           "check speeds, limits and load, or give a longer timeout");
    }
  }
}

void Axis402::home(const HomingRequest& request, Time timeout, const Progress& progress) {
  require_enabled("home");
  // Clears the bits of a former command. A halt stays until the mode has changed: without it a drive would resume the
  // move that was stopped.
  halted_ = false;
  const std::uint16_t halt = controlword_ & control_bit::halt;
  write_controlword(command_word::enable_operation | halt);
  set_mode(OperationMode::homing);
  if (halt != 0) write_controlword(command_word::enable_operation);
  write_if_given(0x6098, 0, request.method);
  write_if_given(0x6099, 1, request.switch_speed);
  write_if_given(0x6099, 2, request.zero_speed);
  write_if_given(0x609A, 0, request.acceleration);
  write_if_given(0x607C, 0, request.offset);
  require_no_stop("home");
  write_controlword(command_word::enable_operation | start_homing);
  const catalogue::HomingSignals& signals = product().dialect.homing_signals;
  const std::string doing = fmt::format("homing by method {}", objects_.read<std::int8_t>(0x6098));
  place_.reset();
  follow(timeout, progress, doing, [&](std::uint16_t word) {
    if ((word & signals.error) != 0) {
      write_controlword(command_word::enable_operation);
      fail(doing + " ended with an error",
           "check that the switches of the method are present and wired, and that homing speeds and acceleration are "
           "not 0");
    }
    const std::uint16_t done =
        static_cast<std::uint16_t>(signals.attained | (signals.target_reached ? status_bit::target_reached : 0U));
    if ((word & done) == done) return true;
    if (stands() && objects_.now() - stands_since_ >= options_.progress_timeout) {
      const std::string problem = try_to_stop();
      fail(fmt::format("{} does not end, and the axis stands at {}{}", doing, *place_,
                       problem.empty() ? "" : "; " + problem),
           "check the statusword: the drive may not move, or may not report the end of homing");
    }
    return false;
  });
  write_controlword(command_word::enable_operation);
  // A drive may report homing attained within a window of position and speed, while the shaft still moves. The next
  // read must return the final position.
  if (!rests_within(options_.state_timeout)) {
    fail(doing + " is attained, but the shaft does not come to rest", "check homing speeds, gains and load");
  }
}

std::int32_t Axis402::position_demand() {
  if (const auto demand = objects_.read_if_present<std::int32_t>(0x6062)) return *demand;
  return position();
}

// If a halt follows a set-point at once, this set-point stays pending: a drive with room for one set-point then accepts
// no other one. A change of the mode removes the pending set-point. The axis must be at rest and halted. Returns true
// if the drive now accepts a set-point.
bool Axis402::drop_set_points(std::uint16_t halted) {
  objects_.write<std::int32_t>(0x60FF, 0, 0);
  set_mode(OperationMode::profile_velocity);
  set_mode(OperationMode::profile_position);
  write_controlword(halted);
  return wait_for_bits(set_point_acknowledge, 0, options_.state_timeout);
}

void Axis402::hand_over(std::int32_t target, std::uint16_t order) {
  // If the halt bit is cleared first, the drive resumes the halted move. Therefore the write that clears the bit also
  // starts the new move.
  const std::uint16_t halt = controlword_ & control_bit::halt;
  if (halt != 0) order |= change_immediately;
  halted_ = false;
  require_no_stop("move");
  write_controlword(order | halt);
  const bool is_free = wait_for_bits(set_point_acknowledge, 0, halt != 0 ? settling : options_.state_timeout);
  if (!is_free && !(halt != 0 && drop_set_points(order | halt))) {
    fail("the drive accepts no further set-point (statusword bit 12 stays set)", "stop the present motion first");
  }
  objects_.write<std::int32_t>(0x607A, 0, target);
  require_no_stop("move");
  write_controlword(order | new_set_point);
  // Some drives clear the acknowledgement by themselves, so this master may miss it. A "target reached" that becomes 0
  // also proves that the drive accepted the set-point.
  constexpr Time between_looks = std::chrono::milliseconds(1);  // long enough for a statusword in process data to be
                                                                // refreshed
  const Time deadline = objects_.now() + options_.state_timeout;
  for (;; objects_.wait(between_looks)) {
    leave_if_cancelled("handing over a set-point");
    const std::uint16_t word = statusword();
    if ((word & set_point_acknowledge) != 0 || (word & status_bit::target_reached) == 0) break;
    if (objects_.now() >= deadline) {
      write_controlword(order);
      fail(fmt::format("the drive did not take over target position {}", target),
           "check that target, profile velocity and accelerations are within the drive's limits and not 0");
    }
  }
  write_controlword(order);
  ordered_ = objects_.now();
}

void Axis402::start_move(std::int32_t target, bool relative, const MotionProfile& profile) {
  require_enabled("move");
  // Several drives have a factory setting of 0: they accept the set-point and never move.
  const auto velocity = profile.velocity ? profile.velocity : objects_.read_if_present<std::uint32_t>(0x6081);
  if (velocity == 0U) {
    fail("the profile velocity (6081h) is 0: the axis would not move", "give a velocity for the move");
  }
  // The drive adds the distance to the target of a move that is under way.
  const bool is_under_way = goal_ && (controlword_ & control_bit::halt) == 0 &&
                            mode() == static_cast<std::int8_t>(OperationMode::profile_position) &&
                            (statusword() & status_bit::target_reached) == 0;
  set_mode(OperationMode::profile_position);
  write_profile(profile);
  const std::int64_t base = !relative ? 0 : is_under_way ? *goal_ : position_demand();
  const std::int64_t goal = base + target;
  goal_ = goal == static_cast<std::int32_t>(goal) ? std::optional(static_cast<std::int32_t>(goal)) : std::nullopt;
  const std::int64_t distance = goal - position();
  direction_ = distance == 0 ? 0 : distance > 0 ? 1 : -1;
  order_ = relative ? fmt::format("moving by {}", target) : fmt::format("moving to {}", target);
  hand_over(target, static_cast<std::uint16_t>(command_word::enable_operation | (relative ? relative_move : 0U)));
}

void Axis402::start_move_to(std::int32_t position, const MotionProfile& profile) {
  start_move(position, false, profile);
}

void Axis402::start_move_by(std::int32_t distance, const MotionProfile& profile) {
  require_enabled("move");
  if ((controlword_ & control_bit::halt) == 0) return start_move(distance, true, profile);
  // The drive would add the distance to the target of the move that was stopped, so the absolute target is computed
  // here.
  const std::int64_t target = std::int64_t{position()} + distance;
  if (is_outside_range(target)) {
    // The axis would reach a target outside the range 607Bh in the other direction.
    if (!drop_set_points(controlword_)) {
      fail("the drive keeps the move that was stopped (statusword bit 12 stays set)", "disable and enable the axis");
    }
    return start_move(distance, true, profile);
  }
  if (target != static_cast<std::int32_t>(target)) {
    fail(fmt::format("{} is not a position", target), "move by less, or home the axis");
  }
  start_move(static_cast<std::int32_t>(target), false, profile);
}

bool Axis402::stands() {
  constexpr Time between_looks = std::chrono::milliseconds(100);
  const Time now = objects_.now();
  if (halted_) place_.reset();
  if (halted_ || now < next_look_) return false;
  next_look_ = now + between_looks;
  const std::int32_t at = position();
  if (!place_ || std::abs(std::int64_t{at} - *place_) > 1) {
    place_ = at;
    stands_since_ = now;
    increments_.reset();
  } else if (now - stands_since_ >= standing && has_crept()) {
    stands_since_ = crept_at_ = now;
  }
  return now - stands_since_ >= standing;
}

// The position units may be too coarse to show a slow motion; the increments of the encoder show it.
bool Axis402::has_crept() {
  if (!has_increments_) return false;
  const auto present = objects_.read_if_present<std::int32_t>(0x6063);
  has_increments_ = present.has_value();
  if (!present) return false;
  const bool moved = increments_ && std::abs(std::int64_t{*present} - *increments_) > rest_increments();
  if (!increments_ || moved) increments_ = present;
  return moved;
}

bool Axis402::is_outside_range(std::int64_t goal) {
  if (!product().dialect.has_position_range) return false;
  const auto lowest = objects_.read_if_present<std::int32_t>(0x607B, 1);
  const auto highest = objects_.read_if_present<std::int32_t>(0x607B, 2);
  return lowest && highest && *lowest < *highest && (goal < *lowest || goal > *highest);
}

std::int64_t Axis402::tolerance() {
  if (!near_) {
    constexpr std::int64_t least = 2000;  // used if the units of a revolution are unknown
    constexpr std::uint32_t no_window = 1U << 30;
    const std::uint32_t window = objects_.read_if_present<std::uint32_t>(0x6067).value_or(0);
    const auto revolution = units();
    near_ = std::max<std::int64_t>(window < no_window ? window : 0,
                                   revolution ? std::llround(revolution->position / 50) + 1 : least);
    // The position wraps around before it reaches such a goal, so goal and position cannot be compared.
    if (is_outside_range(*goal_)) near_ = std::numeric_limits<std::int64_t>::max();
  }
  return *near_;
}

bool Axis402::at_limit() {
  constexpr std::uint32_t negative_limit = 1U << 0;
  constexpr std::uint32_t positive_limit = 1U << 1;
  if (direction_ == 0) return false;
  const std::uint32_t inputs = objects_.read_if_present<std::uint32_t>(0x60FD).value_or(0);
  return (inputs & (direction_ > 0 ? positive_limit : negative_limit)) != 0;
}

void Axis402::leave_if_at_limit(const std::string& doing) {
  if (!at_limit()) return;
  const char* const side = direction_ > 0 ? "positive" : "negative";
  const std::int32_t at = position();
  const std::string problem = try_to_stop();
  fail(fmt::format("{} ended at position {}, where the {} limit switch is active (60FDh){}", doing, at, side,
                   problem.empty() ? "" : "; " + problem),
       "move the other way; or check switch, wiring and polarity of the input");
}

void Axis402::leave_if_rests_at_limit(const std::string& doing) {
  if (place_ && std::abs(std::int64_t{position()} - *place_) <= 1) leave_if_at_limit(doing);
}

// A drive may show the target as reached while the axis still approaches it, so the position must be constant for a
// short time. An axis that vibrates within the tolerance has arrived, too.
bool Axis402::has_settled(std::int32_t at) {
  constexpr Time between_looks = std::chrono::milliseconds(10);
  constexpr Time vibrating = std::chrono::milliseconds(500);
  const Time now = objects_.now();
  // A thousandth of a revolution, or one unit if the units are coarse.
  const std::int64_t still = std::min(rest_distance(), std::max<std::int64_t>(1, tolerance() / 20));
  if (!arrived_) near_since_ = now;
  if (!arrived_ || std::abs(std::int64_t{at} - *arrived_) > still) {
    arrived_ = at;
    arrived_at_ = now;
  }
  return now - arrived_at_ >= between_looks || now - near_since_ >= vibrating;
}

bool Axis402::has_arrived(std::uint16_t statusword, const std::string& doing) {
  const bool reached = (statusword & status_bit::target_reached) != 0;
  if (!goal_) return reached;
  if (!reached) {
    closest_.reset();
    arrived_.reset();
  } else {
    const std::int32_t at = position();
    const std::int64_t distance = std::abs(std::int64_t{*goal_} - at);
    if (distance <= tolerance()) return has_settled(at);
    arrived_.reset();
    if (!closest_ || distance < *closest_) {
      closest_ = distance;
      closest_at_ = objects_.now();
    }
    const bool may_creep = distance <= *closest_ + 1;  // the position unit may be too coarse to show progress
    const Time progress_at = may_creep ? std::max(closest_at_, crept_at_) : closest_at_;
    if (objects_.now() - progress_at >= options_.progress_timeout) {
      const std::string problem = try_to_stop();
      fail(fmt::format("{}: the drive shows the target as reached, but the position is {} and does not come nearer{}",
                       doing, at, problem.empty() ? "" : "; " + problem),
           "check whether the shaft turns or only the position drifts (encoder, its cable and its shield)");
    }
  }
  if (!stands()) return false;
  leave_if_at_limit(doing);
  if (!reached || objects_.now() - stands_since_ < 2 * standing) return false;  // slow motion may follow
  const std::int32_t goal = *goal_;
  const std::string problem = try_to_stop();
  fail(fmt::format("{}: the drive shows the target as reached, but the axis stands at {} instead of {}{}", doing,
                   *place_, goal, problem.empty() ? "" : "; " + problem),
       "check what blocks it (a hard stop, a brake, a torque limit), and whether the following error window (6065h) is "
       "switched off");
}

void Axis402::wait_for_target(Time timeout, const Progress& progress) {
  const std::string doing = order_.empty() ? "moving" : order_;
  place_.reset();
  near_.reset();
  closest_.reset();
  arrived_.reset();
  follow(timeout, progress, doing, [&](std::uint16_t word) { return has_arrived(word, doing); });
}

void Axis402::move_to(std::int32_t position, const MotionProfile& profile, Time timeout, const Progress& progress) {
  start_move_to(position, profile);
  wait_for_target(timeout, progress);
}

void Axis402::move_by(std::int32_t distance, const MotionProfile& profile, Time timeout, const Progress& progress) {
  start_move_by(distance, profile);
  wait_for_target(timeout, progress);
}

}  // namespace servodrome::master
