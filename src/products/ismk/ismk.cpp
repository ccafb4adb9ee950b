#include "products/ismk/ismk.hpp"

#include <algorithm>

namespace servodrome::products {

namespace {

// 2F81h (L3211).
struct BitRateCode {
  std::uint8_t code;
  std::uint32_t bit_rate;
};
constexpr auto bit_rate_codes =
    std::to_array<BitRateCode>({{100, 1000000}, {50, 500000}, {25, 250000}, {12, 125000}, {5, 50000}, {1, 10000}});

constexpr std::uint16_t encoder_turns_valid = 10;  // of 2690h (L3350)

}  // namespace

const Model& Ismk::rating() const {
  static constexpr std::size_t factory_rating = [] {
    std::size_t i = 0;
    while (ismk::ratings[i].name != ismk::default_rating) ++i;
    return i;
  }();
  const Model* model = find_model(ismk::ratings, settings().model);
  return model != nullptr ? *model : ismk::ratings[factory_rating];
}

std::uint32_t Ismk::chosen_bit_rate() const {
  for (const BitRateCode& row : bit_rate_codes) {
    if (row.code == objects().buses.can_bit_rate) return row.bit_rate;
  }
  return factory_bit_rate;
}

void Ismk::prepare(dictionary::Area areas) {
  ismk::Objects& own = objects();
  own.communication.serial_number = settings().serial_number;
  if (contains(areas, dictionary::Area::communication) && settings().node_id != 0) {
    own.buses.station = settings().node_id;
  }
  if (contains(areas, dictionary::Area::manufacturer)) {
    for (const BitRateCode& row : bit_rate_codes) {
      if (row.bit_rate == settings().bit_rate) own.buses.can_bit_rate = row.code;
    }
  }
  if (contains(areas, dictionary::Area::motor)) {
    own.device.encoder_resolution = settings().motor.counts_per_revolution;
  }
  if (contains(areas, dictionary::Area::profile)) {
    own.device.peak_current_a = static_cast<std::uint16_t>(rating().motor.peak_current_a);
  }
  prepare_rs485(areas);
}

drive::Configuration Ismk::configuration() {
  const ismk::Objects& own = objects();
  drive::Configuration configuration;
  configuration.motor = settings().motor;
  configuration.motor.peak_current_a = rating().motor.peak_current_a;
  tuning_.configure(own, configuration);
  configuration.monitors.over_voltage_v = own.device.over_voltage_v;
  configuration.monitors.under_voltage_v = own.device.under_voltage_v;
  configuration.monitors.chopper_on_v = configuration.monitors.chopper_off_v = 1e9F;  // there is none inside (L315)
  configuration.monitors.motor_hot_c = own.device.motor_hot_c;
  configuration.monitors.warning_margin_c = 0.0F;  // no warnings are listed
  if (own.device.brake_present != 0) {
    configuration.brake_release_ms = configuration.brake_engage_ms = own.device.brake_delay_ms;
  }
  // The power stage may carry its printed continuous current for ever (L303-306), as the motor its rated one.
  configuration.monitors.stage_rated_current_a = rating().stage_rated_current_a;
  configuration.monitors.stage_peak_current_a = rating().motor.peak_current_a;
  configuration.ignored = ismk::AlarmLog::ignored(own.alarms);
  terminals_.configure(own, configuration);
  ismk::MotionControl::configure(own, configuration);
  return configuration;
}

void Ismk::power_on(const drive::Feedback& feedback, Time now) {
  terminals_.reset();
  motion_control_.power_on();
  restart_requested_ = false;
  tuning_.reset(static_cast<double>(rating().motor.inertia_kgm2));
  CanDevice::power_on(feedback, now);
  tuning_.objects_loaded(objects(), drive().configuration().motor);
  open_serial_port();
  if (settings().store != nullptr && dictionary::Store(*settings().store).damaged()) {
    drive().raise(drive::Cause::memory);
  }
}

void Ismk::cycle(Time now) {
  if (restart_requested_) return restart(now);
  terminals_.cycle(drive(), objects());
  if (tuning_.cycle(drive(), objects(), terminals_)) reconfigure();
  motion_control_.watch_sync(drive(), objects(), now);
  if (motion_control_.cycle(drive(), objects())) reconfigure();
  CanDevice::cycle(now);
}

void Ismk::reset(canopen::NmtCommand command, dictionary::Area restore, std::uint8_t node_id) {
  if (command == canopen::NmtCommand::reset_node) {
    terminals_.reset();
    tuning_.reset(static_cast<double>(rating().motor.inertia_kgm2));
    drive().set_analysis(nullptr);
  }
  CanDevice::reset(command, restore, node_id);
  tuning_.objects_loaded(objects(), drive().configuration().motor);
  if (command == canopen::NmtCommand::reset_node) open_serial_port();
}

// With 6007h = 1 the loss of the master is an alarm of the drive, which sends its own emergency; otherwise nothing at
// all (L3079, L3215, L3306).
canopen::LossReaction Ismk::communication_lost(canopen::LossCause, canopen::LossReaction) {
  if (objects().drive.abort_connection_option_code == 1) drive().raise(drive::Cause::communication_lost);
  return {.emergency_code = 0, .behaviour = canopen::ErrorBehaviour::no_change};
}

void Ismk::sync(std::uint8_t counter, Time now) {
  motion_control_.sync(drive(), objects(), now);
  CanDevice::sync(counter, now);
}

void Ismk::fault_raised(const drive::FaultRow& fault) {
  alarm_log_.raise(fault, objects().alarms, drive());
  node().raise(fault.code, fault.error_register, ismk::emergency_bytes(objects().alarms));
}

void Ismk::errors_gone(std::uint8_t remaining) {
  ismk::AlarmLog::reset(objects().alarms);
  node().clear(remaining, ismk::emergency_bytes(objects().alarms));
}

std::array<char, 6> Ismk::display() {
  if (drive().is_active(drive::Cause::motor_mismatch)) return ismk::motor_wrong_code;
  const ismk::Alarms& alarms = objects().alarms;
  // 000.1 of 2601h says to look at 2602h (L3347).
  return ismk::display_code(alarms.state);
}

dictionary::AbortCode Ismk::check(const dictionary::Entry& entry, std::span<const std::byte> value) {
  const std::int64_t number = dictionary::decode_number(entry.type, value);
  if (entry.index == 0x2F81) {
    const bool known = std::any_of(bit_rate_codes.begin(), bit_rate_codes.end(),
                                   [number](const BitRateCode& row) { return row.code == number; });
    if (!known) return dictionary::AbortCode::value_invalid;
  }
  if (entry.index == 0x2FE2) {  // L2285
    const auto& codes = ismk::rs485_bit_rates;
    if (std::find(codes.begin(), codes.end(), number) == codes.end()) return dictionary::AbortCode::value_invalid;
  }
  if (entry.index == 0x2010 && number != 0) {
    const auto code = static_cast<std::uint16_t>(number);
    const bool input = entry.sub >= 0x03 && entry.sub <= 0x07;
    const bool output = entry.sub == 0x0F || entry.sub == 0x10;
    if ((input && drive::find_function(ismk::input_functions, code) == nullptr) ||
        (output && drive::find_function(ismk::output_functions, code) == nullptr)) {
      return dictionary::AbortCode::value_invalid;
    }
  }
  switch (entry.index << 8 | entry.sub) {
    case 0x100E00:  // the node answers on the pre-defined COB-ID only
      return number == 0x700 + node_id() ? dictionary::AbortCode::none : dictionary::AbortCode::value_invalid;
    case 0x2FF001: return store_parameters(number);
    case 0x2FF003: return store_motor_data(number);
    case 0x2FFF00: return request_restart(number);
    default: break;
  }
  const dictionary::AbortCode motion = ismk::MotionControl::check(entry, number, drive());
  return motion != dictionary::AbortCode::none ? motion : ismk::LoopTuning::check(entry, number, drive());
}

void Ismk::set_rigidity(double bandwidth_hz) {
  tuning_.set_rigidity(bandwidth_hz, objects(), drive().configuration().motor);
  reconfigure();
}

void Ismk::written(const dictionary::Entry& entry) {
  tuning_.written(entry, objects(), drive());
  switch (entry.index << 8 | entry.sub) {
    case 0x2FF001:
      if (objects().device.store_data == ismk::initialise_command) initialise_parameters();
      objects().device.store_data = 0;
      break;
    case 0x2FF003: objects().device.store_motor_data = 0; break;
    case 0x2FFF00: objects().device.restart = 0; break;
    case 0x65100C: select_protocol(); break;
    case 0x269000:
      if (objects().device.encoder_reset == encoder_turns_valid) drive().clear_multi_turn();
      break;
    case 0x2FF102:
    case 0x2FF103: ismk::enter_position(objects().tables); break;
    default:
      if (!ismk::MotionControl::written(entry, objects(), drive())) reconfigure();
  }
}

void Ismk::refresh(const dictionary::Entry& entry) {
  tuning_.refresh(entry, objects(), drive().configuration().motor);
  ismk::Device& device = objects().device;
  switch (entry.index << 8 | entry.sub) {
    case 0x641019:
      device.motor_temperature_c = ismk::rounded<std::int16_t>(static_cast<double>(drive().winding_temperature_c()));
      break;
    case 0x2FF010:
      device.motor_utilisation_percent = ismk::rounded<std::uint8_t>(drive().i2t_utilisation_percent());
      break;
    case 0x2FF011:
      device.drive_utilisation_percent = ismk::rounded<std::uint8_t>(drive().stage_utilisation_percent());
      break;
    default: ismk::MotionControl::refresh(entry, objects(), drive());
  }
}

}  // namespace servodrome::products
