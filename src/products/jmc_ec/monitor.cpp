#include "products/jmc_ec/monitor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace servodrome::products::jmc_ec {

namespace {

constexpr std::uint32_t slot_ms = 100;

// Inertia: windows that the estimator remembers, and the greatest uncertainty of an estimate that d22 shows.
constexpr double memory_windows = 100.0;
constexpr double good_uncertainty = 0.03;
// AF-J-L swings one turn to each side.
constexpr double recognition_turns = 1.0;
constexpr double recognition_rpm = 300.0;
constexpr float recognition_torque = 0.5F;
// Steps of the resonance search in one cycle.
constexpr std::size_t steps_per_cycle = 32;

// d19, "phase sequence position" (ch. 8.3): Hall bits U, V, W of the six sectors of an electrical turn, U in bit 0.
constexpr std::array<std::uint8_t, 6> uvw_of_sector{1, 3, 2, 6, 4, 5};

std::int32_t shown(double value) {
  constexpr double most = std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(std::llround(std::clamp(value, -most, most)));
}

std::int64_t within_turn(std::int64_t counts, std::int64_t turn) {
  const std::int64_t rest = counts % turn;
  return rest < 0 ? rest + turn : rest;
}

std::int32_t uvw(const drive::Drive& drive) {
  const drive::MotorData& motor = drive.configuration().motor;
  const auto turn = static_cast<std::int64_t>(motor.counts_per_revolution);
  const double shaft =
      static_cast<double>(within_turn(drive.axis().encoder_position, turn)) / static_cast<double>(turn);
  const double electrical = shaft * motor.pole_pairs * (motor.phase_order_reversed ? -1.0 : 1.0) +
                            static_cast<double>(motor.commutation_offset_turns);
  const auto sector = static_cast<std::size_t>(6.0 * (electrical - std::floor(electrical)));
  return uvw_of_sector[std::min<std::size_t>(sector, 5)];
}

}  // namespace

void Monitor::power_on(double rotor_inertia_kgm2, double inertia_ratio) {
  const double run_time_s = run_time_s_;
  *this = {};
  run_time_s_ = run_time_s;
  rotor_inertia_kgm2_ = rotor_inertia_kgm2;
  inertia_ratio_ = inertia_ratio;
}

void Monitor::end_slot() {
  const double cycles = cycles_;
  const Sums mean{slot_.torque / cycles, slot_.square / cycles, slot_.regeneration / cycles};
  history_[next_] = mean;
  next_ = next_ + 1 == slots ? 0 : next_ + 1;
  if (filled_ < slots) ++filled_;
  total_ = {};
  for (std::size_t i = 0; i < filled_; ++i) {
    total_.torque += history_[i].torque;
    total_.square += history_[i].square;
    total_.regeneration += history_[i].regeneration;
  }
  slot_ = {};
  cycles_ = 0;
}

void Monitor::cycle(drive::Drive& drive) {
  const drive::Axis& axis = drive.axis();
  const float torque = std::abs(drive.loops().mean_torque);
  peak_ = std::max(peak_, torque);
  slot_.torque += static_cast<double>(torque);
  slot_.square += static_cast<double>(torque * torque);
  if (drive.chopper_on()) slot_.regeneration += 1.0;
  if (++cycles_ >= axis.cycles(slot_ms)) end_slot();
  run_time_s_ += axis.cycle_s;

  if (recognition_ == FunctionState::running && !drive.identification().running()) {
    const bool done = drive.identification().outcome() == drive::InertiaIdentification::Outcome::done;
    recognition_ = done ? FunctionState::done : FunctionState::failed;
    if (done) inertia_ratio_ = drive.identification().estimate().inertia_kgm2 / rotor_inertia_kgm2_ - 1.0;
  }
  if (search_ == FunctionState::running) {
    if (drive.state() != drive::PowerState::operation_enabled) analysis_.stop();
    analysis_.compute(steps_per_cycle);
    if (!analysis_.running()) {
      drive.set_analysis(nullptr);
      const bool done = analysis_.state() == drive::ResonanceAnalysis::State::done;
      search_ = done ? FunctionState::done : FunctionState::failed;
      resonance_hz_ = {};
      for (std::size_t i = 0; done && i < analysis_.count(); ++i) {
        resonance_hz_[i] = analysis_.resonance(i).frequency_hz;
      }
    }
  }

  // d22 follows any motion.
  if (axis.demand.loop == drive::Loop::off) return estimator_.interrupt();
  if (estimator_.windows() == 0 && windows_ == 0) {
    const drive::MotorData& motor = drive.configuration().motor;
    estimator_.begin({.counts_per_revolution = static_cast<double>(motor.counts_per_revolution),
                      .rated_torque_nm = static_cast<double>(motor.rated_torque_nm),
                      .cycle_s = axis.cycle_s,
                      .memory_windows = memory_windows});
    windows_ = 1;
  }
  estimator_.sample(axis.encoder_position, drive.loops().mean_torque);
  if (estimator_.windows() + 1 == windows_) return;
  windows_ = estimator_.windows() + 1;
  drive::InertiaEstimate found;
  if (!estimator_.estimate(found) || found.relative_uncertainty > good_uncertainty) return;
  inertia_ratio_ = found.inertia_kgm2 / rotor_inertia_kgm2_ - 1.0;
}

bool Monitor::may_start(const drive::Drive& drive) {
  return drive.state() == drive::PowerState::operation_enabled && !drive.in_motion();
}

void Monitor::start_recognition(drive::Drive& drive) {
  const auto counts = static_cast<double>(drive.configuration().motor.counts_per_revolution);
  const bool started = search_ != FunctionState::running &&
                       drive.identify_inertia({.travel_counts = recognition_turns * counts,
                                               .speed_counts_per_s = recognition_rpm / 60.0 * counts,
                                               .torque_limit = recognition_torque});
  recognition_ = started ? FunctionState::running : FunctionState::failed;
}

void Monitor::start_search(drive::Drive& drive) {
  if (recognition_ == FunctionState::running) {
    search_ = FunctionState::failed;
    return;
  }
  analysis_.begin({.sample_s = static_cast<float>(drive.axis().policy.loops.velocity_ticks * drive::tick_seconds)});
  drive.set_analysis(&analysis_);
  search_ = FunctionState::running;
}

std::int32_t Monitor::item(std::uint8_t number, const drive::Drive& drive, std::uint32_t outputs) const {
  const drive::Axis& axis = drive.axis();
  const drive::Units& units = axis.units;
  const drive::CascadeState& loops = drive.loops();
  const drive::Counts command = axis.generator.nearest_position();
  const drive::Counts deviation = axis.demand.loop == drive::Loop::position ? loops.following_error_counts : 0;
  const double rpm = 60.0 / units.counts_per_revolution;
  const double held = std::max<double>(1.0, static_cast<double>(filled_));
  switch (number) {
    case 0: return drive::wrap_to_32_bits(units.to_user(command));
    case 1: return drive::wrap_to_32_bits(units.to_user(axis.position()));
    case 2: return drive::wrap_to_32_bits(units.to_user(deviation));
    case 3: return drive::wrap_to_32_bits(command);
    case 4: return drive::wrap_to_32_bits(axis.position());
    case 5: return drive::wrap_to_32_bits(deviation);
    case 6: return shown(std::abs(units.velocity_to_user(axis.generator.velocity())) / 1000.0);
    case 7: return shown(static_cast<double>(loops.velocity_reference_counts_per_s) * rpm);
    case 8: return shown(axis.shown_velocity() * rpm);
    case 9: return shown(100.0 * static_cast<double>(loops.torque_reference));
    case 10: return shown(100.0 * static_cast<double>(loops.mean_torque));
    case 11: return shown(100.0 * total_.torque / held);
    case 12: return shown(100.0 * static_cast<double>(peak_));
    case 13: return shown(100.0 * std::sqrt(total_.square / held));
    case 14: return shown(100.0 * total_.regeneration / held);
    case 16: return static_cast<std::int32_t>(~drive.wires() & 0x1F);  // 1: the opto-coupler is off
    case 17: return static_cast<std::int32_t>(outputs);
    case 18: {
      const auto turn = static_cast<std::int64_t>(axis.configuration.motor.counts_per_revolution);
      return static_cast<std::int32_t>(3600 * within_turn(axis.encoder_position, turn) / turn);
    }
    case 19: return uvw(drive);
    case 22: return shown(100.0 * inertia_ratio_);
    case 23: return shown(static_cast<double>(drive.dc_link_v()));
    case 24: return shown(static_cast<double>(drive.power_stage_temperature_c()));
    case 25: return shown(std::floor(run_time_s_));
    case 26: return shown(static_cast<double>(resonance_hz_[0]));
    case 28: return shown(static_cast<double>(resonance_hz_[1]));
    default: return 0;  // 20, 21: no absolute encoder; 30, 31: no analogue inputs
  }
}

void Monitor::refresh(const dictionary::Entry& entry, MonitorObjects& objects, const drive::Drive& drive,
                      std::uint32_t outputs) const {
  if (entry.index == monitor_index && entry.sub != 0) {
    const auto number = static_cast<std::uint8_t>(entry.sub - 1);
    objects.items[number] = item(number, drive, outputs);
  } else if (entry.index == function_index) {
    objects.recognise_inertia = static_cast<std::uint8_t>(recognition_);
    objects.find_resonances = static_cast<std::uint8_t>(search_);
  }
}

}  // namespace servodrome::products::jmc_ec
