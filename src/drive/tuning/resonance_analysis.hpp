#pragma once

#include <array>
#include <cstdint>

#include "drive/tuning/fft.hpp"
#include "drive/units.hpp"

namespace servodrome::drive {

// Finds the mechanical resonances of an axis that is under control: it repeatedly adds a small sweep to the torque and
// compares the measured torque with the motion of the shaft. Their quotient depends on the mechanics only, not on the
// control loops. Scaled with the frequency it is acceleration / torque, which is flat for a rigid shaft and has a peak
// at each resonance.
//
// The excitation repeats after half of a recorded block. So its energy is in the even lines of the transform, and the
// odd lines hold only noise from the encoder and from other disturbances. A line that does not exceed the noise around
// it is ignored.
//
// exchange() is called by the velocity loop, compute() between cycles with an amount of work chosen by the caller.
class ResonanceAnalysis {
 public:
  static constexpr unsigned log2_block = 11;
  static constexpr std::size_t block = std::size_t{1} << log2_block;
  static constexpr std::size_t excitation_period = block / 2;
  static constexpr std::size_t most_resonances = 2;

  // The signal that is divided by the measured torque: the encoder's motion, or the output of the velocity controller.
  enum class Answer : std::uint8_t { position, controller };

  struct Settings {
    float sample_s = 125e-6F;          // velocity period
    float amplitude = 0.15F;           // of the excitation, as a fraction of rated torque
    float lowest_hz = 100.0F;          // range of the search: from
    float highest_hz = 2000.0F;        // to, below 0.47 of the sampling rate
    float least_prominence = 2.5F;     // height of a resonance / the higher of the valleys beside it
    std::uint8_t settling_blocks = 1;  // blocks of excitation before recording begins
    std::uint8_t blocks = 4;           // number of blocks recorded and added up
    Answer answer = Answer::position;
  };

  enum class State : std::uint8_t { idle, settling, recording, transforming, measuring, searching, done };

  // Values of the velocity period that has just ended, torques as fractions of rated.
  struct Sample {
    Counts position = 0;             // encoder
    float controller_torque = 0.0F;  // output of the velocity controller, before notches and filters
    float torque = 0.0F;             // measured
  };

  struct Resonance {
    float frequency_hz = 0.0F;
    float prominence = 0.0F;
    float height = 0.0F;  // squared gain of acceleration / torque, without a unit
  };

  void begin(const Settings& settings);
  void stop() { state_ = State::idle; }

  State state() const { return state_; }
  bool running() const { return state_ != State::idle && state_ != State::done; }
  bool exciting() const { return state_ == State::settling || state_ == State::recording; }

  // Returns the torque to add in the period that begins now, as a fraction of rated torque.
  float exchange(const Sample& sample);

  // Executes up to `steps` steps of the transform and the search. Does nothing until the record is complete.
  void compute(std::size_t steps);

  // Valid when done: the resonances found, highest first. None means that the axis is rigid in this range, or its
  // motion is lost in noise.
  std::size_t count() const { return count_; }
  const Resonance& resonance(std::size_t i) const { return resonances_[i]; }

 private:
  void measure(std::size_t line);
  void consider(std::size_t line);
  float line_hz(float line) const;

  Settings settings_{};
  State state_ = State::idle;
  std::size_t sample_ = 0;  // index in the excitation's period, in the record, in the search
  std::uint8_t block_ = 0;
  Counts last_position_ = 0;
  float sweep_start_ = 0.0F;
  float sweep_slope_ = 0.0F;
  std::size_t lowest_line_ = 2;  // range of the search
  std::size_t highest_line_ = 2;
  std::size_t first_line_ = 2;  // range measured
  std::size_t last_line_ = 2;
  std::size_t count_ = 0;
  std::array<Resonance, most_resonances> resonances_{};
  Fft<log2_block> fft_{};
  Fft<log2_block>::Values torque_{};  // sum of the blocks; after the transform the squared gain of each line
  Fft<log2_block>::Values answer_{};
};

}  // namespace servodrome::drive
