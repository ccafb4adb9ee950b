#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "drive/hardware.hpp"
#include "drive/transforms.hpp"
#include "plant/parameters.hpp"

// The DC link: a source behind a rectifier and a resistance, the drive's relay with its precharge, a capacitor, brake
// and bleeder resistors, and the drive's electronics. The source feeds the electronics; while the capacitor's voltage
// is above that of the source, the capacitor feeds them. The model conserves energy: the capacitor loses exactly the
// energy that the motor takes, and gains exactly what it returns.
namespace servodrome::plant {

class DcLink {
 public:
  explicit DcLink(const Supply& supply);

  // Advances by one tick. `power_w` goes to the motor (negative: comes back), `stage_w` becomes heat in the power
  // stage. `chopper_on`: the brake resistor conducts. `connected`: the relay is closed.
  void step(double power_w, double stage_w, bool chopper_on, bool connected) {
    if (connected != connected_) [[unlikely]]
      set_connected(connected);
    if (mains_phases_ != 0) [[unlikely]]
      follow_mains();
    if (volts_ < empty_v) [[unlikely]]
      stage_w = 0.0;
    stage_power_sum_w_ += stage_w;
    power_w += stage_w;
    if (volts_ > source_v_) [[unlikely]]
      return step_alone(power_w, chopper_on);
    exchange(power_w, chopper_on);
  }

  void set_supply_v(double volts);
  void discharge();  // empties the link at once and opens the relay

  double volts() const { return volts_; }
  double supplied_j() const { return supplied_j_; }
  double chopped_j() const { return chopped_j_; }
  double standby_j() const { return standby_j_; }
  double stage_j() const { return drive::tick_seconds * stage_power_sum_w_; }
  double stored_j() const { return half_capacitance_ * volts_ * volts_; }

 private:
  static constexpr double empty_v = 10.0;  // below this voltage, nothing in the drive switches

  // Coefficients of one tick with the bleeder, and with or without the brake resistor.
  struct Leak {
    double keep;           // share of the voltage that remains without the source
    double fed_keep;       // with the source: share of the distance from the steady state that remains
    double fed_v;          // steady voltage with the source, without any other current
    double fed_ohm;        // decrease of that voltage per A of current
    double per_square_v2;  // J per V^2 lost in the resistors
  };
  void exchange(double power_w, bool chopper_on) {
    const double start_v = volts_;
    const Leak& leak = leaks_[chopper_on ? 1 : 0];
    const double kept_v = start_v * leak.keep;
    double current_a = 0.0;
    double free_v = kept_v;
    if (power_w != 0.0) {           // avoids a division in the common case
      if (kept_v != inverted_v_) {  // equal while the drive stands
        inverted_v_ = kept_v;
        per_volt_ = 1.0 / std::max(kept_v, 1.0e-9);
      }
      const double per_volt = per_volt_;
      current_a = power_w * per_volt;
      const double used = current_a * tick_over_capacitance_ * per_volt;  // half the share of the energy that is taken
      if (std::abs(used) < 0.01) [[likely]] {
        free_v = kept_v * (1.0 - used - 0.5 * used * used);  // sqrt(1 - 2 used) to 5e-7
      } else {
        free_v = std::sqrt(std::max(0.0, kept_v * kept_v - 2.0 * power_w * tick_over_capacitance_));
      }
    }
    // With the source connected the link relaxes exponentially to (source - resistance * current) / (1 + resistance *
    // leak); no current flows back through the rectifier. A source of 0 V represents the open relay.
    const double target_v = leak.fed_v - current_a * leak.fed_ohm;
    const double fed_v = std::min(target_v + (start_v - target_v) * leak.fed_keep, source_v_);
    if (fed_v > free_v) {
      volts_ = fed_v;
      const double leaked_j = leak.per_square_v2 * start_v * fed_v;
      chopped_j_ += leaked_j;
      supplied_j_ +=
          (half_capacitance_ * (fed_v - start_v) * (fed_v + start_v) + leaked_j) + power_w * drive::tick_seconds;
    } else {
      volts_ = free_v;
      chopped_j_ += half_capacitance_ * (start_v - kept_v) * (start_v + kept_v);
    }
    if (precharging_) [[unlikely]]
      end_precharge();
  }
  void step_alone(double power_w, bool chopper_on);  // link above the source's voltage: the source feeds nothing
  void set_connected(bool connected);
  void follow_mains();
  double standby_power() {  // power in this tick, W; limited to the stored energy
    const double energy_j = std::min(standby_w_ * drive::tick_seconds, stored_j());
    standby_j_ += energy_j;
    return energy_j / drive::tick_seconds;
  }
  void end_precharge();
  void prepare();

  double volts_ = 0.0;
  double source_v_ = 0.0;                  // 0 while the relay is open
  double source_resistance_in_use_ = 0.0;  // of the source or of the precharge
  std::array<Leak, 2> leaks_{};            // bleeder alone; with the brake resistor
  double inverted_v_ = 0.0;                // the voltage of the last division, and its result
  double per_volt_ = 1.0e9;
  double tick_over_capacitance_;
  double half_capacitance_;
  int mains_phases_;         // 0: the source has a constant voltage
  drive::Phase mains_step_;  // of the mains in a tick
  drive::Phase mains_;       // at the middle of the last tick
  double supplied_j_ = 0.0;
  double chopped_j_ = 0.0;
  bool connected_ = false;
  bool precharging_ = false;

  double stage_power_sum_w_ = 0.0;  // of all ticks
  double standby_j_ = 0.0;          // energy of the electronics, from the capacitor
  double supply_v_;
  double standby_w_;
  double source_resistance_;
  double precharge_resistance_;
  std::array<double, 2> leak_s_;  // conductances, in the order of leaks_
};

}  // namespace servodrome::plant
