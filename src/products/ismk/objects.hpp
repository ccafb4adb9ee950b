#pragma once

#include <array>
#include <cstdint>

#include "canopen/301/communication_objects.hpp"
#include "drive/objects.hpp"

// The memory of an iSMK drive's objects (ch. 7), one plain struct for each group. Index, type, range and unit are in
// object_table.hpp. Values the manual gives "in DEC" are in internal units: see units.hpp.
namespace servodrome::products::ismk {

// 2010h: terminals.
struct Io {
  std::uint16_t input_polarity = 0xFFFF;           // bit n: input n+1 is direct, else inverted
  std::uint16_t input_simulation = 0;              // bit n: input n+1
  std::array<std::uint16_t, 5> input_function{};   // function words, ch. 7.9
  std::uint16_t input_real = 0;                    // bit n: input n+1
  std::uint16_t output_polarity = 0xFFFF;          // bit n: output n+1
  std::uint16_t output_simulation = 0;             // bit n: output n+1
  std::array<std::uint16_t, 2> output_function{};  // function words, ch. 7.9
  std::uint16_t output_real = 0;                   // bit n: output n+1
  std::uint16_t zero_speed_window_inc_per_ms = 3;  // 2010h sub 18h
  std::uint8_t limit_function = 1;                 // 0: a limit switch after homing is an alarm
  std::int32_t positive_limit_position = 0;        // inc, latched when the limit input became active
  std::int32_t negative_limit_position = 0;
};

// 2020h: values that digital inputs select. 2FF1h writes one of its positions by two 16-bit halves.
struct Tables {
  std::array<std::int32_t, 8> position{};  // inc
  std::array<std::int32_t, 8> speed{};     // DEC
  std::array<std::int8_t, 2> mode{};       // 6060h while the input "mode control" is inactive, active
  std::uint16_t controlword = 0x2F;        // 6040h while the input "enable" is active
  std::uint8_t select = 0;                 // 2FF1h sub 1: L
  std::int16_t position_m = 0;             // position L = M * 10000 + N
  std::int16_t position_n = 0;
};

// 60F9h, 60FBh, 2340h, 2FF0h, 250Bh: gains and filters of the loops.
struct Gains {
  std::array<std::uint16_t, 4> velocity_kp{};  // Kvp[0..3]
  std::array<std::uint16_t, 4> velocity_ki{};  // Kvi[0..3]
  std::array<std::uint16_t, 4> position_kp{};  // Kpp[0..3], 0.01 Hz
  std::uint16_t velocity_ki_32 = 2;            // Kvi/32
  std::uint16_t velocity_integral_limit = 0;   // Kvi_Sum_Limit
  std::uint8_t feedback_filter = 7;            // Speed_Fb_N: 100 + 20 N Hz
  std::uint8_t feedback_mode = 0;              // Speed_Mode
  std::uint16_t output_filter = 1;             // Output_Filter_N: 2546 / N Hz
  std::uint8_t auto_switch = 0;                // 60F9h sub 9
  std::uint8_t pointer = 0;                    // 60F9h sub 28h: the set in use
  std::int16_t velocity_feed_forward = 1000;   // permille; also 2FF0h sub 1Ah
  std::int16_t acceleration_feed_forward = 32767;
  std::uint16_t velocity_bandwidth_hz = 0;  // 2FF0h sub 0Ah
  std::uint16_t velocity_ki_mix = 2;        // 2FF0h sub 19h
  std::uint16_t acceleration_feed_forward_permille = 0;
  std::array<std::uint16_t, 3> notch_frequency_hz{};  // 250Bh
};

// 2340h sub 10h, 60F9h sub 3 and 4: automatic tuning.
struct Tuning {
  std::uint8_t control = 12;  // Auto_Tuning_Control
  std::uint16_t notch_frequency_hz = 0;
  std::uint8_t notch_control = 0;
};

// Motion objects that an iSMK has in addition to those of CiA 402.
struct Motion {
  std::uint8_t step_stop_mode = 0;            // 2340h sub 1
  std::int16_t step_stop_current = 0;         // DEC
  std::int16_t target_speed_rpm = 0;          // 2FF0h sub 9, the same target as 60FFh
  std::uint16_t following_error_limit = 0;    // 2FF0h sub 0Eh, 100 inc: the same limit as 6065h
  std::uint8_t sync_period = 2;               // 3011h sub 1: 1, 2, 4, 8 ms
  std::uint8_t sync_clock_mode = 0;           // 3011h sub 2: 1 in interpolation mode
  std::uint16_t sync_lost_count = 0;          // 3011h sub 4
  std::uint8_t homing_at_power_on = 0;        // 6099h sub 3
  std::int16_t homing_current = 0;            // 6099h sub 4, DEC
  std::uint8_t home_offset_mode = 0;          // 6099h sub 5
  std::uint8_t index_blind_window = 0;        // 6099h sub 6
  std::int16_t torque_reached_reference = 0;  // 60F5h sub 6, DEC; 0: off
  std::int16_t torque_reached_time_ms = 100;  // 60F5h sub 7
  std::int16_t torque_reached_current = 0;    // 60F5h sub 8, DEC
  std::int16_t target_current = 0;            // 60F6h sub 8, DEC
  std::int32_t target_speed_window = 178956;  // 60F9h sub 0Ah, DEC
  std::uint16_t zero_speed_time_ms = 10;      // 60F9h sub 14h
  std::int32_t actual_velocity_per_ms = 0;    // 60F9h sub 1Ah, inc/ms
  std::int32_t speed_error = 0;               // 60F9h sub 1Ch, DEC
  std::uint8_t profile_order = 1;             // 60FBh sub 4: 1 trapezoid, 3 S-curve
  std::uint16_t smoothing_ms = 1;             // 60FBh sub 5
};

// 2601h, 2602h, 2605h: alarms and their masks.
struct Alarms {
  std::uint16_t state = 0;          // 2601h
  std::uint16_t state_2 = 0;        // 2602h
  std::uint16_t mask = 0xFFFF;      // 2605h sub 1: a bit that is 0: the alarm is ignored
  std::uint16_t store_on = 0xFBFF;  // alarms that the history keeps, while the motor is enabled
  std::uint16_t store_off = 0;      // ... while it is not
  std::uint16_t mask_2 = 0xFFFF;
  std::uint16_t store_on_2 = 0xF1FF;
  std::uint16_t store_off_2 = 0x003F;
  std::uint16_t extension = 0;  // 2605h sub 7
};

// Addresses, bit rates and protocols of the buses.
struct Buses {
  std::uint16_t station = 1;              // 100Bh: node id and RS485 station, from the next restart
  std::uint32_t cob_id_guarding = 0x700;  // 100Eh
  std::uint8_t can_bit_rate = 50;         // 2F81h, 10 kbit/s (but 12 is 125 kbit/s, Table 9-26); from the next restart
  std::uint16_t rs485_bit_rate = 90;      // 2FE2h: 10368000 / baud, from the next restart
  std::uint8_t cascade = 0;               // 6510h sub 0Bh
  std::uint8_t rs485_protocol = 1;        // 6510h sub 0Ch: bit 0: RS232 protocol, bit 1: from the next restart
  std::uint16_t rs485_mode = 0;           // 6510h sub 0Eh: 8 data bits, 1 stop bit, no parity
};

// Storage, restart, motor, brake, power stage.
struct Device {
  std::uint8_t store_data = 0;                      // 2FF0h sub 1
  std::uint8_t store_motor_data = 0;                // 2FF0h sub 3
  std::uint8_t motor_utilisation_percent = 0;       // 2FF0h sub 10h
  std::uint8_t drive_utilisation_percent = 0;       // 2FF0h sub 11h
  std::uint16_t restart = 0;                        // 2FFFh
  std::uint16_t encoder_reset = 0;                  // 2690h
  std::uint16_t analogue_speed_control = 0;         // 2502h sub 7
  std::uint16_t pulse_frequency_control = 0;        // 2508h sub 8
  std::array<std::uint16_t, 5> full_closed_loop{};  // 250Ah sub 1, 3, 5, 6, 9
  std::uint8_t motor_library = 2;                   // 3041h sub 6
  std::uint32_t encoder_resolution = 65536;         // 6410h sub 3, inc/rev
  std::uint16_t motor_current_max = 2048;           // 6410h sub 0Bh, DEC
  std::uint16_t brake_duty_percent = 70;            // 6410h sub 11h
  std::uint16_t brake_delay_ms = 150;               // 6410h sub 12h
  std::uint8_t brake_present = 0;                   // 6410h sub 17h
  std::int16_t motor_hot_c = 100;                   // 6410h sub 18h
  std::int16_t motor_temperature_c = 0;             // 6410h sub 19h
  std::int16_t encoder_output_resolution = 0;       // 6410h sub 1Fh
  std::uint16_t peak_current_a = 48;                // 6510h sub 3, Ap
  std::uint16_t under_voltage_v = 18;               // 6510h sub 7
  std::uint16_t chopper_voltage_v = 63;             // 6510h sub 8
  std::uint16_t over_voltage_v = 70;                // 6510h sub 9
};

// The objects that both variants have.
struct ServoObjects {
  drive::Objects drive{};
  Io io{};
  Tables tables{};
  Gains gains{};
  Tuning tuning{};
  Motion motion{};
  Alarms alarms{};
  Buses buses{};
  Device device{};
};

// Variant AA.
struct Objects {
  canopen::CommunicationObjects<4, 4, 8, 1, 1> communication{};
  ServoObjects servo{};
};

}  // namespace servodrome::products::ismk
