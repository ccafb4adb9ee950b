#pragma once

#include <array>

#include "drive/faults.hpp"
#include "products/jmc_ec/communication_alarms.hpp"

// The alarms of the JMC EC drives: AL.051 to AL.971 (ch. 9), the drive codes E101 to E107 (Table 18) and the
// communication codes E601 to E62B.
namespace servodrome::products::jmc_ec {

using drive::Cause;
using drive::Reaction;
using drive::ResetRule;

// Causes that only this drive has. The first ones are the communication alarms, in the order of their table.
constexpr Cause communication_cause(std::size_t row) {
  return static_cast<Cause>(static_cast<std::size_t>(Cause::first_product_cause) + row);
}
namespace cause {
inline constexpr auto own(unsigned n) { return communication_cause(communication_alarms.size() + n); }
inline constexpr Cause initialisation = own(0);
inline constexpr Cause programmable_logic = own(1);
inline constexpr Cause product_mismatch = own(2);
inline constexpr Cause parameter_storage = own(3);  // writing to the EEPROM failed
inline constexpr Cause self_test = own(4);
inline constexpr Cause analogue_setting = own(5);
inline constexpr Cause input_allocation = own(6);
inline constexpr Cause output_allocation = own(7);
inline constexpr Cause divider = own(8);
inline constexpr Cause power_cycle_needed = own(9);
inline constexpr Cause servo_on_invalid = own(10);
inline constexpr Cause loss_of_control = own(11);
inline constexpr Cause runaway = own(12);
inline constexpr Cause analogue_over_voltage = own(13);
inline constexpr Cause inrush_resistor = own(14);
inline constexpr Cause divider_over_speed = own(15);
inline constexpr Cause inertia_identification = own(16);
inline constexpr Cause angle_identification = own(17);
inline constexpr Cause encoder_supply = own(18);
inline constexpr Cause absolute_encoder = own(19);
inline constexpr Cause encoder_memory = own(20);
inline constexpr Cause encoder_memory_parity = own(21);
inline constexpr Cause motor_not_enabled = own(22);
inline constexpr Cause deviation_at_servo_on = own(23);
inline constexpr Cause power_cycle_pending = own(24);
inline constexpr Cause memory_wear = own(25);
inline constexpr Cause serial_interference = own(26);
}  // namespace cause

// FaultRow::alarm has the printed digits as a hexadecimal number: AL.051 is 0051h, E105 is E105h.
inline constexpr std::uint16_t no_alarm_number = 0;

// The manual prints 603Fh and 1001h for E101 to E107 and for the communication alarms. It does not say which AL.xxx are
// E101 to E107; this project reads (C-33): AL.063 is E101, AL.066 E102, AL.051 and AL.062 E103, AL.402 E104, AL.501
// E106; E105 and E107 have no AL number. Every other alarm has the code of CiA 402-2 for it, if there is one, else
// A000h + the alarm's number. Reset: of E101 to E107 the manual says that only E106 and E107 can be cleared. Of the
// other alarms, those whose printed remedy is a power cycle, another part or wiring need a power cycle.
inline constexpr auto drive_faults = [] {
  constexpr auto option_code = Reaction::option_code;
  constexpr auto angle_lost = Reaction::angle_lost;
  constexpr auto power_off = Reaction::power_off;
  constexpr auto warning = Reaction::none;
  constexpr auto reset = ResetRule::when_cause_gone;
  constexpr auto restart = ResetRule::power_cycle;
  const auto overcurrent = [](Cause from) {  // ch. 9.2, AL.063
    return drive::FaultRow{from, 0x5001, 0x02, Reaction::power_off, ResetRule::power_cycle, "Over-current", 0x063};
  };
  const auto encoder_offline = [](Cause from) {  // ch. 9.2, AL.610
    return drive::FaultRow{
        from, 0x7305, 0x01, Reaction::angle_lost, ResetRule::power_cycle, "Incremental encoder offline", 0x610};
  };
  const auto over_speed = [](Cause from) {  // ch. 9.2, AL.420
    return drive::FaultRow{from, 0xA420, 0x01, Reaction::option_code, ResetRule::when_cause_gone, "Over speed", 0x420};
  };
  const auto overrun = [](Cause from) {  // overtravel (ch. 9.1, AL.950)
    return drive::FaultRow{from, 0xA950, 0x00, Reaction::none, ResetRule::when_cause_gone, "Overrun", 0x950};
  };
  return std::to_array<drive::FaultRow>({
      {Cause::memory, 0x5003, 0xC0, option_code, restart, "EEPROM parameter abnormal", 0x051},
      {cause::programmable_logic, 0xA052, 0x01, power_off, restart, "Programmable logic configuration fault", 0x052},
      {cause::initialisation, 0xA053, 0x01, power_off, restart, "Initialisation failed", 0x053},
      {Cause::internal_hardware, 0xA054, 0x01, power_off, restart, "System abnormal", 0x054},
      {Cause::motor_mismatch, 0xA060, 0x01, power_off, reset, "Product model selection fault", 0x060},
      {cause::product_mismatch, 0xA061, 0x01, power_off, restart, "Product matching fault", 0x061},
      {cause::parameter_storage, 0x5003, 0xC0, option_code, restart, "Parameter storage fault", 0x062},
      overcurrent(Cause::overcurrent_u),
      overcurrent(Cause::overcurrent_v),
      overcurrent(Cause::overcurrent_w),
      overcurrent(Cause::bus_overcurrent),
      overcurrent(Cause::short_circuit),
      {cause::self_test, 0xA064, 0x01, power_off, restart, "Output short circuit at power-on", 0x064},
      {Cause::gate_supply, 0x5002, 0x05, power_off, restart, "Control supply under-voltage", 0x066},
      {Cause::current_saturation, 0xA070, 0x02, power_off, restart, "AD sampling fault 1", 0x070},
      {Cause::current_sensor, 0xA071, 0x02, power_off, restart, "Current sampling fault", 0x071},
      {Cause::software_limits_wrong, 0xA100, 0x01, option_code, reset, "Parameter combination abnormal", 0x100},
      {cause::analogue_setting, 0xA101, 0x01, option_code, reset, "AI setting fault", 0x101},
      {cause::input_allocation, 0xA102, 0x01, option_code, restart, "DI allocation fault", 0x102},
      {cause::output_allocation, 0xA103, 0x01, option_code, restart, "DO allocation fault", 0x103},
      {Cause::factor_group, 0xA105, 0x01, option_code, reset, "Electronic gear setting error", 0x105},
      {cause::divider, 0xA106, 0x01, option_code, reset, "Frequency divider output setting abnormal", 0x106},
      {cause::power_cycle_needed, 0xA110, 0x01, option_code, restart, "Power cycle required", 0x110},
      {cause::servo_on_invalid, 0xA120, 0x01, option_code, restart, "Servo ON command invalid", 0x120},
      {Cause::under_voltage, 0x3220, 0x04, power_off, reset, "Under-voltage", 0x401},
      {Cause::over_voltage, 0x5004, 0x04, option_code, restart, "Over-voltage", 0x402},
      {Cause::jammed, 0x7121, 0x02, option_code, reset, "Overload, momentary", 0x410},
      {Cause::stage_i2t, 0xA411, 0x02, option_code, reset, "Driver overload", 0x411},
      {Cause::i2t, 0x2310, 0x02, option_code, reset, "Motor overload", 0x412},
      over_speed(Cause::over_speed),
      over_speed(Cause::velocity_excessive),
      {cause::loss_of_control, 0xA421, 0x01, power_off, reset, "Loss of control detected", 0x421},
      {cause::runaway, 0xA422, 0x01, power_off, reset, "Runaway", 0x422},
      {cause::analogue_over_voltage, 0xA425, 0x01, option_code, reset, "AI sampling over-voltage", 0x425},
      {cause::inrush_resistor, 0xA435, 0x01, option_code, reset, "Inrush resistor overload", 0x435},
      {Cause::brake_resistor, 0xA436, 0x01, option_code, reset, "Dynamic brake overload", 0x436},
      {Cause::power_stage_hot, 0x4210, 0x08, option_code, reset, "Radiator overheat", 0x440},
      {Cause::motor_hot, 0x4310, 0x08, option_code, reset, "Motor overheat", 0x441},
      {cause::divider_over_speed, 0xA500, 0x01, option_code, reset, "Divided pulse output over-speed", 0x500},
      {Cause::following_error, 0x5006, 0x80, option_code, reset, "Position deviation too large", 0x501},
      {Cause::second_encoder_count, 0xA502, 0x01, option_code, reset, "Full-closed-loop deviation", 0x502},
      {Cause::pulse_frequency, 0xA505, 0x01, option_code, reset, "Command pulse input abnormal", 0x505},
      {cause::inertia_identification, 0xA550, 0x01, option_code, reset, "Inertia identification failed", 0x550},
      {Cause::homing_timeout, 0xA551, 0x01, option_code, reset, "Return to origin time-out", 0x551},
      {cause::angle_identification, 0xA552, 0x01, option_code, reset, "Angle identification failed", 0x552},
      {cause::encoder_supply, 0xA600, 0x01, angle_lost, restart, "Encoder supply short circuit", 0x600},
      encoder_offline(Cause::encoder_connection),
      encoder_offline(Cause::hall_wiring),
      encoder_offline(Cause::hall_state),
      {Cause::index_lost, 0xA611, 0x01, option_code, restart, "Incremental encoder Z signal lost", 0x611},
      {cause::absolute_encoder, 0xA620, 0x01, angle_lost, restart, "Absolute encoder offline", 0x620},
      {cause::encoder_memory, 0xA621, 0x01, option_code, restart, "Encoder EEPROM abnormal", 0x621},
      {cause::encoder_memory_parity, 0xA622, 0x01, option_code, restart, "Encoder EEPROM parity error", 0x622},
      // Drive codes without a number AL.xxx (Table 18)
      {Cause::phase_loss, 0x5005, 0x40, power_off, restart, "Phase loss", 0xE105},
      {cause::motor_not_enabled, 0x5000, 0x01, option_code, reset, "Motor not enabled", 0xE107},
      // Without a number: a target at which the manual says that the drive stops (Table 228; C-34). The code is that of
      // CiA 402-2.
      {Cause::position_limit, 0x8612, 0x01, option_code, reset, "Target beyond the software limit", no_alarm_number},
      // Warnings: statusword bit 7 is set while the warning is present; there is no other effect.
      {Cause::following_error_near, 0xA900, 0x00, warning, reset, "Position deviation large", 0x900},
      {cause::deviation_at_servo_on, 0xA901, 0x00, warning, reset, "Position deviation large at servo ON", 0x901},
      {Cause::i2t_near, 0xA910, 0x00, warning, reset, "Motor overload warning", 0x910},
      {Cause::stage_i2t_near, 0xA912, 0x00, warning, reset, "Driver overload warning", 0x912},
      {cause::power_cycle_pending, 0xA941, 0x00, warning, reset, "Power cycle required after parameter change", 0x941},
      {cause::memory_wear, 0xA942, 0x00, warning, reset, "EEPROM written too often", 0x942},
      {cause::serial_interference, 0xA943, 0x00, warning, reset, "Abnormal serial communication", 0x943},
      overrun(Cause::positive_limit),
      overrun(Cause::negative_limit),
      {Cause::under_voltage_near, 0xA971, 0x00, warning, reset, "Under-voltage warning", 0x971},
      {Cause::velocity_clipped, 0xA001, 0x00, warning, reset, "Set-point above the greatest speed", no_alarm_number},
      {Cause::acceleration_clipped, 0xA002, 0x00, warning, reset, "Ramp above 60C5h or 60C6h", no_alarm_number},
      {Cause::position_change_clipped, 0xA003, 0x00, warning, reset, "Target beyond 607Bh", no_alarm_number},
  });
}();

// All rows. The rows of the bus are last.
inline constexpr auto faults = [] {
  std::array<drive::FaultRow, drive_faults.size() + communication_alarms.size()> rows{};
  std::copy(drive_faults.begin(), drive_faults.end(), rows.begin());
  for (std::size_t i = 0; i < communication_alarms.size(); ++i) {
    const CommunicationAlarm& alarm = communication_alarms[i];
    rows[drive_faults.size() + i] = {communication_cause(i),
                                     alarm.code,
                                     communication_error_register,
                                     Reaction::option_code,
                                     ResetRule::when_cause_gone,
                                     alarm.name,
                                     alarm.alarm};
  }
  return rows;
}();
static_assert(static_cast<unsigned>(cause::serial_interference) < 256);

}  // namespace servodrome::products::jmc_ec
