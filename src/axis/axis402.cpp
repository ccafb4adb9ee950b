// Status and power state of an axis. Motion is in axis402_motion.cpp and axis402_run.cpp.
#include "axis/axis402.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>

#include "axis/cia402_words.hpp"
#include "axis/fault_report.hpp"
#include "catalogue/status_words.hpp"
#include "master/restored.hpp"

namespace servodrome::master {

PowerState state_of(std::uint16_t statusword) {
  constexpr std::uint16_t without_quick_stop = 0x4F;
  constexpr std::uint16_t with_quick_stop = 0x6F;
  for (const PowerState state : {PowerState::not_ready_to_switch_on, PowerState::switch_on_disabled,
                                 PowerState::fault_reaction_active, PowerState::fault}) {
    if ((statusword & without_quick_stop) == (drive::state_bits(state) & without_quick_stop)) return state;
  }
  for (const PowerState state : {PowerState::ready_to_switch_on, PowerState::switched_on, PowerState::operation_enabled,
                                 PowerState::quick_stop_active}) {
    if ((statusword & with_quick_stop) == drive::state_bits(state)) return state;
  }
  return PowerState::not_ready_to_switch_on;  // none of the standard's bit patterns
}

std::string text_of_statusword(std::uint16_t statusword, std::string_view product, std::int8_t mode) {
  std::string names;
  for (unsigned bit = 0; bit < 16; ++bit) {
    if ((unsigned{statusword} >> bit & 1U) == 0) continue;
    const std::string_view name = catalogue::status_bit_name(product, bit, mode);
    names += fmt::format("{}{}", names.empty() ? "" : ", ", name.empty() ? fmt::format("bit {}", bit) : name);
  }
  return fmt::format("{:04X}h ({})", statusword, names.empty() ? "no bit set" : names);
}

std::string_view name(OperationMode mode, std::string_view product) {
  return catalogue::mode_name(product, static_cast<std::int8_t>(mode));
}

std::int32_t Axis402::position() {
  if (has_position_) {
    if (const auto value = objects_.read_if_present<std::int32_t>(0x6064)) return *value;
    has_position_ = false;
  }
  return objects_.read<std::int32_t>(0x6063);
}

std::int8_t Axis402::mode() {
  if (has_mode_display_) {
    if (const auto value = objects_.read_if_present<std::int8_t>(0x6061)) return *value;
    has_mode_display_ = false;
  }
  return objects_.read<std::int8_t>(0x6060);
}

AxisStatus Axis402::status() {
  AxisStatus status;
  status.statusword = statusword();
  status.mode = mode();
  status.position = position();
  if (has_velocity_) {
    const auto value = objects_.read_if_present<std::int32_t>(0x606C);
    has_velocity_ = value.has_value();
    status.velocity = value.value_or(0);
  }
  status.has_velocity = has_velocity_;
  if (has_torque_) {
    const auto value = objects_.read_if_present<std::int16_t>(0x6077);
    has_torque_ = value.has_value();
    status.torque = value.value_or(0);
  }
  status.has_torque = has_torque_;
  return status;
}

void Axis402::fail(const std::string& happened, const std::string& remedy) {
  const std::uint16_t word = statusword();
  const std::string_view product = options_.product->name;
  std::string shown =
      fmt::format("state {}, statusword {}", drive::name(state_of(word)), text_of_statusword(word, product, mode()));
  std::string to_do = remedy;
  if (const auto code = objects_.read_if_present<std::uint16_t>(0x603F); code && *code != 0) {
    const ReportedFault fault = fault_of_code(*code, {0x603F, 0}, product);
    shown += ", error code 603Fh " + text_of(fault, product);
    for (const catalogue::FaultText* meaning : fault.meanings) {
      to_do += fmt::format(". {}: {} {}", meaning->text, meaning->cause, meaning->remedy);
    }
  }
  // Some drives report an active limit switch as a fault.
  const PowerState present = state_of(word);
  if (present == PowerState::fault || present == PowerState::fault_reaction_active) {
    const std::uint32_t inputs = objects_.read_if_present<std::uint32_t>(0x60FD).value_or(0);
    for (const unsigned bit : {0U, 1U}) {
      if ((inputs >> bit & 1U) == 0) continue;
      shown += fmt::format(", the {} limit switch is active (60FDh)", bit == 0 ? "negative" : "positive");
    }
  }
  if (const auto emergency = latest_emergency()) shown += ", latest " + text_of(*emergency);
  throw MasterError(fmt::format("{} [{}]", happened, shown), objects_.where(), to_do);
}

void Axis402::leave_if_cancelled(const std::string& doing) {
  if (comes_to_rest_ || !options_.cancelled || !options_.cancelled()) return;
  stop();
  throw Cancelled(fmt::format("{} was cancelled; the axis stands at position {}", doing, position()), objects_.where(),
                  "start it anew");
}

void Axis402::pause() {
  leave_if_cancelled("waiting for the drive");
  objects_.wait(options_.poll_interval);
}

void Axis402::write_number(ObjectAddress object, std::int64_t value) {
  const std::size_t bytes = std::min(objects_.upload(object).size(), sizeof value);
  // Whether the object has a sign is not known.
  const std::int64_t half = bytes < sizeof value ? std::int64_t{1} << (8 * bytes) >> 1 : 0;
  if (half != 0 && (value < -half || value >= 2 * half)) {
    throw ObjectError(fmt::format("{} does not fit into the {} bytes of the object", value, bytes),
                      fmt::format("{}, {}", objects_.where(), text_of(object)), "give a value that fits", false);
  }
  objects_.download(object, std::as_bytes(std::span(&value, 1)).first(bytes));
}

// Returns the controlword that the drive holds; nullopt if the drive does not report it. Uses a short timeout, because
// the caller has waited for an answer already.
std::optional<std::uint16_t> Axis402::kept_controlword() {
  constexpr Time longest = std::chrono::milliseconds(300);
  const LimitedWait limited(objects_, longest);
  try {
    return objects_.read<std::uint16_t>(0x6040);
  } catch (const MasterError&) {
    return std::nullopt;
  }
}

// Returns true if `word`, which the drive may not have received, may be sent again over the word `kept` that the drive
// holds. Another client may have stopped the axis meanwhile, and its word may equal the former word of this client. So
// only a word that starts no motion is sent again.
bool Axis402::is_sent_again(std::uint16_t word, std::uint16_t kept) const {
  if (is_stop(word)) return true;
  if (commands_operation(word)) return (word & control_bit::halt) != 0 && commands_operation(kept);
  return kept == controlword_;
}

bool Axis402::is_stop(std::uint16_t word) const {
  return word == command_word::quick_stop || (word == command_word::disable_voltage && comes_to_rest_);
}

// If the drive does not answer, it may not have received the word. So the word is read back, and sent again if
// necessary. Under a limited wait there is no time to read: a stop is sent a second time at once.
void Axis402::write_controlword(std::uint16_t word) {
  const auto send = [&] {
    if (commands_operation(word)) leave_if_cancelled("commanding the drive");
    objects_.write<std::uint16_t>(0x6040, 0, word);
  };
  try {
    send();
  } catch (const ObjectError& error) {
    if (error.answered()) throw;
    if (objects_.has_limited_wait()) {
      if (!is_stop(word)) throw;
      send();
    } else {
      const auto kept = kept_controlword();
      if (!kept || (*kept != word && !is_sent_again(word, *kept))) throw;
      if (*kept != word) send();
    }
  }
  controlword_ = word;
}

bool Axis402::wait_for_bits(std::uint16_t mask, std::uint16_t value, Time timeout) {
  const Time deadline = objects_.now() + timeout;
  while ((statusword() & mask) != value) {
    if (objects_.now() >= deadline) return false;
    pause();
  }
  return true;
}

void Axis402::wait_for_state(std::initializer_list<PowerState> wanted, const char* doing, Time timeout) {
  const Time deadline = objects_.now() + timeout;
  for (;;) {
    const PowerState present = state();
    if (std::find(wanted.begin(), wanted.end(), present) != wanted.end()) return;
    if (present == PowerState::fault)
      fail(fmt::format("the drive has a fault and cannot {}", doing), "remove its cause and reset it");
    if (objects_.now() >= deadline) {
      fail(fmt::format("the drive did not {} within {} ms", doing, timeout / std::chrono::milliseconds(1)),
           "check its supply, enable input and safety input, and whether another master commands it");
    }
    pause();
  }
}

void Axis402::reset_fault() {
  const Time deadline = objects_.now() + options_.state_timeout;
  PowerState present = state();
  while (present == PowerState::fault_reaction_active && objects_.now() < deadline) {
    pause();
    present = state();
  }
  if (present == PowerState::fault_reaction_active) {
    fail("the fault cannot be reset: the drive still carries out its fault reaction", "reset it when the axis stands");
  }
  if (present != PowerState::fault) return;
  write_controlword(command_word::disable_voltage);  // the drive resets the fault at the rising edge of bit 7
  write_controlword(command_word::fault_reset);
  const Time reset_deadline = objects_.now() + options_.reset_timeout;
  while (state() == PowerState::fault) {
    if (objects_.now() >= reset_deadline) {
      write_controlword(command_word::disable_voltage);
      fail("the fault cannot be reset", "remove its cause; some faults need power off and on");
    }
    pause();
  }
  write_controlword(command_word::disable_voltage);
}

void Axis402::step_to_operation(bool& is_commanded) {
  PowerState present = state();
  if (present == PowerState::operation_enabled) return;
  goal_.reset();
  const Time timeout = options_.enable_timeout + brake_delay();
  const auto step = [&](std::uint16_t word, PowerState to, const char* doing) {
    if (commands_operation(word)) leave_if_cancelled("commanding the drive");
    is_commanded = true;
    write_controlword(word);
    wait_for_state({to}, doing, timeout);
  };
  for (;; present = state()) {
    switch (present) {
      case PowerState::not_ready_to_switch_on:
        wait_for_state({PowerState::switch_on_disabled, PowerState::ready_to_switch_on, PowerState::switched_on,
                        PowerState::operation_enabled},
                       "initialise", timeout);
        break;
      case PowerState::switch_on_disabled:
        step(command_word::shutdown, PowerState::ready_to_switch_on, "get ready to switch on");
        break;
      case PowerState::ready_to_switch_on: step(command_word::switch_on, PowerState::switched_on, "switch on"); break;
      case PowerState::switched_on:
        take_back_targets_before_enabling();
        step(command_word::enable_operation, PowerState::operation_enabled, "enable operation");
        break;
      case PowerState::quick_stop_active:
        // Goes through switch on disabled, because transition 16 is optional. To switch off before the end of the quick
        // stop would let the axis coast.
        wait_for_standstill();
        step(command_word::disable_voltage, PowerState::switch_on_disabled, "leave quick stop");
        break;
      case PowerState::operation_enabled: return;
      case PowerState::fault_reaction_active:
      case PowerState::fault: fail("the drive cannot be enabled: it has a fault", "remove its cause and reset it");
    }
  }
}

// If enabling fails, a quick stop takes the command back, because the drive could execute it later, for example when
// its brake has opened. Quick stop leaves the states of enabling (transitions 7 and 10), and brakes an axis that
// another client has set in motion. The call does not wait for standstill, because the caller may have to stop other
// axes.
void Axis402::enable() {
  bool is_commanded = false;
  try {
    step_to_operation(is_commanded);
  } catch (...) {
    if (is_commanded) {
      const LimitedWait limited(objects_, short_wait);
      try {
        write_controlword(command_word::quick_stop);
      } catch (const std::exception&) {
        // The first error is reported.
      }
    }
    throw;
  }
}

// After a cancellation the command must end soon, even if the drive never shows that it has obeyed.
Time Axis402::time_to_obey() const {
  constexpr Time when_cancelled = std::chrono::milliseconds(300);
  return options_.cancelled && options_.cancelled() ? std::min(when_cancelled, options_.state_timeout)
                                                    : options_.state_timeout;
}

Time Axis402::brake_delay() {
  const auto& delay = product().dialect.brake_delay;
  if (!delay) return {};
  return std::chrono::milliseconds(objects_.read_if_present<std::uint16_t>(delay->index, delay->sub).value_or(0));
}

void Axis402::disable() {
  const Restored rest(comes_to_rest_, true);
  const PowerState present = or_send(command_word::disable_voltage, [this] { return state(); });
  const bool is_off = present == PowerState::fault || present == PowerState::switch_on_disabled;
  if (is_off) return take_back_targets_of_idle_axis();
  halted_ = false;
  write_controlword(command_word::disable_voltage);
  if (is_doubtful(present)) return take_back_targets_of_idle_axis();
  wait_for_state({PowerState::switch_on_disabled}, "switch off", time_to_obey() + brake_delay());
  take_back_targets();
}

// Option code 605Ah decides: the drive stays in quick stop active or continues to switch on disabled.
void Axis402::quick_stop() {
  const PowerState present = or_send(command_word::quick_stop, [this] { return state_to_stop(); });
  if (is_doubtful(present)) stop_in_doubt();
  if (present != PowerState::operation_enabled && present != PowerState::quick_stop_active) {
    return take_back_targets_of_idle_axis();
  }
  const Restored rest(comes_to_rest_, true);
  halted_ = false;
  write_controlword(command_word::quick_stop);  // even if the state shows quick stop active: a bit of it may be wrong
  wait_for_state({PowerState::quick_stop_active, PowerState::switch_on_disabled}, "quick stop", time_to_obey());
  take_back_targets();
  wait_for_standstill();
  rests_within(options_.state_timeout);
}

void Axis402::set_mode(OperationMode mode) {
  const auto number = static_cast<std::int8_t>(mode);
  mode_ = number;
  if (this->mode() == number) return;
  if (number > 0) {
    const auto supported = objects_.read_if_present<std::uint32_t>(0x6502);
    if (supported && (*supported >> (number - 1) & 1U) == 0) {
      fail(fmt::format("the drive does not have mode {} ({}); 6502h is {:08X}h", number, name(mode, product().name),
                       *supported),
           "choose another mode");
    }
  }
  objects_.write<std::int8_t>(0x6060, 0, number);
  const Time deadline = objects_.now() + options_.state_timeout;
  while (this->mode() != number) {
    if (objects_.now() >= deadline) {
      fail(fmt::format("the drive did not accept mode {} ({}); 6061h is {}", number, name(mode, product().name),
                       this->mode()),
           "stop or disable the drive first, and check that no other master writes 6060h");
    }
    pause();
  }
}

std::optional<double> Axis402::ratio(std::uint16_t index) {
  const auto dividend = objects_.read_if_present<std::uint32_t>(index, 1);
  const auto divisor = objects_.read_if_present<std::uint32_t>(index, 2);
  if (!dividend || !divisor || *dividend == 0 || *divisor == 0) return std::nullopt;
  return static_cast<double>(*dividend) / static_cast<double>(*divisor);
}

std::optional<AxisUnits> Axis402::units_per_count() {
  const auto revolution = units();
  const auto counts = counts_per_revolution();
  if (revolution && counts) {
    return AxisUnits{revolution->position / *counts, revolution->velocity / *counts,
                     revolution->acceleration / *counts};
  }
  if (ratio(0x6092)) return std::nullopt;
  return AxisUnits{1.0, 1.0, 1.0};
}

// If the dialect (from the manual) defines the units, the drive may have factors as well. The position unit before
// these factors is an increment of the encoder.
std::optional<double> Axis402::counts_per_revolution() {
  const catalogue::Dialect& dialect = product().dialect;
  if (!dialect.units) return ratio(0x608F);
  if (!dialect.encoder_counts) return dialect.units->position;
  const auto counts =
      objects_.read_if_present<std::uint32_t>(dialect.encoder_counts->index, dialect.encoder_counts->sub);
  if (!counts || *counts == 0) return std::nullopt;
  return static_cast<double>(*counts);
}

std::optional<AxisUnits> Axis402::units(std::optional<double> position) {
  const catalogue::Dialect& dialect = product().dialect;
  if (dialect.units) {
    AxisUnits units = *dialect.units;
    if (!position) {
      const auto counts = counts_per_revolution();
      if (!counts) return std::nullopt;
      units.position = *counts;
    }
    if (dialect.has_old_factors) {
      units.position /= ratio(0x6093).value_or(1.0);
      units.velocity /= ratio(0x6094).value_or(1.0);
      units.acceleration /= ratio(0x6097).value_or(1.0);
    }
    if (position) units.position = *position;
    return units;
  }
  if (!position) {
    if (const auto feed = ratio(0x6092)) {
      position = *feed / ratio(0x6091).value_or(1.0);
    } else {
      position = ratio(0x608F);
    }
  }
  if (!position) return std::nullopt;
  return AxisUnits{*position, *position, *position};
}

}  // namespace servodrome::master
