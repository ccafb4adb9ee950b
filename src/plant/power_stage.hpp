#pragma once

#include <array>
#include <cstddef>

#include "drive/hardware.hpp"
#include "plant/parameters.hpp"

namespace servodrome::plant {

// Errors of a real power stage: the commanded voltages act late, and each half bridge loses voltage by its dead time
// and its switches. The stage switches once per tick, so its PWM frequency is the tick's.
class PowerStage {
 public:
  // `range_a` is a current amplitude. Only above a small share of it does the sign of the current decide the switching.
  PowerStage(const Stage& stage, int phases, double range_a);

  bool ideal() const { return ideal_; }
  // Returns true if the commanded voltages are modulated; otherwise all switches are open, or all low-side ones closed.
  static bool modulates(const drive::Actuation& commanded) { return commanded.pwm_enabled && !commanded.short_circuit; }
  // apply() without modulation, when the command acts as it is: the PWM then restarts from zero.
  void pause() {
    loss_w_ = 0.0;
    waiting_ = {};
  }
  // What acts in the next tick. `current_a`: phase currents at its beginning; `link_v`: voltage of the DC link. A plant
  // whose PWM rests calls pause() instead, without the copy.
  drive::Actuation apply(const drive::Actuation& commanded, const std::array<double, 3>& current_a, double link_v);
  // Loss in the switches in that tick in W, for constant currents.
  double loss_w() const { return loss_w_; }

 private:
  static constexpr std::size_t longest_delay = 3;

  bool ideal_;
  bool two_phases_;
  std::size_t delay_;
  double dead_share_;  // share of the DC link voltage that a half bridge loses
  double drop_v_;
  double modulation_limit_;
  double per_soft_current_;  // 1/A
  double loss_w_ = 0.0;
  std::array<std::array<float, 3>, longest_delay + 1> waiting_{};  // ring buffer; the newest entry is at `newest_`
  std::size_t newest_ = 0;
};

}  // namespace servodrome::plant
