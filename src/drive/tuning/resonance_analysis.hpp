#pragma once

#include <array>
#include <cstdint>

#include "drive/tuning/fft.hpp"
#include "drive/units.hpp"

namespace servodrome::drive {

// Finds the mechanical resonances of an axis that is under control: it adds a small sweep to the torque, over and over,
// and compares what torque flowed with how the shaft answered. The quotient of the two is the mechanics alone, whatever
// the loops around it do; times the frequency it is acceleration by torque, flat for a rigid shaft and with a peak at
// each resonance.
//
// The excitation repeats after half of a recorded block, so that its lines are the even ones of the transform and the
// odd ones hold nothing but noise, of the encoder and of whatever else moves the axis: a line that does not stand out
// of those around it is not believed.
//
// exchange() is called by the velocity loop, compute() between cycles with an amount of work chosen by the caller.
class ResonanceAnalysis {
 public:
  static constexpr unsigned log2_block = 11;
  static constexpr std::size_t block = std::size_t{1} << log2_block;
  static constexpr std::size_t excitation_period = block / 2;
  static constexpr std::size_t most_resonances = 2;

  // What is divided by the measured torque: the encoder's motion, or what the velocity controller makes of it.
  enum class Answer : std::uint8_t { position, controller };

  struct Settings {
    float sample_s = 125e-6F;          // velocity period
    float amplitude = 0.15F;           // of the excitation, fraction of rated torque
    float lowest_hz = 100.0F;          // resonances are looked for from here
    float highest_hz = 2000.0F;        // to here, below 0.47 of the sampling rate
    float least_prominence = 2.5F;     // of a resonance: its height by the higher of the valleys beside it
    std::uint8_t settling_blocks = 1;  // excitation before the record begins
    std::uint8_t blocks = 4;           // recorded and added up
    Answer answer = Answer::position;
  };

  enum class State : std::uint8_t { idle, settling, recording, transforming, measuring, searching, done };

  // One velocity period: what the period just over brought, torques as fractions of rated.
  struct Sample {
    Counts position = 0;             // encoder
    float controller_torque = 0.0F;  // output of the velocity controller, before notches and filters
    float torque = 0.0F;             // measured
  };

  struct Resonance {
    float frequency_hz = 0.0F;
    float prominence = 0.0F;
    float height = 0.0F;  // gain of acceleration by torque, squared, in no unit
  };

  void begin(const Settings& settings);
  void stop() { state_ = State::idle; }

  State state() const { return state_; }
  bool running() const { return state_ != State::idle && state_ != State::done; }
  bool exciting() const { return state_ == State::settling || state_ == State::recording; }

  // The torque to add in the period that begins now.
  float exchange(const Sample& sample);

  // Up to `steps` steps of the transform and the search; nothing while the record is not complete.
  void compute(std::size_t steps);

  // When done: what was found, the higher first. None is a result as well: the axis is rigid in this range, or
  // its answer is lost in noise.
  std::size_t count() const { return count_; }
  const Resonance& resonance(std::size_t i) const { return resonances_[i]; }

 private:
  void measure(std::size_t line);
  void consider(std::size_t line);
  float line_hz(float line) const;

  Settings settings_{};
  State state_ = State::idle;
  std::size_t sample_ = 0;  // of the excitation's period, of the record, of the search
  std::uint8_t block_ = 0;
  Counts last_position_ = 0;
  float sweep_start_ = 0.0F;
  float sweep_slope_ = 0.0F;
  std::size_t lowest_line_ = 2;  // of a resonance
  std::size_t highest_line_ = 2;
  std::size_t first_line_ = 2;  // measured
  std::size_t last_line_ = 2;
  std::size_t count_ = 0;
  std::array<Resonance, most_resonances> resonances_{};
  Fft<log2_block> fft_{};
  Fft<log2_block>::Values torque_{};  // sum of the blocks; after the transform the squared gain of each line
  Fft<log2_block>::Values answer_{};
};

}  // namespace servodrome::drive
