#include "axis/cyclic/cyclic_axis.hpp"

#include <fmt/format.h>

#include "axis/cia402_words.hpp"

namespace servodrome::master {

namespace {

[[noreturn]] void not_mapped(const std::string& where, std::uint16_t index, const char* pdo) {
  throw MasterError(fmt::format("{:04X}h is not among its process data", index), where,
                    fmt::format("map it into one of its {}", pdo));
}

constexpr const char* rpdos_with_remedy = "RPDOs (on EtherCAT: one that 1C12h names)";
constexpr const char* tpdos_with_remedy = "TPDOs (on EtherCAT: one that 1C13h names)";

ProcessObject mapped(std::optional<ProcessObject> object, const std::string& where, std::uint16_t index,
                     const char* pdo) {
  if (!object) not_mapped(where, index, pdo);
  return *object;
}

constexpr std::size_t probe_position(unsigned probe, bool rising) {
  return (probe == 2 ? 2U : 0U) + (rising ? 0U : 1U);
}

}  // namespace

CyclicAxis::CyclicAxis(ProcessImage& image)
    : where_(image.where()),
      controlword_(mapped(image.output({0x6040, 0}), where_, 0x6040, rpdos_with_remedy)),
      statusword_(mapped(image.input({0x6041, 0}), where_, 0x6041, tpdos_with_remedy)),
      mode_(image.output({0x6060, 0})),
      target_position_(image.output({0x607A, 0})),
      interpolated_position_(image.output({0x60C1, 1})),
      target_velocity_(image.output({0x60FF, 0})),
      target_torque_(image.output({0x6071, 0})),
      velocity_offset_(image.output({0x60B1, 0})),
      torque_offset_(image.output({0x60B2, 0})),
      probe_function_(image.output({0x60B8, 0})),
      mode_display_(image.input({0x6061, 0})),
      position_(image.input({0x6064, 0})),
      velocity_(image.input({0x606C, 0})),
      torque_(image.input({0x6077, 0})),
      following_error_(image.input({0x60F4, 0})),
      error_code_(image.input({0x603F, 0})),
      digital_inputs_(image.input({0x60FD, 0})),
      probe_status_(image.input({0x60B9, 0})),
      probe_positions_{image.input({0x60BA, 0}), image.input({0x60BB, 0}), image.input({0x60BC, 0}),
                       image.input({0x60BD, 0})} {}

ProcessObject& CyclicAxis::required(std::optional<ProcessObject>& object, std::uint16_t index) {
  if (!object) not_mapped(where_, index, rpdos_with_remedy);
  return *object;
}

bool CyclicAxis::can_command(OperationMode mode) const {
  switch (mode) {
    case OperationMode::cyclic_synchronous_position: return target_position_ && position_;
    case OperationMode::interpolated_position: return (interpolated_position_ || target_position_) && position_;
    case OperationMode::cyclic_synchronous_velocity: return target_velocity_.has_value();
    case OperationMode::cyclic_synchronous_torque: return target_torque_.has_value();
    case OperationMode::homing: return mode_.has_value();
    default: return false;
  }
}

bool CyclicAxis::has_touch_probe(unsigned probe, bool rising) const {
  return probe_function_ && probe_status_ && (probe == 1 || probe == 2) &&
         probe_positions_[probe_position(probe, rising)];
}

std::int32_t CyclicAxis::touch_probe_position(unsigned probe, bool rising) const {
  return value<std::int32_t>(probe_positions_[probe_position(probe, rising)]);
}

void CyclicAxis::hold() {
  if (target_position_ && position_) target_position_->set(position());
  if (interpolated_position_ && position_) interpolated_position_->set(position());
  if (target_velocity_) target_velocity_->set(0);
  if (target_torque_) target_torque_->set(0);
}

bool CyclicAxis::enable() {
  switch (state()) {
    case PowerState::operation_enabled: return true;
    case PowerState::switched_on: set_controlword(command_word::enable_operation); break;
    case PowerState::ready_to_switch_on: set_controlword(command_word::switch_on); break;
    case PowerState::switch_on_disabled: set_controlword(command_word::shutdown); break;
    case PowerState::quick_stop_active: set_controlword(command_word::disable_voltage); break;
    default: break;
  }
  hold();
  return false;
}

bool CyclicAxis::disable() {
  set_controlword(command_word::disable_voltage);
  return state() == PowerState::switch_on_disabled;
}

bool CyclicAxis::reset_fault() {
  if (state() != PowerState::fault) {
    if (controlword_.get<std::uint16_t>() == command_word::fault_reset) set_controlword(command_word::disable_voltage);
    return state() != PowerState::fault_reaction_active;
  }
  set_controlword(controlword_.get<std::uint16_t>() == command_word::fault_reset ? command_word::disable_voltage
                                                                                 : command_word::fault_reset);
  return false;
}

}  // namespace servodrome::master
