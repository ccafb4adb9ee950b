#include "drive/io/input_commands.hpp"

#include "drive/drive.hpp"

namespace servodrome::drive {

namespace {

constexpr std::uint16_t without(std::uint16_t word, std::uint16_t bits) {
  return static_cast<std::uint16_t>(word & ~static_cast<unsigned>(bits));
}
constexpr std::uint16_t with(std::uint16_t word, std::uint16_t bits) { return static_cast<std::uint16_t>(word | bits); }

constexpr auto position_mode = static_cast<std::int8_t>(Mode::profile_position);

constexpr std::uint32_t position_index_bits =
    bit(InputAction::position_index_0) | bit(InputAction::position_index_1) | bit(InputAction::position_index_2);
constexpr unsigned index_bits = 3;

}  // namespace

void InputCommands::step(const InputFunctions& inputs, const Settings& settings, Drive& drive, Objects& objects) {
  if (inputs.assigned() == 0 && assigned_ == 0 && !homing_.running() && !start_bit_is_ours_) return;
  changed_ = (inputs.actions() ^ active_) | (inputs.assigned() & ~assigned_);
  rising_ = inputs.actions() & ~active_;
  active_ = inputs.actions();
  assigned_ = inputs.assigned();

  control(inputs, settings, drive, objects);
  const auto is = [&objects](std::int8_t mode) { return mode == objects.modes_of_operation; };
  if (inputs.has_index(InputAction::speed_index_0, index_bits) && settings.speeds_valid &&
      std::any_of(settings.speed_modes.begin(), settings.speed_modes.end(), is)) {
    objects.target_velocity = settings.speeds[inputs.index(InputAction::speed_index_0, index_bits)];
  }
  position_table(inputs, settings, drive, objects);
  homing(drive, objects);
}

// When an input gets its function, its level acts at once, like a change. Afterwards only changes act, so that a master
// may set the other bits of the controlword.
void InputCommands::control(const InputFunctions& inputs, const Settings& settings, Drive& drive, Objects& objects) {
  const auto changed = [&](InputAction action) { return (changed_ & bit(action)) != 0; };
  if (changed(InputAction::mode_control) && inputs.has(InputAction::mode_control)) {
    objects.modes_of_operation = inputs.active(InputAction::mode_control) ? settings.mode_on : settings.mode_off;
  }
  if (changed(InputAction::enable)) {
    drive.command(inputs.active(InputAction::enable) ? settings.enabling_controlword : settings.disabling_controlword);
  }
  if (changed(InputAction::reset_errors)) {
    if (inputs.active(InputAction::reset_errors)) {
      drive.command(with(objects.controlword, controlword::fault_reset));
    } else {
      drive.clear_controlword_bits(controlword::fault_reset);
    }
  }
  if ((rising_ & bit(InputAction::quick_stop)) != 0) {
    drive.command(without(objects.controlword, controlword::quick_stop_inactive));
  }
}

// The table replaces target and profile velocity, whether an input or the bus starts the motion.
void InputCommands::position_table(const InputFunctions& inputs, const Settings& settings, Drive& drive,
                                   Objects& objects) {
  const bool indexed = inputs.has_index(InputAction::position_index_0, index_bits);
  const std::uint8_t index = inputs.index(InputAction::position_index_0, index_bits);
  const bool enabled = drive.state() == PowerState::operation_enabled && !homing_.running();
  if (start_bit_is_ours_) {
    start_bit_is_ours_ = false;
    if (!inputs.active(InputAction::activate)) drive.clear_controlword_bits(controlword::mode_bit_4);
  }
  if (objects.modes_of_operation != position_mode) {
    going_to_.reset();
    reached_.reset();
    start_bit_was_ = false;
    return;
  }
  if (indexed) {
    const std::int64_t speed = settings.speeds[index];
    objects.target_position = settings.positions[index];
    objects.profile_velocity = static_cast<std::uint32_t>(speed < 0 ? -speed : speed);
  }
  const bool index_moved = indexed && (changed_ & position_index_bits) != 0;
  const bool activated = (rising_ & bit(InputAction::activate)) != 0;
  if (enabled && (index_moved || activated)) {
    start_bit_is_ours_ = !activated;
    drive.clear_controlword_bits(controlword::mode_bit_4);
    start_bit_was_ = false;
    drive.command(with(objects.controlword, controlword::mode_bit_4));
  } else if ((changed_ & bit(InputAction::activate)) != 0 && !inputs.active(InputAction::activate)) {
    drive.clear_controlword_bits(controlword::mode_bit_4);
  }

  const bool start_bit = enabled && (objects.controlword & controlword::mode_bit_4) != 0;
  if (start_bit && !start_bit_was_) {
    reached_.reset();
    going_to_ = index;
  } else if (enabled && going_to_ && (drive.statusword() & statusword::target_reached) != 0) {
    reached_ = going_to_;
  }
  if (!enabled || !indexed) {
    going_to_.reset();
    reached_.reset();
  }
  start_bit_was_ = start_bit;
}

void InputCommands::homing(Drive& drive, Objects& objects) {
  const bool asked = (rising_ & bit(InputAction::start_homing)) != 0;
  if (homing_.running()) {
    homing_.step(drive, objects);
  } else if (asked && drive.state() == PowerState::operation_enabled) {
    homing_.start(drive, objects);
  }
}

}  // namespace servodrome::drive
