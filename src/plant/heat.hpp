#pragma once

#include "plant/parameters.hpp"

// Temperatures of winding, motor case and power stage, with the heat flow to ambient. They change slowly, so one step
// covers `ticks_per_step` ticks.
namespace servodrome::plant {

class Heat {
 public:
  static constexpr int ticks_per_step = 64;  // 4 ms

  explicit Heat(const Thermal& thermal);

  // Mean losses in W since the last step.
  void step(double copper_w, double stage_w, double iron_w = 0.0);
  void set_ambient_c(double temperature_c) { ambient_c = temperature_c; }

  double winding_c;
  double case_c;
  double stage_c;
  double ambient_c;

 private:
  // Backward Euler for the two coupled nodes, solved once at construction: new = m * (old + gains).
  double winding_rate_;   // conductance winding to case * step / heat capacity of the winding
  double case_rate_;      // the same conductance * step / heat capacity of the case
  double loss_rate_;      // conductance case to ambient * step / heat capacity of the case
  double inverse_;        // 1 / determinant
  double winding_per_w_;  // K per W in a step
  double case_per_w_;
  double stage_per_w_;
  double stage_loss_rate_;
  double stage_inverse_;
};

}  // namespace servodrome::plant
