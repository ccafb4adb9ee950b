// The heat step of Plant: once in Heat::ticks_per_step ticks, temperatures, the resistance they give, and the readings.
#include <algorithm>
#include <cmath>
#include <utility>

#include "plant/plant.hpp"

namespace servodrome::plant {

void Plant::update_heat(bool pwm) {
  heat_countdown_ = Heat::ticks_per_step;
  const double mean_square = windings_.phase_factor() / Heat::ticks_per_step * current_squared_sum_;
  current_squared_sum_ = 0.0;
  const double copper_w = mean_square * windings_.resistance_ohm();
  copper_j_ += copper_w * Heat::ticks_per_step * drive::tick_seconds;
  const double switch_w = std::exchange(switch_j_, 0.0) / (Heat::ticks_per_step * drive::tick_seconds);
  const double iron_w = iron_since_j_ / (Heat::ticks_per_step * drive::tick_seconds);
  iron_j_ += std::exchange(iron_since_j_, 0.0);
  heat_.step(copper_w,
             mean_square * parameters_.thermal.stage_resistance_ohm + switch_w +
                 (pwm ? parameters_.thermal.stage_standby_w : 0.0),
             iron_w);
  update_resistance();
  update_flux();
  update_readings();
}

void Plant::update_resistance() {
  if (std::abs(heat_.winding_c - resistance_at_c_) < 0.1) return;  // 0.04 % of copper
  resistance_at_c_ = heat_.winding_c;
  windings_.set_resistance_ohm(parameters_.motor.resistance_ohm *
                               (1.0 + parameters_.motor.copper_temperature_coefficient * (resistance_at_c_ - 25.0)));
}

// The magnets have the temperature of the motor's case.
void Plant::update_flux() {
  const double coefficient = parameters_.motor.magnet_temperature_coefficient;
  if (std::abs(heat_.case_c - flux_at_c_) < 0.1 || coefficient == 0.0) return;  // 0.01 % of neodymium
  flux_at_c_ = heat_.case_c;
  windings_.set_flux_vs(flux_linkage_vs(parameters_.motor) * std::max(0.1, 1.0 - coefficient * (flux_at_c_ - 25.0)));
}

void Plant::update_readings() {
  winding_reading_c_ = injected(Injection::winding_overheat) ? 180.0F : static_cast<float>(heat_.winding_c);
  stage_reading_c_ = injected(Injection::stage_overheat) ? 120.0F : static_cast<float>(heat_.stage_c);
  encoder_reading_c_ = injected(Injection::encoder_overheat) ? 120.0F : static_cast<float>(heat_.case_c);
  ambient_reading_c_ = injected(Injection::ambient_hot)    ? 90.0F
                       : injected(Injection::ambient_cold) ? -40.0F
                                                           : static_cast<float>(heat_.ambient_c);
}

}  // namespace servodrome::plant
