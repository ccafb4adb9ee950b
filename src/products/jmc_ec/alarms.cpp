#include "products/jmc_ec/jmc_ec.hpp"

// How alarms are reported: 603Fh, 1001h, emergencies, numbers and lamps.
namespace servodrome::products {

using ethercat::AlState;
using ethercat::AlStatusCode;

namespace {

constexpr Time activity_time = std::chrono::milliseconds(100);

const jmc_ec::CommunicationAlarm& alarm_of(AlStatusCode code) {
  return jmc_ec::communication_alarms[jmc_ec::communication_alarm_index(code)];
}

}  // namespace

// An error of the state machine persists until the master acknowledges it.
void JmcEc::follow_bus_error() {
  const AlStatusCode code = slave().error() ? slave().status_code() : AlStatusCode::none;
  if (code != bus_error_) bus_error(code);
}

// Reports an error of the bus. If the motor is enabled and 6007h says so, the error is a fault already; otherwise it is
// reported in the same way as a fault.
void JmcEc::bus_error(AlStatusCode code) {
  bus_error_ = code;
  show_alarm();
  if (code == AlStatusCode::none) {
    // If a fault is present, its reset clears the error of the bus as well.
    if (!drive().any_fault()) EthercatDevice::errors_gone(drive().error_register());
    return;
  }
  const std::size_t row = jmc_ec::communication_alarm_index(code);
  if (drive().is_active(jmc_ec::communication_cause(row))) return;
  report(jmc_ec::communication_alarms[row].code, jmc_ec::communication_error_register);
}

void JmcEc::fault_raised(const drive::FaultRow& fault) {
  fault_told_ = true;
  EthercatDevice::fault_raised(fault);
}

void JmcEc::warning_raised(const drive::FaultRow&) { show_alarm(); }

void JmcEc::errors_gone(std::uint8_t remaining) {
  show_alarm();
  // The drive sends no emergency when a warning begins or ends.
  if (!fault_told_ || drive().any_fault()) return;
  fault_told_ = false;
  if (bus_error_ != AlStatusCode::none) remaining |= jmc_ec::communication_error_register;
  EthercatDevice::errors_gone(remaining);
}

// Returns the fault, else the error of the bus, else the first active warning of the list.
JmcEc::Alarm JmcEc::alarm_to_show() {
  if (const drive::FaultRow* fault = drive().shown_fault()) return {fault->code, fault->alarm};
  if (bus_error_ != AlStatusCode::none) return {alarm_of(bus_error_).code, alarm_of(bus_error_).alarm};
  for (const drive::FaultRow& row : jmc_ec::faults) {
    if (drive().warns(row.cause)) return {row.code, row.alarm};
  }
  return {};
}

// In 603Fh, "the latest alarm signal" (Table 151).
void JmcEc::show_alarm() { objects().drive.error_code = alarm_to_show().code; }

jmc_ec::Leds JmcEc::leds(Time now) {
  jmc_ec::Leds leds;
  const bool linked = esc().link(0) || esc().link(1);
  leds.power = linked ? jmc_ec::Lamp::on : jmc_ec::Lamp::flashing;
  const std::uint16_t shown = alarm_to_show().number;
  leds.alarm_flashes = jmc_ec::flashes_of(shown);
  leds.alarm_on = leds.alarm_flashes == 0 && drive().any_fault();
  if (leds.alarm_flashes == 0 && !leds.alarm_on) {
    const drive::Axis& axis = drive().axis();
    if (axis.active(drive::Signal::negative_limit)) {
      leds.alarm_flashes = jmc_ec::ccw_limit_flashes;
    } else if (axis.active(drive::Signal::positive_limit)) {
      leds.alarm_flashes = jmc_ec::cw_limit_flashes;
    } else if (axis.active(drive::Signal::home)) {
      leds.alarm_flashes = jmc_ec::origin_flashes;
    }
  }
  switch (slave().state()) {
    case AlState::init:
    case AlState::bootstrap: leds.run = jmc_ec::Lamp::off; break;
    case AlState::pre_operational: leds.run = jmc_ec::Lamp::flashing; break;
    case AlState::safe_operational: leds.run = jmc_ec::Lamp::single_flash; break;
    case AlState::operational: leds.run = jmc_ec::Lamp::on; break;
  }
  for (const jmc_ec::CommunicationAlarm& row : jmc_ec::communication_alarms) {
    if (row.alarm == shown) leds.error = row.led;
  }
  const bool traffic = last_frame_ >= Time{} && now - last_frame_ < activity_time;
  const auto port = [&](unsigned number) {
    if (!esc().link(number)) return jmc_ec::Lamp::off;
    return traffic ? jmc_ec::Lamp::flashing : jmc_ec::Lamp::on;
  };
  leds.data_in = port(0);
  leds.data_out = port(1);
  return leds;
}

namespace {

// Table 10: single to quadruple flash.
Lamp error_lamp(jmc_ec::ErrorLed led) {
  constexpr Lamp lamp{"ERR", "red"};
  if (led == jmc_ec::ErrorLed::off) return lamp;
  if (led == jmc_ec::ErrorLed::on) return {lamp.name, lamp.colour, Light::on};
  return {lamp.name, lamp.colour, Light::flashes, static_cast<std::uint8_t>(led)};
}

}  // namespace

Lamps JmcEc::lamps(Time now) {
  const jmc_ec::Leds leds = this->leds(now);
  const auto lamp = [](std::string_view name, std::string_view colour, jmc_ec::Lamp state) -> Lamp {
    switch (state) {
      case jmc_ec::Lamp::off: return {name, colour, Light::off};
      case jmc_ec::Lamp::on: return {name, colour, Light::on};
      case jmc_ec::Lamp::flashing: return {name, colour, Light::blinking};
      case jmc_ec::Lamp::single_flash: return {name, colour, Light::flashes, 1};
    }
    return {name, colour};
  };
  Lamps lamps;
  lamps.add(lamp("power", "green", leds.power));
  if (leds.alarm_flashes != 0) {
    lamps.add({"alarm", "red", Light::flashes, leds.alarm_flashes});
  } else {
    lamps.add({"alarm", "red", steady(leds.alarm_on)});
  }
  lamps.add(lamp("RUN", "green", leds.run));
  lamps.add(error_lamp(leds.error));
  lamps.add(lamp("IN", "yellow", leds.data_in));
  lamps.add(lamp("OUT", "yellow", leds.data_out));
  return lamps;
}

}  // namespace servodrome::products
