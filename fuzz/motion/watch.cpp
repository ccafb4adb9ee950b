#include <cmath>
#include <fmt/format.h>
#include <utility>

#include "watch_terms.hpp"

namespace servodrome::motion {

namespace {

constexpr auto rows = std::to_array<InvariantRow>({
    {"torque-without-operation",
     "no torque outside Operation enabled, quick stop, fault reaction (and Switched on, where the maker has it)"},
    {"coasting-gains-speed", "a shaft without load and without power gains no speed"},
    {"wrong-transition", "power states follow each other as CiA 402 has them"},
    {"enabled-unasked", "Operation enabled is entered by the command for it"},
    {"demand-jumps", "the position demand moves no faster than the motor may, unless it is put where the shaft is"},
    {"cyclic-demand-jumps", "likewise where a master's targets are followed"},
    {"demand-too-steep", "in profile modes the demand gains speed no faster than the ramps that are set"},
    {"demand-too-fast", "in profile modes the demand gains no speed above 607Fh and 6080h"},
    {"limit-not-obeyed",
     "a demand above 6080h, 607Fh in profile velocity or 6081h of a set-point at once comes down by a ramp"},
    {"first-target-jumps", "the target that a cyclic mode begins with, if it is far away, is no step of the speed"},
    {"stop-runs-away", "a stop rests within v^2/2a of the speed at its beginning and the loop's lag"},
    {"stop-never-ends", "a stop comes to its end, and so does a motion in profile position without a set-point"},
    {"halt-ends-with-a-jump", "what goes on after a halt goes on with the speed that the shaft has"},
    {"stop-goes-back",
     "a shaft that was too fast for the ramp of a stop or a rest without a target is not pulled back"},
    {"torque-begins-wrong", "profile torque begins in motion with a torque between 0 and the target"},
    {"limit-switch-passed", "an active limit switch is not driven into"},
    {"software-limit-passed", "607Dh is not passed"},
    {"target-missed", "a set-point that was taken ends at its target"},
    {"never-arrives", "... and it ends"},
    {"no-way-off-limit", "a relative set-point or a cyclic target away from an active limit switch is gone to"},
    {"demand-beyond-targets",
     "in cyclic position the demand stays between the targets, but for its way to rest at the beginning and one "
     "period"},
    {"bus-overloaded", "drives with their factory settings leave room on the bus"},
    {"moves-unasked", "a resting axis moves only after a command"},
    {"let-go-in-motion", "power is not taken from a turning motor at the end of a stop with a ramp"},
    {"torque-beyond-limit", "torque stays within 6072h, 60E0h and 60E1h"},
    {"reached-is-untrue", "statusword bit 10 is set only at the target"},
    {"reached-is-missing", "... and is set there, and at the end of a halt"},
    {"limit-is-untrue",
     "bit 11 of profile velocity shows that 607Fh or 6080h holds the axis back, and nothing else does"},
    {"following-error-is-untrue", "bit 13 of the position modes shows that the shaft is out of 6065h, and only that"},
    {"zero-speed-is-untrue", "statusword bit 12 of profile velocity is set only at rest"},
    {"velocity-not-obeyed", "60FFh = 0 stops the axis"},
    {"mode-display", "6061h is a mode that the product has"},
    {"position-is-untrue", "6064h is the shaft's place by 607Bh, 607Eh, 607Ch and 32 bits"},
    {"probe-is-untrue", "a touch probe latches where the shaft has just been"},
    {"lost-master-ignored", "a master that 1016h watches and that is lost ends the operation, as 6007h has it"},
    {"range-way-is-untrue", "a target in a range 607Bh is gone to in the direction that 60F2h says"},
    {"fault-without-code", "in Fault 603Fh and 1001h tell why"},
    {"register-without-error", "without a fault or a warning 1001h is 0"},
    {"error-history", "1003h has the code that 603Fh shows"},
    {"al-status", "an AL status code is there when, and only when, the error bit is"},
    {"emergency-missing", "a fault is told by an EMCY"},
    {"stale-statusword", "a TPDO shows a statusword that was true when it could be sent"},
    {"pdo-in-wrong-state", "no PDO outside NMT operational"},
    {"false-alarm", "no alarm of hardware that is whole"},
    {"energy", "what the phases take is heat, work and field"},
    {"not-finite", "positions, speeds and torques are numbers"},
    {"no-way-back", "every state has a way back to Operation enabled"},
    {"not-deterministic", "the same sequence twice is the same to the last bit"},
});

}  // namespace

std::span<const InvariantRow> invariants() { return rows; }

Watch::Watch(line::Axis& axis, std::size_t number)
    : axis_(axis),
      drive_(axis.device().drive()),
      objects_(drive_.axis().objects),
      number_(number),
      counts_per_revolution_(axis.plant().parameters().encoder.counts_per_revolution),
      counts_per_s_per_rpm_(counts_per_revolution_ / 60.0),
      rated_torque_nm_(axis.plant().parameters().motor.rated_torque_nm),
      inertia_kgm2_(axis.plant().parameters().motor.rotor_inertia_kgm2),
      load_inertia_kgm2_(axis.plant().parameters().load.inertia_kgm2),
      negative_wire_(1u << axis.settings().product->wiring.negative_limit),
      positive_wire_(1u << axis.settings().product->wiring.positive_limit) {
  const drive::MotorData& motor = drive_.configuration().motor;
  lost_by_fault_only_ = axis.settings().product->name.starts_with("ismk");
  peak_torque_share_ = static_cast<double>(motor.peak_current_a) / static_cast<double>(motor.rated_current_a);
  const plant::Motor& built = axis.plant().parameters().motor;
  // Torque per A rms = phases / 2 p flux sqrt(2); the voltage is flux times the electrical speed.
  emf_per_speed_ =
      built.torque_constant_nm_per_a / (0.5 * built.phases * std::sqrt(2.0)) * 2.0 * pi / counts_per_revolution_;
  voltage_share_ = built.phases == 2 ? 1.0 : 1.0 / std::sqrt(3.0);
  statusword_at_.fill(-1);
}

void Watch::fail(const char* invariant, std::string text) {
  if (finding_) return;
  finding_ = Finding{invariant, number_, tick_, std::move(text)};
}

double Watch::greatest_speed() const {
  double limit = static_cast<double>(drive_.configuration().motor.max_speed_rpm);
  if (objects_.max_motor_speed_rpm != 0) limit = std::min(limit, static_cast<double>(objects_.max_motor_speed_rpm));
  return limit / 60.0 * counts_per_revolution_;
}

double Watch::torque_acceleration() const {
  double share = std::min({peak_torque_share_, objects_.max_torque * 0.001, objects_.positive_torque_limit * 0.001,
                           objects_.negative_torque_limit * 0.001});
  const drive::Configuration& own = drive_.configuration();
  share =
      std::min({share, static_cast<double>(own.torque_limit_positive), static_cast<double>(own.torque_limit_negative)});
  const double left = 0.8 * share - std::abs(around_->load_share) - 0.05;
  if (left <= 0.05) return 0.0;
  return left * rated_acceleration_;
}

// The measured speed is late while the shaft brakes hard, and coarse with few encoder lines. The tolerance is a
// fraction of the motor's nameplate speed, independent of 6080h.
double Watch::unsure_speed() const {
  return 0.02 * static_cast<double>(drive_.configuration().motor.max_speed_rpm) * counts_per_s_per_rpm_;
}

Watch::Ramp Watch::gentlest() const {
  const drive::Units& units = drive_.axis().units;
  constexpr std::uint32_t none = 0xFFFFFFFF;
  std::uint32_t least = none;  // values less 1, so that 0 (no ramp) becomes the greatest number
  const auto take = [&least](std::uint32_t value) { least = std::min(least, value - 1); };
  take(objects_.profile_deceleration);
  take(objects_.quick_stop_deceleration);
  take(objects_.max_deceleration);
  take(objects_.max_acceleration);
  take(objects_.profile_acceleration);
  if (mode_ == Mode::homing) {  // a homing in progress may keep an earlier ramp
    take(objects_.homing_acceleration);
    take(around_->gentlest_homing_ramp);
  }
  double slope = least == none ? 0.0 : (static_cast<double>(least) + 1.0) * units.acceleration;
  if (mode_ == Mode::velocity) {  // it has its own ramps, in rpm and s; 0 s: no ramp
    const auto own = [&](std::uint32_t speed, std::uint16_t seconds) {
      if (speed != 0 && seconds != 0) slope = Ramp::lower(slope, speed * counts_per_s_per_rpm_ / seconds);
    };
    own(objects_.vl_deceleration_delta_speed, objects_.vl_deceleration_delta_time_s);
    own(objects_.vl_quick_stop_delta_speed, objects_.vl_quick_stop_delta_time_s);
  }
  return {slope, objects_.profile_jerk[0] * units.jerk, objects_.motion_profile_type != 0};
}

// Collects the ramps since the last standstill, because a motion keeps the ramp with which it was planned, and a
// set-point the one with which it was given.
void Watch::ramps() {
  const bool stands = drive_.axis().demand.velocity == 0.0F && mode_ != Mode::profile_position;
  const Ramp now = gentlest();
  // The drive may have begun with the ramp of the previous tick.
  ramp_set_ = !pwm_ || stands || mode_ != mode_before_ ? now.gentler(gentlest_before_) : ramp_set_.gentler(now);
  gentlest_before_ = now;
  steepest_given_ = mode_ == mode_before_ ? std::max(steepest_given_, steepest()) : 0.0;
  const double end = objects_.end_velocity * drive_.axis().units.velocity;
  // A halted or waiting set-point still has its end velocity.
  const bool done = !drive_.in_motion() && (objects_.controlword & controlword::halt) == 0 &&
                    (objects_.statusword & drive::statusword::mode_bit_12) == 0 &&
                    (objects_.statusword & drive::statusword::target_reached) != 0;
  done_ticks_ = done ? done_ticks_ + 1 : 0;
  if (mode_ != mode_before_ || done_ticks_ > 2 * cycle_ticks) end_velocity_given_ = 0.0;
  end_velocity_given_ = std::max(end_velocity_given_, end);
}

double Watch::steepest() const {
  std::uint32_t most = std::max({objects_.profile_acceleration, objects_.profile_deceleration,
                                 objects_.quick_stop_deceleration, objects_.homing_acceleration});
  if (drive_.policy().ramps.zeros_are_greatest)
    most = std::max({most, objects_.max_acceleration, objects_.max_deceleration});
  return most * drive_.axis().units.acceleration;
}

// The drive stops before a limit with the quick stop's ramp, unless the ramp of the motion is steeper.
double Watch::limit_slope() const {
  if (mode_ == Mode::velocity) {  // it has its own ramp for that, 604Ah in rpm and s
    const double rpm_per_s =
        objects_.vl_quick_stop_delta_speed / std::max(1.0, static_cast<double>(objects_.vl_quick_stop_delta_time_s));
    return rpm_per_s * counts_per_s_per_rpm_;
  }
  const double quick = drive_.axis().quick_stop_ramp();
  return quick > 0.0 ? quick : slope();
}

// When a stop begins, the present torque still acts for a short time. The torque that a loop needed for a ramp is in
// its integral and acts for longer; `slope` below 0 leaves that part out.
double Watch::overshoot(double slope) const {
  const double inertia = inertia_kgm2_ + load_inertia_kgm2_ * around_->inertia_factor;
  const double torque = std::abs(axis_.plant().torque_nm()) + std::abs(around_->load_share) * rated_torque_nm_;
  const double gained = torque / inertia / (2.0 * pi) * counts_per_revolution_;
  return slope < 0.0 ? gained * torque_in_flight_s
                     : gained * torque_in_flight_s + std::min(gained, slope > 0.0 ? slope : gained) * integral_s;
}

double Watch::lag(double velocity) const {
  const auto gain = static_cast<double>(drive_.configuration().gains.position_kp);
  return gain > 0.0 ? 1.3 * std::abs(velocity) / gain : 0.0;
}

std::int64_t Watch::demand_cycle() const {
  const std::uint8_t own = drive_.configuration().rates.position_loop_ticks;
  return own != 0 ? own : drive_.policy().loops.position_ticks;
}

// The additional time, in s, that a change of speed by `speed` (counts/s) takes compared with a linear ramp. A
// jerk-limited ramp begins with the present acceleration of the demand, and gains speed until the jerk has reduced it
// to 0.
double Watch::jerk_delay(double speed, double ramp, double acceleration) const {
  if (!ramp_set_.shaped) return 0.0;
  const double jerk = ramp_set_.jerk;
  if (jerk <= 0.0) return speed / ramp;  // a sin2 ramp, whose mean slope is lower
  const double begun = std::min(std::abs(acceleration), std::max(steepest(), ramp));
  const double gained = 0.5 * begun * begun / jerk;
  return (speed + 2.0 * gained) / ramp + begun / jerk + std::min(ramp / jerk, 2.0 * std::sqrt((speed + gained) / jerk));
}

Watch::Stopping Watch::stopping(double velocity, double slope) const {
  const double jerk = ramp_set_.shaped ? ramp_set_.jerk : 0.0;
  const double pushing = std::min(std::abs(drive_.axis().generator.acceleration()), std::max(steepest(), slope));
  const double speed = std::abs(velocity) + still_rpm / 60.0 * counts_per_revolution_ + overshoot(slope) +
                       (jerk > 0.0 ? 0.5 * pushing * pushing / jerk : 0.0);
  double braking = acceleration_;
  if (slope > 0.0) braking = std::min(braking, slope);
  if (braking <= 0.0) return {1e18, 1e18};
  double seconds = speed / braking + jerk_delay(speed, braking);
  seconds +=
      0.001 * drive_.configuration().smoothing_ms + 0.003 * static_cast<double>(drive_.configuration().position_lag_ms);
  return {0.5 * speed * seconds + speed * lag_s + place_revolutions * counts_per_revolution_, seconds + lag_s};
}

// Returns true if the motor can follow its commands: for a while nothing has disturbed its motion.
bool Watch::motion_can_be_judged() const {
  return around_->powered && !around_->locked && (around_->injected & spoils_motion) == 0 &&
         std::abs(around_->load_share) + std::abs(objects_.torque_offset) * 0.001 <= heavy_load &&
         around_->supply_share >= 0.8 && around_->supply_share <= 1.2 && tick_ - around_->disturbed > ms(150) &&
         tick_ - voltage_spent_ > ms(50);
}

void Watch::look() {
  if (finding_) return;
  const plant::Plant& plant = axis_.plant();
  position_ = static_cast<double>(plant.position_counts()) + plant.position_fraction();
  velocity_ = plant.velocity_rpm() * counts_per_s_per_rpm_;
  if (!std::isfinite(position_ + velocity_ + plant.torque_nm())) {
    return fail("not-finite",
                fmt::format("position {}, velocity {}, torque {}", position_, velocity_, plant.torque_nm()));
  }
  if ((around_->injected & spoils_motion) != 0) {
    spoilt_ = true;
    spoiled_ = tick_;
  }
  // The current loop cannot control a motor whose back-EMF reaches the DC link's voltage. That does not excuse a shaft
  // that became so fast during a stop.
  constexpr double spent_share = 0.9;
  const double available = axis_.plant().dc_link_v() * voltage_share_;
  const bool runs_away = told_to_stop() && judgeable_ && acceleration_ > 0.0 &&
                         std::abs(velocity_) > 1.5 * stop_.speed + 4.0 * still_rpm * counts_per_s_per_rpm_;
  if (std::abs(velocity_) * emf_per_speed_ > spent_share * available && !runs_away) voltage_spent_ = tick_;
  pwm_ = axis_.actuation().pwm_enabled;
  shorted_ = axis_.actuation().short_circuit;
  state_ = around_->powered ? drive_.state() : PowerState::not_ready_to_switch_on;
  mode_ = drive_.mode();
  if (first_ || disturbed_ != around_->disturbed) {
    disturbed_ = around_->disturbed;
    slowest_ = 1e18;
  }
  if (first_) {
    before_ = state_;
    mode_before_ = mode_;
    rest_ = position_;
    first_ = false;
    look_up_bits();
  }
  if (inertia_factor_ != around_->inertia_factor) {
    inertia_factor_ = around_->inertia_factor;
    const double inertia = inertia_kgm2_ + load_inertia_kgm2_ * inertia_factor_;
    rated_acceleration_ = rated_torque_nm_ * counts_per_revolution_ / (2.0 * pi * inertia);
  }
  judgeable_ = motion_can_be_judged();
  acceleration_ = torque_acceleration();
  if (std::abs(velocity_) < still_rpm / 60.0 * counts_per_revolution_ && drive_.axis().demand.velocity == 0.0F)
    stood_ = tick_;
  if (tick_ % ms(1000.0 * torque_in_flight_s) == 0) fastest_ = {0.0, fastest_[0]};
  fastest_[0] = std::max(fastest_[0], std::abs(velocity_));
  if (mode_ != mode_before_) {
    mode_since_ = tick_;
    look_up_bits();
  }
  if (pwm_ != had_pwm_) pwm_before_ = std::exchange(pwm_since_, tick_);
  coasting();
  if (around_->powered) {
    // A frame may wait for the bus, so a command counts from when it has reached the objects.
    const std::uint64_t asked = static_cast<std::uint64_t>(objects_.controlword) << 48 ^
                                static_cast<std::uint64_t>(static_cast<std::uint8_t>(objects_.modes_of_operation))
                                    << 40 ^
                                static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.target_position)) * 3 ^
                                static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.target_velocity)) * 5;
    if (asked != asked_before_) asked_ = tick_;
    asked_before_ = asked;
    // The drive calculates it again when a TPDO is sent, so a bit of the loops may show for a single tick.
    const std::uint16_t statusword = drive_.statusword();
    if (shown_count_ == 0 || shown_[(shown_count_ - 1) % shown_.size()].statusword != statusword) {
      shown_[shown_count_++ % shown_.size()] = {tick_, statusword};
    }
    look_at_frame();
    power();
    states();
    count_targets();
    ramps();
    demand();
    speed_limits();
    stops();
    limit_switches();
    software_limits();
    set_points();
    off_limit();
    beyond_targets();
    unasked();
    torque();
    errors();
    constexpr std::int64_t bits_every = 4;  // ticks; these conditions must last for some milliseconds anyway
    if (tick_ % bits_every == 0) {
      bits();
      limit_bit();
      following_error_bit();
      error_registers();
    }
    shown_position();
    touch_probes();
    lost_master();
  }
  had_pwm_ = pwm_;
  was_powered_ = around_->powered;
  mode_before_ = mode_;
  if (state_ != before_) {
    before_ = state_;
    state_since_ = tick_;
  }
}

}  // namespace servodrome::motion
