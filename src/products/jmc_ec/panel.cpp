// Panel parameters, monitoring items and the service port of the JMC EC.
#include <algorithm>

#include "products/jmc_ec/jmc_ec.hpp"

namespace servodrome::products {

using dictionary::AbortCode;
using dictionary::Entry;
using jmc_ec::is_panel;

bool JmcEc::supports(const modbus::CharacterFormat& format) {
  const auto& rates = jmc_ec::rs232_bit_rates;
  return format.data_bits == 8 && format.stop_bits == 1 && format.parity == modbus::Parity::none &&
         std::find(rates.begin(), rates.end(), format.bit_rate) != rates.end();
}

// The motor of the nameplate, with the inertia of the rotor alone.
drive::MotorData JmcEc::rated_motor() const {
  drive::MotorData motor = settings().motor;
  motor.inertia_kgm2 = rating().model.motor.inertia_kgm2;
  return motor;
}

void JmcEc::prepare_panel() {
  jmc_ec::Panel& panel = objects().panel;
  jmc_ec::PanelControl::factory_values(panel, rated_motor());
  if (settings().serial.station != 0) panel.station = settings().serial.station;
  const auto& rates = jmc_ec::rs232_bit_rates;
  for (std::size_t i = 0; i < rates.size(); ++i) {
    if (settings().serial.format && settings().serial.format->bit_rate == rates[i]) {
      panel.rs232_bit_rate = static_cast<std::uint16_t>(i);
    }
  }
}

void JmcEc::configure_panel(drive::Configuration& configuration) const {
  configuration.motor = panel_control_.motor(rated_motor());
  configuration.motor.peak_current_a = rating().model.motor.peak_current_a;
  panel_control_.configure(objects().panel, configuration);
  const std::uint32_t deviation = jmc_ec::PanelControl::excessive_deviation(objects().panel);
  if (deviation != 0) configuration.monitors.window_of_zero = deviation;  // P03-15, unless 6065h is set (C-26)
}

void JmcEc::start_panel() {
  jmc_ec::Panel& panel = objects().panel;
  panel_control_.power_on(panel, rated_motor());
  monitor_.power_on(static_cast<double>(rating().model.motor.inertia_kgm2), 0.01 * panel.inertia_ratio);
  SerialSetup setup;
  setup.station = static_cast<std::uint8_t>(std::min<std::uint16_t>(panel.station, 247));
  setup.format = jmc_ec::rs232_format(panel.rs232_bit_rate);
  setup.timing = modbus::character_timing(setup.format);
  setup.timing.inter_character = Time{0};
  setup.timing = modbus::at_least(settings().serial.silence, setup.timing);
  setup.timing.silence += std::chrono::milliseconds(panel.response_delay_ms);  // P00-26
  serial_port_.open(setup);
  drive().inject(jmc_ec::cause::power_cycle_pending, false);
  was_energised_ = false;
}

void JmcEc::cycle_panel() {
  panel_control_.cycle(objects().panel, drive());
  monitor_.cycle(drive());
  // AL.941 is active while a changed parameter waits for the next power-on. Enabling the motor in this state is AL.110
  // (ch. 9.2).
  const bool energised = drive().energised();
  if (energised && !was_energised_ && panel_control_.power_cycle_needed(objects().panel)) {
    drive().raise(jmc_ec::cause::power_cycle_needed);
  }
  was_energised_ = energised;
}

AbortCode JmcEc::check_panel(const Entry& entry, std::int64_t value) {
  if (is_panel(entry.index)) return jmc_ec::PanelControl::check(entry, drive());
  if (entry.index != jmc_ec::function_index || value == 0) return AbortCode::none;
  return jmc_ec::Monitor::may_start(drive()) ? AbortCode::none : AbortCode::device_state;
}

// Panel parameters are saved when they are written, because the manual describes no command to save.
void JmcEc::panel_written(const Entry& entry) {
  if (entry.index == jmc_ec::function_index) {
    jmc_ec::MonitorObjects& monitor = objects().monitor;
    if (entry.sub == 1 && monitor.recognise_inertia != 0) monitor_.start_recognition(drive());
    if (entry.sub == 2 && monitor.find_resonances != 0) monitor_.start_search(drive());
    return;
  }
  if (!is_panel(entry.index)) return;
  jmc_ec::PanelControl::written(objects().panel);
  keep(dictionary::Area::manufacturer, jmc_ec::cause::parameter_storage);  // AL.062
  drive().inject(jmc_ec::cause::power_cycle_pending, panel_control_.power_cycle_needed(objects().panel));
  reconfigure();
  set_position_window();
}

void JmcEc::refresh(const Entry& entry) {
  monitor_.refresh(entry, objects().monitor, drive(), panel_control_.levels());
}

}  // namespace servodrome::products
