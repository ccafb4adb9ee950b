#pragma once

#include <array>

#include "dictionary/entry.hpp"
#include "drive/loops/motor_data.hpp"
#include "products/jmc_ec/rigidity.hpp"

// The panel parameters P00 to P08 of the JMC EC drives (ch. 6, Table 65). They are not CoE objects, as Table 219 has
// none of them: the service port, the bench and the non-volatile memory access them, the fieldbus cannot. Parameter
// Pgg-nn is object 2000h + gg sub-index nn + 1, a number in the steps that the manual prints its value in.
//
// Defaults and ranges are those of the list; where the descriptions differ, the wider range (README C-21, C-22).
namespace servodrome::products::jmc_ec {

struct Panel {
  // P00: motor and drive. Factory values are those of the rating.
  std::uint16_t motor_code = 0;
  std::uint16_t rated_speed_rpm = 0;
  std::uint16_t rated_torque = 0;   // 0.01 Nm
  std::uint16_t rated_current = 0;  // 0.01 A, rms
  std::uint16_t rotor_inertia = 0;  // 0.01 kg cm^2
  std::uint16_t pole_pairs = 0;
  std::uint16_t encoder_lines = 0;
  std::uint16_t index_angle = 0;
  std::array<std::uint16_t, 6> initial_angle{};
  std::uint16_t rs232_bit_rate = 0;  // code
  std::uint16_t station = 0;
  std::uint16_t modbus_bit_rate = 0;
  std::uint16_t modbus_format = 0;
  std::uint16_t response_delay_ms = 0;
  std::uint16_t canopen_bit_rate = 0;
  std::uint16_t over_voltage_v = 0;

  // P01: main control
  std::uint16_t control_mode = 0;
  std::uint16_t adjustment_mode = 0;
  std::uint16_t rigidity_level = 0;
  std::uint16_t inertia_ratio = 0;  // 0.01, load by rotor
  std::uint16_t brake_delay_ms = 0;
  std::uint16_t brake_speed_rpm = 0;
  std::uint16_t brake_wait_ms = 0;

  // P02: gains
  std::array<std::uint16_t, 2> position_gain{};      // 0.1 /s
  std::uint16_t velocity_forward = 0;                // 0.1 %
  std::uint16_t velocity_forward_filter = 0;         // 0.01 ms
  std::array<std::uint16_t, 2> velocity_gain{};      // 0.1 Hz
  std::array<std::uint16_t, 2> integral_time{};      // 0.1 ms
  std::array<std::uint16_t, 2> pseudo_derivative{};  // 0.1 %
  std::uint16_t torque_forward = 0;                  // %
  std::uint16_t torque_forward_filter = 0;           // 0.01 ms
  std::uint16_t switching_mode = 0;
  std::uint16_t switching_level = 0;
  std::uint16_t switching_hysteresis = 0;
  std::uint16_t switching_delay = 0;     // 0.1 ms
  std::uint16_t position_gain_time = 0;  // 0.1 ms
  std::uint16_t mode_switch_level = 0;
  std::int16_t torque_added = 0;           // 0.1 %
  std::int16_t torque_forward_motion = 0;  // 0.1 %
  std::int16_t torque_reverse_motion = 0;  // 0.1 %

  // P03: position
  std::uint16_t position_source = 0;
  std::uint16_t pulse_inversion = 0;
  std::uint16_t pulse_filter = 0;
  std::uint16_t in_position_criterion = 0;
  std::uint16_t in_position_window = 0;  // encoder counts
  std::uint16_t pulses_per_revolution = 0;
  std::uint16_t gear_numerator = 0;
  std::uint16_t gear_denominator = 0;
  std::uint16_t position_deviation = 0;  // 10 command units
  std::uint16_t position_smoothing = 0;  // 0.1 ms
  std::uint16_t homing_timeout_s = 0;

  // P04: speed
  std::uint16_t speed_source = 0;
  std::uint16_t speed_inversion = 0;
  std::int16_t digital_speed_rpm = 0;
  std::uint16_t over_speed_rpm = 0;
  std::int16_t forward_speed_rpm = 0;
  std::int16_t reverse_speed_rpm = 0;  // 0 or less
  std::uint16_t zero_speed = 0;        // 0.1 rpm
  std::uint16_t acceleration_time = 0;
  std::uint16_t deceleration_time = 0;

  // P05: torque
  std::uint16_t forward_torque = 0;  // 0.1 %
  std::uint16_t reverse_torque = 0;  // 0.1 %

  // P06: terminals
  std::uint16_t enable_level = 0;
  std::uint16_t alarm_level = 0;
  std::uint16_t in_position_level = 0;

  // P08: filters
  std::uint16_t velocity_filter = 0;     // 0.01 ms
  std::uint16_t torque_filter = 0;       // 0.01 ms
  std::uint16_t disturbance_gain = 0;    // 0.1 %
  std::uint16_t disturbance_filter = 0;  // 0.01 ms
};

// Pgg-nn as the manual writes it.
struct ParameterId {
  std::uint8_t group;
  std::uint8_t number;

  constexpr std::uint16_t index() const { return static_cast<std::uint16_t>(0x2000 + group); }
  constexpr std::uint8_t sub() const { return static_cast<std::uint8_t>(number + 1); }
  friend constexpr bool operator==(const ParameterId&, const ParameterId&) = default;
};

inline constexpr std::uint16_t first_panel_index = 0x2000;
inline constexpr std::uint16_t last_panel_index = 0x2008;

constexpr bool is_panel(std::uint16_t index) { return index >= first_panel_index && index <= last_panel_index; }
constexpr ParameterId parameter_of(const dictionary::Entry& entry) {
  return {static_cast<std::uint8_t>(entry.index - first_panel_index), static_cast<std::uint8_t>(entry.sub - 1)};
}

// "Power-on again": the parameter acts from the next power-on (ch. 6, Table 65).
constexpr bool acts_from_power_on(ParameterId id) {
  return id.group == 0 || (id.group == 3 && id.number >= 9 && id.number <= 11) || id.group == 6;
}

// "Stop & set": writing is refused while the motor has power. P00-26 and 27 may be set while it runs (ch. 6).
constexpr bool set_while_stopped(ParameterId id) {
  return (id.group == 0 && id.number != 26 && id.number != 27) || id == ParameterId{1, 1} || id == ParameterId{3, 0} ||
         id == ParameterId{3, 3} || id == ParameterId{4, 0} || id == ParameterId{4, 1};
}

// P03-68 is named as the limit of AL.551 but not described. Seconds, and 0 for no limit, are this project's choice.
inline constexpr std::int64_t homing_timeout_default_s = 300;

inline constexpr auto panel_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  const auto parameter = [](std::uint8_t group, std::uint8_t number, const char* name, Field field, std::int64_t value,
                            std::int64_t minimum, std::int64_t maximum, const char* unit = "") {
    const ParameterId id{group, number};
    return element(id.index(), id.sub(), ObjectCode::record, name, field, Access::rw, Pdo::none,
                   {.default_value = value,
                    .minimum = minimum,
                    .maximum = maximum,
                    .unit = unit,
                    .saved = true,
                    .local = true,
                    .owner = Owner::product});
  };
  const auto group = [](std::uint8_t number, const char* name, std::uint8_t last) {
    Entry entry =
        highest_sub(ParameterId{number, 0}.index(), ObjectCode::record, name, static_cast<std::uint8_t>(last + 1));
    entry.local = true;
    return entry;
  };
  return std::to_array<Entry>({
      group(0, "P00 Motor and drive", 42),  // Table 65, ch. 8.2.1; the factory sets them (ch. 6)
      parameter(0, 0, "P00-00 Motor code", SERVODROME_FIELD(Panel, motor_code), 0, 0, 65535),
      parameter(0, 1, "P00-01 Motor rated speed", SERVODROME_FIELD(Panel, rated_speed_rpm), 3000, 1, 6000, "rpm"),
      parameter(0, 2, "P00-02 Motor rated torque", SERVODROME_FIELD(Panel, rated_torque), 1, 1, 65535, "0.01 Nm"),
      parameter(0, 3, "P00-03 Motor rated current", SERVODROME_FIELD(Panel, rated_current), 1, 1, 65535, "0.01 A"),
      parameter(0, 4, "P00-04 Motor rotor inertia", SERVODROME_FIELD(Panel, rotor_inertia), 1, 1, 65535, "0.01 kg cm2"),
      parameter(0, 5, "P00-05 Motor pole pairs", SERVODROME_FIELD(Panel, pole_pairs), 5, 1, 50),  // steppers have 50
      parameter(0, 10, "P00-10 Encoder lines", SERVODROME_FIELD(Panel, encoder_lines), 1000, 0, 65535),
      parameter(0, 11, "P00-11 Encoder Z angle", SERVODROME_FIELD(Panel, index_angle), 0, 0, 65535),
      parameter(0, 12, "P00-12 Rotor initial angle 1", SERVODROME_ELEMENT(Panel, initial_angle, 0), 150, 0, 360, "deg"),
      parameter(0, 13, "P00-13 Rotor initial angle 2", SERVODROME_ELEMENT(Panel, initial_angle, 1), 30, 0, 360, "deg"),
      parameter(0, 14, "P00-14 Rotor initial angle 3", SERVODROME_ELEMENT(Panel, initial_angle, 2), 90, 0, 360, "deg"),
      parameter(0, 15, "P00-15 Rotor initial angle 4", SERVODROME_ELEMENT(Panel, initial_angle, 3), 270, 0, 360, "deg"),
      parameter(0, 16, "P00-16 Rotor initial angle 5", SERVODROME_ELEMENT(Panel, initial_angle, 4), 210, 0, 360, "deg"),
      parameter(0, 17, "P00-17 Rotor initial angle 6", SERVODROME_ELEMENT(Panel, initial_angle, 5), 330, 0, 360, "deg"),
      parameter(0, 21, "P00-21 RS232 bit rate", SERVODROME_FIELD(Panel, rs232_bit_rate), 2, 0, 3),
      parameter(0, 23, "P00-23 Slave address", SERVODROME_FIELD(Panel, station), 1, 0, 255),
      parameter(0, 24, "P00-24 Modbus bit rate", SERVODROME_FIELD(Panel, modbus_bit_rate), 2, 0, 7),
      parameter(0, 25, "P00-25 Parity and stop bits", SERVODROME_FIELD(Panel, modbus_format), 1, 0, 3),
      parameter(0, 26, "P00-26 Modbus response delay", SERVODROME_FIELD(Panel, response_delay_ms), 0, 0, 100, "ms"),
      parameter(0, 27, "P00-27 CANopen bit rate", SERVODROME_FIELD(Panel, canopen_bit_rate), 0, 0, 7),
      parameter(0, 42, "P00-42 Overvoltage threshold", SERVODROME_FIELD(Panel, over_voltage_v), 0, 0, 300, "V"),

      group(1, "P01 Main control", 32),  // Table 65, ch. 8.2.2
      parameter(1, 1, "P01-01 Control mode", SERVODROME_FIELD(Panel, control_mode), 0, 0, 6),
      parameter(1, 2, "P01-02 Real-time adjustment mode", SERVODROME_FIELD(Panel, adjustment_mode), 1, 0, 2),
      parameter(1, 3, "P01-03 Rigidity level", SERVODROME_FIELD(Panel, rigidity_level), printed_level, 0, 31),
      parameter(1, 4, "P01-04 Load inertia ratio", SERVODROME_FIELD(Panel, inertia_ratio), 100, 0, 10000, "0.01"),
      parameter(1, 30, "P01-30 Brake delay", SERVODROME_FIELD(Panel, brake_delay_ms), 100, 0, 255, "ms"),
      parameter(1, 31, "P01-31 Brake speed threshold", SERVODROME_FIELD(Panel, brake_speed_rpm), 100, 0, 3000, "rpm"),
      parameter(1, 32, "P01-32 Brake wait", SERVODROME_FIELD(Panel, brake_wait_ms), 100, 0, 255, "ms"),

      group(2, "P02 Gains", 52),  // Table 65, ch. 8.2.3
      parameter(2, 0, "P02-00 Position gain 1", SERVODROME_ELEMENT(Panel, position_gain, 0), 480, 0, 30000, "0.1/s"),
      parameter(2, 1, "P02-01 Position gain 2", SERVODROME_ELEMENT(Panel, position_gain, 1), 570, 0, 30000, "0.1/s"),
      parameter(2, 3, "P02-03 Speed feed-forward", SERVODROME_FIELD(Panel, velocity_forward), 300, 0, 1000, "0.1%"),
      parameter(2, 4, "P02-04 Speed feed-forward filter", SERVODROME_FIELD(Panel, velocity_forward_filter), 50, 0, 6400,
                "0.01 ms"),
      parameter(2, 10, "P02-10 Speed gain 1", SERVODROME_ELEMENT(Panel, velocity_gain, 0), 270, 10, 20000, "0.1 Hz"),
      parameter(2, 11, "P02-11 Speed integral time 1", SERVODROME_ELEMENT(Panel, integral_time, 0), 100, 1, 10000,
                "0.1 ms"),
      parameter(2, 12, "P02-12 Pseudo-derivative 1", SERVODROME_ELEMENT(Panel, pseudo_derivative, 0), 1000, 0, 1000,
                "0.1%"),
      parameter(2, 13, "P02-13 Speed gain 2", SERVODROME_ELEMENT(Panel, velocity_gain, 1), 270, 10, 20000, "0.1 Hz"),
      parameter(2, 14, "P02-14 Speed integral time 2", SERVODROME_ELEMENT(Panel, integral_time, 1), 10000, 1, 10000,
                "0.1 ms"),
      parameter(2, 15, "P02-15 Pseudo-derivative 2", SERVODROME_ELEMENT(Panel, pseudo_derivative, 1), 1000, 0, 1000,
                "0.1%"),
      parameter(2, 19, "P02-19 Torque feed-forward", SERVODROME_FIELD(Panel, torque_forward), 0, 0, 30000, "%"),
      parameter(2, 20, "P02-20 Torque feed-forward filter", SERVODROME_FIELD(Panel, torque_forward_filter), 80, 0, 6400,
                "0.01 ms"),
      parameter(2, 30, "P02-30 Gain switching mode", SERVODROME_FIELD(Panel, switching_mode), 0, 0, 10),
      parameter(2, 31, "P02-31 Gain switching level", SERVODROME_FIELD(Panel, switching_level), 800, 0, 20000),
      parameter(2, 32, "P02-32 Gain switching hysteresis", SERVODROME_FIELD(Panel, switching_hysteresis), 100, 0,
                20000),
      parameter(2, 33, "P02-33 Gain switching delay", SERVODROME_FIELD(Panel, switching_delay), 100, 0, 10000,
                "0.1 ms"),
      parameter(2, 34, "P02-34 Position gain switching time", SERVODROME_FIELD(Panel, position_gain_time), 100, 0,
                10000, "0.1 ms"),
      parameter(2, 41, "P02-41 Mode switch level", SERVODROME_FIELD(Panel, mode_switch_level), 10000, 0, 20000),
      parameter(2, 50, "P02-50 Torque added", SERVODROME_FIELD(Panel, torque_added), 0, -1000, 1000, "0.1%"),
      parameter(2, 51, "P02-51 Forward torque compensation", SERVODROME_FIELD(Panel, torque_forward_motion), 0, -1000,
                1000, "0.1%"),
      parameter(2, 52, "P02-52 Reverse torque compensation", SERVODROME_FIELD(Panel, torque_reverse_motion), 0, -1000,
                1000, "0.1%"),

      group(3, "P03 Position", 68),  // Table 65; ch. 8.2.4; ch. 9.2, AL.551
      parameter(3, 0, "P03-00 Position command source", SERVODROME_FIELD(Panel, position_source), 0, 0, 1),
      parameter(3, 3, "P03-03 Command pulse inversion", SERVODROME_FIELD(Panel, pulse_inversion), 0, 0, 1),
      parameter(3, 4, "P03-04 Pulse filter", SERVODROME_FIELD(Panel, pulse_filter), 2, 0, 3),
      parameter(3, 5, "P03-05 In-position criterion", SERVODROME_FIELD(Panel, in_position_criterion), 1, 0, 2),
      parameter(3, 6, "P03-06 In-position window", SERVODROME_FIELD(Panel, in_position_window), 30, 0, 65535, "counts"),
      parameter(3, 9, "P03-09 Pulses per revolution", SERVODROME_FIELD(Panel, pulses_per_revolution), 4000, 0, 65535),
      parameter(3, 10, "P03-10 Gear numerator", SERVODROME_FIELD(Panel, gear_numerator), 4000, 1, 65535),
      parameter(3, 11, "P03-11 Gear denominator", SERVODROME_FIELD(Panel, gear_denominator), 4000, 1, 65535),
      parameter(3, 15, "P03-15 Excessive deviation", SERVODROME_FIELD(Panel, position_deviation), 0, 0, 65535,
                "10 pos"),
      parameter(3, 16, "P03-16 Position smoothing", SERVODROME_FIELD(Panel, position_smoothing), 0, 0, 10000, "0.1 ms"),
      parameter(3, 68, "P03-68 Homing time-out", SERVODROME_FIELD(Panel, homing_timeout_s), homing_timeout_default_s, 0,
                65535, "s"),

      group(4, "P04 Speed", 15),  // Table 65, ch. 8.2.5
      parameter(4, 0, "P04-00 Speed command source", SERVODROME_FIELD(Panel, speed_source), 1, 0, 3),
      parameter(4, 1, "P04-01 Speed command inversion", SERVODROME_FIELD(Panel, speed_inversion), 0, 0, 1),
      parameter(4, 2, "P04-02 Digital speed", SERVODROME_FIELD(Panel, digital_speed_rpm), 0, -6000, 6000, "rpm"),
      parameter(4, 5, "P04-05 Overspeed alarm", SERVODROME_FIELD(Panel, over_speed_rpm), 6400, 0, 6500, "rpm"),
      parameter(4, 6, "P04-06 Forward speed limit", SERVODROME_FIELD(Panel, forward_speed_rpm), 5000, 0, 6000, "rpm"),
      parameter(4, 7, "P04-07 Reverse speed limit", SERVODROME_FIELD(Panel, reverse_speed_rpm), -5000, -6000, 0, "rpm"),
      parameter(4, 10, "P04-10 Zero speed", SERVODROME_FIELD(Panel, zero_speed), 400, 0, 2000, "0.1 rpm"),
      parameter(4, 14, "P04-14 Acceleration time", SERVODROME_FIELD(Panel, acceleration_time), 500, 0, 10000,
                "ms/1000rpm"),
      parameter(4, 15, "P04-15 Deceleration time", SERVODROME_FIELD(Panel, deceleration_time), 500, 0, 10000,
                "ms/1000rpm"),

      group(5, "P05 Torque", 11),  // Table 65, ch. 8.2.6
      parameter(5, 10, "P05-10 Forward torque limit", SERVODROME_FIELD(Panel, forward_torque), 2000, 0, 3000, "0.1%"),
      parameter(5, 11, "P05-11 Reverse torque limit", SERVODROME_FIELD(Panel, reverse_torque), 2000, 0, 3000, "0.1%"),

      group(6, "P06 Terminals", 22),  // Table 65, ch. 8.2.7
      parameter(6, 0, "P06-00 Enable input level", SERVODROME_FIELD(Panel, enable_level), 1, 0, 4),
      parameter(6, 20, "P06-20 Alarm output level", SERVODROME_FIELD(Panel, alarm_level), 1, 0, 1),
      parameter(6, 22, "P06-22 In-position output level", SERVODROME_FIELD(Panel, in_position_level), 1, 0, 1),

      group(8, "P08 Advanced", 26),  // Table 65, ch. 8.2.8
      parameter(8, 19, "P08-19 Speed feedback filter", SERVODROME_FIELD(Panel, velocity_filter), 80, 0, 2500,
                "0.01 ms"),
      parameter(8, 20, "P08-20 Torque command filter", SERVODROME_FIELD(Panel, torque_filter), 84, 0, 2500, "0.01 ms"),
      parameter(8, 25, "P08-25 Disturbance compensation", SERVODROME_FIELD(Panel, disturbance_gain), 0, 0, 1000,
                "0.1%"),
      parameter(8, 26, "P08-26 Disturbance filter", SERVODROME_FIELD(Panel, disturbance_filter), 80, 0, 2500,
                "0.01 ms"),
  });
}();

}  // namespace servodrome::products::jmc_ec
