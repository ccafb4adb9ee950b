#include "host/ethercat/cyclic_axis.hpp"

#include <fmt/format.h>

namespace servodrome::host {

namespace {

// Controlwords of the commands (CiA 402-2 table 24).
constexpr std::uint16_t disable_voltage = 0x0000;
constexpr std::uint16_t shutdown = 0x0006;
constexpr std::uint16_t switch_on = 0x0007;
constexpr std::uint16_t enable_operation = 0x000F;
constexpr std::uint16_t fault_reset = 0x0080;

[[noreturn]] void not_mapped(const std::string& where, std::uint16_t index, const char* assignment) {
  throw EthercatError(EthercatError::Kind::unsupported, fmt::format("{:04X}h is not among its process data", index),
                      where, fmt::format("map it into a PDO that {} names", assignment));
}

ProcessObject mapped(std::optional<ProcessObject> object, const std::string& where, std::uint16_t index,
                     const char* assignment) {
  if (!object) not_mapped(where, index, assignment);
  return *object;
}

}  // namespace

CyclicAxis::CyclicAxis(CyclicExchange& exchange, std::size_t member)
    : where_(exchange.members()[member].slave->where()),
      controlword_(mapped(exchange.output(member, {0x6040, 0}), where_, 0x6040, "1C12h")),
      statusword_(mapped(exchange.input(member, {0x6041, 0}), where_, 0x6041, "1C13h")),
      mode_(exchange.output(member, {0x6060, 0})),
      target_position_(exchange.output(member, {0x607A, 0})),
      target_velocity_(exchange.output(member, {0x60FF, 0})),
      target_torque_(exchange.output(member, {0x6071, 0})),
      velocity_offset_(exchange.output(member, {0x60B1, 0})),
      torque_offset_(exchange.output(member, {0x60B2, 0})),
      mode_display_(exchange.input(member, {0x6061, 0})),
      position_(exchange.input(member, {0x6064, 0})),
      velocity_(exchange.input(member, {0x606C, 0})),
      torque_(exchange.input(member, {0x6077, 0})),
      following_error_(exchange.input(member, {0x60F4, 0})),
      error_code_(exchange.input(member, {0x603F, 0})),
      digital_inputs_(exchange.input(member, {0x60FD, 0})) {}

ProcessObject& CyclicAxis::required(std::optional<ProcessObject>& object, std::uint16_t index) {
  if (!object) not_mapped(where_, index, "1C12h");
  return *object;
}

void CyclicAxis::hold() {
  if (target_position_ && position_) target_position_->set(position());
  if (target_velocity_) target_velocity_->set(0);
  if (target_torque_) target_torque_->set(0);
}

bool CyclicAxis::enable() {
  switch (state()) {
    case PowerState::operation_enabled: return true;
    case PowerState::switched_on: set_controlword(enable_operation); break;
    case PowerState::ready_to_switch_on: set_controlword(switch_on); break;
    case PowerState::switch_on_disabled: set_controlword(shutdown); break;
    case PowerState::quick_stop_active: set_controlword(disable_voltage); break;
    default: break;
  }
  hold();
  return false;
}

bool CyclicAxis::disable() {
  set_controlword(disable_voltage);
  return state() == PowerState::switch_on_disabled;
}

bool CyclicAxis::reset_fault() {
  if (state() != PowerState::fault) {
    if (controlword_.get<std::uint16_t>() == fault_reset) set_controlword(disable_voltage);
    return state() != PowerState::fault_reaction_active;
  }
  set_controlword(controlword_.get<std::uint16_t>() == fault_reset ? disable_voltage : fault_reset);
  return false;
}

}  // namespace servodrome::host
