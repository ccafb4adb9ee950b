#pragma once

#include <string_view>

#include "canopen/301/communication_section.hpp"
#include "drive/cia402_section.hpp"
#include "products/identity.hpp"
#include "products/ismc/policy.hpp"

namespace servodrome::products::ismc {

// Parameters of the manufacturer's area. Indices from 2F10h on are this project's choice for settings of the PC tool
// that the manual describes without an index.
struct Manufacturer {
  std::uint32_t index_deviation_threshold = 0;             // 2001h, counts; 0: off
  std::uint16_t phase_sequence = 0;                        // 2002h
  std::uint32_t bit_rate = 1000000;                        // 2004h, bit/s, from the next restart
  std::uint16_t protection_enable = 0;                     // 2017h; bit 1: I2t
  std::uint16_t hall_type = 0;                             // 2103h
  std::uint16_t auto_calibration = 0;                      // 2105h
  std::uint16_t torque_mode_speed_positive = 1000;         // 2115h, rated speed / 1000
  std::uint16_t torque_mode_speed_negative = 1000;         // 2116h
  std::int16_t velocity_stop_profile = 0;                  // 2117h
  std::uint16_t collision_time_ms = 0;                     // 2137h
  std::uint16_t collision_torque = 0;                      // 2138h, rated torque / 1000
  std::uint32_t velocity_tracking_threshold = 0xFFFFFFFF;  // 2200h
  std::uint32_t velocity_tracking_time_ms = 1000;
  std::uint8_t node_id = 1;                      // 2401h, from the next restart
  std::uint16_t auto_calibration_2 = 0;          // 2402h
  std::uint32_t collision_retraction = 0;        // 2F10h, counts
  std::uint32_t homing_timeout_ms = 0;           // 2F11h; 0: none
  std::array<std::uint8_t, 6> input_function{};  // 2F12h
  std::uint8_t output_function = 0;              // 2F13h: bit n: DOn is "remote DO"
  std::int16_t minimum_ambient_c = 0;            // 2F14h
  std::uint16_t peak_current = 0;                // 2F15h, rated current / 1000
  std::uint16_t peak_current_time_ms = 0;        // 2F16h
  std::uint16_t commutation_current_ratio = 0;   // 2F17h
  std::uint8_t index_deviation_firmware = 0;     // 2F18h: 1: touch probe as firmware V1.04
};

// Functions of digital inputs (2F12h).
enum class InputFunction : std::uint8_t {
  none,
  negative_limit,
  positive_limit,
  home,
  external_alarm,
  motor_temperature
};

struct Objects {
  canopen::CommunicationObjects<4, 4, 8, 1, 8> communication{};
  drive::Objects drive{};
  Manufacturer manufacturer{};
};

// 1018h and 1000h are not in the manual (G50). Vendor and product numbers are this project's choice.
inline constexpr std::uint32_t product_code = 0x49534D43;     // "ISMC"
inline constexpr std::uint32_t revision_number = 0x00010006;  // manual V1.6

inline constexpr auto manufacturer_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using M = Manufacturer;
  constexpr auto rw = Access::rw;
  constexpr auto none = Pdo::none;
  constexpr auto array = ObjectCode::array;
  constexpr auto mine = Owner::product;
  return std::to_array<Entry>({
      var(0x2001, "Z pulse repeat-positioning deviation threshold", SERVODROME_FIELD(M, index_deviation_threshold), rw,
          none, {.unit = "inc", .saved = true, .owner = mine}),
      var(0x2002, "Phase sequence setting", SERVODROME_FIELD(M, phase_sequence), rw, none, {.saved = true}),
      var(0x2004, "CAN baud rate", SERVODROME_FIELD(M, bit_rate), rw, none,
          {.default_value = 1000000,
           .minimum = 20000,
           .maximum = 1000000,
           .unit = "bit/s",
           .saved = true,
           .owner = mine}),
      var(0x2017, "Protection enable flags", SERVODROME_FIELD(M, protection_enable), rw, none,
          {.saved = true, .owner = mine}),
      var(0x2103, "Hall model", SERVODROME_FIELD(M, hall_type), rw, none, {.saved = true}),
      var(0x2105, "Auto-calibration setting", SERVODROME_FIELD(M, auto_calibration), rw, none, {.saved = true}),
      var(0x2115, "Forward speed limit in torque control", SERVODROME_FIELD(M, torque_mode_speed_positive), rw, none,
          {.default_value = 1000, .unit = "rated speed/1000", .saved = true, .owner = mine}),
      var(0x2116, "Reverse speed limit in torque control", SERVODROME_FIELD(M, torque_mode_speed_negative), rw, none,
          {.default_value = 1000, .unit = "rated speed/1000", .saved = true, .owner = mine}),
      var(0x2117, "Motion profile type of stopping in velocity mode", SERVODROME_FIELD(M, velocity_stop_profile), rw,
          none, {.default_value = 0, .saved = true, .owner = mine}),
      var(0x2137, "Collision homing stall time", SERVODROME_FIELD(M, collision_time_ms), rw, none,
          {.default_value = 50, .unit = "ms", .saved = true, .owner = mine}),
      var(0x2138, "Collision homing stall torque", SERVODROME_FIELD(M, collision_torque), rw, none,
          {.default_value = 500,
           .minimum = 10,
           .maximum = 3000,
           .unit = "rated torque/1000",
           .saved = true,
           .owner = mine}),
      highest_sub(0x2200, array, "Velocity tracking", 2),
      element(0x2200, 1, array, "Velocity tracking threshold", SERVODROME_FIELD(M, velocity_tracking_threshold), rw,
              none, {.default_value = 4294967295, .unit = "UU", .saved = true, .owner = mine}),
      element(0x2200, 2, array, "Velocity tracking time", SERVODROME_FIELD(M, velocity_tracking_time_ms), rw, none,
              {.default_value = 1000, .unit = "ms", .saved = true, .owner = mine}),
      var(0x2401, "Node-ID", SERVODROME_FIELD(M, node_id), rw, none,
          {.default_value = 1, .minimum = 1, .maximum = 127, .saved = true, .owner = mine}),
      var(0x2402, "Auto-calibration setting 2", SERVODROME_FIELD(M, auto_calibration_2), rw, none, {.saved = true}),
      var(0x2F10, "Collision homing retraction distance", SERVODROME_FIELD(M, collision_retraction), rw, none,
          {.maximum = 2147483647, .unit = "UU", .saved = true, .owner = mine}),
      var(0x2F11, "Homing time limit", SERVODROME_FIELD(M, homing_timeout_ms), rw, none,
          {.default_value = 60000, .unit = "ms", .saved = true, .owner = mine}),
      highest_sub(0x2F12, array, "Digital input function", 6),
      element(0x2F12, 1, array, "Function of DI0", SERVODROME_ELEMENT(M, input_function, 0), rw, none,
              {.default_value = 1, .minimum = 0, .maximum = 5, .saved = true, .owner = mine}),
      element(0x2F12, 2, array, "Function of DI1", SERVODROME_ELEMENT(M, input_function, 1), rw, none,
              {.default_value = 2, .minimum = 0, .maximum = 5, .saved = true, .owner = mine}),
      element(0x2F12, 3, array, "Function of DI2", SERVODROME_ELEMENT(M, input_function, 2), rw, none,
              {.default_value = 3, .minimum = 0, .maximum = 5, .saved = true, .owner = mine}),
      element(0x2F12, 4, array, "Function of DI3", SERVODROME_ELEMENT(M, input_function, 3), rw, none,
              {.default_value = 0, .minimum = 0, .maximum = 5, .saved = true, .owner = mine}),
      element(0x2F12, 5, array, "Function of DI4", SERVODROME_ELEMENT(M, input_function, 4), rw, none,
              {.default_value = 0, .minimum = 0, .maximum = 5, .saved = true, .owner = mine}),
      element(0x2F12, 6, array, "Function of DI5", SERVODROME_ELEMENT(M, input_function, 5), rw, none,
              {.default_value = 0, .minimum = 0, .maximum = 5, .saved = true, .owner = mine}),
      var(0x2F13, "Outputs with the function remote DO", SERVODROME_FIELD(M, output_function), rw, none,
          {.default_value = 15, .minimum = 0, .maximum = 15, .saved = true, .owner = mine}),
      var(0x2F14, "Minimum ambient temperature", SERVODROME_FIELD(M, minimum_ambient_c), rw, none,
          {.default_value = -20, .unit = "degC", .saved = true, .owner = mine}),
      var(0x2F15, "Limiter protection peak current", SERVODROME_FIELD(M, peak_current), rw, none,
          {.default_value = 3000,
           .minimum = 1100,
           .maximum = 5000,
           .unit = "rated current/1000",
           .saved = true,
           .owner = mine}),
      var(0x2F16, "Limiter protection peak current duration", SERVODROME_FIELD(M, peak_current_time_ms), rw, none,
          {.default_value = 3000, .minimum = 1, .maximum = 65535, .unit = "ms", .saved = true, .owner = mine}),
      var(0x2F17, "Commutation current ratio 1", SERVODROME_FIELD(M, commutation_current_ratio), rw, none,
          {.default_value = 500, .saved = true}),
      var(0x2F18, "Touch probe holds index deviation (firmware V1.04)", SERVODROME_FIELD(M, index_deviation_firmware),
          rw, none, {.default_value = 0, .minimum = 0, .maximum = 1, .saved = true, .owner = mine}),
  });
}();

// The CiA 402 objects that the manual documents, and 603Fh and 6502h (G50).
inline constexpr auto cia402_objects = std::to_array<std::uint16_t>(
    {0x603F, 0x6040, 0x6041, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6060, 0x6061, 0x6062, 0x6063, 0x6064,
     0x6065, 0x6066, 0x6067, 0x6068, 0x6069, 0x606B, 0x606C, 0x606D, 0x606E, 0x606F, 0x6070, 0x6071, 0x6074,
     0x6077, 0x6078, 0x607A, 0x607B, 0x607C, 0x607D, 0x607F, 0x6080, 0x6081, 0x6083, 0x6084, 0x6085, 0x6086,
     0x6087, 0x6088, 0x6098, 0x6099, 0x609A, 0x60A4, 0x60B0, 0x60B1, 0x60B2, 0x60B8, 0x60B9, 0x60BA, 0x60C2,
     0x60C5, 0x60C6, 0x60E0, 0x60E1, 0x60FC, 0x60FD, 0x60FE, 0x60FF, 0x6502});

inline constexpr std::int64_t tpdo_inhibit_time = 100;  // 10 ms, in 100 us

inline constexpr auto object_table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using Communication = decltype(Objects::communication);
  constexpr std::size_t at_communication = offsetof(Objects, communication);
  TableBuilder<400> builder;
  constexpr auto general = std::to_array<std::uint16_t>({0x1000, 0x1001, 0x1003, 0x1005, 0x1006, 0x1007, 0x100C, 0x100D,
                                                         0x1010, 0x1011, 0x1014, 0x1015, 0x1016, 0x1017, 0x1018});
  builder.pick(canopen::general_section<Communication>, general, at_communication);
  builder.append(canopen::sdo_server_section<Communication>, at_communication);
  constexpr canopen::PdoSubIndices rpdo_subs{.inhibit_time = false, .event_timer = false, .sync_start_value = false};
  constexpr canopen::PdoSubIndices tpdo_subs{.sync_start_value = false};
  builder.append(canopen::rpdo_section<Communication, rpdo_subs>, at_communication);
  builder.append(canopen::tpdo_section<Communication, tpdo_subs>, at_communication);
  builder.add(text_constant(0x1008, "Manufacturer device name", "Sapphire"));  // ch. 6
  builder.add(text_constant(0x1009, "Manufacturer hardware version", "1.0"));
  builder.add(text_constant(0x100A, "Manufacturer software version", "V1.03"));
  builder.pick(drive::cia402_section, cia402_objects, offsetof(Objects, drive));
  builder.append(manufacturer_section, offsetof(Objects, manufacturer));

  set_identity(builder, product_code, revision_number);

  // Factory PDOs are those of the manual's application example (ch. 6, Table 5-2); PDO 3 and 4 are off (G7).
  builder.map_pdo(0x1600, {0x60400010, 0x60600008, 0x607A0020});
  builder.map_pdo(0x1601, {0x60FF0020, 0x60810020});
  builder.map_pdo(0x1A00, {0x60410010, 0x60610008, 0x60640020});
  builder.map_pdo(0x1A01, {0x606C0020, 0x60780010});
  // "A prohibition time has been set for TxPDO" (ch. 2.6.2, 'Prohibited time'), but no value is printed. Without one,
  // three axes in motion would fill a bus of 1 Mbit/s, because their process data change every cycle (G6).
  for (std::uint16_t index = 0x1800; index <= 0x1803; ++index) builder.set_default(index, 3, tpdo_inhibit_time);
  for (const std::uint16_t index : std::to_array<std::uint16_t>({0x1402, 0x1403, 0x1802, 0x1803})) {
    builder.at(index, 1).default_value |= 0x80000000;
  }

  // Defaults, types and sub-indices that the manual prints differently from the reference section.
  builder.set_default(0x605C, 0, 0).set_default(0x605E, 0, 0);
  builder.set_default(0x607B, 1, -2147483648).set_default(0x607B, 2, 2147483647);
  builder.set_default(0x607D, 1, -2147483648).set_default(0x607D, 2, 2147483647);
  builder.set_default(0x6081, 0, 0).set_default(0x6087, 0, 0);
  // Any value may be written; an unsupported one is a fault when the motion starts (G39b).
  builder.set_range(0x6086, 0, -32768, 32767).set_range(0x6088, 0, -32768, 32767);
  builder.add(highest_sub(0x60A4, ObjectCode::array, "Profile jerk", 1));
  std::size_t kept = 0;
  for (std::size_t i = 0; i < builder.count; ++i) {
    const Entry entry = builder.entries[i];
    const bool absent = (entry.index == 0x60A4 && entry.sub > 1);
    if (!absent) builder.entries[kept++] = entry;
  }
  builder.count = kept;
  builder.set_default(0x60A4, 1, 1310720);
  builder.set_range(0x60C2, 1, 0, 4);    // 1 to 4 ms (ch. 4.6.2); 0 raises 6553h
  builder.set_range(0x60C2, 2, -3, -3);  // masters write it (G52)
  builder.at(0x60C2, 1).unit = "ms";
  builder.at(0x60E0, 0).type = Type::integer16;  // printed INT16 (G43)
  builder.at(0x60E1, 0).type = Type::integer16;
  builder.set_range(0x60E0, 0, 0, 32767).set_range(0x60E1, 0, 0, 32767);
  builder.at(0x60FD, 0).type = Type::integer32;
  // Process data may be mapped (G44), parameters may not.
  constexpr auto parameters =
      std::to_array<std::uint16_t>({0x6065, 0x6066, 0x6067, 0x6068, 0x606D, 0x606E, 0x606F, 0x6070, 0x607F, 0x6086,
                                    0x6098, 0x609A, 0x60C5, 0x60C6, 0x60E0, 0x60E1, 0x6502});
  for (const std::uint16_t index : parameters) builder.at(index, 0).pdo = Pdo::none;
  builder.at(0x6099, 1).pdo = Pdo::none;
  builder.at(0x6099, 2).pdo = Pdo::none;
  builder.at(0x60C2, 1).pdo = Pdo::none;
  builder.at(0x60C2, 2).pdo = Pdo::none;
  // Units as the manual names them: all quantities of motion are in user units, which are counts (ch. 4.3.2).
  for (std::size_t i = 0; i < builder.count; ++i) {
    Entry& entry = builder.entries[i];
    const std::string_view unit = entry.unit;
    if (unit == "pos" || unit == "vel" || unit == "acc" || unit == "jerk") entry.unit = "UU";
    if (unit == "inc") entry.unit = "cnt";
    if (unit == "inc/s") entry.unit = "cnt/s";
    if (unit == "0.1%") entry.unit = "rated torque/1000";
    if (unit == "0.1%/s") entry.unit = "rated torque/1000/s";
  }
  builder.at(0x6078, 0).unit = "rated current/1000";
  return builder;
}>();
static_assert(dictionary::is_valid_table(object_table));

}  // namespace servodrome::products::ismc
