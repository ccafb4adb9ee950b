#include "plant/dc_link.hpp"

#include <cmath>

#include "drive/hardware.hpp"
#include "plant/step.hpp"

namespace servodrome::plant {

namespace {
constexpr double precharge_complete = 0.97;  // share of the supply voltage at which the precharge ends
}  // namespace

DcLink::DcLink(const Supply& supply)
    : tick_over_capacitance_(h / supply.capacitance_f),
      half_capacitance_(0.5 * supply.capacitance_f),
      mains_phases_(supply.mains_phases),
      mains_step_(drive::phase_of(supply.mains_hz * h)),
      mains_(0U - mains_step_ / 2U),
      supply_v_(supply.volts),
      standby_w_(supply.standby_w),
      source_resistance_(supply.source_resistance_ohm),
      precharge_resistance_(
          std::max(supply.precharge_time_constant_s / supply.capacitance_f, supply.source_resistance_ohm)),
      leak_s_{1.0 / supply.bleeder_resistance_ohm,
              1.0 / supply.bleeder_resistance_ohm + 1.0 / supply.chopper_resistance_ohm} {
  set_connected(false);
  if (!supply.charged_at_start) return;
  volts_ = supply_v_;
  set_connected(true);
}

void DcLink::set_supply_v(double volts) {
  supply_v_ = volts;
  if (connected_) source_v_ = volts;
  prepare();
}

void DcLink::discharge() {
  volts_ = 0.0;
  set_connected(false);
}

void DcLink::step_alone(double power_w, bool chopper_on) { exchange(power_w + standby_power(), chopper_on); }

void DcLink::set_connected(bool connected) {
  connected_ = connected;
  source_v_ = connected ? supply_v_ : 0.0;
  precharging_ = connected;
  source_resistance_in_use_ = precharge_resistance_;
  prepare();
  if (connected) end_precharge();
}

void DcLink::end_precharge() {
  if (volts_ < precharge_complete * supply_v_) return;
  precharging_ = false;
  source_resistance_in_use_ = source_resistance_;
  prepare();
}

// The rectified mains: the greatest of the voltages between its wires, at mid-tick.
void DcLink::follow_mains() {
  mains_ += mains_step_;
  if (!connected_) return;
  // Of three phases, the nearest of six peaks in a period lies within 30 degrees.
  constexpr drive::Phase sixth = 0x2AAAAAABU;
  const drive::SinCos angle = drive::sin_cos(mains_phases_ == 3 ? mains_ % sixth - sixth / 2 : mains_);
  const double share = static_cast<double>(mains_phases_ == 3 ? angle.cosine : std::abs(angle.sine));
  source_v_ = supply_v_ * share;
  for (Leak& leak : leaks_) leak.fed_v = source_v_ * leak.fed_ohm / source_resistance_in_use_;
}

void DcLink::prepare() {
  const double resistance_ohm = source_resistance_in_use_;
  for (std::size_t i = 0; i < leaks_.size(); ++i) {
    const double conductance_s = leak_s_[i];
    const double share = 1.0 / (1.0 + resistance_ohm * conductance_s);
    leaks_[i] = {.keep = std::exp(-tick_over_capacitance_ * conductance_s),
                 .fed_keep = std::exp(-tick_over_capacitance_ * (conductance_s + 1.0 / resistance_ohm)),
                 .fed_v = source_v_ * share,
                 .fed_ohm = resistance_ohm * share,
                 .per_square_v2 = h * conductance_s};
  }
}

}  // namespace servodrome::plant
