#include "products/ismk/servo.hpp"

#include <algorithm>

#include "products/ismk/units.hpp"

namespace servodrome::products::ismk {

namespace {

// 2F81h (Table 9-26).
struct BitRateCode {
  std::uint8_t code;
  std::uint32_t bit_rate;
};
constexpr auto bit_rate_codes =
    std::to_array<BitRateCode>({{100, 1000000}, {50, 500000}, {25, 250000}, {12, 125000}, {5, 50000}, {1, 10000}});

constexpr std::uint16_t encoder_turns_valid = 10;  // of 2690h (Table 10-5, 000.4)
constexpr std::uint32_t restart_delay_ms = 20;     // enough for the answer to 2FFFh, on a slow or busy bus too

}  // namespace

std::uint32_t can_bit_rate_of(std::uint8_t code) {
  for (const BitRateCode& row : bit_rate_codes) {
    if (row.code == code) return row.bit_rate;
  }
  return 0;
}

const Model& Servo::rating() const {
  static constexpr std::size_t factory_rating = [] {
    std::size_t i = 0;
    while (ratings[i].name != default_rating) ++i;
    return i;
  }();
  const Model* model = find_model(ratings, settings_.model);
  return model != nullptr ? *model : ratings[factory_rating];
}

void Servo::prepare(dictionary::Area areas) {
  // One number for all buses; on EtherCAT it is that of the RS485 port only.
  const std::uint8_t station = settings_.serial.station != 0 ? settings_.serial.station : settings_.node_id;
  if (contains(areas, dictionary::Area::communication) && station != 0) objects_.buses.station = station;
  if (contains(areas, dictionary::Area::manufacturer)) {
    for (const BitRateCode& row : bit_rate_codes) {
      if (row.bit_rate == settings_.bit_rate) objects_.buses.can_bit_rate = row.code;
    }
  }
  if (contains(areas, dictionary::Area::motor)) {
    objects_.device.encoder_resolution = settings_.motor.counts_per_revolution;
  }
  if (contains(areas, dictionary::Area::profile)) {
    objects_.device.peak_current_a = static_cast<std::uint16_t>(rating().motor.peak_current_a);
  }
  prepare_rs485(areas);
}

drive::Configuration Servo::configuration() {
  const Device& device = objects_.device;
  drive::Configuration configuration;
  configuration.motor = settings_.motor;
  configuration.motor.peak_current_a = rating().motor.peak_current_a;
  tuning_.configure(objects_, configuration);
  configuration.monitors.over_voltage_v = device.over_voltage_v;
  configuration.monitors.under_voltage_v = device.under_voltage_v;
  configuration.monitors.chopper_on_v = configuration.monitors.chopper_off_v = 1e9F;  // none (ch. 1.3.1)
  configuration.monitors.motor_hot_c = device.motor_hot_c;
  configuration.monitors.warning_margin_c = 0.0F;  // no warnings are listed
  if (device.brake_present != 0) {
    configuration.brake_release_ms = configuration.brake_engage_ms = device.brake_delay_ms;
  }
  // The power stage withstands its printed continuous current (ch. 1.3.1), and the motor its rated current, without
  // limit of time.
  configuration.monitors.stage_rated_current_a = rating().stage_rated_current_a;
  configuration.monitors.stage_peak_current_a = rating().motor.peak_current_a;
  configuration.ignored = AlarmLog::ignored(objects_.alarms);
  terminals_.configure(objects_, configuration);
  MotionControl::configure(objects_, configuration);
  configuration.set_point_period_s = set_point_period_s_;
  return configuration;
}

void Servo::before_power_on() {
  terminals_.reset();
  motion_control_.power_on();
  restart_requested_ = false;
  restart_cycles_ = 0;
  set_point_period_s_ = 0.0;
  tuning_.reset(static_cast<double>(rating().motor.inertia_kgm2));
}

void Servo::set_set_point_period(double seconds) {
  if (seconds == set_point_period_s_) return;
  set_point_period_s_ = seconds;
  reconfigure();
}

void Servo::before_reset(bool whole) {
  if (!whole) return;
  terminals_.reset();
  tuning_.reset(static_cast<double>(rating().motor.inertia_kgm2));
  drive_.set_analysis(nullptr);
}

void Servo::after_reset() { tuning_.objects_loaded(objects_, drive_.configuration().motor); }

bool Servo::cycle(Time now) {
  if (restart_requested_ && restart_cycles_++ >= drive_.axis().cycles(restart_delay_ms)) return true;
  terminals_.cycle(drive_, objects_);
  if (tuning_.cycle(drive_, objects_, terminals_)) reconfigure();
  motion_control_.watch_sync(drive_, objects_, now);
  if (motion_control_.cycle(drive_, objects_)) reconfigure();
  return false;
}

drive::Feedback Servo::restart_feedback() const {
  drive::Feedback feedback;
  feedback.position_counts = drive_.axis().encoder_position;
  feedback.single_turn_counts = drive_.single_turn_counts();
  feedback.inputs = drive_.wires();
  return feedback;
}

std::array<char, 6> Servo::display() const {
  if (drive_.is_active(drive::Cause::motor_mismatch)) return motor_wrong_code;
  // 000.1 of 2601h refers to 2602h (Table 10-5).
  return display_code(objects_.alarms.state);
}

dictionary::AbortCode Servo::check(const dictionary::Entry& entry, std::span<const std::byte> value,
                                   std::uint8_t node_id) {
  const std::int64_t number = dictionary::decode_number(entry.type, value);
  if (entry.index == 0x2F81) {
    const bool known = std::any_of(bit_rate_codes.begin(), bit_rate_codes.end(),
                                   [number](const BitRateCode& row) { return row.code == number; });
    if (!known) return dictionary::AbortCode::value_invalid;
  }
  if (entry.index == 0x2FE2) {  // ch. 8.2
    const bool known = std::find(rs485_bit_rates.begin(), rs485_bit_rates.end(), number) != rs485_bit_rates.end();
    if (!known) return dictionary::AbortCode::value_invalid;
  }
  if (entry.index == 0x2010 && number != 0) {
    const auto code = static_cast<std::uint16_t>(number);
    const bool input = entry.sub >= 0x03 && entry.sub <= 0x07;
    const bool output = entry.sub == 0x0F || entry.sub == 0x10;
    if ((input && drive::find_function(input_functions, code) == nullptr) ||
        (output && drive::find_function(output_functions, code) == nullptr)) {
      return dictionary::AbortCode::value_invalid;
    }
  }
  switch (entry.index << 8 | entry.sub) {
    case 0x100E00:  // the node uses the pre-defined COB-ID only
      return number == 0x700 + node_id ? dictionary::AbortCode::none : dictionary::AbortCode::value_invalid;
    case 0x2FF001: return store_parameters(number);
    case 0x2FF003: return store_motor_data(number);
    case 0x2FFF00: return request_restart(number);
    default: break;
  }
  const dictionary::AbortCode motion = MotionControl::check(entry, number, drive_);
  return motion != dictionary::AbortCode::none ? motion : LoopTuning::check(entry, number, drive_);
}

void Servo::set_rigidity(double bandwidth_hz) {
  tuning_.set_rigidity(bandwidth_hz, objects_, drive_.configuration().motor);
  reconfigure();
}

void Servo::written(const dictionary::Entry& entry, std::uint8_t node_id, SerialPort& port) {
  tuning_.written(entry, objects_, drive_);
  Device& device = objects_.device;
  switch (entry.index << 8 | entry.sub) {
    case 0x2FF001:
      if (device.store_data == initialise_command) initialise_parameters(node_id);
      device.store_data = 0;
      break;
    case 0x2FF003: device.store_motor_data = 0; break;
    case 0x2FFF00: device.restart = 0; break;
    case 0x65100C: select_protocol(port); break;
    case 0x269000:
      if (device.encoder_reset == encoder_turns_valid) drive_.clear_multi_turn();
      break;
    case 0x2FF102:
    case 0x2FF103: enter_position(objects_.tables); break;
    default:
      if (!MotionControl::written(entry, objects_, drive_)) reconfigure();
  }
}

void Servo::refresh(const dictionary::Entry& entry) {
  tuning_.refresh(entry, objects_, drive_.configuration().motor);
  Device& device = objects_.device;
  switch (entry.index << 8 | entry.sub) {
    case 0x641019:
      device.motor_temperature_c = rounded<std::int16_t>(static_cast<double>(drive_.winding_temperature_c()));
      break;
    case 0x2FF010: device.motor_utilisation_percent = rounded<std::uint8_t>(drive_.i2t_utilisation_percent()); break;
    case 0x2FF011: device.drive_utilisation_percent = rounded<std::uint8_t>(drive_.stage_utilisation_percent()); break;
    default: MotionControl::refresh(entry, objects_, drive_);
  }
}

}  // namespace servodrome::products::ismk
