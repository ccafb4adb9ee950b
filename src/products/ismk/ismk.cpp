#include "products/ismk/ismk.hpp"

namespace servodrome::products {

std::uint32_t Ismk::chosen_bit_rate() const {
  const std::uint32_t chosen = ismk::can_bit_rate_of(objects().servo.buses.can_bit_rate);
  return chosen != 0 ? chosen : factory_bit_rate;
}

void Ismk::reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) {
  const bool whole = command == canopen::NmtCommand::reset_node;
  servo().before_reset(whole);
  CanDevice::reset(command, restore, node_id);
  servo().after_reset();
  if (whole) open_serial_port();
}

// With 6007h = 1 the loss of the master is an alarm of the drive, which sends its own emergency. With 6007h = 0 it has
// no effect (ch. 9.3.3.4; Table 9-26; Table 10-2, bit 12).
canopen::LossReaction Ismk::communication_lost(canopen::LossCause, canopen::LossReaction) {
  if (objects().servo.drive.abort_connection_option_code == 1) drive().raise(drive::Cause::communication_lost);
  return {.emergency_code = 0, .behaviour = canopen::ErrorBehaviour::no_change};
}

void Ismk::sync(std::uint8_t counter, Time now) {
  servo().sync(now);
  CanDevice::sync(counter, now);
}

void Ismk::fault_raised(const drive::FaultRow& fault) {
  servo().raise(fault);
  node().raise(fault.code, fault.error_register, servo().emergency_bytes());
}

void Ismk::errors_gone(std::uint8_t remaining) {
  servo().alarms_gone();
  node().clear(remaining, servo().emergency_bytes());
}

}  // namespace servodrome::products
