#include "plant/dc_link.hpp"

#include "drive/hardware.hpp"

namespace servodrome::plant {

namespace {
constexpr double h = drive::tick_seconds;
constexpr double precharge_complete = 0.97;  // of the supply voltage: then the relay bridges the precharge resistor
}  // namespace

DcLink::DcLink(const Supply& supply)
    : bleeder_keep_(std::exp(-h / (supply.bleeder_resistance_ohm * supply.capacitance_f))),
      chopper_keep_(bleeder_keep_ * std::exp(-h / (supply.chopper_resistance_ohm * supply.capacitance_f))),
      tick_over_capacitance_(h / supply.capacitance_f),
      half_capacitance_(0.5 * supply.capacitance_f),
      supply_v_(supply.volts),
      standby_w_(supply.standby_w),
      source_resistance_(supply.source_resistance_ohm),
      precharge_resistance_(
          std::max(supply.precharge_time_constant_s / supply.capacitance_f, supply.source_resistance_ohm)) {
  if (!supply.charged_at_start) return;
  volts_ = supply_v_;
  set_connected(true);
}

void DcLink::set_supply_v(double volts) {
  supply_v_ = volts;
  if (connected_) source_v_ = volts;
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
  set_source_resistance(precharge_resistance_);
  if (connected) end_precharge();
}

void DcLink::end_precharge() {
  if (volts_ < precharge_complete * source_v_) return;
  precharging_ = false;
  set_source_resistance(source_resistance_);
}

void DcLink::set_source_resistance(double resistance_ohm) {
  source_resistance_in_use_ = resistance_ohm;
  source_keep_ = std::exp(-tick_over_capacitance_ / resistance_ohm);
}

}  // namespace servodrome::plant
