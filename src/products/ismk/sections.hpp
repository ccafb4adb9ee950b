#pragma once

#include "dictionary/table.hpp"
#include "products/ismk/objects.hpp"

// The manufacturer's objects of the iSMK as table sections, a section for each group of objects.hpp. Rows that the
// manual prints without a type or default have those that README.md chooses.
namespace servodrome::products::ismk {

namespace section {

using namespace dictionary;  // NOLINT(google-build-using-namespace)

inline constexpr auto rw = Access::rw;
inline constexpr auto ro = Access::ro;
inline constexpr auto none = Pdo::none;
inline constexpr auto tx = Pdo::tpdo;
inline constexpr auto both = Pdo::both;
inline constexpr auto record = ObjectCode::record;

constexpr Entry object(std::uint16_t index, const char* name, Field field, Access access, Pdo pdo = none,
                       Options options = {}) {
  options.owner = Owner::product;
  return var(index, name, field, access, pdo, options);
}
constexpr Entry sub(std::uint16_t index, std::uint8_t sub_index, const char* name, Field field, Access access,
                    Pdo pdo = none, Options options = {}) {
  options.owner = Owner::product;
  return element(index, sub_index, record, name, field, access, pdo, options);
}

inline constexpr auto io = std::to_array<Entry>({
    highest_sub(0x2010, record, "Digital inputs and outputs", 0x1C),
    sub(0x2010, 0x01, "Din_Polarity", SERVODROME_FIELD(Io, input_polarity), rw, none,
        {.default_value = 0xFFFF, .saved = true}),
    sub(0x2010, 0x02, "Din_Simulate", SERVODROME_FIELD(Io, input_simulation), rw),
    sub(0x2010, 0x03, "Din1_Function", SERVODROME_ELEMENT(Io, input_function, 0), rw, none, {.saved = true}),
    sub(0x2010, 0x04, "Din2_Function", SERVODROME_ELEMENT(Io, input_function, 1), rw, none, {.saved = true}),
    sub(0x2010, 0x05, "Din3_Function", SERVODROME_ELEMENT(Io, input_function, 2), rw, none, {.saved = true}),
    sub(0x2010, 0x06, "Din4_Function", SERVODROME_ELEMENT(Io, input_function, 3), rw, none, {.saved = true}),
    sub(0x2010, 0x07, "Din5_Function", SERVODROME_ELEMENT(Io, input_function, 4), rw, none, {.saved = true}),
    sub(0x2010, 0x0A, "Din_Real", SERVODROME_FIELD(Io, input_real), ro, tx),
    sub(0x2010, 0x0D, "Dout_Polarity", SERVODROME_FIELD(Io, output_polarity), rw, both,
        {.default_value = 0xFFFF, .saved = true}),
    sub(0x2010, 0x0E, "Dout_Simulate", SERVODROME_FIELD(Io, output_simulation), rw, both),
    sub(0x2010, 0x0F, "Dout1_Function", SERVODROME_ELEMENT(Io, output_function, 0), rw, none,
        {.default_value = 0x0001, .saved = true}),
    sub(0x2010, 0x10, "Dout2_Function", SERVODROME_ELEMENT(Io, output_function, 1), rw, none,
        {.default_value = 0x0002, .saved = true}),
    sub(0x2010, 0x14, "Dout_Real", SERVODROME_FIELD(Io, output_real), ro, tx),
    sub(0x2010, 0x18, "Zero_Speed_Window", SERVODROME_FIELD(Io, zero_speed_window_inc_per_ms), rw, none,
        {.default_value = 3, .unit = "inc/ms", .saved = true}),
    sub(0x2010, 0x19, "Limit_Function", SERVODROME_FIELD(Io, limit_function), rw, none,
        {.default_value = 1, .minimum = 0, .maximum = 1, .saved = true}),
    sub(0x2010, 0x1B, "Positive limit position", SERVODROME_FIELD(Io, positive_limit_position), ro, tx,
        {.unit = "inc"}),
    sub(0x2010, 0x1C, "Negative limit position", SERVODROME_FIELD(Io, negative_limit_position), ro, tx,
        {.unit = "inc"}),
});

inline constexpr auto tables = [] {
  constexpr auto position = [](std::uint8_t number, const char* name) {
    return sub(0x2020, static_cast<std::uint8_t>(number < 4 ? 0x01 + number : 0x10 + number - 4), name,
               SERVODROME_ELEMENT(Tables, position, number), rw, none, {.unit = "inc", .saved = true});
  };
  constexpr auto speed = [](std::uint8_t number, const char* name) {
    return sub(0x2020, static_cast<std::uint8_t>(number < 4 ? 0x05 + number : 0x14 + number - 4), name,
               SERVODROME_ELEMENT(Tables, speed, number), rw, none, {.unit = "rpm (DEC raw)", .saved = true});
  };
  return std::to_array<Entry>({
      highest_sub(0x2020, record, "Position and speed tables", 0x17),
      position(0, "Din_Pos0"),
      position(1, "Din_Pos1"),
      position(2, "Din_Pos2"),
      position(3, "Din_Pos3"),
      speed(0, "Din_Speed0"),
      speed(1, "Din_Speed1"),
      speed(2, "Din_Speed2"),
      speed(3, "Din_Speed3"),
      sub(0x2020, 0x0D, "Din_Mode0", SERVODROME_ELEMENT(Tables, mode, 0), rw, none,
          {.default_value = -3, .saved = true}),
      sub(0x2020, 0x0E, "Din_Mode1", SERVODROME_ELEMENT(Tables, mode, 1), rw, none,
          {.default_value = -4, .saved = true}),
      sub(0x2020, 0x0F, "Din_Control_Word", SERVODROME_FIELD(Tables, controlword), rw, none,
          {.default_value = 0x2F, .saved = true}),
      position(4, "Din_Pos4"),
      position(5, "Din_Pos5"),
      position(6, "Din_Pos6"),
      position(7, "Din_Pos7"),
      speed(4, "Din_Speed4"),
      speed(5, "Din_Speed5"),
      speed(6, "Din_Speed6"),
      speed(7, "Din_Speed7"),
      highest_sub(0x2FF1, record, "Quick entry of positions", 3),
      sub(0x2FF1, 1, "Din_position_select_L", SERVODROME_FIELD(Tables, select), rw, none, {.minimum = 0, .maximum = 7}),
      sub(0x2FF1, 2, "Din_position_M", SERVODROME_FIELD(Tables, position_m), rw),
      sub(0x2FF1, 3, "Din_position_N", SERVODROME_FIELD(Tables, position_n), rw),
  });
}();

// The manual prints values for set 0 only (ch. 7.7, Tables 6-2 and 6-5). The other sets have the same values and
// ranges, so that a change of sets never leaves an axis without control.
constexpr Entry kvp(std::uint16_t index, std::uint8_t sub_index, const char* name, Field field,
                    const char* unit = "DEC (Hz shown)") {
  return sub(index, sub_index, name, field, rw, none,
             {.default_value = 4, .minimum = 1, .maximum = 32767, .unit = unit, .saved = true});
}
constexpr Entry kvi(std::uint16_t index, std::uint8_t sub_index, const char* name, Field field) {
  return sub(index, sub_index, name, field, rw, none,
             {.default_value = 0, .minimum = 0, .maximum = 1023, .unit = "DEC", .saved = true});
}
constexpr Entry kpp(std::uint16_t index, std::uint8_t sub_index, const char* name, Field field,
                    const char* unit = "DEC (Hz shown)") {
  return sub(index, sub_index, name, field, rw, none,
             {.default_value = 1000, .minimum = 0, .maximum = 32700, .unit = unit, .saved = true});
}

inline constexpr auto gains = std::to_array<Entry>({
    kvp(0x2340, 0x04, "Kvp[1]", SERVODROME_ELEMENT(Gains, velocity_kp, 1)),
    kvi(0x2340, 0x05, "Kvi[1]", SERVODROME_ELEMENT(Gains, velocity_ki, 1)),
    kpp(0x2340, 0x06, "Kpp[1]", SERVODROME_ELEMENT(Gains, position_kp, 1)),
    kvp(0x2340, 0x07, "Kvp[2]", SERVODROME_ELEMENT(Gains, velocity_kp, 2)),
    kvi(0x2340, 0x08, "Kvi[2]", SERVODROME_ELEMENT(Gains, velocity_ki, 2)),
    kpp(0x2340, 0x09, "Kpp[2]", SERVODROME_ELEMENT(Gains, position_kp, 2)),
    kvp(0x2340, 0x0A, "Kvp[3]", SERVODROME_ELEMENT(Gains, velocity_kp, 3)),
    kvi(0x2340, 0x0B, "Kvi[3]", SERVODROME_ELEMENT(Gains, velocity_ki, 3)),
    kpp(0x2340, 0x0C, "Kpp[3]", SERVODROME_ELEMENT(Gains, position_kp, 3)),
    highest_sub(0x250B, record, "Notch filters", 3),
    sub(0x250B, 1, "Notch filter 1 frequency", SERVODROME_ELEMENT(Gains, notch_frequency_hz, 0), rw, none,
        {.default_value = 550, .minimum = 100, .maximum = 2000, .unit = "Hz", .saved = true}),
    sub(0x250B, 2, "Notch filter 2 frequency", SERVODROME_ELEMENT(Gains, notch_frequency_hz, 1), rw, none,
        {.default_value = 330, .minimum = 100, .maximum = 2000, .unit = "Hz", .saved = true}),
    sub(0x250B, 3, "Notch filter 3 frequency", SERVODROME_ELEMENT(Gains, notch_frequency_hz, 2), rw, none,
        {.unit = "Hz", .saved = true}),
    sub(0x2FF0, 0x0A, "Velocity_BW", SERVODROME_FIELD(Gains, velocity_bandwidth_hz), rw, none,
        {.default_value = 24, .minimum = 1, .maximum = 700, .unit = "Hz"}),
    sub(0x2FF0, 0x19, "Kvi_Mix", SERVODROME_FIELD(Gains, velocity_ki_mix), rw, none,
        {.default_value = 2, .minimum = 0, .maximum = 16384}),
    [] {
      // The same value as 60FBh sub 2, with the type that the manual's range for this object needs.
      Entry share = sub(0x2FF0, 0x1A, "K_Velocity_FF permille", SERVODROME_FIELD(Gains, velocity_feed_forward), rw,
                        none, {.default_value = 1000, .minimum = 0, .maximum = 4000, .unit = "permille"});
      share.type = Type::unsigned16;
      return share;
    }(),
    sub(0x2FF0, 0x1B, "K_Acc_FF permille", SERVODROME_FIELD(Gains, acceleration_feed_forward_permille), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 4000, .unit = "permille"}),
    kvp(0x60F9, 0x01, "Kvp[0]", SERVODROME_ELEMENT(Gains, velocity_kp, 0), "DEC"),
    kvi(0x60F9, 0x02, "Kvi[0]", SERVODROME_ELEMENT(Gains, velocity_ki, 0)),
    sub(0x60F9, 0x05, "Speed_Fb_N", SERVODROME_FIELD(Gains, feedback_filter), rw, none,
        {.default_value = 7, .minimum = 0, .maximum = 45, .saved = true}),
    sub(0x60F9, 0x06, "Speed_Mode", SERVODROME_FIELD(Gains, feedback_mode), rw, none, {.saved = true}),
    sub(0x60F9, 0x07, "Kvi/32", SERVODROME_FIELD(Gains, velocity_ki_32), rw, none,
        {.default_value = 2, .minimum = 0, .maximum = 32767, .unit = "DEC", .saved = true}),
    sub(0x60F9, 0x08, "Kvi_Sum_Limit", SERVODROME_FIELD(Gains, velocity_integral_limit), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 32768, .saved = true}),
    sub(0x60F9, 0x09, "Auto PI switch", SERVODROME_FIELD(Gains, auto_switch), rw, none,
        {.minimum = 0, .maximum = 1, .saved = true}),
    sub(0x60F9, 0x15, "Output_Filter_N", SERVODROME_FIELD(Gains, output_filter), rw, none,
        {.default_value = 1, .unit = "DEC (2546/Hz)", .saved = true}),
    sub(0x60F9, 0x28, "PI pointer", SERVODROME_FIELD(Gains, pointer), rw, none, {.minimum = 0, .maximum = 3}),
    highest_sub(0x60FB, record, "Position loop", 5),
    [] {
      // Set 0 is INTEGER16 (Table 6-5), the other sets are UNSIGNED16 (Table 6-6).
      Entry entry = kpp(0x60FB, 0x01, "Kpp[0]", SERVODROME_ELEMENT(Gains, position_kp, 0), "0.01 Hz");
      entry.type = Type::integer16;
      return entry;
    }(),
    sub(0x60FB, 0x02, "K_Velocity_FF", SERVODROME_FIELD(Gains, velocity_feed_forward), rw, none,
        {.default_value = 1000, .unit = "%", .saved = true}),
    sub(0x60FB, 0x03, "K_Acc_FF", SERVODROME_FIELD(Gains, acceleration_feed_forward), rw, none,
        {.default_value = 32767, .unit = "DEC", .saved = true}),
});

// The printed range, 0 to 31, excludes bits 5 and 7, whose functions are printed as well (Table 6-1, C26). The range
// here includes them.
inline constexpr std::int64_t auto_tuning_maximum = 255;

inline constexpr auto tuning = std::to_array<Entry>({
    sub(0x2340, 0x10, "Auto_Tuning_Control", SERVODROME_FIELD(Tuning, control), rw, none,
        {.default_value = 12, .minimum = 0, .maximum = auto_tuning_maximum, .saved = true}),
    sub(0x60F9, 0x03, "Notch filter frequency", SERVODROME_FIELD(Tuning, notch_frequency_hz), rw, none,
        {.unit = "Hz", .saved = true}),
    sub(0x60F9, 0x04, "Notch filter control", SERVODROME_FIELD(Tuning, notch_control), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 255, .saved = true}),
});

inline constexpr auto motion = std::to_array<Entry>({
    highest_sub(0x2340, record, "Step stop, gain sets, automatic tuning", 0x10),
    sub(0x2340, 0x01, "Step_Stop_Mode", SERVODROME_FIELD(Motion, step_stop_mode), rw, none,
        {.minimum = 0, .maximum = 1, .saved = true}),
    sub(0x2340, 0x02, "Step_Stop_Amp", SERVODROME_FIELD(Motion, step_stop_current), rw, none,
        {.unit = "Ap (DEC raw)", .saved = true}),
    sub(0x2FF0, 0x09, "Target speed in rpm", SERVODROME_FIELD(Motion, target_speed_rpm), rw, none, {.unit = "rpm"}),
    sub(0x2FF0, 0x0E, "Max_Following_Error_16", SERVODROME_FIELD(Motion, following_error_limit), rw, none,
        {.default_value = 5243}),
    highest_sub(0x3011, record, "ECAN synchronisation", 4),
    sub(0x3011, 1, "ECAN synchronisation period", SERVODROME_FIELD(Motion, sync_period), rw, none,
        {.default_value = 2, .minimum = 0, .maximum = 3, .saved = true}),
    sub(0x3011, 2, "ECAN synchronous clock mode", SERVODROME_FIELD(Motion, sync_clock_mode), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 1, .saved = true}),
    sub(0x3011, 4, "ECAN synchronisation lost count", SERVODROME_FIELD(Motion, sync_lost_count), ro, tx),
    sub(0x6099, 3, "Homing_Power_On", SERVODROME_FIELD(Motion, homing_at_power_on), rw, none,
        {.minimum = 0, .maximum = 1, .saved = true}),
    sub(0x6099, 4, "Homing_Current", SERVODROME_FIELD(Motion, homing_current), rw, none,
        {.default_value = 2048, .unit = "Ap (DEC raw)", .saved = true}),
    sub(0x6099, 5, "Home_Offset_Mode", SERVODROME_FIELD(Motion, home_offset_mode), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 1, .saved = true}),
    sub(0x6099, 6, "Home_N_Blind", SERVODROME_FIELD(Motion, index_blind_window), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 2, .saved = true}),
    highest_sub(0x60F5, record, "Torque reached", 8),
    sub(0x60F5, 6, "Torque_OUT_Ref", SERVODROME_FIELD(Motion, torque_reached_reference), rw, none,
        {.default_value = 0, .unit = "Ap (DEC raw)", .saved = true}),
    sub(0x60F5, 7, "Torque_OUT_Filter", SERVODROME_FIELD(Motion, torque_reached_time_ms), rw, none,
        {.default_value = 100, .minimum = 0, .maximum = 32767, .unit = "ms", .saved = true}),
    sub(0x60F5, 8, "Current_OUT_Real", SERVODROME_FIELD(Motion, torque_reached_current), ro, tx,
        {.unit = "Ap (DEC raw)"}),
    highest_sub(0x60F6, record, "Current loop", 8),
    sub(0x60F6, 8, "CMD_q", SERVODROME_FIELD(Motion, target_current), rw, both, {.unit = "Ap (DEC raw)"}),
    highest_sub(0x60F9, record, "Velocity loop", 0x28),
    sub(0x60F9, 0x0A, "Target_Speed_Window", SERVODROME_FIELD(Motion, target_speed_window), rw, none,
        {.default_value = 178956, .unit = "inc/16s (DEC)", .saved = true}),
    sub(0x60F9, 0x14, "Zero_Speed_Time", SERVODROME_FIELD(Motion, zero_speed_time_ms), rw, none,
        {.default_value = 10, .unit = "ms", .saved = true}),
    sub(0x60F9, 0x1A, "Actual velocity per ms", SERVODROME_FIELD(Motion, actual_velocity_per_ms), ro, tx,
        {.unit = "inc/ms"}),
    sub(0x60F9, 0x1C, "Speed_Error", SERVODROME_FIELD(Motion, speed_error), ro, tx, {.unit = "DEC"}),
    sub(0x60FB, 0x04, "Position loop filter order", SERVODROME_FIELD(Motion, profile_order), rw, none,
        {.default_value = 1, .minimum = 1, .maximum = 3, .saved = true}),
    sub(0x60FB, 0x05, "Pos_Filter_N", SERVODROME_FIELD(Motion, smoothing_ms), rw, none,
        {.default_value = 1, .minimum = 1, .maximum = 255, .unit = "ms", .saved = true}),
});

inline constexpr auto alarms = std::to_array<Entry>({
    object(0x2601, "Error_State", SERVODROME_FIELD(Alarms, state), ro, tx),
    object(0x2602, "Error_State2", SERVODROME_FIELD(Alarms, state_2), ro, tx),
    highest_sub(0x2605, record, "Error masks", 7),
    sub(0x2605, 1, "Error_Mask", SERVODROME_FIELD(Alarms, mask), rw, none, {.default_value = 0xFFFF, .saved = true}),
    sub(0x2605, 2, "Store_Mask_ON", SERVODROME_FIELD(Alarms, store_on), rw, none,
        {.default_value = 0xFBFF, .saved = true}),
    sub(0x2605, 3, "Store_Mask_OFF", SERVODROME_FIELD(Alarms, store_off), rw, none,
        {.default_value = 0x0000, .saved = true}),
    sub(0x2605, 4, "Error_Mask2", SERVODROME_FIELD(Alarms, mask_2), rw, none, {.default_value = 0xFFFF, .saved = true}),
    sub(0x2605, 5, "Store_Mask_ON2", SERVODROME_FIELD(Alarms, store_on_2), rw, none,
        {.default_value = 0xF1FF, .saved = true}),
    sub(0x2605, 6, "Store_Mask_OFF2", SERVODROME_FIELD(Alarms, store_off_2), rw, none,
        {.default_value = 0x003F, .saved = true}),
    sub(0x2605, 7, "Error extension", SERVODROME_FIELD(Alarms, extension), ro, tx),
});

inline constexpr auto buses = std::to_array<Entry>({
    object(0x100B, "Equipment station number", SERVODROME_FIELD(Buses, station), rw, none,
           {.default_value = 1, .minimum = 1, .maximum = 127, .saved = true}),
    object(0x100E, "Node protection ID", SERVODROME_FIELD(Buses, cob_id_guarding), rw, none,
           {.default_value = 0x700, .adds_node_id = true}),
    object(0x2F81, "CAN baud rate", SERVODROME_FIELD(Buses, can_bit_rate), rw, none,
           {.default_value = 50, .minimum = 1, .maximum = 100, .unit = "code", .saved = true}),
    object(0x2FE2, "RS485 baud rate", SERVODROME_FIELD(Buses, rs485_bit_rate), rw, none,
           {.default_value = 90, .minimum = 90, .maximum = 1080, .unit = "code", .saved = true}),
    sub(0x6510, 0x0B, "RS232 class communication", SERVODROME_FIELD(Buses, cascade), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 1, .saved = true}),
    sub(0x6510, 0x0C, "RS485 communication protocol selection", SERVODROME_FIELD(Buses, rs485_protocol), rw, none,
        {.default_value = 1, .minimum = 0, .maximum = 3, .saved = true}),
    sub(0x6510, 0x0E, "RS485 mode", SERVODROME_FIELD(Buses, rs485_mode), ro),
});

inline constexpr auto device = std::to_array<Entry>({
    highest_sub(0x2502, record, "Analogue inputs", 7),
    sub(0x2502, 7, "Analog-speed control", SERVODROME_FIELD(Device, analogue_speed_control), rw, none, {.saved = true}),
    highest_sub(0x2508, record, "Pulse input and position window", 9),
    sub(0x2508, 8, "Pulse frequency control", SERVODROME_FIELD(Device, pulse_frequency_control), rw, none,
        {.saved = true}),
    highest_sub(0x250A, record, "Main encoder and full closed loop", 9),
    sub(0x250A, 1, "Main encoder period", SERVODROME_ELEMENT(Device, full_closed_loop, 0), rw, none, {.saved = true}),
    sub(0x250A, 3, "Main encoder count direction", SERVODROME_ELEMENT(Device, full_closed_loop, 1), rw, none,
        {.saved = true}),
    sub(0x250A, 5, "Full closed-loop spindle check", SERVODROME_ELEMENT(Device, full_closed_loop, 2), rw, none,
        {.saved = true}),
    sub(0x250A, 6, "Full closed-loop slave shaft check", SERVODROME_ELEMENT(Device, full_closed_loop, 3), rw, none,
        {.saved = true}),
    sub(0x250A, 9, "Full closed-loop ratio check", SERVODROME_ELEMENT(Device, full_closed_loop, 4), rw, none,
        {.saved = true}),
    object(0x2690, "Communication encoder data reset", SERVODROME_FIELD(Device, encoder_reset), rw),
    highest_sub(0x2FF0, record, "Storage and combined parameters", 0x1B),
    sub(0x2FF0, 0x01, "Store_Data", SERVODROME_FIELD(Device, store_data), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 10}),
    sub(0x2FF0, 0x03, "Store_Motor_Data", SERVODROME_FIELD(Device, store_motor_data), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 1}),
    sub(0x2FF0, 0x10, "Motor IIT actual utilization", SERVODROME_FIELD(Device, motor_utilisation_percent), ro, none,
        {.unit = "%"}),
    sub(0x2FF0, 0x11, "Drive IIT actual utilization", SERVODROME_FIELD(Device, drive_utilisation_percent), ro, none,
        {.unit = "%"}),
    object(0x2FFF, "Device restart", SERVODROME_FIELD(Device, restart), rw),
    highest_sub(0x3041, record, "Motor library", 6),
    sub(0x3041, 6, "Use the internal motor library", SERVODROME_FIELD(Device, motor_library), rw, none,
        {.default_value = 2, .minimum = 0, .maximum = 2, .saved = true}),
    highest_sub(0x6410, record, "Motor", 0x1F),
    sub(0x6410, 0x03, "Encoder resolution", SERVODROME_FIELD(Device, encoder_resolution), ro, none,
        {.default_value = 65536, .unit = "inc/rev"}),
    sub(0x6410, 0x0B, "Maximum motor current", SERVODROME_FIELD(Device, motor_current_max), ro, none,
        {.default_value = 2048, .unit = "Ap (DEC raw)"}),
    sub(0x6410, 0x11, "Brake duty cycle", SERVODROME_FIELD(Device, brake_duty_percent), rw, none,
        {.default_value = 70, .minimum = 0, .maximum = 100, .unit = "%", .saved = true}),
    sub(0x6410, 0x12, "Brake delay", SERVODROME_FIELD(Device, brake_delay_ms), rw, none,
        {.default_value = 150, .unit = "ms", .saved = true}),
    sub(0x6410, 0x17, "Additional device", SERVODROME_FIELD(Device, brake_present), rw, none,
        {.default_value = 0, .minimum = 0, .maximum = 1, .saved = true}),
    sub(0x6410, 0x18, "Temp_Motor_Ref", SERVODROME_FIELD(Device, motor_hot_c), rw, none,
        {.default_value = 100, .unit = "degC", .saved = true}),
    sub(0x6410, 0x19, "Temp_Motor", SERVODROME_FIELD(Device, motor_temperature_c), ro, none, {.unit = "degC"}),
    sub(0x6410, 0x1F, "Analog increment", SERVODROME_FIELD(Device, encoder_output_resolution), rw, none,
        {.unit = "inc/rev", .saved = true}),
    highest_sub(0x6510, record, "Drive", 0x0E),
    sub(0x6510, 0x03, "Peak drive current", SERVODROME_FIELD(Device, peak_current_a), ro, none,
        {.default_value = 48, .unit = "Ap"}),
    sub(0x6510, 0x07, "Voltage_Under", SERVODROME_FIELD(Device, under_voltage_v), rw, none,
        {.default_value = 18, .unit = "V", .saved = true}),
    sub(0x6510, 0x08, "Chop_Voltage", SERVODROME_FIELD(Device, chopper_voltage_v), rw, none,
        {.default_value = 63, .unit = "V", .saved = true}),
    sub(0x6510, 0x09, "Voltage_Over", SERVODROME_FIELD(Device, over_voltage_v), rw, none,
        {.default_value = 70, .unit = "V", .saved = true}),
});

}  // namespace section

}  // namespace servodrome::products::ismk
