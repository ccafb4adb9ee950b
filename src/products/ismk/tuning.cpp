#include "products/ismk/tuning.hpp"

#include <algorithm>
#include <cmath>

#include "products/ismk/gains.hpp"

namespace servodrome::products::ismk {

namespace {

using dictionary::AbortCode;

// Online: an estimate with at most this uncertainty is adopted if it differs from the known inertia by at least
// `least_change`. Windows older than `memory_windows` fade, so that the estimate follows a load that changes.
constexpr double good_uncertainty = 0.01;
constexpr double least_change = 0.02;
constexpr double memory_windows = 100.0;

// Inertia recognition: speed of the swings, and their greatest torque as a fraction of the rated one.
constexpr double recognition_rpm = 800.0;
constexpr float recognition_torque = 1.0F;

// During the search for resonances the gains of the loops are this fraction of their values; the factor of the integral
// gain is the square of this fraction.
constexpr float soft_share = 0.125F;
constexpr float excitation = 0.15F;          // of rated torque
constexpr std::size_t steps_per_cycle = 64;  // of the analysis

// Rigidity: bandwidth of the position loop (ch. 6.2.2) and corner of the integral as fractions of the velocity loop's
// bandwidth, and the feedback filter as a multiple of it (at least 2, ch. 6.2.1).
constexpr double position_share = 0.25;
constexpr double integral_share = 0.2;
constexpr double filter_ratio = 6.0;

constexpr std::uint16_t target_reached_bit = 0x0400;

std::uint16_t to_kvp(double kvp) { return static_cast<std::uint16_t>(std::lround(std::clamp(kvp, 1.0, 32767.0))); }

}  // namespace

void LoopTuning::reset(double rotor_inertia_kgm2) {
  rotor_inertia_kgm2_ = inertia_kgm2_ = rotor_inertia_kgm2;
  estimate_ = {};
  learning_ = 0;
  identified_ = recognising_ = analysing_ = false;
  analysis_.stop();
}

void LoopTuning::objects_loaded(ServoObjects& objects, const drive::MotorData& motor) {
  bandwidth_hz_ = bandwidth_of_kvp(objects.gains.velocity_kp[0], inertia_kgm2_, motor);
  if (!analysing_) objects.tuning.notch_control &= static_cast<std::uint8_t>(~notch_control::run);
}

void LoopTuning::configure(const ServoObjects& objects, drive::Configuration& configuration) const {
  configuration.motor.inertia_kgm2 = static_cast<float>(inertia_kgm2_);
  configuration.gains = loop_gains(objects.gains, objects.tuning, configuration.motor);
  configuration.rates = (objects.gains.feedback_mode & fast_sampling) != 0 ? fast_rates : slow_rates;
  if (analysing_) {
    configuration.gains.velocity_kp *= soft_share;
    configuration.gains.velocity_ki *= soft_share * soft_share;
    configuration.gains.position_kp *= soft_share;
    // The observer computes its speed from the torque, so the search uses the filtered speed instead.
    if (configuration.gains.velocity_feedback == drive::VelocityFeedback::observer) {
      configuration.gains.velocity_feedback = drive::VelocityFeedback::first_order;
    }
  }
}

AbortCode LoopTuning::check(const dictionary::Entry& entry, std::int64_t value, const drive::Drive& drive) {
  switch (entry.index << 8 | entry.sub) {
    case 0x60F906:
      return find_speed_mode(static_cast<std::uint8_t>(value)) != nullptr ? AbortCode::none : AbortCode::value_invalid;
    case 0x60F904:
      // The analysis moves the motor: only while it is enabled (Table 6-3), and at rest. The constant current of a step
      // stop leaves no loop to excite.
      return (value & notch_control::run) == 0 || drive.rests_under_control() ? AbortCode::none
                                                                              : AbortCode::device_state;
    default: return AbortCode::none;
  }
}

void LoopTuning::set_kvp(ServoObjects& objects, const drive::MotorData& motor) const {
  objects.gains.velocity_kp[0] = to_kvp(kvp_of_bandwidth(bandwidth_hz_, inertia_kgm2_, motor));
}

void LoopTuning::written(const dictionary::Entry& entry, ServoObjects& objects, drive::Drive& drive) {
  Gains& gains = objects.gains;
  const drive::MotorData& motor = drive.configuration().motor;
  switch (entry.index << 8 | entry.sub) {
    case 0x60F901: bandwidth_hz_ = bandwidth_of_kvp(gains.velocity_kp[0], inertia_kgm2_, motor); break;
    case 0x2FF00A:  // Table 6-2
      bandwidth_hz_ = gains.velocity_bandwidth_hz;
      set_kvp(objects, motor);
      break;
    case 0x2FF019:  // Table 6-2
      gains.velocity_ki[0] = 0;
      gains.velocity_ki_32 = gains.velocity_ki_mix;
      break;
    case 0x2FF01B:  // Table 6-5
      gains.acceleration_feed_forward =
          acceleration_feed_forward_of(gains.acceleration_feed_forward_permille, inertia_kgm2_, motor);
      break;
    case 0x60F909:  // 0: back to set 0 (Table 6-6)
      if (gains.auto_switch == 0) gains.pointer = 0;
      break;
    case 0x60F904:
      if ((objects.tuning.notch_control & notch_control::run) != 0 && !analysing_) {
        const std::uint8_t control = objects.tuning.notch_control;
        using Analysis = drive::ResonanceAnalysis;
        analysis_.begin({.sample_s = static_cast<float>(drive.rates().velocity_loop_ticks * drive::tick_seconds),
                         .amplitude = excitation,
                         .answer = (control & notch_control::actual_speed) != 0 ? Analysis::Answer::position
                                                                                : Analysis::Answer::controller});
        analysing_ = true;
        drive.set_analysis(&analysis_);
      } else if ((objects.tuning.notch_control & notch_control::run) == 0) {
        analysis_.stop();  // cancelled: cycle() restores the gains
      }
      break;
    default: break;
  }
}

void LoopTuning::refresh(const dictionary::Entry& entry, ServoObjects& objects, const drive::MotorData& motor) const {
  Gains& gains = objects.gains;
  const auto within = [](double value, double low, double high) {
    return static_cast<std::uint16_t>(std::lround(std::clamp(value, low, high)));
  };
  switch (entry.index << 8 | entry.sub) {
    case 0x2FF00A: gains.velocity_bandwidth_hz = within(bandwidth_hz_, 1.0, 700.0); break;
    case 0x2FF019:
      gains.velocity_ki_mix = within(kvi_mix(gains.velocity_ki[0], gains.velocity_ki_32), 0.0, 65535.0);
      break;
    case 0x2FF01B:
      gains.acceleration_feed_forward_permille =
          within(acceleration_permille_of(gains.acceleration_feed_forward, inertia_kgm2_, motor), 0.0, 65535.0);
      break;
    default: break;
  }
}

bool LoopTuning::cycle(drive::Drive& drive, ServoObjects& objects, const Terminals& terminals) {
  bool changed = select_gains(objects, terminals);
  if (learning_ != 0 || (objects.tuning.control & auto_tuning::enabled) != 0) changed |= tune_online(drive, objects);
  if (recognising_) changed |= take_recognition(drive, objects);
  if (analysing_) changed |= set_notches(drive, objects);
  return changed;
}

bool LoopTuning::select_gains(ServoObjects& objects, const Terminals& terminals) {
  using drive::InputAction;
  Gains& gains = objects.gains;
  const drive::InputFunctions& inputs = terminals.inputs();
  const bool at_target = (objects.drive.statusword & target_reached_bit) != 0 ||
                         (terminals.conditions() & bit(drive::OutputCondition::zero_speed)) != 0;
  const std::uint8_t pointer = gain_pointer({.inputs_assigned = inputs.has_index(InputAction::gain_index_0, 2),
                                             .inputs = inputs.index(InputAction::gain_index_0, 2),
                                             .automatic = gains.auto_switch != 0,
                                             .at_target = at_target,
                                             .written = gains.pointer});
  if (pointer == gains.pointer) return false;
  gains.pointer = pointer;
  return true;
}

bool LoopTuning::tune_online(drive::Drive& drive, ServoObjects& objects) {
  constexpr std::uint8_t of_the_estimator = auto_tuning::enabled | auto_tuning::not_forward | auto_tuning::not_reverse;
  const std::uint8_t control = objects.tuning.control;
  const drive::MotorData& motor = drive.configuration().motor;
  const double cycle_s = drive.axis().cycle_s;
  if ((control & of_the_estimator) != learning_ || (learning_ != 0 && cycle_s != learned_cycle_s_)) {
    learning_ = (control & auto_tuning::enabled) != 0 ? control & of_the_estimator : 0;
    if (learning_ == 0) return false;
    bool forward = (control & auto_tuning::not_forward) == 0;
    bool reverse = (control & auto_tuning::not_reverse) == 0;
    if (drive.axis().units.velocity_inverted) std::swap(forward, reverse);
    windows_ = 0;
    learned_cycle_s_ = cycle_s;
    estimator_.begin({.counts_per_revolution = static_cast<double>(motor.counts_per_revolution),
                      .rated_torque_nm = static_cast<double>(motor.rated_torque_nm),
                      .cycle_s = cycle_s,
                      .memory_windows = memory_windows,
                      .forward = forward,
                      .reverse = reverse});
  }
  if (drive.axis().demand.loop == drive::Loop::off) {
    estimator_.interrupt();
    return false;
  }
  estimator_.sample(drive.axis().encoder_position, drive.loops().mean_torque);
  if (estimator_.windows() == windows_) return false;
  windows_ = estimator_.windows();
  drive::InertiaEstimate found;
  if (!estimator_.estimate(found) || found.relative_uncertainty > good_uncertainty) return false;
  if (found.inertia_kgm2 < rotor_inertia_kgm2_ * (1.0 - least_change)) return false;  // no axis is lighter
  estimate_ = found;
  if (identified_ && std::fabs(found.inertia_kgm2 / inertia_kgm2_ - 1.0) < least_change) return false;
  adopt(found, objects, motor, control);
  return true;
}

// Adopts the estimate. With the bit of kvp in `adjust`, kvp changes so that the bandwidth stays; otherwise the
// bandwidth changes. With the bit of the acceleration feed-forward, the feed-forward becomes 100 % of the new inertia.
void LoopTuning::adopt(const drive::InertiaEstimate& estimate, ServoObjects& objects, const drive::MotorData& motor,
                       std::uint8_t adjust) {
  const double before = inertia_kgm2_;
  estimate_ = estimate;
  identified_ = true;
  inertia_kgm2_ = estimate.inertia_kgm2;
  if ((adjust & auto_tuning::adjusts_kvp) != 0) {
    set_kvp(objects, motor);
  } else {
    bandwidth_hz_ *= before / inertia_kgm2_;  // kvp stays
  }
  if ((adjust & auto_tuning::adjusts_acceleration_feed_forward) != 0) {
    objects.gains.acceleration_feed_forward = acceleration_feed_forward_of(1000.0, inertia_kgm2_, motor);
  }
}

bool LoopTuning::recognise_inertia(drive::Drive& drive, double turns) {
  const double resolution = static_cast<double>(drive.configuration().motor.counts_per_revolution);
  recognising_ = !analysing_ && drive.identify_inertia({.travel_counts = turns * resolution,
                                                        .speed_counts_per_s = recognition_rpm / 60.0 * resolution,
                                                        .torque_limit = recognition_torque});
  return recognising_;
}

bool LoopTuning::take_recognition(drive::Drive& drive, ServoObjects& objects) {
  if (drive.identification().running()) return false;
  recognising_ = false;
  if (drive.identification().outcome() != drive::InertiaIdentification::Outcome::done) return false;
  adopt(drive.identification().estimate(), objects, drive.configuration().motor, objects.tuning.control);
  return true;
}

void LoopTuning::set_rigidity(double bandwidth_hz, ServoObjects& objects, const drive::MotorData& motor) {
  constexpr double pi = 3.14159265358979;
  Gains& gains = objects.gains;
  bandwidth_hz_ = bandwidth_hz;
  set_kvp(objects, motor);
  const double kvi = gains.velocity_kp[0] * 2.0 * pi * bandwidth_hz * integral_share / velocity_ki_rate_hz;
  gains.velocity_ki[0] = 0;
  gains.velocity_ki_32 = static_cast<std::uint16_t>(std::lround(std::clamp(32.0 * kvi, 0.0, 32767.0)));
  gains.position_kp[0] =
      static_cast<std::uint16_t>(std::lround(std::clamp(position_share * bandwidth_hz * kpp_per_hz, 0.0, 32700.0)));
  const double n = std::ceil((filter_ratio * bandwidth_hz - feedback_filter_hz(0)) / 20.0);
  gains.feedback_filter = static_cast<std::uint8_t>(std::clamp(n, 0.0, 45.0));
}

bool LoopTuning::set_notches(drive::Drive& drive, ServoObjects& objects) {
  using State = drive::ResonanceAnalysis::State;
  std::uint8_t& control = objects.tuning.notch_control;
  if (drive.state() != drive::PowerState::operation_enabled) analysis_.stop();
  if (analysis_.running()) {
    analysis_.compute(steps_per_cycle);
    return false;
  }
  drive.set_analysis(nullptr);
  analysing_ = false;
  control &= static_cast<std::uint8_t>(~notch_control::run);
  if (analysis_.state() == State::done && analysis_.count() > 0) {
    const auto hz = [&](std::size_t i) {
      return static_cast<std::uint16_t>(std::lround(static_cast<double>(analysis_.resonance(i).frequency_hz)));
    };
    objects.tuning.notch_frequency_hz = hz(0);
    if (analysis_.count() > 1) objects.gains.notch_frequency_hz[0] = hz(1);
    // Filters that are on already stay on.
    const auto code = static_cast<std::uint8_t>(analysis_.count());
    const auto filters = std::max<std::uint8_t>(control & notch_control::filters, code);
    control = static_cast<std::uint8_t>((control & ~notch_control::filters) | filters);
  }
  return true;
}

}  // namespace servodrome::products::ismk
