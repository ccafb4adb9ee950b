// Motions that last until they are stopped (velocity, jog, torque), and stop, halt and resume.
#include <cstdlib>
#include <fmt/format.h>
#include <limits>

#include "axis/axis402.hpp"
#include "axis/cia402_words.hpp"
#include "master/restored.hpp"

namespace servodrome::master {
namespace {

bool reached(std::uint16_t word) { return (word & status_bit::target_reached) != 0; }

int sign_of(std::int32_t number) { return number == 0 ? 0 : number > 0 ? 1 : -1; }

bool is_cyclic(OperationMode mode) {
  return mode == OperationMode::cyclic_synchronous_position || mode == OperationMode::cyclic_synchronous_velocity ||
         mode == OperationMode::cyclic_synchronous_torque;
}

// The distance that an axis at rest may move. While the integral of the velocity loop decreases, the shaft slips
// repeatedly against its friction (measured on an iSMK after a halt: slips of 2 rpm for 5 ms).
std::int64_t rest_of(double revolution) {
  constexpr double least = 10.0;
  constexpr double revolutions = 0.001;
  return std::llround(std::max(least, revolutions * std::abs(revolution)));
}

}  // namespace

// Sets the target velocity to 0 before the mode changes, so that the target of a former run does not act.
void Axis402::begin_velocity(const MotionProfile& profile) {
  halted_ = false;
  if (mode() != static_cast<std::int8_t>(OperationMode::profile_velocity)) objects_.write<std::int32_t>(0x60FF, 0, 0);
  set_mode(OperationMode::profile_velocity);
  write_profile(profile);
}

void Axis402::run_at(std::int32_t velocity, const MotionProfile& profile, Time timeout, const Progress& progress) {
  require_enabled("run");
  begin_velocity(profile);
  const std::string doing = fmt::format("running up to velocity {}", velocity);
  leave_if_cancelled(doing);
  require_no_stop("run");
  objects_.write<std::int32_t>(0x60FF, 0, velocity);
  write_controlword(command_word::enable_operation);
  place_.reset();
  direction_ = sign_of(velocity);
  follow(timeout, progress, doing, [&](std::uint16_t word) {
    if (reached(word)) return true;
    if (stands()) leave_if_at_limit(doing);
    return false;
  });
}

void Axis402::change_velocity(std::int32_t velocity) {
  require_enabled("change its velocity");
  const auto present = static_cast<OperationMode>(mode());
  if (present == OperationMode::profile_velocity) {
    objects_.write<std::int32_t>(0x60FF, 0, velocity);
    direction_ = sign_of(velocity);
    place_.reset();
    return;
  }
  if (present != OperationMode::profile_position || !goal_ || velocity <= 0 || is_outside_range(*goal_)) {
    fail(fmt::format("the velocity of this motion ({}) cannot be changed to {}", name(present, product().name),
                     velocity),
         "it can be changed in profile velocity, and (to a value above 0) during a move to a target within the range "
         "607Bh");
  }
  objects_.write<std::uint32_t>(0x6081, 0, static_cast<std::uint32_t>(velocity));
  // The drive applies 6081h with the next set-point, so the same target is sent again, at once or by resume().
  must_send_again_ = halted_;
  if (!halted_) hand_over(*goal_, command_word::enable_operation | change_immediately);
}

void Axis402::hold_for(Time span, const Progress& progress) {
  const Time end = objects_.now() + span;
  const std::string doing = "keeping on";
  place_.reset();
  follow(span + options_.state_timeout, progress, doing, [&](std::uint16_t) {
    if (stands()) leave_if_at_limit(doing);
    return objects_.now() >= end;
  });
  leave_if_rests_at_limit(doing);
}

void Axis402::jog(const MotionProfile& profile, const JogDemand& demand, bool waits_at_limit) {
  require_enabled("jog");
  const std::string doing = "jogging";
  begin_velocity(profile);
  objects_.write<std::int32_t>(0x60FF, 0, 0);
  require_no_stop("jog");
  write_controlword(command_word::enable_operation);
  std::int32_t asked = 0;
  direction_ = 0;
  try {
    for (;; objects_.wait(options_.poll_interval)) {
      leave_if_cancelled(doing);
      const AxisStatus present = status();
      if (present.state() != PowerState::operation_enabled) {
        fail("the drive left operation enabled while jogging",
             "look at the error code; then reset the fault and enable again");
      }
      const std::optional<std::int32_t> wanted = demand(present);
      if (!wanted) break;
      if (*wanted != asked) {
        objects_.write<std::int32_t>(0x60FF, 0, *wanted);
        asked = *wanted;
        direction_ = sign_of(asked);
        place_.reset();
      }
      if (!waits_at_limit && stands()) leave_if_at_limit(doing);
    }
    if (!waits_at_limit) leave_if_rests_at_limit(doing);
  } catch (...) {
    try_to_stop();
    throw;
  }
  stop();
}

void Axis402::jog_for(Time duration, std::int32_t velocity, const MotionProfile& profile, const Progress& progress) {
  const Time end = objects_.now() + duration;
  jog(profile, [&](const AxisStatus& present) -> std::optional<std::int32_t> {
    if (progress) progress(present);
    return objects_.now() < end ? std::optional(velocity) : std::nullopt;
  });
}

void Axis402::start_torque(std::int16_t torque_permille, const TorqueProfile& profile) {
  require_enabled("give torque");
  halted_ = false;
  if (mode() != static_cast<std::int8_t>(OperationMode::profile_torque)) objects_.write<std::int16_t>(0x6071, 0, 0);
  set_mode(OperationMode::profile_torque);
  write_if_given(0x6087, 0, profile.slope);
  require_no_stop("give torque");
  objects_.write<std::int16_t>(0x6071, 0, torque_permille);
  objects_.wait(options_.poll_interval);
  if (const auto kept = objects_.read<std::int16_t>(0x6071); kept != torque_permille) {
    fail(fmt::format("the target torque (6071h) is {} after {} was written", kept, torque_permille),
         "something else writes it: another target in the process data, an input, or another master");
  }
  write_controlword(command_word::enable_operation);
  place_.reset();
  direction_ = sign_of(torque_permille);
}

void Axis402::run_torque(std::int16_t torque_permille, const TorqueProfile& profile, Time timeout,
                         const Progress& progress) {
  start_torque(torque_permille, profile);
  const std::string doing = fmt::format("applying {:g} % of rated torque", torque_permille / 10.0);
  const std::int32_t start = position();
  follow(timeout, progress, doing, [&](std::uint16_t word) {
    if (stands()) leave_if_at_limit(doing);
    // At an active limit switch a drive may report the torque as reached without applying it. Only motion of the shaft
    // proves that it does.
    return reached(word) && (std::abs(std::int64_t{position()} - start) > 1 || !at_limit());
  });
}

// A stop must not fail because the drive does not report its units.
std::int64_t Axis402::rest_distance() {
  if (!rest_distance_) {
    try {
      const auto scale = this->units();
      rest_distance_ = rest_of(scale ? scale->position : 0.0);
    } catch (const MasterError&) {
      rest_distance_ = rest_of(0.0);
    }
  }
  return *rest_distance_;
}

std::int64_t Axis402::rest_increments() {
  if (!rest_increments_) rest_increments_ = rest_of(counts_per_revolution().value_or(0.0));
  return *rest_increments_;
}

// With halt set, target reached means standstill (CiA 402-2 table 29). Some drives (iSMK) do not report this in homing:
// for these drives, and in a quick stop, the axis is at standstill after 100 ms without a change of position. The
// timeout restarts each time the axis has become slower by 1 %, because a ramp may be long.
bool Axis402::wait_for_standstill(std::optional<Time> longest) {
  constexpr Time standing = std::chrono::milliseconds(100);
  constexpr Time between_looks = std::chrono::milliseconds(10);
  constexpr Time vibrating = std::chrono::milliseconds(500);
  const Time began = objects_.now();
  objects_.wait(settling);
  std::optional<std::int32_t> place;
  Time since{};
  std::optional<Time> reached_since;
  std::int64_t slowest = std::numeric_limits<std::int64_t>::max();
  Time deadline = objects_.now() + options_.state_timeout;
  for (;;) {
    const AxisStatus present = status();
    const bool is_enabled = present.state() == PowerState::operation_enabled;
    if (!is_enabled && present.state() != PowerState::quick_stop_active) return true;
    const Time now = objects_.now();
    if (!place || std::abs(std::int64_t{present.position} - *place) > rest_distance()) {
      place = present.position;
      since = now;
    } else if (now - since >= standing) {
      return true;
    }
    // The bit may be that of the motion before the halt, or wrong, so the position must confirm it.
    if (!is_enabled || !reached(present.statusword)) {
      reached_since.reset();
    } else if (now - since >= between_looks || now - reached_since.value_or(now) >= vibrating) {
      return true;
    } else if (!reached_since) {
      reached_since = now;
    }
    if (longest && is_enabled && now - began >= *longest) return false;
    if (const std::int64_t speed = std::abs(std::int64_t{present.velocity}); speed < slowest - slowest / 100) {
      slowest = speed;
      deadline = objects_.now() + options_.state_timeout;
    }
    if (objects_.now() >= deadline) {
      fail(is_enabled ? "the axis does not come to rest on halt" : "the axis does not come to rest by its quick stop",
           "use quick stop, and check the option codes 605Dh and 605Ah and the decelerations");
    }
    objects_.wait(options_.poll_interval);
  }
}

// Returns false if the axis is not enabled, or if another client has commanded a stop or the disabling. In the second
// case the drive executes that command, and a controlword of this master would interrupt it or enable the axis again.
bool Axis402::is_to_operate() {
  if (state() != PowerState::operation_enabled) return false;
  return is_ordered_to_operate(present_controlword());
}

// A word with the bit fault reset counts as well: a drive without a fault ignores it and stays enabled.
bool Axis402::is_ordered_to_operate(std::uint16_t word) {
  return commands_operation(word) || (word & control_bit::fault_reset) != 0;
}

std::uint16_t Axis402::present_controlword() {
  try {
    return objects_.read<std::uint16_t>(0x6040);
  } catch (const MasterError&) {
    return controlword_ != 0 ? controlword_ : command_word::enable_operation;  // some drives only accept writes
  }
}

// One wrong bit makes operation enabled look like switched on, or like quick stop active. Switched on counts only if
// the shaft rests and a second read shows the same state.
PowerState Axis402::state_to_stop() {
  constexpr Time between_looks = std::chrono::milliseconds(30);
  const PowerState present = state();
  if (present != PowerState::switched_on) return present;
  const auto before = static_cast<std::uint32_t>(position());
  objects_.wait(between_looks);
  const auto moved = static_cast<std::int32_t>(static_cast<std::uint32_t>(position()) - before);
  return std::abs(std::int64_t{moved}) > rest_distance() ? PowerState::not_ready_to_switch_on : state();
}

void Axis402::stop() {
  const Restored rest(comes_to_rest_, true);
  const PowerState present = or_send(command_word::quick_stop, [this] { return state_to_stop(); });
  if (present == PowerState::quick_stop_active) return quick_stop();
  if (is_doubtful(present)) return stop_in_doubt();
  if (present != PowerState::operation_enabled) return;
  if (!or_send(command_word::quick_stop, [this] { return is_to_operate(); })) return complete_stop_of_another();
  const OperationMode mode = or_send(command_word::quick_stop, [this] { return command_halt(); });
  if (!wait_for_standstill(options_.longest_halt)) {
    became_quick_stop_ = true;
    return quick_stop();
  }
  if (!is_to_operate()) return;
  if (mode == OperationMode::profile_velocity) {
    objects_.write<std::int32_t>(0x60FF, 0, 0);
    write_controlword(command_word::enable_operation);
  } else if (mode == OperationMode::homing) {
    write_controlword(command_word::enable_operation);  // bit 4 is 0: homing is aborted
  }
}

// A statusword that matches no state counts as not ready to switch on. One wrong bit makes operation enabled look like
// fault reaction active. So in both states the axis may be in motion.
bool Axis402::is_doubtful(PowerState state) {
  return state == PowerState::not_ready_to_switch_on || state == PowerState::fault_reaction_active;
}

// Sends a quick stop, because the axis may be in motion. A drive that really is in one of the states of is_doubtful()
// ignores it.
void Axis402::stop_in_doubt() {
  halted_ = false;
  write_controlword(command_word::quick_stop);
  rests_within(options_.state_timeout);
}

void Axis402::begin_stop() {
  const Restored rest(comes_to_rest_, true);
  or_send(command_word::quick_stop, [this] {
    if (is_to_operate()) command_halt();
  });
}

void Axis402::begin_stop_of(std::span<Axis402* const> axes) {
  std::vector<Axis402*> slow;
  for (Axis402* axis : axes) {
    const Restored rest(axis->comes_to_rest_, true);
    const LimitedWait limited(axis->objects_, short_wait);
    try {
      if (axis->is_to_operate()) axis->command_halt();
    } catch (const std::exception&) {
      slow.push_back(axis);
    }
  }
  for (Axis402* axis : slow) {
    try {
      axis->begin_stop();
    } catch (const std::exception&) {
      // Ignored, so that the next axis is stopped; stop() reports the error again.
    }
  }
}

// Waits for the end of a stop or a disabling that another client has commanded. If the axis does not come to rest by
// it, commands a quick stop.
void Axis402::complete_stop_of_another() {
  try {
    if (wait_for_standstill(options_.longest_halt)) return;
  } catch (const ObjectError&) {
    throw;
  } catch (const MasterError&) {
    // The axis does not come to rest: the quick stop below follows.
  }
  quick_stop();
}

// Commands the halt; returns the mode in which the axis then brakes.
OperationMode Axis402::command_halt() {
  halted_ = false;
  goal_.reset();
  auto mode = static_cast<OperationMode>(this->mode());
  if (mode == OperationMode::profile_torque || is_cyclic(mode)) {
    // In torque modes a halt removes at most the torque, and the axis coasts. A target velocity of 0 brakes it. In
    // cyclic modes some drives do not report standstill.
    if (mode == OperationMode::profile_torque) objects_.write<std::int16_t>(0x6071, 0, 0);
    begin_velocity({});
    mode = OperationMode::profile_velocity;
  }
  write_controlword(command_word::enable_operation | control_bit::halt);
  return mode;
}

std::string Axis402::try_to_stop() {
  try {
    stop();
    return {};
  } catch (const MasterError& error) {
    return error.what();
  }
}

std::string Axis402::try_to_switch_off() {
  const auto problem_of = [](const auto& call) -> std::string {
    try {
      call();
      return {};
    } catch (const MasterError& error) {
      return error.what();
    }
  };
  const Restored rest(comes_to_rest_, true);
  if (!try_to_stop().empty()) problem_of([this] { quick_stop(); });
  return problem_of([this] { disable(); });
}

void Axis402::halt() {
  const PowerState present = state_to_stop();
  if (is_doubtful(present)) return stop_in_doubt();
  if (present == PowerState::quick_stop_active) return quick_stop();
  if (present != PowerState::operation_enabled) return;
  if (halted_ && (present_controlword() & control_bit::halt) != 0) return;
  mode_ = mode();
  if (*mode_ == static_cast<std::int8_t>(OperationMode::profile_torque)) {
    fail("an axis in a torque mode cannot be halted: it would coast", "stop it");
  }
  const Restored rest(comes_to_rest_, true);
  if (!is_to_operate()) return complete_stop_of_another();
  // Another client may have begun the motion: bits 4 to 6 of its controlword stay, so that resume() continues it.
  constexpr unsigned of_mode = start_homing | change_immediately | relative_move;
  const unsigned kept = present_controlword() & of_mode;
  write_controlword(static_cast<std::uint16_t>(command_word::enable_operation | kept | control_bit::halt));
  halted_ = true;
  must_send_again_ = product().dialect.halt_drops_target;
  wait_for_standstill();
}

void Axis402::resume() {
  if (!halted_) return;
  require_enabled("go on");
  place_.reset();  // the halt does not count as time without progress
  closest_.reset();
  arrived_.reset();
  const bool moves = mode() == static_cast<std::int8_t>(OperationMode::profile_position);
  if (moves && must_send_again_) {
    if (!goal_ || is_outside_range(*goal_)) fail("the drive has dropped the halted move", "order it anew");
    return hand_over(*goal_, command_word::enable_operation);
  }
  halted_ = false;
  write_controlword(static_cast<std::uint16_t>(controlword_ & ~unsigned{control_bit::halt}));
  ordered_ = objects_.now();
}

}  // namespace servodrome::master
