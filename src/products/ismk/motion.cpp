#include "products/ismk/motion.hpp"

#include <algorithm>
#include <cmath>

#include "drive/drive.hpp"
#include "products/ismk/units.hpp"

namespace servodrome::products::ismk {

namespace {

using dictionary::AbortCode;
using dictionary::Entry;
using drive::Mode;

constexpr std::uint32_t key(const Entry& entry) { return entry.key(); }

// 60FBh sub 4 (Table 6-5).
constexpr std::int64_t trapezoid = 1;
constexpr std::int64_t s_curve = 3;
// 6086h of the S-curve: the manual prints no jerk, so it is the shape without that parameter (README.md).
constexpr std::int16_t s_curve_shape = static_cast<std::int16_t>(drive::RampShape::sin2);

// 6099h sub 6 (ch. 5.5), the window in which homing ignores the index: with 1 a quarter of a turn while the drive
// determines the right window, with 2 half a turn.
constexpr std::uint8_t blind_automatic = 1;
constexpr std::uint8_t blind_half_turn = 2;
constexpr double automatic_blind_turns = 0.25;
constexpr double fixed_blind_turns = 0.5;

double revolution(const drive::Drive& drive) { return drive.axis().units.counts_per_revolution; }

// The window that always leads to the same index: none if the index is far from the edge of the switch; half a turn if
// it is so near that a small displacement of the edge would lead to the neighbouring index.
std::uint8_t blind_window_for(double turns_from_edge) {
  const double place = turns_from_edge - std::floor(turns_from_edge);
  return place < automatic_blind_turns || place > 1.0 - automatic_blind_turns ? blind_half_turn : 0;
}

std::uint8_t sync_period_ms(const ServoObjects& objects) {
  return static_cast<std::uint8_t>(1U << objects.motion.sync_period);  // Table 9-26, 3011.01
}
Time sync_period(const ServoObjects& objects) { return std::chrono::milliseconds(sync_period_ms(objects)); }

bool interpolates_by_sync(const drive::Drive& drive, const ServoObjects& objects) {
  return drive.mode() == Mode::interpolated_position && drive.state() == drive::PowerState::operation_enabled &&
         (objects.drive.controlword & drive::controlword::mode_bit_4) != 0 && objects.motion.sync_clock_mode != 0;
}

void take_over_shape(ServoObjects& objects) {
  objects.drive.motion_profile_type = objects.motion.profile_order == s_curve ? s_curve_shape : std::int16_t{0};
}
void take_over_period(ServoObjects& objects) {
  objects.drive.interpolation_time_period_value = sync_period_ms(objects);
  objects.drive.interpolation_time_index = -3;
}

double velocity_dec(double counts_per_s) { return counts_per_s * velocity_dec_per_inc_s; }

// 60F9h sub 1Ch: target less actual velocity, in the modes with target 60FFh.
double speed_error(const drive::Drive& drive, const drive::Objects& objects) {
  const drive::Axis& axis = drive.axis();
  const bool speed_mode = drive.mode() == Mode::profile_velocity || drive.mode() == Mode::immediate_velocity;
  const double target = axis.units.velocity_to_counts(objects.target_velocity);
  const double wanted = !speed_mode ? static_cast<double>(drive.loops().velocity_reference_counts_per_s)
                        : axis.active(drive::Signal::invert_direction) ? -target
                                                                       : target;
  const double error = wanted - axis.shown_velocity();
  return axis.units.velocity_inverted ? -error : error;
}

}  // namespace

void MotionControl::configure(const ServoObjects& objects, drive::Configuration& configuration) {
  const Motion& own = objects.motion;
  const drive::MotorData& motor = configuration.motor;
  configuration.speed_windows = {.used = true,
                                 .reached_counts_per_s = own.target_speed_window / velocity_dec_per_inc_s,
                                 .zero_counts_per_ms = objects.io.zero_speed_window_inc_per_ms,
                                 .zero_ms = own.zero_speed_time_ms};
  // Table 5-18 (2340.01) prints "disables" for both values. Here 1 enables.
  if (own.step_stop_mode != 0) {
    const auto share = static_cast<float>(std::abs(own.step_stop_current / peak_current_dec));
    configuration.standstill_current_a = std::min(share, 1.0F) * motor.peak_current_a;
  }
  configuration.smoothing_ms = own.smoothing_ms;
  configuration.locks_to_sync = own.sync_clock_mode != 0;
  const double top_speed = objects.drive.max_profile_velocity / velocity_dec_per_inc_s;
  if (top_speed > 0.0)
    configuration.torque_mode_velocity_positive = configuration.torque_mode_velocity_negative = top_speed;
  configuration.homing_end = own.home_offset_mode == 0 ? drive::HomingEnd::offset : drive::HomingEnd::home;
  const double blind_turns = own.index_blind_window == blind_automatic   ? automatic_blind_turns
                             : own.index_blind_window == blind_half_turn ? fixed_blind_turns
                                                                         : 0.0;
  configuration.homing_blind_window =
      static_cast<drive::Counts>(blind_turns * static_cast<double>(motor.counts_per_revolution));
  const auto current_a = static_cast<float>(own.homing_current / peak_current_dec) * motor.peak_current_a;
  configuration.homing_torque_limit = current_a * motor.torque_constant_nm_per_a / motor.rated_torque_nm;
}

void MotionControl::loaded(ServoObjects& objects) {
  take_over_shape(objects);
  take_over_period(objects);
}

AbortCode MotionControl::check(const Entry& entry, std::int64_t number, const drive::Drive& drive) {
  switch (key(entry)) {
    case 0x60FB04: return number == trapezoid || number == s_curve ? AbortCode::none : AbortCode::value_invalid;
    case 0x60FB05: return drive.energised() ? AbortCode::device_state : AbortCode::none;  // ch. 7.8
    default: return AbortCode::none;
  }
}

bool MotionControl::written(const Entry& entry, ServoObjects& objects, const drive::Drive& drive) {
  const double thousandth_per_dec = drive.axis().units.current * 1000.0;
  drive::Objects& common = objects.drive;
  Motion& own = objects.motion;
  switch (key(entry)) {
    case 0x2FF009:  // one target speed in two units (ch. 8.4.2)
      common.target_velocity = rounded<std::int32_t>(velocity_dec_from_rpm(own.target_speed_rpm));
      return true;
    case 0x2FF00E: common.following_error_window = own.following_error_limit * 100U; return true;  // Table 6-5
    case 0x607100:  // one target of torque mode in two units (Table 5-9)
      own.target_current = rounded<std::int16_t>(common.target_torque / thousandth_per_dec);
      return true;
    case 0x60F608: common.target_torque = rounded<std::int16_t>(own.target_current * thousandth_per_dec); return true;
    case 0x607F00:  // one limit in two units (ch. 5.2.1.4)
      common.max_motor_speed_rpm = rounded<std::uint16_t>(rpm_from_velocity_dec(common.max_profile_velocity));
      // 0 would mean: no limit.
      if (common.max_profile_velocity != 0) common.max_motor_speed_rpm = std::max(common.max_motor_speed_rpm, 1U);
      return false;
    case 0x608000:
      common.max_profile_velocity = rounded<std::uint32_t>(velocity_dec_from_rpm(common.max_motor_speed_rpm));
      return false;
    case 0x301101: take_over_period(objects); return true;
    case 0x60FB04: take_over_shape(objects); return true;
    default: return false;
  }
}

void MotionControl::refresh(const Entry& entry, ServoObjects& objects, const drive::Drive& drive) {
  const drive::Axis& axis = drive.axis();
  const double sign = axis.units.velocity_inverted ? -1.0 : 1.0;
  drive::Objects& common = objects.drive;
  Motion& own = objects.motion;
  switch (key(entry)) {
    case 0x2FF009: own.target_speed_rpm = rounded<std::int16_t>(rpm_from_velocity_dec(common.target_velocity)); break;
    case 0x2FF00E: own.following_error_limit = rounded<std::uint16_t>(common.following_error_window / 100.0); break;
    case 0x606300:  // the actual position in the user's direction, for any value of 607Eh (ch. 7.2)
      common.position_actual_internal_value = drive::wrap_to_32_bits(axis.to_user_position(axis.position()));
      break;
    case 0x60FC00:
      common.position_demand_internal_value =
          drive::wrap_to_32_bits(axis.to_user_position(axis.generator.nearest_position()));
      break;
    case 0x60F508:
      own.torque_reached_current = rounded<std::int16_t>(
          sign * static_cast<double>(drive.loops().current_q_a / axis.configuration.motor.peak_current_a) *
          peak_current_dec);
      break;
    case 0x60F91A:
      own.actual_velocity_per_ms = rounded<std::int32_t>(sign * static_cast<double>(axis.counts_per_ms));
      break;
    case 0x60F91C: own.speed_error = rounded<std::int32_t>(velocity_dec(speed_error(drive, common))); break;
    default: break;
  }
}

std::uint16_t SyncMonitor::sync(Time now, Time period) {
  const bool early = running_ && now - last_ < period / 2;
  running_ = true;
  last_ = now;
  return early ? 1 : 0;
}

std::uint16_t SyncMonitor::wait(Time now, Time period) {
  if (!running_ || now - last_ <= period + period / 2) return 0;
  last_ += period;
  return 1;
}

void MotionControl::sync(const drive::Drive& drive, ServoObjects& objects, Time now) {
  if (!interpolates_by_sync(drive, objects)) return sync_monitor_.stop();
  objects.motion.sync_lost_count =
      static_cast<std::uint16_t>(objects.motion.sync_lost_count + sync_monitor_.sync(now, sync_period(objects)));
}

void MotionControl::watch_sync(const drive::Drive& drive, ServoObjects& objects, Time now) {
  if (!interpolates_by_sync(drive, objects)) return sync_monitor_.stop();
  objects.motion.sync_lost_count =
      static_cast<std::uint16_t>(objects.motion.sync_lost_count + sync_monitor_.wait(now, sync_period(objects)));
}

bool MotionControl::cycle(drive::Drive& drive, ServoObjects& objects) {
  const bool enabled = drive.state() == drive::PowerState::operation_enabled;
  if (homing_.running()) {
    homing_.step(drive, objects.drive);
  } else if (enabled && !enabled_once_ && objects.motion.homing_at_power_on != 0) {
    homing_.start(drive, objects.drive);  // Table 5-14, ch. 5.5
  }
  enabled_once_ = enabled_once_ || enabled;

  std::uint8_t& blind_window = objects.motion.index_blind_window;
  const bool found = drive.homed() && !was_homed_;
  was_homed_ = drive.homed();
  if (!found || blind_window != blind_automatic || drive.homing_index_distance() < 0) return false;
  blind_window = blind_window_for(static_cast<double>(drive.homing_index_distance()) / revolution(drive));
  return true;
}

}  // namespace servodrome::products::ismk
