#include "watch.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <utility>

#include "canopen/node.hpp"
#include "ethercat/slave/slave.hpp"

namespace servodrome::motion {

using drive::Loop;
using drive::Mode;
using drive::PowerState;
namespace controlword = drive::controlword;

namespace {

constexpr double tick_s = drive::tick_seconds;
constexpr std::int64_t ms(double milliseconds) { return static_cast<std::int64_t>(milliseconds * ticks_per_ms); }

constexpr double pi = 3.14159265358979323846;

// Tolerances, and where they come from.
constexpr double lag_s = 0.08;  // a loop follows its demand so late: 1/Kp of the softest factory gains, twice
constexpr double place_revolutions = 0.05;    // and stops so far beside: friction under a soft integral, and cogging
constexpr double still_rpm = 30.0;            // slower is rest: velocity ripple of a cogging motor held by a soft loop
constexpr double heavy_load = 0.6;            // of the rated torque: a motor at the edge of its limits is not judged
constexpr std::int64_t cycle_ticks = 16;      // the slowest position loop
constexpr double torque_in_flight_s = 0.002;  // until velocity and current loop have taken a torque back
constexpr double integral_s = 0.02;           // until a soft loop has taken back what its integral had for a ramp

constexpr bool one_of(PowerState state, std::initializer_list<PowerState> states) {
  return std::find(states.begin(), states.end(), state) != states.end();
}

constexpr bool has_stage(PowerState state) {
  return one_of(state,
                {PowerState::operation_enabled, PowerState::quick_stop_active, PowerState::fault_reaction_active});
}

// One step of the automaton of CiA 402 (with the way of some makers out of Quick stop active).
bool step_allowed(PowerState from, PowerState to) {
  using enum PowerState;
  if (from == to || to == not_ready_to_switch_on) return true;
  if (to == fault_reaction_active) return from != fault;
  switch (from) {
    case not_ready_to_switch_on: return one_of(to, {switch_on_disabled, fault});
    case switch_on_disabled: return one_of(to, {ready_to_switch_on, fault});
    case ready_to_switch_on: return one_of(to, {switched_on, switch_on_disabled, fault});
    case switched_on: return one_of(to, {operation_enabled, ready_to_switch_on, switch_on_disabled, fault});
    case operation_enabled:
      return one_of(to, {switched_on, ready_to_switch_on, switch_on_disabled, quick_stop_active, fault});
    case quick_stop_active: return one_of(to, {switch_on_disabled, operation_enabled, ready_to_switch_on, fault});
    case fault_reaction_active: return to == fault;
    case fault: return to == switch_on_disabled;
  }
  return false;
}

// More than one command may come within a tick.
bool allowed(PowerState from, PowerState to) {
  if (step_allowed(from, to)) return true;
  for (std::uint8_t one = 0; one < 8; ++one) {
    const auto by = static_cast<PowerState>(one);
    if (!step_allowed(from, by)) continue;
    if (step_allowed(by, to)) return true;
    for (std::uint8_t two = 0; two < 8; ++two) {
      const auto then = static_cast<PowerState>(two);
      if (step_allowed(by, then) && step_allowed(then, to)) return true;
    }
  }
  return false;
}

constexpr std::uint32_t bit(plant::Injection injection) { return 1u << static_cast<unsigned>(injection); }
// Without these the motor does what the current loop says.
constexpr std::uint32_t spoils_motion = bit(plant::Injection::encoder_loss) | bit(plant::Injection::encoder_crc) |
                                        bit(plant::Injection::encoder_delimiter) | bit(plant::Injection::open_phase_u) |
                                        bit(plant::Injection::open_phase_v) | bit(plant::Injection::open_phase_w) |
                                        bit(plant::Injection::short_phase_u) | bit(plant::Injection::short_phase_v) |
                                        bit(plant::Injection::short_phase_w) | bit(plant::Injection::brake_stuck) |
                                        bit(plant::Injection::supply_loss) | bit(plant::Injection::chopper_broken);

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
    {"stop-goes-back", "a shaft that was too fast for the ramp of a stop is not pulled back afterwards"},
    {"limit-switch-passed", "an active limit switch is not driven into"},
    {"software-limit-passed", "607Dh is not passed"},
    {"target-missed", "a set-point that was taken ends at its target"},
    {"never-arrives", "... and it ends"},
    {"no-way-off-limit", "a relative set-point or a cyclic target away from an active limit switch is gone to"},
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

Watch::Ramp Watch::gentlest() const {
  const drive::Units& units = drive_.axis().units;
  constexpr std::uint32_t none = 0xFFFFFFFF;
  std::uint32_t least = none;  // less 1, so that 0 is none
  const auto take = [&least](std::uint32_t value) { least = std::min(least, value - 1); };
  take(objects_.profile_deceleration);
  take(objects_.quick_stop_deceleration);
  take(objects_.max_deceleration);
  take(objects_.max_acceleration);
  take(objects_.profile_acceleration);
  if (mode_ == Mode::homing) {  // under way it may keep one of before
    take(objects_.homing_acceleration);
    take(around_->gentlest_homing_ramp);
  }
  const double slope = least == none ? 0.0 : (static_cast<double>(least) + 1.0) * units.acceleration;
  return {slope, objects_.profile_jerk[0] * units.jerk, objects_.motion_profile_type != 0};
}

// What moves keeps the ramp that it was planned with, and a set-point the one that it was given with.
void Watch::ramps() {
  const bool stands = drive_.axis().demand.velocity == 0.0F && mode_ != Mode::profile_position;
  ramp_set_ = !pwm_ || stands || mode_ != mode_before_ ? gentlest() : ramp_set_.gentler(gentlest());
}

double Watch::steepest() const {
  std::uint32_t most = std::max({objects_.profile_acceleration, objects_.profile_deceleration,
                                 objects_.quick_stop_deceleration, objects_.homing_acceleration});
  if (drive_.policy().zero_ramps_are_greatest)
    most = std::max({most, objects_.max_acceleration, objects_.max_deceleration});
  return most * drive_.axis().units.acceleration;
}

// A limit is kept by the quick stop's ramp, unless the one of the motion is steeper.
double Watch::limit_slope() const {
  const double quick = drive_.axis().quick_stop_ramp();
  return quick > 0.0 ? quick : slope();
}

// The torque that flows when a stop begins acts for some time yet. What a loop holds for a ramp is in its integral;
// `slope` below 0: that is not meant.
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
  return own != 0 ? own : drive_.policy().position_loop_ticks;
}

// What a change of speed by `speed` (counts/s) takes longer than with a linear ramp, in s. A jerk-limited one goes on
// with the acceleration that the demand has when it begins, and gains speed until the jerk has taken that away.
double Watch::jerk_delay(double speed, double ramp, double acceleration) const {
  if (!ramp_set_.shaped) return 0.0;
  const double jerk = ramp_set_.jerk;
  if (jerk <= 0.0) return speed / ramp;  // a sin2 ramp of the same peak
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

// The motor does what it is told: nothing was done to it for a while that moves it by itself.
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
  if ((around_->injected & spoils_motion) != 0) spoilt_ = true;
  // A motor whose own voltage is that of the DC link is out of the current loop's hands.
  constexpr double spent_share = 0.9;
  const double available = axis_.plant().dc_link_v() * voltage_share_;
  if (std::abs(velocity_) * emf_per_speed_ > spent_share * available) voltage_spent_ = tick_;
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
  if (mode_ != mode_before_) {
    mode_since_ = tick_;
    look_up_bits();
  }
  if (pwm_ != had_pwm_) pwm_before_ = std::exchange(pwm_since_, tick_);
  coasting();
  if (around_->powered) {
    // A frame may wait for the bus: the command comes when the objects have it.
    const std::uint64_t asked = static_cast<std::uint64_t>(objects_.controlword) << 48 ^
                                static_cast<std::uint64_t>(static_cast<std::uint8_t>(objects_.modes_of_operation))
                                    << 40 ^
                                static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.target_position)) * 3 ^
                                static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.target_velocity)) * 5;
    if (asked != asked_before_) asked_ = tick_;
    asked_before_ = asked;
    if (shown_count_ == 0 || shown_[(shown_count_ - 1) % shown_.size()].statusword != objects_.statusword) {
      shown_[shown_count_++ % shown_.size()] = {tick_, objects_.statusword};
    }
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
    unasked();
    torque();
    bits();
    limit_bit();
    following_error_bit();
    errors();
    error_registers();
  }
  had_pwm_ = pwm_;
  was_powered_ = around_->powered;
  mode_before_ = mode_;
  if (state_ != before_) {
    before_ = state_;
    state_since_ = tick_;
  }
}

void Watch::power() {
  const bool allowed_here =
      has_stage(state_) || (state_ == PowerState::switched_on && drive_.policy().energised_in_switched_on) ||
      // a brake closes before power goes
      (drive_.configuration().has_brake() && tick_ - state_since_ < ms(drive_.configuration().brake_engage_ms + 2.0));
  unpowered_ticks_ = (pwm_ || shorted_) && !allowed_here ? unpowered_ticks_ + 1 : 0;
  if (unpowered_ticks_ > cycle_ticks) {
    fail("torque-without-operation", fmt::format("the stage is on in {}, {:.2f} Nm at {:.1f} rpm", drive::name(state_),
                                                 axis_.plant().torque_nm(), rpm(velocity_)));
  }
  // The end of a stop.
  if (had_pwm_ && !pwm_ && !shorted_ && was_powered_ && judgeable_ && acceleration_ > 0.0 &&
      axis_.feedback().hardware_faults == 0) {
    const drive::FaultRow* fault = drive_.shown_fault();
    std::int16_t code = 0;
    bool judged = true;
    switch (before_) {
      case PowerState::quick_stop_active:
        code = objects_.quick_stop_option_code;
        judged = !one_of(state_, {PowerState::fault, PowerState::fault_reaction_active});
        break;
      case PowerState::fault_reaction_active:
        code = objects_.fault_reaction_option_code;
        judged = fault != nullptr && fault->reaction == drive::Reaction::option_code;
        break;
      case PowerState::operation_enabled:
        judged =
            !one_of(state_, {PowerState::fault, PowerState::fault_reaction_active, PowerState::not_ready_to_switch_on});
        switch (drive::command_of(objects_.controlword)) {
          case drive::Command::shutdown: code = objects_.shutdown_option_code; break;
          case drive::Command::switch_on: code = objects_.disable_operation_option_code; break;
          case drive::Command::quick_stop: code = objects_.quick_stop_option_code; break;
          default: judged = false;
        }
        break;
      default: judged = false;
    }
    // As long as a brake opens, it still holds the axis, and nothing has begun that could be ended by a ramp.
    if (tick_ - pwm_before_ <= ms(drive_.configuration().brake_release_ms)) judged = false;
    // By hand, a second time: disable voltage waits for no ramp.
    if (drive::command_of(objects_.controlword) == drive::Command::disable_voltage) judged = false;
    const bool ramp = code == 1 || code == 2 || code == 3 || code == 5 || code == 6 || code == 7;
    // Or before a stop could be seen to begin.
    const std::int64_t began = told_to_stop() ? stop_.began : tick_;
    const double passed = static_cast<double>(tick_ - began) * tick_s;
    const bool in_time = !told_to_stop() || (stop_.seconds < 1e9 && passed < stop_.seconds + 0.5);
    // A stop that has come to rest is over. What moves the shaft while its brake closes is a load.
    const bool rested = stood_ >= began - ms(drive_.configuration().brake_engage_ms + 5.0);
    // Writes of the option code while the stop runs leave open which of them counts.
    if (judged && ramp && in_time && !rested && std::abs(velocity_) > 3.0 * still_rpm / 60.0 * counts_per_revolution_) {
      fail("let-go-in-motion", fmt::format("power goes at {:.0f} rpm, {:.1f} ms after the stop began in {}",
                                           rpm(velocity_), 1000.0 * passed, drive::name(before_)));
    }
  }
}

void Watch::coasting() {
  const bool free = !pwm_ && !shorted_ && around_->load_share == 0.0 && !around_->locked;
  const double speed = std::abs(velocity_);
  // The current that flows on through the diodes may still push.
  const bool current = std::abs(axis_.plant().torque_nm()) > 0.02 * rated_torque_nm_;
  if (!free || current || pwm_ != had_pwm_) {
    slowest_ = speed;
    return;
  }
  slowest_ = std::min(slowest_, speed);
  // A cogging torque gives back what it took.
  if (speed > slowest_ + 60.0 / 60.0 * counts_per_revolution_) {
    fail("coasting-gains-speed", fmt::format("{:.1f} rpm, after {:.1f} rpm", rpm(speed), rpm(slowest_)));
  }
}

void Watch::states() {
  if (state_ == before_) return;
  if (!was_powered_) return;
  if (!allowed(before_, state_)) {
    return fail("wrong-transition", fmt::format("{} to {}", drive::name(before_), drive::name(state_)));
  }
  if (state_ == PowerState::operation_enabled &&
      drive::command_of(objects_.controlword) != drive::Command::enable_operation) {
    fail("enabled-unasked", fmt::format("from {}, controlword {:04X}h", drive::name(before_), objects_.controlword));
  }
  if (state_ == PowerState::fault || state_ == PowerState::fault_reaction_active) {
    if (!one_of(before_, {PowerState::fault, PowerState::fault_reaction_active})) fault_since_ = tick_;
  }
}

void Watch::demand() {
  const drive::LoopDemand& now = drive_.axis().demand;
  Demand demand{now.loop, static_cast<double>(now.position) + static_cast<double>(now.position_fraction),
                static_cast<double>(now.velocity)};
  if (now.loop != Loop::position) demand.position = demand_before_.position;
  const bool new_cycle = demand.position != demand_before_.position || demand.velocity != demand_before_.velocity ||
                         demand.loop != demand_before_.loop;
  const Demand before = demand_before_;
  if (!new_cycle) {
    if (tick_ - demand_tick_ > demand_cycle() && now.loop == Loop::position) demand_speed_ = 0.0;
    return;
  }
  demand_before_ = demand;
  // A command that comes between two cycles may change the velocity of a demand that moves with the next one only.
  const bool between = demand_tick_ >= 0 && tick_ - demand_tick_ < demand_cycle();
  if (between && now.loop == before.loop && demand.position == before.position) return;
  const std::int64_t passed = demand_tick_ < 0 ? cycle_ticks : std::max(tick_ - demand_tick_, demand_cycle());
  demand_speed_ = now.loop == Loop::position && before.loop == Loop::position && demand_tick_ >= 0
                      ? (demand.position - before.position) / (static_cast<double>(passed) * tick_s)
                      : demand.velocity;
  const std::int64_t cycle = std::min(passed, cycle_ticks);
  demand_tick_ = tick_;
  // An encoder that fails, and the place that it shows again afterwards, moves what begins with the shaft.
  if ((around_->injected & spoils_motion) != 0) spoiled_ = tick_;
  if (!pwm_ || !had_pwm_ || tick_ - spoiled_ < ms(150)) {
    ramp_ = 0.0;
    return;
  }
  const double seconds = static_cast<double>(cycle) * tick_s;
  // Where the shaft is, a position loop's lag before it. The speed that the drive measures is late.
  const double speed = std::abs(velocity_) + overshoot(-1.0);
  const bool caught = tick_ - around_->disturbed < ms(10);  // a locked rotor stands at once, from any speed
  const double near = speed * 4.0 * cycle_ticks * tick_s + lag(speed) + 0.004 * counts_per_revolution_ + 3.0;
  if (demand.loop == Loop::position && before.loop == Loop::position) {
    const double moved = std::abs(demand.position - before.position);
    // The nameplate's, since a demand comes down to a 6080h that was lowered by its ramps.
    const double most = static_cast<double>(drive_.configuration().motor.max_speed_rpm) / 60.0 *
                            counts_per_revolution_ * 1.02 * seconds +
                        2.0;
    // What comes half way back to the shaft, or nearer, moves nothing that is faster than it was.
    const bool back = std::abs(demand.position - position_) < 0.5 * std::abs(before.position - position_);
    if (moved > most && !caught && !back && std::abs(demand.position - position_) > near) {
      const bool cyclic = mode_ == Mode::cyclic_sync_position || mode_ == Mode::interpolated_position;
      return fail(cyclic ? "cyclic-demand-jumps" : "demand-jumps",
                  fmt::format("by {:.0f} counts in {:.3f} ms (at most {:.0f}), shaft {:.0f} counts behind, mode {}",
                              moved, 1000.0 * seconds, most, demand.position - position_, static_cast<int>(mode_)));
    }
  }
  if (demand.loop == Loop::position && before.loop == Loop::position)
    first_target(before.velocity, demand.velocity, seconds);
  after_halt(demand, seconds);
  // Profile modes: no speed is gained faster than by the steepest ramp.
  const bool profiled = state_ == PowerState::operation_enabled && tick_ - mode_since_ > 2 * cycle_ticks &&
                        tick_ - state_since_ > 2 * cycle_ticks && judgeable_ &&
                        (mode_ == Mode::profile_position || mode_ == Mode::profile_velocity);
  const bool loops = demand.loop == before.loop && (demand.loop == Loop::position || demand.loop == Loop::velocity);
  if (!profiled || !loops) {
    ramp_ = 0.0;
    return;
  }
  if (before.velocity == 0.0 && demand.velocity == 0.0) ramp_ = 0.0;
  const drive::Units& units = drive_.axis().units;
  ramp_ = std::max(ramp_, steepest());
  const bool gains = std::abs(demand.velocity) > std::abs(before.velocity) || demand.velocity * before.velocity < 0.0;
  if (!gains) return;
  const bool starts_with_speed = drive_.policy().end_velocity_is_start && objects_.end_velocity != 0;
  const double change = std::abs(demand.velocity - before.velocity);
  // The cycle in which a plan begins, and rounding of a float.
  const double allowance = ramp_ * 2.0 * seconds * 1.02 + 1e-4 * greatest_speed();
  // From the shaft's speed, which may brake hard and be known a cycle late, a ramp's step further.
  const bool taken_over = std::abs(demand.velocity - velocity_) <
                          0.05 * std::abs(velocity_) + greatest_speed() * 0.02 + overshoot(-1.0) + allowance;
  const bool smoothed = drive_.configuration().smoothing_ms != 0 || drive_.configuration().position_lag_ms > 0.0F;
  if (change > allowance && !taken_over && !starts_with_speed && !smoothed) {
    return fail(
        "demand-too-steep",
        fmt::format("from {:.1f} to {:.1f} rpm in {:.3f} ms, the ramps allow {:.2f} rpm, mode {}", rpm(before.velocity),
                    rpm(demand.velocity), 1000.0 * seconds, rpm(allowance), static_cast<int>(mode_)));
  }
  double most = greatest_speed();
  if (objects_.max_profile_velocity != 0) most = std::min(most, objects_.max_profile_velocity * units.velocity);
  if (std::abs(demand.velocity) > most * 1.001 + 1e-4 * greatest_speed() && !taken_over &&
      tick_ - around_->commanded > 2 * cycle_ticks && mode_ == Mode::profile_velocity) {
    fail("demand-too-fast", fmt::format("{:.1f} rpm and growing, {:.1f} are allowed", rpm(demand.velocity), rpm(most)));
  }
}

// Where the demand of a cyclic mode begins, with the mode, with its power, after a halt, the target that is there may
// be far away.
void Watch::count_targets() {
  const bool cyclic = mode_ == Mode::cyclic_sync_position || mode_ == Mode::interpolated_position;
  if (!cyclic) {  // with the mode the count begins anew
    targets_ = 0;
    return;
  }
  const std::uint64_t target =
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.target_position)) << 32 ^
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.position_offset)) * 5 ^
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.interpolation_data_record)) * 3 ^
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.min_position_limit)) *
          7 ^  // it is clipped to them
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(objects_.max_position_limit)) * 11;
  if (state_ != PowerState::operation_enabled || !pwm_ || stop_.kind != StopKind::none || mode_since_ == tick_) {
    targets_ = 0;
  } else if (target != cyclic_target_) {
    ++targets_;
  }
  cyclic_target_ = target;
}

void Watch::first_target(double from, double to, double seconds) {
  const bool cyclic = mode_ == Mode::cyclic_sync_position || mode_ == Mode::interpolated_position;
  const std::uint16_t word = drive_.axis().controlword;
  const bool runs = state_ == PowerState::operation_enabled && (word & controlword::halt) == 0 &&
                    drive::command_of(word) == drive::Command::enable_operation && stop_.kind == StopKind::none;
  if (!cyclic || !runs || targets_ > 0 || !judgeable_) return;
  constexpr double jump_share = 0.13;
  const double greatest =
      static_cast<double>(drive_.configuration().motor.max_speed_rpm) / 60.0 * counts_per_revolution_;
  // From the demand, or from the shaft that a mode takes over.
  const double gained = std::abs(to) - std::max(std::abs(from), std::abs(velocity_));
  const drive::MotionLimits limits = drive_.axis().catch_up_limits();
  const double most =
      std::max(jump_share * greatest, 1.1 * std::max(limits.acceleration, limits.deceleration) * seconds);
  if (gained > most && objects_.velocity_offset == 0) {
    fail("first-target-jumps", fmt::format("from {:.0f} to {:.0f} rpm in {:.3f} ms, mode {}", rpm(from), rpm(to),
                                           1000.0 * seconds, static_cast<int>(mode_)));
  }
}

// With the first demand after a halt, which may have ended anywhere on its ramp.
void Watch::after_halt(const Demand& demand, double seconds) {
  const std::uint16_t word = drive_.axis().controlword;
  const bool runs = state_ == PowerState::operation_enabled && state_ == before_ && mode_since_ != tick_ &&
                    drive::command_of(word) == drive::Command::enable_operation &&
                    (mode_ == Mode::profile_position || mode_ == Mode::profile_velocity);
  const bool halt =
      (word & controlword::halt) != 0 && (drive_.policy().modes_without_halt & drive::mode_bit(mode_)) == 0;
  const bool ended = std::exchange(halted_, runs && halt) && runs && !halt;
  const bool switched =
      drive_.axis().active(drive::Signal::negative_limit) || drive_.axis().active(drive::Signal::positive_limit);
  if (!ended || switched || !judgeable_ || acceleration_ <= 0.0) return;
  // The drive's speed is a cycle old, and a shaft that follows its demand does so within 5 %.
  const double off = std::abs(demand.velocity - velocity_);
  const double most = 0.06 * std::abs(velocity_) + 2.0 * still_rpm / 60.0 * counts_per_revolution_ + overshoot(-1.0) +
                      2.0 * steepest() * seconds;
  if (off > most && objects_.end_velocity == 0) {
    fail("halt-ends-with-a-jump", fmt::format("{:.0f} rpm are demanded at {:.0f} rpm, mode {}", rpm(demand.velocity),
                                              rpm(velocity_), static_cast<int>(mode_)));
  }
}

void Watch::speed_limits() {
  const drive::LoopDemand& now = drive_.axis().demand;
  const bool judged = state_ == PowerState::operation_enabled && pwm_ && judgeable_ &&
                      (now.loop == Loop::position || now.loop == Loop::velocity) && mode_ != Mode::homing &&
                      mode_ != Mode::velocity && !drive_.identification().running();
  if (!judged) {
    excess_.most = -1.0;
    return;
  }
  double most = greatest_speed();
  if (mode_ == Mode::profile_velocity && objects_.max_profile_velocity != 0)
    most = std::min(most, objects_.max_profile_velocity * drive_.axis().units.velocity);
  if (at_once_.active && at_once_.taken) most = std::min(most, at_once_.speed);
  const double speed = std::abs(now.loop == Loop::position ? demand_speed_ : static_cast<double>(now.velocity));
  const double over = speed - most;
  if (over <= 0.02 * most + 0.002 * greatest_speed() || most != excess_.most) {
    // A demand that is taken over from the shaft comes down from there.
    const double excess = std::max({over, std::abs(velocity_) - most, 0.0});
    excess_ = {tick_, most, excess, drive_.axis().generator.acceleration(), 0.0};
    return;
  }
  // A motor without the torque for the ramp takes the demand along: then its torque is the ramp, and without any there
  // is no end.
  const double ramp = slope() > 0.0 ? std::min(slope(), acceleration_) : acceleration_;
  if (ramp <= 0.0) return;
  const drive::Configuration& own = drive_.configuration();
  const double enough = 1.1 * (excess_.over / ramp + jerk_delay(excess_.over, ramp, excess_.gaining)) + lag_s +
                        0.001 * own.smoothing_ms + 0.003 * static_cast<double>(own.position_lag_ms);
  excess_.done += tick_s / enough;  // ramps and torque may change meanwhile
  if (excess_.done > 1.0) {
    fail("limit-not-obeyed",
         fmt::format(
             "{:.0f} rpm are demanded since {:.3f} s, {:.0f} are allowed, {:.3f} s are enough to come down, mode {}",
             rpm(speed), static_cast<double>(tick_ - excess_.since) * tick_s, rpm(most), enough,
             static_cast<int>(mode_)));
  }
}

void Watch::stops() {
  StopKind kind = StopKind::none;
  const drive::Command command = drive::command_of(objects_.controlword);
  // A set-point that is given while the DC link charges counts with Operation enabled.
  const bool operates = state_ == PowerState::operation_enabled;
  if (mode_ != Mode::profile_position || mode_since_ == tick_ ||
      (!operates && before_ == PowerState::operation_enabled)) {
    has_target_ = false;
  } else if ((objects_.controlword & controlword::mode_bit_4) != 0 ||
             (operates && (objects_.statusword & drive::statusword::mode_bit_12) != 0)) {
    has_target_ = true;
  }
  const bool resets = (objects_.controlword & controlword::fault_reset) != 0;
  const bool halt = (objects_.controlword & controlword::halt) != 0 &&
                    (drive_.policy().modes_without_halt & drive::mode_bit(mode_)) == 0 && mode_ != Mode::none;
  if (state_ == PowerState::quick_stop_active) {
    kind = StopKind::quick;
  } else if (state_ == PowerState::fault_reaction_active) {
    kind = StopKind::fault;
  } else if (state_ == PowerState::operation_enabled && !resets) {
    if (command != drive::Command::enable_operation) {
      kind = StopKind::leave;
    } else if (halt) {
      kind = StopKind::halt;
    } else if (mode_ == Mode::profile_velocity && objects_.target_velocity == 0) {
      kind = StopKind::velocity;
    } else if (mode_ == Mode::profile_position && !has_target_) {
      kind = StopKind::no_target;
    } else if (mode_ == Mode::homing && (drive_.axis().controlword & controlword::mode_bit_4) == 0) {
      kind = StopKind::homing;
    }
  }
  if (!pwm_ || mode_ == Mode::velocity || (around_->injected & spoils_motion) != 0 || around_->locked)
    kind = StopKind::none;
  told_ = kind;
  // What slows down by a torque slope first goes on being driven meanwhile.
  if (mode_ == Mode::profile_torque && objects_.torque_slope != 0) kind = StopKind::none;
  if (kind == StopKind::none && stop_.kind == StopKind::none) return;
  // A limit switch releases what it holds, and homing goes on where it was.
  const std::int64_t settled = tick_ - std::max({stop_.since, around_->disturbed, mode_since_});
  if (kind != stop_.kind || around_->disturbed > stop_.since || mode_since_ > stop_.since || !judgeable_) {
    if (kind == StopKind::none) {
      stop_ = {};
      return;
    }
    // A stop that goes on in another mode keeps the ramp that it began with.
    const bool goes_on = kind == stop_.kind && stop_.slope > 0.0 && slope() > 0.0;
    const double gentlest = goes_on ? std::min(slope(), stop_.slope) : slope();
    // A shaft that lags behind the stop's ramp meanwhile may become as fast again.
    const double speed = goes_on ? std::max(std::abs(velocity_), stop_.speed) : std::abs(velocity_);
    const Stopping stopping = this->stopping(speed, gentlest);
    const bool turns = std::abs(velocity_) > 4.0 * still_rpm / 60.0 * counts_per_revolution_;
    const double direction = turns ? std::copysign(1.0, velocity_) : 0.0;
    const std::int64_t began = kind == stop_.kind ? stop_.began : tick_;
    stop_ = {kind,
             began,
             tick_,
             position_,
             stopping.counts,
             stopping.seconds,
             gentlest,
             speed,
             direction,
             direction * position_};
    return;
  }
  if (kind == StopKind::none) return;
  if (acceleration_ <= 0.0) {  // the torque that a stop needs was taken from it
    stop_.since = tick_;
    stop_.from = position_;
  }
  if (const double ramp = slope(); ramp != stop_.slope) {
    // Written while it runs: the stop may have been planned with the one of before, the loops' lag with either.
    const double gentler = ramp > 0.0 && stop_.slope > 0.0 ? std::min(ramp, stop_.slope) : std::max(ramp, stop_.slope);
    if (gentler != stop_.slope) {
      const Stopping stopping = this->stopping(velocity_, gentler);
      stop_ = {kind,    stop_.began, tick_,           position_,     stopping.counts, stopping.seconds,
               gentler, stop_.speed, stop_.direction, stop_.furthest};
      return;
    }
  }
  const double place = stop_.direction * position_;
  stop_.furthest = std::max(stop_.furthest, place);
  static constexpr std::array names{"none",           "halt",      "leaving operation", "quick stop",
                                    "fault reaction", "60FFh = 0", "homing given up",   "no set-point"};
  const char* name = names[static_cast<std::size_t>(kind)];
  const double way = std::abs(position_ - stop_.from);
  constexpr double rounding = 1.005;  // of ways of many revolutions
  if (way > rounding * stop_.counts) {
    return fail("stop-runs-away",
                fmt::format("{}: {:.2f} revolutions after {:.1f} ms, at {:.0f} rpm; {:.2f} are enough for it", name,
                            way / counts_per_revolution_, static_cast<double>(settled) / ticks_per_ms, rpm(velocity_),
                            stop_.counts / counts_per_revolution_));
  }
  constexpr double swing_revolutions = 0.4;  // of a soft loop
  // While a brake opens the axis is held where it is, whatever it did before.
  const bool held = stop_.since - pwm_since_ <= ms(drive_.configuration().brake_release_ms);
  if (kind < StopKind::velocity && !held && acceleration_ > 0.0 && drive_.axis().demand.loop == Loop::position &&
      stop_.furthest - place > swing_revolutions * counts_per_revolution_ + 0.1 * way) {
    return fail("stop-goes-back", fmt::format("{}: {:.2f} revolutions back, at {:.0f} rpm", name,
                                              (stop_.furthest - place) / counts_per_revolution_, rpm(velocity_)));
  }
  const double late = static_cast<double>(tick_ - stop_.since) * tick_s - stop_.seconds;
  // A soft loop may swing for long about a demand that rests at the end of its ramp.
  const bool swings =
      (kind == StopKind::no_target || kind == StopKind::homing) && drive_.axis().demand.velocity == 0.0F;
  if (late > 0.3 && !swings && std::abs(velocity_) > 2.0 * still_rpm / 60.0 * counts_per_revolution_) {
    const char* broken = kind == StopKind::velocity ? "velocity-not-obeyed" : "stop-never-ends";
    fail(broken, fmt::format("{}: still {:.0f} rpm after {:.3f} s; {:.3f} s are enough for it", name, rpm(velocity_),
                             static_cast<double>(tick_ - stop_.since) * tick_s, stop_.seconds));
  }
  if (late > 2.0 && kind == StopKind::fault) fail("stop-never-ends", "fault reaction active does not end");
}

void Watch::limit_switches() {
  if (drive_.policy().limit_switches != drive::LimitSwitches::stop) return;
  const std::uint32_t inputs = axis_.feedback().inputs;
  const bool any = (inputs & (negative_wire_ | positive_wire_)) != 0;
  if (!any && !limits_[0].active && !limits_[1].active) return;
  for (std::size_t i = 0; i < 2; ++i) {
    const double direction = i == 0 ? -1.0 : 1.0;
    const bool closed = (inputs & (i == 0 ? negative_wire_ : positive_wire_)) != 0;
    const bool signal = drive_.axis().active(i == 0 ? drive::Signal::negative_limit : drive::Signal::positive_limit);
    const bool active = closed && signal && pwm_ && has_stage(state_) && mode_ != Mode::homing && mode_ != Mode::none;
    Limit& limit = limits_[i];
    if (!active) {
      limit = {};
      continue;
    }
    // In the position loop the shaft comes to where the demand stands, though it may have swung back from there.
    const bool demanded = drive_.axis().demand.loop == Loop::position;
    const double speed = std::max(
        {0.0, direction * velocity_, demanded ? direction * static_cast<double>(drive_.axis().demand.velocity) : 0.0});
    const double place =
        demanded ? std::max(direction * position_, direction * static_cast<double>(drive_.axis().demand.position))
                 : direction * position_ + lag(speed);  // a stop may go on in the position loop
    // 605Ah and 605Eh choose the ramp of a quick stop and of a fault.
    const bool chosen = one_of(state_, {PowerState::quick_stop_active, PowerState::fault_reaction_active});
    double ramp = chosen && stop_.slope > 0.0 ? std::min(slope(), stop_.slope) : limit_slope();
    if (limit.slope > 0.0)
      ramp = ramp > 0.0 ? std::min(ramp, limit.slope) : limit.slope;  // it may have begun with that
    const double reach = place + stopping(speed, ramp).counts;
    const bool unknown = chosen && stop_.kind == StopKind::none;  // which ramp it is
    // Without torque nothing brakes.
    if (!limit.active || (chosen && stop_.since == tick_) || unknown || !judgeable_ || mode_since_ == tick_ ||
        acceleration_ <= 0.0) {
      limit = {true, reach, ramp, direction * position_};
      continue;
    }
    limit.slope = ramp;
    limit.furthest = std::min(limit.furthest, reach);
    constexpr double rounding = 0.005;  // of ways of many revolutions
    if (direction * position_ > limit.furthest + rounding * std::max(0.0, limit.furthest - limit.from)) {
      fail("limit-switch-passed", fmt::format("{:.2f} revolutions beyond, at {:.0f} rpm, mode {}",
                                              (direction * position_ - limit.furthest) / counts_per_revolution_,
                                              rpm(velocity_), static_cast<int>(mode_)));
    }
  }
}

void Watch::software_limits() {
  const drive::Axis& axis = drive_.axis();
  // A demand that the motor has no torque to follow is taken along by the shaft.
  const bool applies =
      pwm_ && state_ == PowerState::operation_enabled && axis.software_limits_active() && acceleration_ > 0.0 &&
      objects_.min_position_limit < objects_.max_position_limit && !axis.units.position_inverted &&
      (mode_ == Mode::profile_position || mode_ == Mode::profile_velocity || mode_ == Mode::interpolated_position ||
       mode_ == Mode::cyclic_sync_position || mode_ == Mode::profile_torque || mode_ == Mode::cyclic_sync_torque);
  // A cyclic target may end at a limit at any speed; a stop that begins there needs its way.
  const bool stopped =
      told_to_stop() || axis.active(drive::Signal::negative_limit) || axis.active(drive::Signal::positive_limit);
  if (stopped && !stopped_before_) stopped_since_ = tick_;
  const bool begins = stopped && tick_ - stopped_since_ <= demand_cycle();  // the drive hears of it with its cycle
  stopped_before_ = stopped;
  if (!applies) {
    borders_ = {};
    return;
  }
  const double slope = limit_slope();
  const auto offset = static_cast<double>(drive_.position_offset());
  // In the position loop the demand is judged, which has no lag; else the shaft.
  const bool demanded = axis.demand.loop == Loop::position;
  const double place_now = offset + (demanded ? static_cast<double>(axis.demand.position) : position_);
  const double slack = demanded ? 0.02 * counts_per_revolution_ : place_revolutions * counts_per_revolution_;
  for (std::size_t i = 0; i < 2; ++i) {
    const double direction = i == 0 ? -1.0 : 1.0;
    const std::int32_t limit = i == 0 ? objects_.min_position_limit : objects_.max_position_limit;
    Border& border = borders_[i];
    const double at = direction * static_cast<double>(axis.units.to_counts(limit));
    const double place = direction * place_now;
    // A demand that is taken over by a stop moves back, and goes on with its velocity.
    const double shaft = direction * velocity_;
    const double led = std::max(direction * demand_speed_, direction * static_cast<double>(axis.demand.velocity));
    const double speed = std::max({0.0, demanded ? led : shaft, begins ? shaft : 0.0});
    const double way = demanded ? ramp_way(speed, slope) : stopping(speed, slope).counts;
    const double reach = place + way + slack;
    if (!border.active || border.at != limit || border.demanded != demanded || slope < border.slope || begins ||
        !judgeable_ || tick_ - mode_since_ < 2 * cycle_ticks || tick_ - state_since_ < 2 * cycle_ticks) {
      border = {true, demanded, limit, slope, std::max(at + slack, reach)};
      continue;
    }
    // A demand in the velocity loop is braked when the shaft is there; a fault brakes from there as well.
    const double tolerance = demanded ? slack + 0.002 * speed : way + slack;
    border.bound = std::max(at + tolerance, std::min(border.bound, reach));
    // A demand that comes to a shaft which is already there leads it nowhere.
    const bool leads = !demanded || place > direction * (offset + position_);
    if (place > border.bound && leads) {
      return fail("software-limit-passed",
                  fmt::format("{:.2f} revolutions beyond 607Dh, at {:.0f} rpm, mode {}",
                              (place - at) / counts_per_revolution_, rpm(velocity_), static_cast<int>(mode_)));
    }
  }
}

// A set-point of profile position that stood alone: from its edge to rest.
void Watch::set_points() {
  const std::uint16_t word = objects_.controlword;
  const bool edge = (word & controlword::mode_bit_4) != 0 && (word_before_ & controlword::mode_bit_4) == 0;
  const bool working = state_ == PowerState::operation_enabled && mode_ == Mode::profile_position && pwm_ &&
                       (word & (controlword::halt | controlword::fault_reset)) == 0 && judgeable_ &&
                       drive::command_of(word) == drive::Command::enable_operation;  // any other gives the set-point up
  word_before_ = word;
  const bool ready_before = std::exchange(ready_, (objects_.statusword & drive::statusword::mode_bit_12) == 0);
  const std::uint32_t velocity_before = std::exchange(profile_velocity_before_, objects_.profile_velocity);
  if (!working) {
    at_once_.active = set_point_.active = set_point_.leaves = false;
    set_point_.alone = tick_;
    return;
  }
  const drive::Axis& axis = drive_.axis();
  const auto offset = static_cast<double>(drive_.position_offset());
  const bool changed = objects_.target_position != target_before_;
  target_before_ = objects_.target_position;
  const bool at_switch = axis.active(drive::Signal::negative_limit) || axis.active(drive::Signal::positive_limit);
  const bool bounded = axis.software_limits_active() && drive_.policy().out_of_limits != drive::OutOfLimits::fault;
  const bool limited = at_switch || (axis.software_limits_active() && !bounded);
  if (edge) {
    // Its 6081h counts from the next cycle on, whatever was under way before.
    const double asked = std::max(velocity_before, objects_.profile_velocity) * axis.units.velocity;
    const bool at_once = (word & controlword::mode_bit_5) != 0 && ready_before;
    at_once_ = {at_once && !drive_.policy().end_velocity_is_start, false, tick_, asked};
    const bool relative = (word & controlword::mode_bit_6) != 0;
    const bool usual = (word & controlword::mode_bit_9) == 0 && objects_.positioning_option_code == 0 &&
                       objects_.polarity == 0 && objects_.end_velocity == 0 && objects_.profile_velocity != 0 &&
                       objects_.profile_acceleration != 0 && objects_.profile_deceleration != 0 &&
                       objects_.min_position_range_limit == objects_.max_position_range_limit;
    const bool standing = ready_before && tick_ - set_point_.alone > ms(30) && !drive_.in_motion() &&
                          std::abs(velocity_) < still_rpm / 60.0 * counts_per_revolution_;
    double target = static_cast<double>(axis.units.to_counts(objects_.target_position));
    if (bounded && !relative)
      target = static_cast<double>(axis.units.to_counts(
          std::clamp(objects_.target_position, objects_.min_position_limit, objects_.max_position_limit)));
    set_point_.active = usual && standing && !relative && !limited && !changed && acceleration_ > 0.0;
    set_point_.taken = false;
    // Away from the one switch that holds it.
    const bool below = axis.active(drive::Signal::negative_limit);
    const bool above = axis.active(drive::Signal::positive_limit);
    const double least = 0.3 * counts_per_revolution_;
    set_point_.leaves = usual && standing && relative && !changed && below != above && !axis.software_limits_active() &&
                        (drive_.policy().limit_switches == drive::LimitSwitches::stop) && acceleration_ > 0.0 &&
                        (below ? target > least : target < -least);
    set_point_.from = position_;
    set_point_.direction = below ? 1.0 : -1.0;
    set_point_.since = tick_;
    set_point_.target = target - offset;
    set_point_.alone = tick_;
    const double way = std::abs(set_point_.target - position_);
    double speed = objects_.profile_velocity * axis.units.velocity;
    if (objects_.max_profile_velocity != 0)
      speed = std::min(speed, objects_.max_profile_velocity * axis.units.velocity);
    speed = std::min(speed, greatest_speed());
    const Stopping stopping = this->stopping(speed);
    set_point_.seconds = way / speed + 4.0 * stopping.seconds + 0.3;
    if (way > 1000.0 * counts_per_revolution_) set_point_.active = false;
    return;
  }
  if (at_once_.active) {  // until something else is commanded
    if ((objects_.statusword & drive::statusword::mode_bit_12) != 0) at_once_.taken = true;
    if (around_->commanded > at_once_.since + ms(10)) at_once_.active = false;
  }
  if (set_point_.leaves) {
    if ((objects_.statusword & drive::statusword::mode_bit_12) != 0) set_point_.taken = true;
    const double moved = set_point_.direction * (position_ - set_point_.from);
    const bool again = around_->commanded > set_point_.since + ms(10);
    if (again || moved > 0.1 * counts_per_revolution_ || (!set_point_.taken && tick_ - set_point_.since > ms(10)) ||
        axis.active(set_point_.direction > 0.0 ? drive::Signal::positive_limit : drive::Signal::negative_limit)) {
      set_point_.leaves = false;
    } else if (const double acceleration = std::min(slope(), acceleration_);
               static_cast<double>(tick_ - set_point_.since) * tick_s >
               0.2 + std::sqrt(0.5 * counts_per_revolution_ / std::max(acceleration, 1.0)) +
                   0.3 * counts_per_revolution_ / (objects_.profile_velocity * axis.units.velocity) +
                   0.001 * drive_.configuration().brake_release_ms) {
      fail("no-way-off-limit",
           fmt::format("{:.2f} revolutions away {:.0f} ms after the set-point", moved / counts_per_revolution_,
                       static_cast<double>(tick_ - set_point_.since) / ticks_per_ms));
    }
  }
  if (!set_point_.active) {
    if (drive_.in_motion()) set_point_.alone = tick_;
    return;
  }
  // Anything else that is written may change the plan.
  if (limited || around_->commanded > set_point_.since + ms(10)) {
    set_point_.active = false;
    set_point_.alone = tick_;
    return;
  }
  if ((objects_.statusword & drive::statusword::mode_bit_12) != 0) set_point_.taken = true;
  if (!set_point_.taken) {  // not acknowledged
    if (tick_ - set_point_.since > ms(10)) set_point_.active = false;
    return;
  }
  const double seconds = static_cast<double>(tick_ - set_point_.since) * tick_s;
  const bool reached = (objects_.statusword & drive::statusword::target_reached) != 0 && !drive_.in_motion();
  const double beside = std::abs(position_ - set_point_.target);
  set_point_.reached = reached ? set_point_.reached + 1 : 0;
  if (set_point_.reached > ms(80) || seconds > set_point_.seconds) {
    set_point_.active = false;
    const bool arrived = beside < 2.0 * place_revolutions * counts_per_revolution_;
    if (!arrived) {
      fail(set_point_.reached > ms(80) ? "target-missed" : "never-arrives",
           fmt::format("{:.2f} revolutions beside the target {:.3f} s after the set-point, at {:.0f} rpm",
                       beside / counts_per_revolution_, seconds, rpm(velocity_)));
    } else if (!reached &&
               beside + 1.0 < static_cast<double>(axis.units.to_counts(std::min<std::int64_t>(
                                  objects_.position_window, std::numeric_limits<std::int32_t>::max()))) &&
               objects_.position_window_time_ms < 50 && std::abs(velocity_) < 2.0 / 60.0 * counts_per_revolution_) {
      fail("reached-is-missing",
           fmt::format("no bit 10 {:.3f} s after the set-point, {:.0f} counts beside the target", seconds, beside));
    }
  }
}

// A cyclic target that lies away from the one limit switch that is active, and came while it was.
void Watch::off_limit() {
  if (mode_ != Mode::cyclic_sync_position) {
    held_by_ = 0;
    away_ = {};
    return;
  }
  const drive::Axis& axis = drive_.axis();
  const bool below = axis.active(drive::Signal::negative_limit);
  const bool above = axis.active(drive::Signal::positive_limit);
  // A switch holds the axis until it is commanded away from it, also when it is gone and the other one is active.
  if (state_ != PowerState::operation_enabled || mode_since_ == tick_ ||
      std::abs(velocity_) > still_rpm / 60.0 * counts_per_revolution_)
    held_by_ = 0;
  held_by_ |= (below ? 1u : 0u) | (above ? 2u : 0u);
  if (below == above || held_by_ == 3) {
    away_ = {};
    return;
  }
  const double slowest_rpm = 4.0 * still_rpm;
  const bool judged = state_ == PowerState::operation_enabled && pwm_ && judgeable_ && acceleration_ > 0.0 &&
                      stop_.kind == StopKind::none && drive_.policy().limit_switches == drive::LimitSwitches::stop &&
                      !axis.software_limits_active() && objects_.polarity == 0 &&
                      (axis.controlword & controlword::halt) == 0 &&
                      objects_.min_position_range_limit == objects_.max_position_range_limit &&
                      rpm(greatest_speed()) > slowest_rpm && mode_since_ != tick_;
  const double direction = below ? 1.0 : -1.0;
  const double target =
      static_cast<double>(axis.units.to_counts(std::int64_t{objects_.target_position} + objects_.position_offset)) -
      static_cast<double>(drive_.position_offset());
  if (!judged || std::exchange(away_.target, target) != target) {
    away_.targets = judged ? away_.targets + 1 : 0;
    away_.since = tick_;
    away_.from = position_;
    return;
  }
  constexpr double least_revolutions = 0.3;
  if (direction * velocity_ < -still_rpm / 60.0 * counts_per_revolution_) {  // it still brakes before the switch
    away_.since = tick_;
    away_.from = position_;
  }
  const double moved = direction * (position_ - away_.from);
  if (direction * (target - away_.from) < least_revolutions * counts_per_revolution_ || away_.targets < 3) return;
  if (std::abs(target - away_.from) > 0x40000000) return;  // which way round it is near is the product's choice
  const double ramp = slope() > 0.0 ? std::min(slope(), acceleration_) : acceleration_;
  const double passed = static_cast<double>(tick_ - away_.since) * tick_s;
  if (passed > 0.2 + std::sqrt(0.5 * counts_per_revolution_ / ramp) && moved < 0.05 * counts_per_revolution_) {
    fail("no-way-off-limit",
         fmt::format("{:.2f} revolutions away {:.0f} ms after a target {:.2f} revolutions away, mode {}",
                     moved / counts_per_revolution_, 1000.0 * passed,
                     direction * (target - away_.from) / counts_per_revolution_, static_cast<int>(mode_)));
  }
}

// What a demand at `speed` needs to rest by the ramps alone.
double Watch::ramp_way(double speed, double ramp) const {
  if (ramp <= 0.0) return speed * 0.1;
  const double seconds = speed / ramp + jerk_delay(speed, ramp) + 0.002 + 0.001 * drive_.configuration().smoothing_ms +
                         0.003 * static_cast<double>(drive_.configuration().position_lag_ms);
  return 0.55 * speed * seconds;
}

void Watch::unasked() {
  const bool open = mode_ == Mode::homing || mode_ == Mode::none || mode_ == Mode::interpolated_position ||
                    mode_ == Mode::profile_torque || mode_ == Mode::cyclic_sync_torque ||
                    mode_ == Mode::cyclic_sync_velocity || drive_.identification().running();
  if (!judgeable_ || !pwm_ || open || state_ != PowerState::operation_enabled ||
      tick_ - std::max(pwm_since_, mode_since_) < ms(50)) {
    rest_ = position_;
    rest_since_ = tick_;
    return;
  }
  const double away = std::abs(position_ - rest_);
  const bool moves = away > 0.004 * counts_per_revolution_ + 3.0 || drive_.in_motion();
  const std::int64_t rested = tick_ - rest_since_;
  const std::int64_t enough = ms(120.0 + drive_.configuration().brake_release_ms);
  if (rested < enough) {
    if (moves) {
      rest_ = position_;
      rest_since_ = tick_;
    }
    return;
  }
  if (away > 0.15 * counts_per_revolution_) {
    if (std::max(around_->commanded, asked_) < rest_since_ && around_->disturbed < rest_since_) {
      fail("moves-unasked",
           fmt::format("{:.2f} revolutions from where it rested {:.1f} ms, mode {}", away / counts_per_revolution_,
                       static_cast<double>(rested) / ticks_per_ms, static_cast<int>(mode_)));
    }
    rest_ = position_;
    rest_since_ = tick_;
  }
  if (std::max(around_->commanded, asked_) >= rest_since_) {  // asked for something
    rest_ = position_;
    rest_since_ = tick_;
  }
}

void Watch::torque() {
  const std::int64_t limits = std::int64_t{objects_.max_torque} << 32 |
                              std::int64_t{objects_.positive_torque_limit} << 16 | objects_.negative_torque_limit;
  if (limits != torque_limits_) {
    torque_limits_ = limits;
    torque_limits_since_ = tick_;
  }
  if (!pwm_ || tick_ - torque_limits_since_ <= ms(20)) {
    torque_over_ = 0;
    return;
  }
  const double limit = std::max(std::min(objects_.max_torque, objects_.positive_torque_limit),
                                std::min(objects_.max_torque, objects_.negative_torque_limit)) *
                       0.001;
  const double share = std::abs(axis_.plant().torque_nm()) / rated_torque_nm_;
  // The current loop overshoots, and the nameplate's torque constant is that of a cold motor.
  const bool over = share > 1.15 * limit + 0.3 && (around_->injected & spoils_motion) == 0 &&
                    std::abs(velocity_) < greatest_speed() && around_->supply_share >= 0.8;
  torque_over_ = over && tick_ - voltage_spent_ > ms(50) ? torque_over_ + 1 : 0;
  if (torque_over_ > ms(5)) {
    fail("torque-beyond-limit",
         fmt::format("{:.0f} % of the rated torque, {:.0f} % are allowed", 100.0 * share, 100.0 * limit));
  }
}

void Watch::bits() {
  const std::uint16_t word = objects_.statusword;
  const bool judged = state_ == PowerState::operation_enabled && pwm_ && judgeable_ &&
                      tick_ - std::max(state_since_, mode_since_) > ms(20);
  const std::uint16_t commanded = drive_.axis().controlword;  // a word with bit 7 commands nothing
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
      // Whatever 607Fh and 6080h make of it: 60FFh itself is compared with 606Ch (CiA 402-2, profile velocity).
      const double window = std::max(windowed ? objects_.velocity_window * axis.units.velocity : 0.0,
                                     axis.configuration.speed_windows.reached_counts_per_s);
      const double tolerance = window + 0.05 * std::abs(expected) + 3.0 * still_rpm / 60.0 * counts_per_revolution_;
      lies = windowed && std::abs(velocity_ - expected) > tolerance;
    } else if (mode_ == Mode::profile_position || (mode_ == Mode::profile_velocity && halt)) {
      // With 6067h off bit 10 is the demand's, which a motor without torque does not follow.
      const bool window_off = mode_ == Mode::profile_position && objects_.position_window == 0xFFFFFFFF;
      const bool gives_its_best = (objects_.statusword & drive::statusword::internal_limit_active) != 0;
      lies = std::abs(velocity_) > 4.0 * still_rpm / 60.0 * counts_per_revolution_ && objects_.end_velocity == 0 &&
             acceleration_ > 0.0 && !(window_off && gives_its_best);
    }
  }
  // In profile position the demand rests at the target then.
  const std::uint32_t window = objects_.position_window;
  if (judged && !halt && !lies && mode_ == Mode::profile_position && !drive_.in_motion() && window < 0x7FFFFFFF &&
      (word & drive::statusword::target_reached) != 0 && drive_.axis().demand.loop == Loop::position) {
    const auto most = std::abs(static_cast<double>(drive_.axis().units.to_counts(static_cast<std::int32_t>(window))));
    // ... or rests elsewhere after a halt, and the shaft comes by the target.
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
  // A stop that is under way has reached nothing.
  const bool reached = (word & drive::statusword::target_reached) != 0;
  const bool stopping = told_ != StopKind::none && told_ < StopKind::velocity && pwm_ && judgeable_ &&
                        acceleration_ > 0.0 && std::abs(velocity_) > 4.0 * still_rpm / 60.0 * counts_per_revolution_;
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

// Which of the judged meanings the bits of the statusword have in the present mode.
void Watch::look_up_bits() {
  using enum drive::StatusSource;
  const auto shows = [this](unsigned bit, drive::StatusSource source) {
    const auto& rows = drive_.policy().status_bits;
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
                      objects_.profile_acceleration != 0 && (axis.controlword & drive::controlword::halt) == 0 &&
                      tick_ - std::max({state_since_, mode_since_, around_->commanded, asked_}) > ms(300);
  if (!judged) {
    limit_lie_since_ = tick_;
    return;
  }
  const double wanted = std::abs(axis.units.velocity_to_counts(objects_.target_velocity));
  double most = greatest_speed();
  if (objects_.max_profile_velocity != 0) most = std::min(most, objects_.max_profile_velocity * axis.units.velocity);
  const bool shown = (objects_.statusword & drive::statusword::internal_limit_active) != 0;
  // At the wanted speed, without a torque or voltage that is spent on it.
  const bool steady =
      std::abs(std::abs(velocity_) - wanted) < 0.02 * wanted + still_rpm / 60.0 * counts_per_revolution_ &&
      std::abs(axis_.plant().torque_nm()) < 0.5 * rated_torque_nm_;
  // A switch that has opened again holds the axis until the next command, and bit 11 says so.
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
  // As the drive sees it, a cycle late, to a count.
  const double slack = std::abs(velocity_) * 2.0 * cycle_ticks * tick_s + 2.0;
  const bool lies = shown ? off || error + slack < 0.9 * window : !off && error > 1.1 * window + slack;
  if (!lies) following_lie_since_ = tick_;
  if (tick_ - following_lie_since_ > ms(20.0 + (shown ? 0.0 : objects_.following_error_time_out_ms))) {
    fail("following-error-is-untrue",
         fmt::format("bit 13 is {}, the shaft is {:.0f} counts off, 6065h has {:.0f}", shown ? 1 : 0, error, window));
  }
}

void Watch::error_registers() {
  dictionary::Dictionary& objects = axis_.device().bus_dictionary();
  const bool failed = one_of(state_, {PowerState::fault, PowerState::fault_reaction_active});
  const bool warned = (objects_.statusword & drive::statusword::warning) != 0;
  canopen::Node* node = axis_.device().can_node();
  const bool apart = node != nullptr && (node->communication_error() || tick_ - nmt_since_ < ms(20));
  const bool alone = !failed && !warned && !apart && objects_.error_code == 0 && !drive_.any_fault() && node != nullptr;
  if (!alone || (tick_ % ms(1) == 0 && communication_register() == 0)) register_since_ = tick_;
  if (tick_ - register_since_ > ms(20) && communication_register() != 0) {
    return fail("register-without-error",
                fmt::format("1001h is {:02X}h in {}", communication_register(), drive::name(state_)));
  }
  if (const ethercat::Slave* slave = axis_.device().ethercat_slave()) {
    if (slave->error() != (slave->status_code() != ethercat::AlStatusCode::none)) {
      return fail("al-status",
                  fmt::format("error {}, code {:04X}h", slave->error(), static_cast<unsigned>(slave->status_code())));
    }
  }
  if (!failed || state_since_ == tick_ || tick_ - state_since_ != ms(3) || nmt_since_ >= state_since_) return;
  if (objects.find(0x1003, 1) == nullptr || objects_.error_code == 0) return;
  const std::int64_t entries = objects.number(0x1003, 0);
  for (std::uint8_t entry = 1; entry <= entries; ++entry) {
    if ((objects.number(0x1003, entry) & 0xFFFF) == objects_.error_code) return;
  }
  fail("error-history",
       fmt::format("603Fh is {:04X}h, which is in none of the {} entries of 1003h", objects_.error_code, entries));
}

void Watch::errors() {
  const bool failed = one_of(state_, {PowerState::fault, PowerState::fault_reaction_active});
  if (failed && tick_ - state_since_ > cycle_ticks && objects_.error_code == 0) {
    return fail("fault-without-code", "603Fh is 0");
  }
  if (failed && fault_since_ == tick_) {
    const drive::FaultRow* row = drive_.shown_fault();
    if (row != nullptr && row->cause == drive::Cause::phase_loss) {
      constexpr std::uint32_t phases = bit(plant::Injection::open_phase_u) | bit(plant::Injection::open_phase_v) |
                                       bit(plant::Injection::open_phase_w) | bit(plant::Injection::short_phase_u) |
                                       bit(plant::Injection::short_phase_v) | bit(plant::Injection::short_phase_w);
      // What was seen while one was broken is told a little later.
      if ((around_->injected & phases) == 0 && tick_ - std::max(spoiled_, around_->disturbed) > ms(20)) {
        fail("false-alarm", fmt::format("motor phase lost ({:04X}h) with all phases whole, {:.0f} rpm, link {:.0f} V",
                                        row->code, rpm(velocity_), axis_.plant().dc_link_v()));
      }
    }
  }
  if (failed && state_since_ != tick_ && tick_ - state_since_ == ms(2) && communication_register() == 0) {
    return fail("fault-without-code",
                fmt::format("1001h is {:02X}h, 603Fh {:04X}h", communication_register(), objects_.error_code));
  }
  if (canopen::Node* node = axis_.device().can_node()) {
    if (node->nmt_state() != nmt_) {
      nmt_ = node->nmt_state();
      nmt_since_ = tick_;
    }
    const bool speaks = (nmt_ == canopen::NmtState::operational || nmt_ == canopen::NmtState::pre_operational) &&
                        tick_ - nmt_since_ > ms(20) && !around_->cut && tick_ - around_->joined > ms(20) &&
                        around_->quiet_bus;
    if (!speaks || !failed) fault_since_ = fault_since_ == tick_ ? tick_ : -1;
    if (!speaks) fault_since_ = -1;
    if (fault_since_ >= 0 && tick_ - fault_since_ > ms(5)) {
      if (told_at_ < fault_since_ - ms(1)) {
        return fail("emergency-missing", fmt::format("603Fh is {:04X}h for 5 ms", objects_.error_code));
      }
      fault_since_ = -1;
    }
  }
}

std::uint8_t Watch::communication_register() {
  return static_cast<std::uint8_t>(axis_.device().bus_dictionary().number(0x1001, 0));
}

void Watch::pdos_mapped() {
  statusword_at_.fill(-1);
  mapped_since_ = tick_;
  if (axis_.device().can_node() == nullptr) return;
  dictionary::Dictionary& objects = axis_.device().bus_dictionary();
  for (std::size_t pdo = 0; pdo < 4; ++pdo) {
    const auto mapping = static_cast<std::uint16_t>(0x1A00 + pdo);
    int bits = 0;
    for (std::uint8_t entry = 1; entry <= objects.number(mapping, 0); ++entry) {
      const auto word = static_cast<std::uint32_t>(objects.number(mapping, entry));
      if (word >> 8 == 0x604100 && bits % 8 == 0) statusword_at_[pdo] = bits / 8;
      bits += static_cast<int>(word & 0xFF);
    }
  }
}

void Watch::heard(const canopen::Frame& frame, line::Time at) {
  if (finding_ || around_ == nullptr) return;
  const std::uint32_t function = frame.id & 0x780;
  const std::int64_t now = at / line::tick_length;
  if (function == 0x080 && frame.length == 8) {
    told_code_ = static_cast<std::uint16_t>(frame.data[0] | frame.data[1] << 8);
    if (told_code_ != 0) told_at_ = now;
    return;
  }
  if (function == 0x700 && frame.length == 1 && frame.data[0] == 0) nmt_since_ = now;  // a boot-up: 1003h is empty
  const bool pdo = function == 0x180 || function == 0x280 || function == 0x380 || function == 0x480;
  if (!pdo || !around_->powered) return;
  const bool operational = nmt_ == canopen::NmtState::operational;
  // One frame may have been on the wire already.
  if (!operational && now - nmt_since_ > ms(0.25)) {
    return fail("pdo-in-wrong-state", fmt::format("TPDO {:03X}h {:.2f} ms after NMT operational was left", frame.id,
                                                  static_cast<double>(now - nmt_since_) / ticks_per_ms));
  }
  if (around_->cut || now - around_->joined < ms(1))
    return;  // one frame may wait in the controller while the cable is away
  const int place = statusword_at_[(function - 0x180) / 0x100];
  if (place < 0 || place + 2 > frame.length) return;
  const auto word = static_cast<std::uint16_t>(frame.data[static_cast<std::size_t>(place)] |
                                               frame.data[static_cast<std::size_t>(place) + 1] << 8);
  // True at some time within the last 3 ms?
  for (std::size_t back = 0; back < std::min(shown_count_, shown_.size()); ++back) {
    const Shown& shown = shown_[(shown_count_ - 1 - back) % shown_.size()];
    if (shown.statusword == word) return;
    // A command acts when it comes, bit 4, a warning and the bits of the mode follow with the next cycle: between the
    // two a TPDO may have shown what no tick ends with.
    const bool lately = std::max(shown.tick, asked_) >= now - ms(1);
    if (lately && ((shown.statusword ^ word) & 0x006F) == 0) return;
    if (shown.tick < now - ms(3)) {
      return fail(
          "stale-statusword",
          fmt::format("TPDO shows {:04X}h, it is {:04X}h for {:.1f} ms", word, objects_.statusword,
                      static_cast<double>(now - shown_[(shown_count_ - 1) % shown_.size()].tick) / ticks_per_ms));
    }
  }
}

bool Watch::end() {
  if (finding_) return false;
  const plant::Energy energy = axis_.plant().energy();
  const double taken = energy.copper_j + energy.shaft_j + energy.magnetic_j;
  const double scale = std::abs(energy.to_motor_j) + energy.copper_j + std::abs(energy.shaft_j) + energy.magnetic_j;
  if (!spoilt_ && std::abs(energy.to_motor_j - taken) > 0.02 * scale + 0.2) {
    fail("energy", fmt::format("{:.3f} J went into the phases, {:.3f} J are accounted for", energy.to_motor_j, taken));
  }
  return !finding_;
}

}  // namespace servodrome::motion
