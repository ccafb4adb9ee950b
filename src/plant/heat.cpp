#include "plant/heat.hpp"

#include "drive/hardware.hpp"

namespace servodrome::plant {

Heat::Heat(const Thermal& thermal)
    : winding_c(thermal.ambient_c),
      case_c(thermal.ambient_c),
      stage_c(thermal.ambient_c),
      ambient_c(thermal.ambient_c) {
  constexpr double step = ticks_per_step * drive::tick_seconds;
  winding_per_w_ = step / thermal.winding_heat_capacity_j_per_k;
  winding_rate_ = winding_per_w_ / thermal.winding_to_case_k_per_w;
  case_per_w_ = step / thermal.case_heat_capacity_j_per_k;
  case_rate_ = step / (thermal.case_heat_capacity_j_per_k * thermal.winding_to_case_k_per_w);
  loss_rate_ = step / (thermal.case_heat_capacity_j_per_k * thermal.case_to_ambient_k_per_w);
  inverse_ = 1.0 / ((1.0 + winding_rate_) * (1.0 + case_rate_ + loss_rate_) - winding_rate_ * case_rate_);
  stage_per_w_ = step / thermal.stage_heat_capacity_j_per_k;
  stage_loss_rate_ = stage_per_w_ / thermal.stage_to_ambient_k_per_w;
  stage_inverse_ = 1.0 / (1.0 + stage_loss_rate_);
}

void Heat::step(double copper_w, double stage_w, double iron_w) {
  const double winding = winding_c + winding_per_w_ * copper_w;
  const double motor_case = case_c + loss_rate_ * ambient_c + case_per_w_ * iron_w;
  winding_c = ((1.0 + case_rate_ + loss_rate_) * winding + winding_rate_ * motor_case) * inverse_;
  case_c = (case_rate_ * winding + (1.0 + winding_rate_) * motor_case) * inverse_;
  stage_c = (stage_c + stage_per_w_ * stage_w + stage_loss_rate_ * ambient_c) * stage_inverse_;
}

}  // namespace servodrome::plant
