#include "drive/homing/device_homing.hpp"

#include "drive/drive.hpp"

namespace servodrome::drive {

namespace {

constexpr auto homing_mode = static_cast<std::int8_t>(Mode::homing);

}  // namespace

void DeviceHoming::start(Drive& drive, Objects& objects) {
  running_ = true;
  mode_before_ = objects.modes_of_operation;
  objects.modes_of_operation = homing_mode;
  drive.clear_controlword_bits(controlword::mode_bit_4);
  drive.command(static_cast<std::uint16_t>(objects.controlword | controlword::mode_bit_4));
}

void DeviceHoming::step(Drive& drive, Objects& objects) {
  if (!running_ || (drive.state() == PowerState::operation_enabled && drive.homing_running())) return;
  running_ = false;
  drive.clear_controlword_bits(controlword::mode_bit_4);
  // Restores the mode, unless the bus has selected another one meanwhile.
  if (objects.modes_of_operation == homing_mode) objects.modes_of_operation = mode_before_;
}

}  // namespace servodrome::drive
