#include <cmath>
#include <fmt/format.h>

#include "watch_terms.hpp"

// Checks the bits of the statusword against the shaft.
namespace servodrome::motion {

void Watch::bits() {
  const std::uint16_t word = objects_.statusword;
  const bool judged = state_ == PowerState::operation_enabled && pwm_ && judgeable_ &&
                      tick_ - std::max(state_since_, mode_since_) > ms(20);
  // the last word without bit 7, because a word with bit 7 commands nothing
  const std::uint16_t commanded = drive_.axis().controlword;
  const bool halt = (commanded & controlword::halt) != 0;
  bool lies = false;
  double expected = 0.0;
  if (judged && (word & drive::statusword::target_reached) != 0 &&
      drive::command_of(commanded) == drive::Command::enable_operation) {
    const drive::Axis& axis = drive_.axis();
    if (mode_ == Mode::profile_velocity && !halt) {
      const bool windowed = objects_.velocity_window != 0xFFFF;
      expected = axis.units.velocity_to_counts(objects_.target_velocity);
      if (axis.active(drive::Signal::invert_direction)) expected = -expected;
      // 606Ch is compared with 60FFh itself, not with its value clipped to 607Fh and 6080h (CiA 402-2, profile
      // velocity).
      const double window = std::max(windowed ? objects_.velocity_window * axis.units.velocity : 0.0,
                                     axis.configuration.speed_windows.reached_counts_per_s);
      const double tolerance = window + 0.05 * std::abs(expected) + 3.0 * still_rpm / 60.0 * counts_per_revolution_;
      lies = windowed && std::abs(velocity_ - expected) > tolerance;
    } else if (mode_ == Mode::profile_position || (mode_ == Mode::profile_velocity && halt)) {
      // With 6067h off, bit 10 shows that the demand has arrived, even if the motor has too little torque to follow.
      const bool window_off = mode_ == Mode::profile_position && objects_.position_window == 0xFFFFFFFF;
      const bool gives_its_best = (objects_.statusword & drive::statusword::internal_limit_active) != 0;
      lies = std::abs(velocity_) > 4.0 * still_rpm / 60.0 * counts_per_revolution_ && end_velocity_given_ == 0.0 &&
             acceleration_ > 0.0 && !(window_off && gives_its_best);
    }
  }
  // In profile position, with bit 10 set, the shaft must be near the demand, which then stands at the target ...
  const std::uint32_t window = objects_.position_window;
  if (judged && !halt && !lies && mode_ == Mode::profile_position && !drive_.in_motion() && window < 0x7FFFFFFF &&
      (word & drive::statusword::target_reached) != 0 && drive_.axis().demand.loop == Loop::position) {
    const auto most = std::abs(static_cast<double>(drive_.axis().units.to_counts(static_cast<std::int32_t>(window))));
    // ... or near the target: after a halt the demand stands elsewhere, and the shaft may pass the target.
    const auto target = static_cast<double>(drive_.axis().units.to_counts(objects_.target_position)) -
                        static_cast<double>(drive_.position_offset());
    const double beside = std::min(std::abs(static_cast<double>(drive_.axis().demand.position) - position_),
                                   std::abs(target - position_));
    lies = beside > 1.1 * most + std::abs(velocity_) * 2.0 * cycle_ticks * tick_s + 3.0;
  }
  if (!lies) lie_since_ = tick_;
  if (tick_ - lie_since_ > ms(60.0 + objects_.velocity_window_time_ms)) {
    return fail("reached-is-untrue", fmt::format("bit 10 at {:.0f} rpm, {:.0f} are wanted, mode {}", rpm(velocity_),
                                                 rpm(expected), static_cast<int>(mode_)));
  }
  // Bit 10 must be 0 during a stop. Excepted is an axis that a load lets swing about its standing demand.
  const bool reached = (word & drive::statusword::target_reached) != 0;
  const bool stopping = stop_.kind != StopKind::none && stop_.kind < StopKind::velocity && pwm_ && judgeable_ &&
                        acceleration_ > 0.0 && !swings_about_rest() &&
                        std::abs(velocity_) > 4.0 * still_rpm / 60.0 * counts_per_revolution_;
  if (!stopping || !reached || !shown_bits_.reached) stop_lie_since_ = tick_;
  if (tick_ - stop_lie_since_ > ms(20)) {
    return fail("reached-is-untrue",
                fmt::format("bit 10 at {:.0f} rpm in a stop, mode {}", rpm(velocity_), static_cast<int>(mode_)));
  }
  const bool halted = judged && halt && !drive_.in_motion() &&
                      (mode_ == Mode::profile_position || mode_ == Mode::profile_velocity) &&
                      std::abs(velocity_) < 2.0 / 60.0 * counts_per_revolution_ &&
                      drive::command_of(commanded) == drive::Command::enable_operation;
  if (!halted || reached || !shown_bits_.reached) unsaid_since_ = tick_;
  if (tick_ - unsaid_since_ > ms(300)) {
    return fail("reached-is-missing",
                fmt::format("the halted axis rests for 300 ms without bit 10, mode {}", static_cast<int>(mode_)));
  }
  const bool zero_lies = judged && mode_ == Mode::profile_velocity && (word & drive::statusword::mode_bit_12) != 0 &&
                         !drive_.configuration().speed_windows.used &&
                         std::abs(velocity_) > objects_.velocity_threshold * drive_.axis().units.velocity +
                                                   4.0 * still_rpm / 60.0 * counts_per_revolution_ &&
                         shown_bits_.zero_speed;
  if (!zero_lies) zero_lie_since_ = tick_;
  if (tick_ - zero_lie_since_ > ms(60.0 + objects_.velocity_threshold_time_ms)) {
    fail("zero-speed-is-untrue", fmt::format("bit 12 at {:.0f} rpm", rpm(velocity_)));
  }
}

// Looks up which bits of the statusword have the meanings that are checked here, in the present mode.
void Watch::look_up_bits() {
  using enum drive::StatusSource;
  const auto shows = [this](unsigned bit, drive::StatusSource source) {
    const auto& rows = drive_.policy().status.bits;
    return std::any_of(rows.begin(), rows.end(), [&](const drive::StatusBit& row) {
      return row.bit == bit && row.source == source && (row.modes & drive::mode_bit(mode_)) != 0;
    });
  };
  shown_bits_ = {.reached = shows(10, target_reached),
                 .limit = shows(11, internal_limit),
                 .zero_speed = shows(12, mode_bit_12),
                 .following_error = shows(13, following_error) || shows(13, mode_bit_13)};
}

void Watch::limit_bit() {
  const drive::Axis& axis = drive_.axis();
  const bool judged = state_ == PowerState::operation_enabled && mode_ == Mode::profile_velocity && pwm_ &&
                      judgeable_ && stop_.kind == StopKind::none && !drive_.identification().running() &&
                      (axis.controlword & controlword::halt) == 0 &&  // a word with bit 7 keeps the halt before it
                      shown_bits_.limit && acceleration_ > 0.0 && !axis.software_limits_active() &&
                      !axis.active(drive::Signal::negative_limit) && !axis.active(drive::Signal::positive_limit) &&
                      objects_.profile_acceleration != 0 &&
                      tick_ - std::max({state_since_, mode_since_, around_->commanded, asked_}) > ms(300);
  if (!judged) {
    limit_lie_since_ = tick_;
    return;
  }
  const double wanted = std::abs(axis.units.velocity_to_counts(objects_.target_velocity));
  double most = greatest_speed();
  if (objects_.max_profile_velocity != 0) most = std::min(most, objects_.max_profile_velocity * axis.units.velocity);
  const bool shown = (objects_.statusword & drive::statusword::internal_limit_active) != 0;
  // The axis turns at the wanted speed with little torque. A stop at a switch only passes this speed.
  const bool steady =
      drive_.axis().generator.acceleration() == 0.0 &&
      std::abs(std::abs(velocity_) - wanted) < 0.02 * wanted + still_rpm / 60.0 * counts_per_revolution_ &&
      std::abs(axis_.plant().torque_nm()) < 0.5 * rated_torque_nm_;
  // A limit switch holds the axis until the next command even after it has opened, and bit 11 shows that.
  const bool held = axis.demand.velocity == 0.0F && wanted != 0.0;
  const bool lies = shown ? wanted < 0.9 * most && steady && !held : wanted > 1.05 * most;
  if (!lies) limit_lie_since_ = tick_;
  if (tick_ - limit_lie_since_ > ms(50)) {
    fail("limit-is-untrue",
         fmt::format("bit 11 is {}, {:.0f} rpm are wanted, {:.0f} allowed", shown ? 1 : 0, rpm(wanted), rpm(most)));
  }
}

void Watch::following_error_bit() {
  const drive::Axis& axis = drive_.axis();
  const bool judged = state_ == PowerState::operation_enabled && pwm_ && axis.demand.loop == Loop::position &&
                      (mode_ == Mode::profile_position || mode_ == Mode::cyclic_sync_position) &&
                      (around_->injected & spoils_motion) == 0 && objects_.following_error_window != 0 &&
                      shown_bits_.following_error && tick_ - std::max(state_since_, mode_since_) > ms(20);
  const bool shown = (objects_.statusword & drive::statusword::mode_bit_13) != 0;
  if (!judged || shown != following_shown_) following_lie_since_ = tick_;
  following_shown_ = shown;
  if (!judged) return;
  const double error = std::abs(static_cast<double>(axis.demand.position) - position_);
  const bool off = objects_.following_error_window == 0xFFFFFFFF;
  const auto window = std::abs(static_cast<double>(axis.units.to_counts(objects_.following_error_window)));
  // The drive measures the error a cycle late and to one count.
  const double slack = std::abs(velocity_) * 2.0 * cycle_ticks * tick_s + 2.0;
  const bool lies = shown ? off || error + slack < 0.9 * window : !off && error > 1.1 * window + slack;
  if (!lies) following_lie_since_ = tick_;
  if (tick_ - following_lie_since_ > ms(20.0 + (shown ? 0.0 : objects_.following_error_time_out_ms))) {
    fail("following-error-is-untrue",
         fmt::format("bit 13 is {}, the shaft is {:.0f} counts off, 6065h has {:.0f}", shown ? 1 : 0, error, window));
  }
}

}  // namespace servodrome::motion
