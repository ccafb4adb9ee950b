#include "drive/tuning/resonance_analysis.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace servodrome::drive {
namespace {

// Least ratio of a line's power to the mean noise of the `noise_lines` lines on either side.
constexpr float least_signal_to_noise = 8.0F;
// Fraction of the torque's power that the transform's rounding leaks into the answer.
constexpr float rounding = 1.0e-9F;
constexpr std::size_t noise_lines = 4;

// Highest frequency of the lines used, as a fraction of the sampling rate.
constexpr float highest_share = 0.47F;

// The valleys beside a peak are searched within this ratio of frequencies, and a second resonance outside of it.
constexpr float neighbourhood = 1.4F;

// A second resonance whose squared gain is below this fraction of the first one's is ignored: it is harmless or an
// artefact.
constexpr float least_height_share = 0.05F;

}  // namespace

void ResonanceAnalysis::begin(const Settings& settings) {
  settings_ = settings;
  state_ = State::settling;
  sample_ = 0;
  block_ = 0;
  count_ = 0;
  torque_.fill(0.0F);
  answer_.fill(0.0F);
  fft_.begin();
  // Only even lines, those of the excitation.
  const float lines_per_hz = settings.sample_s * static_cast<float>(block);
  const auto line = [&](float hz) {
    const float reachable = std::min(hz, highest_share / settings.sample_s);
    return std::max<std::size_t>(2 * noise_lines, 2 * static_cast<std::size_t>(0.5F * reachable * lines_per_hz));
  };
  lowest_line_ = line(settings.lowest_hz);
  highest_line_ = line(settings.highest_hz);
  first_line_ = line(settings.lowest_hz / neighbourhood);
  last_line_ = line(settings.highest_hz * neighbourhood);
  // The sweep covers the first to the last line in one period. `sweep_start_` is its frequency at the start in turns
  // per sample, `sweep_slope_` half of the increase of the frequency per sample.
  sweep_start_ = static_cast<float>(first_line_) / static_cast<float>(block);
  const auto width = static_cast<float>(last_line_ - first_line_) / static_cast<float>(block);
  sweep_slope_ = 0.5F * width / static_cast<float>(excitation_period);
}

float ResonanceAnalysis::exchange(const Sample& sample) {
  if (!exciting()) return 0.0F;
  const auto moved = static_cast<float>(sample.position - last_position_);
  last_position_ = sample.position;
  if (state_ == State::recording) {
    torque_[sample_] += sample.torque;
    answer_[sample_] += settings_.answer == Answer::position ? moved : sample.controller_torque;
  }
  const auto n = static_cast<float>(sample_ & (excitation_period - 1));
  const float turns = n * (sweep_start_ + n * sweep_slope_);
  if (++sample_ == block) {
    sample_ = 0;
    const std::uint8_t blocks = state_ == State::settling ? settings_.settling_blocks : settings_.blocks;
    if (++block_ >= blocks) {
      block_ = 0;
      state_ = state_ == State::settling ? State::recording : State::transforming;
    }
  }
  return settings_.amplitude * sin_cos(phase_of(turns)).sine;
}

void ResonanceAnalysis::compute(std::size_t steps) {
  if (state_ == State::transforming) {
    if (!fft_.advance(torque_, answer_, steps)) return;
    state_ = State::measuring;
    sample_ = first_line_;
    return;
  }
  if (state_ == State::measuring) {
    for (; steps > 0 && sample_ <= last_line_; --steps, sample_ += 2) measure(sample_);
    if (sample_ <= last_line_) return;
    state_ = State::searching;
    sample_ = std::max(lowest_line_, first_line_ + 2);
  }
  if (state_ != State::searching) return;
  for (; steps > 0 && sample_ <= highest_line_ && sample_ + 2 <= last_line_; --steps, sample_ += 2) consider(sample_);
  if (sample_ <= highest_line_ && sample_ + 2 <= last_line_) return;
  state_ = State::done;
  while (count_ > 1 && resonances_[count_ - 1].height < least_height_share * resonances_[0].height) --count_;
}

// One complex transform Z of torque + i answer holds both real signals: T(k) = (Z(k) + Z*(N - k)) / 2 and A(k) = (Z(k)
// - Z*(N - k)) / 2i. The squared gain overwrites the torque of its even line, which is not read again: noise is
// measured on odd lines.
void ResonanceAnalysis::measure(std::size_t line) {
  const auto power_of_answer = [&](std::size_t k) {
    const float re = answer_[k] + answer_[block - k];
    const float im = torque_[block - k] - torque_[k];
    return re * re + im * im;
  };
  const float torque_re = torque_[line] + torque_[block - line];
  const float torque_im = answer_[line] - answer_[block - line];
  const float torque_power = torque_re * torque_re + torque_im * torque_im;
  float noise = 0.0F;
  for (std::size_t i = 1; i < 2 * noise_lines; i += 2) noise += power_of_answer(line - i) + power_of_answer(line + i);
  noise /= static_cast<float>(2 * noise_lines);
  const float answer_power = power_of_answer(line);
  const auto k = static_cast<float>(line);
  const float least_power = std::max(least_signal_to_noise * noise, rounding * torque_power);
  const bool believed = answer_power > least_power && torque_power > 0.0F;
  const float gain = believed ? (answer_power - noise) / torque_power * k * k : 0.0F;
  torque_[line] = gain;
}

float ResonanceAnalysis::line_hz(float line) const { return line / (settings_.sample_s * static_cast<float>(block)); }

// A line is a resonance if it is higher than both neighbours and exceeds the valleys around it by `least_prominence`.
// The parabola through the logarithms of the three lines refines its frequency. Of two resonances in one neighbourhood
// only the higher counts.
void ResonanceAnalysis::consider(std::size_t line) {
  const float height = torque_[line];
  const float left = torque_[line - 2];
  const float right = torque_[line + 2];
  if (left <= 0.0F || right <= 0.0F || height <= left || height < right) return;  // 0: lost in noise
  const auto lowest = [&](std::size_t from, std::size_t to) {
    float valley = height;
    for (std::size_t k = std::max(from, first_line_); k <= std::min(to, last_line_); k += 2) {
      if (torque_[k] > 0.0F) valley = std::min(valley, torque_[k]);
    }
    return valley;
  };
  const auto at = static_cast<float>(line);
  const auto even = [](float k) { return 2 * static_cast<std::size_t>(0.5F * k); };
  const float valley = std::max(lowest(even(at / neighbourhood), line), lowest(line, even(at * neighbourhood)));
  const float prominence = std::sqrt(height / valley);
  if (prominence < settings_.least_prominence) return;

  const float curvature = std::log(left * right / (height * height));
  const float offset = std::log(left / right) / curvature;  // in lines; the step between measured lines is two
  Resonance found{line_hz(at + offset), prominence, height};
  for (std::size_t i = 0; i < count_; ++i) {
    const float ratio = found.frequency_hz / resonances_[i].frequency_hz;  // > 1, as lines are processed upwards
    if (ratio > neighbourhood) continue;
    if (height <= resonances_[i].height) return;
    for (--count_; i < count_; ++i) resonances_[i] = resonances_[i + 1];
  }
  // Inserts by height; the lowest drops out at the end.
  for (std::size_t i = 0; i < most_resonances; ++i) {
    if (i >= count_ || found.height > resonances_[i].height) std::swap(found, resonances_[i]);
  }
  count_ = std::min(count_ + 1, most_resonances);
}

}  // namespace servodrome::drive
