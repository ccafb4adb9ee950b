#pragma once

#include <array>
#include <cstdint>

namespace servodrome::drive {

// Calibration of the current sensors at power-on. While all switches of the power stage are open and the shaft is at
// rest, no current flows, so the mean of the sensors' readings is their offset. The calibration takes 64 cycles of the
// position loop (32 ms at 2 kHz) after a wait of 8. If the stage switches on earlier, the mean of the samples so far
// applies (from 8 samples on), and the calibration continues when the switches are open again. If the shaft turns, its
// back-EMF may drive a current through the diodes, so the calibration starts again.
class CurrentOffset {
 public:
  static constexpr std::uint32_t wait_cycles = 8;  // until an earlier current has decayed
  static constexpr std::uint32_t least_samples = 8;
  static constexpr std::uint32_t samples = 64;

  bool done() const { return count_ == samples; }
  const std::array<float, 3>& offset_a() const { return offset_a_; }

  // Once per position-loop cycle until done(). `open`: the switches were open in the last cycle. Returns true if the
  // offset has changed.
  bool cycle(const std::array<float, 3>& measured_a, bool open, bool stands) {
    if (!open) {
      wait_ = wait_cycles;
      return false;
    }
    if (!stands) {
      const bool changed = count_ >= least_samples;
      *this = {};
      return changed;
    }
    if (wait_ != 0) {
      --wait_;
      return false;
    }
    ++count_;
    for (std::size_t phase = 0; phase < 3; ++phase) {
      sum_a_[phase] += measured_a[phase];
      if (count_ >= least_samples) offset_a_[phase] = sum_a_[phase] / static_cast<float>(count_);
    }
    return count_ >= least_samples;
  }

 private:
  std::uint32_t wait_ = wait_cycles;
  std::uint32_t count_ = 0;
  std::array<float, 3> sum_a_{};
  std::array<float, 3> offset_a_{};
};

}  // namespace servodrome::drive
