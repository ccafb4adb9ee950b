#pragma once

#include <array>
#include <cstddef>

#include "drive/hardware.hpp"
#include "plant/parameters.hpp"

namespace servodrome::plant {

// What a real power stage makes of the voltages that it is told: they come late, and each half bridge loses what its
// dead time and its switches take. The stage of a tick switches once, so its PWM has the frequency of the tick.
class PowerStage {
 public:
  // The switching of a half bridge is left to the current only above a small share of `range_a`, an amplitude.
  PowerStage(const Stage& stage, int phases, double range_a);

  bool ideal() const { return ideal_; }
  // What acts in the tick to come. `current_a`: of the phases at its beginning; `link_v`: of the DC link.
  drive::Actuation apply(const drive::Actuation& commanded, const std::array<float, 3>& current_a, double link_v);
  // W that the switches took in that tick, if the currents stayed.
  double loss_w() const { return loss_w_; }

 private:
  static constexpr std::size_t longest_delay = 3;

  bool ideal_;
  bool two_phases_;
  std::size_t delay_;
  double dead_share_;  // of the DC link, that a half bridge loses
  double drop_v_;
  double modulation_limit_;
  double per_soft_current_;  // 1/A
  double loss_w_ = 0.0;
  std::array<std::array<float, 3>, longest_delay + 1> waiting_{};  // the newest at `newest_`
  std::size_t newest_ = 0;
};

}  // namespace servodrome::plant
