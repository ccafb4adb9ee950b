#include "drive/open_phase.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace servodrome::drive {

namespace {

// Currents below this fraction of the rated one are not evaluated.
constexpr float least_current_share = 0.005F;
// A phase counts as without current below this fraction of another phase's current.
constexpr float none_share = 0.1F;
// Turning: the least number of sixteenths of a turn without current in the phase, and their least fraction of all
// sixteenths passed. The zero crossings of an intact phase take a few degrees each, at most a quarter of the
// sixteenths. With a very low current there are few valid samples, which may hit zero crossings by chance.
constexpr int least_without = 6;
constexpr int share_numerator = 2;
constexpr int share_denominator = 3;
// Standing: over a window of 50 ms the voltage must exceed a multiple of what the least current needs, plus the
// voltage that the rotor induces in a quarter of a turn, plus the error of a bridge.
constexpr std::uint32_t window_samples = 25;
constexpr float window_s = 0.05F;
constexpr float resistance_margin = 4.0F;
constexpr float bridge_share = 0.01F;

}  // namespace

void OpenPhase::configure(const MotorData& motor) {
  phases_ = motor.phases;
  least_a_ = least_current_share * motor.rated_current_a;
  const auto pole_pairs = static_cast<float>(motor.pole_pairs);
  const float flux_linkage_vs = motor.torque_constant_nm_per_a / (phase_factor(motor.phases) * pole_pairs);
  const float quarter_turn = 1.5707963F;
  const float impedance = motor.resistance_ohm + std::max(motor.inductance_d_h, motor.inductance_q_h) / window_s;
  least_v_ = resistance_margin * impedance * least_a_ + flux_linkage_vs * quarter_turn / window_s;
  standing_counts_ = static_cast<Counts>(motor.counts_per_revolution) / (4 * motor.pole_pairs);
}

void OpenPhase::forget() {
  watched_ = {};
  window_samples_ = 0;
  open_ = looked_ = false;
}

void OpenPhase::look(const Sample& sample) {
  looked_ = true;
  look_turning(sample);
  look_standing(sample);
}

void OpenPhase::look_turning(const Sample& sample) {
  float most = 0.0F;
  for (std::size_t i = 0; i < phases_; ++i) most = std::max(most, std::abs(sample.current_a[i]));
  const auto sixteenth = static_cast<std::uint16_t>(1U << (sample.angle >> 28));
  const bool flows = most > least_a_ && sample.field_turns;
  for (std::size_t i = 0; i < phases_; ++i) {
    Watched& phase = watched_[i];
    if (flows && std::abs(sample.current_a[i]) > none_share * most) {
      phase.passed = phase.without = 0;
      continue;
    }
    phase.passed |= sixteenth;
    if (flows) phase.without |= sixteenth;
    const int passed = std::popcount(phase.passed);
    const int without = std::popcount(phase.without);
    if (without >= least_without && share_denominator * without >= share_numerator * passed) open_ = true;
  }
}

void OpenPhase::look_standing(const Sample& sample) {
  if (window_samples_ == 0) begin_window(sample);
  lowest_ = std::min(lowest_, sample.position);
  highest_ = std::max(highest_, sample.position);
  if (highest_ - lowest_ > standing_counts_) return begin_window(sample);
  ++window_samples_;
  for (std::size_t i = 0; i < phases_; ++i) {
    watched_[i].most_a = std::max(watched_[i].most_a, std::abs(sample.current_a[i]));
    watched_[i].volts += sample.voltage_v[i];
  }
  if (window_samples_ < window_samples) return;
  const float least_v = least_v_ + bridge_share * sample.dc_link_v;
  for (std::size_t i = 0; i < phases_; ++i) {
    const float volts = std::abs(watched_[i].volts) / static_cast<float>(window_samples_);
    if (watched_[i].most_a < least_a_ && volts > least_v) open_ = true;
  }
  window_samples_ = 0;
}

void OpenPhase::begin_window(const Sample& sample) {
  window_samples_ = 0;
  lowest_ = highest_ = sample.position;
  for (Watched& phase : watched_) phase.most_a = phase.volts = 0.0F;
}

}  // namespace servodrome::drive
