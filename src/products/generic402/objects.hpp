#pragma once

#include "canopen/301/communication_section.hpp"
#include "drive/cia402_section.hpp"
#include "modbus/rtu_server.hpp"
#include "products/generic402/policy.hpp"
#include "products/identity.hpp"

namespace servodrome::products::generic402 {

// Manufacturer objects of the reference drive, for settings that CiA 402 leaves to the maker.
struct Manufacturer {
  // 2010h: gains; 0 leaves a gain to the drive, which derives it from the motor and the bandwidths of 2011h.
  std::uint32_t position_kp = 0;                   // 0.01 1/s
  std::uint32_t velocity_kp = 0;                   // 1e-6 A per rad/s
  std::uint32_t velocity_ki = 0;                   // 1e-6 A per rad
  std::uint16_t velocity_feed_forward = 1000;      // 0.1 %
  std::uint16_t acceleration_feed_forward = 1000;  // 0.1 %
  std::uint16_t velocity_filter_hz = 0;
  std::uint16_t torque_filter_hz = 0;
  std::array<std::uint16_t, 2> notch_frequency_hz{};
  std::array<std::uint16_t, 2> notch_width_hz{};
  std::array<std::uint16_t, 2> notch_depth{};  // 0.1 %
  // 2011h
  std::uint16_t current_bandwidth_hz = 1000;
  std::uint16_t velocity_bandwidth_hz = 100;
  std::uint32_t inertia_ratio = 1000;          // 2012h: load and rotor to nameplate, 0.1 %
  std::uint16_t field_weakening_permille = 0;  // 2013h: direct current, 0.1 % of the rated current
  // 2020h
  std::uint16_t brake_release_ms = 0;
  std::uint16_t brake_engage_ms = 0;
  std::array<std::uint8_t, 8> input_function{};  // 2030h
  std::uint8_t input_polarity = 0;               // 2031h: bit n inverts input n
  // 2040h: thresholds
  std::uint16_t over_voltage_v = 400;
  std::uint16_t under_voltage_v = 200;
  std::int16_t motor_hot_c = 130;
  std::int16_t power_stage_hot_c = 95;
  std::uint32_t over_speed_rpm = 0;
  std::uint8_t overload_reaction = 0;  // 2041h: 0 fault, 1 the torque is limited
  // 2050h
  std::uint16_t stall_torque = 500;  // 0.1 % of rated torque
  std::uint16_t stall_time_ms = 50;
  std::uint32_t stall_retraction = 0;  // counts
  std::uint32_t homing_timeout_ms = 0;
  std::uint16_t i2t_utilisation = 0;   // 2060h, %
  std::uint8_t node_id = 2;            // 2F00h, from the next restart or by LSS
  std::uint32_t bit_rate = 1000000;    // 2F01h, bit/s, from the next restart or by LSS
  dictionary::Blob<1024> user_data{};  // 2F10h
  // 2F20h: RS485 port, from the next restart on
  std::uint8_t station = 0;  // 0: as the node-ID
  std::uint32_t serial_bit_rate = 19200;
  std::uint8_t serial_parity = 1;  // modbus::Parity
  std::uint8_t serial_stop_bits = 1;
};

struct Objects {
  canopen::CommunicationObjects<8, 8, 8, 4, 8> communication{};
  drive::Objects drive{};
  Manufacturer manufacturer{};
};

inline constexpr std::uint32_t product_code = 0x34303252;  // "402R"
inline constexpr std::uint32_t revision_number = 0x00010000;

inline constexpr auto manufacturer_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using M = Manufacturer;
  constexpr auto rw = Access::rw;
  constexpr auto none = Pdo::none;
  constexpr auto record = ObjectCode::record;
  constexpr auto array = ObjectCode::array;
  constexpr auto mine = Owner::product;
  Entry user_data = var(0x2F10, "User data", SERVODROME_FIELD(M, user_data), rw, none, {.saved = true});
  user_data.type = Type::domain;
  user_data.code = ObjectCode::domain;
  Entry description =
      make_entry(0x1021, 0, ObjectCode::domain, "Store EDS", {Type::domain}, Access::ro, none, {.owner = mine});
  return std::to_array<Entry>({
      description,
      number_constant(0x1022, 0, ObjectCode::var, "Store format", Type::unsigned8, 0),
      highest_sub(0x2010, record, "Control gains", 13),
      element(0x2010, 1, record, "Position loop gain", SERVODROME_FIELD(M, position_kp), rw, none,
              {.default_value = 0, .unit = "0.01/s", .saved = true, .owner = mine}),
      element(0x2010, 2, record, "Velocity loop proportional gain", SERVODROME_FIELD(M, velocity_kp), rw, none,
              {.unit = "uA s/rad", .saved = true, .owner = mine}),
      element(0x2010, 3, record, "Velocity loop integral gain", SERVODROME_FIELD(M, velocity_ki), rw, none,
              {.unit = "uA/rad", .saved = true, .owner = mine}),
      element(0x2010, 4, record, "Velocity feed-forward", SERVODROME_FIELD(M, velocity_feed_forward), rw, none,
              {.default_value = 1000, .maximum = 1000, .unit = "0.1%", .saved = true, .owner = mine}),
      element(0x2010, 5, record, "Acceleration feed-forward", SERVODROME_FIELD(M, acceleration_feed_forward), rw, none,
              {.default_value = 1000, .maximum = 2000, .unit = "0.1%", .saved = true, .owner = mine}),
      element(0x2010, 6, record, "Velocity filter", SERVODROME_FIELD(M, velocity_filter_hz), rw, none,
              {.unit = "Hz", .saved = true, .owner = mine}),
      element(0x2010, 7, record, "Torque filter", SERVODROME_FIELD(M, torque_filter_hz), rw, none,
              {.unit = "Hz", .saved = true, .owner = mine}),
      element(0x2010, 8, record, "Notch 1 frequency", SERVODROME_ELEMENT(M, notch_frequency_hz, 0), rw, none,
              {.maximum = 3000, .unit = "Hz", .saved = true, .owner = mine}),
      element(0x2010, 9, record, "Notch 1 width", SERVODROME_ELEMENT(M, notch_width_hz, 0), rw, none,
              {.unit = "Hz", .saved = true, .owner = mine}),
      element(0x2010, 10, record, "Notch 1 depth", SERVODROME_ELEMENT(M, notch_depth, 0), rw, none,
              {.maximum = 1000, .unit = "0.1%", .saved = true, .owner = mine}),
      element(0x2010, 11, record, "Notch 2 frequency", SERVODROME_ELEMENT(M, notch_frequency_hz, 1), rw, none,
              {.maximum = 3000, .unit = "Hz", .saved = true, .owner = mine}),
      element(0x2010, 12, record, "Notch 2 width", SERVODROME_ELEMENT(M, notch_width_hz, 1), rw, none,
              {.unit = "Hz", .saved = true, .owner = mine}),
      element(0x2010, 13, record, "Notch 2 depth", SERVODROME_ELEMENT(M, notch_depth, 1), rw, none,
              {.maximum = 1000, .unit = "0.1%", .saved = true, .owner = mine}),
      highest_sub(0x2011, array, "Loop bandwidths", 2),
      element(0x2011, 1, array, "Current loop bandwidth", SERVODROME_FIELD(M, current_bandwidth_hz), rw, none,
              {.default_value = 1000, .minimum = 50, .maximum = 2000, .unit = "Hz", .saved = true, .owner = mine}),
      element(0x2011, 2, array, "Velocity loop bandwidth", SERVODROME_FIELD(M, velocity_bandwidth_hz), rw, none,
              {.default_value = 100, .minimum = 1, .maximum = 500, .unit = "Hz", .saved = true, .owner = mine}),
      var(0x2012, "Inertia ratio", SERVODROME_FIELD(M, inertia_ratio), rw, none,
          {.default_value = 1000, .minimum = 100, .maximum = 100000, .unit = "0.1%", .saved = true, .owner = mine}),
      var(0x2013, "Field weakening current", SERVODROME_FIELD(M, field_weakening_permille), rw, none,
          {.maximum = 3000, .unit = "0.1%", .saved = true, .owner = mine}),
      highest_sub(0x2020, array, "Brake delays", 2),
      element(0x2020, 1, array, "Brake release delay", SERVODROME_FIELD(M, brake_release_ms), rw, none,
              {.maximum = 10000, .unit = "ms", .saved = true, .owner = mine}),
      element(0x2020, 2, array, "Brake engage delay", SERVODROME_FIELD(M, brake_engage_ms), rw, none,
              {.maximum = 10000, .unit = "ms", .saved = true, .owner = mine}),
      highest_sub(0x2030, array, "Digital input function", 8),
      element(0x2030, 1, array, "Function of input 0", SERVODROME_ELEMENT(M, input_function, 0), rw, none,
              {.default_value = 1, .maximum = 10, .saved = true, .owner = mine}),
      element(0x2030, 2, array, "Function of input 1", SERVODROME_ELEMENT(M, input_function, 1), rw, none,
              {.default_value = 2, .maximum = 10, .saved = true, .owner = mine}),
      element(0x2030, 3, array, "Function of input 2", SERVODROME_ELEMENT(M, input_function, 2), rw, none,
              {.default_value = 3, .maximum = 10, .saved = true, .owner = mine}),
      element(0x2030, 4, array, "Function of input 3", SERVODROME_ELEMENT(M, input_function, 3), rw, none,
              {.default_value = 5, .maximum = 10, .saved = true, .owner = mine}),
      element(0x2030, 5, array, "Function of input 4", SERVODROME_ELEMENT(M, input_function, 4), rw, none,
              {.default_value = 6, .maximum = 10, .saved = true, .owner = mine}),
      element(0x2030, 6, array, "Function of input 5", SERVODROME_ELEMENT(M, input_function, 5), rw, none,
              {.default_value = 0, .maximum = 10, .saved = true, .owner = mine}),
      element(0x2030, 7, array, "Function of input 6", SERVODROME_ELEMENT(M, input_function, 6), rw, none,
              {.default_value = 0, .maximum = 10, .saved = true, .owner = mine}),
      element(0x2030, 8, array, "Function of input 7", SERVODROME_ELEMENT(M, input_function, 7), rw, none,
              {.default_value = 0, .maximum = 10, .saved = true, .owner = mine}),
      var(0x2031, "Digital input polarity", SERVODROME_FIELD(M, input_polarity), rw, none,
          {.saved = true, .owner = mine}),
      highest_sub(0x2040, record, "Monitor thresholds", 5),
      element(0x2040, 1, record, "Over-voltage", SERVODROME_FIELD(M, over_voltage_v), rw, none,
              {.default_value = 400, .unit = "V", .saved = true, .owner = mine}),
      element(0x2040, 2, record, "Under-voltage", SERVODROME_FIELD(M, under_voltage_v), rw, none,
              {.default_value = 200, .unit = "V", .saved = true, .owner = mine}),
      element(0x2040, 3, record, "Motor temperature", SERVODROME_FIELD(M, motor_hot_c), rw, none,
              {.default_value = 130, .unit = "degC", .saved = true, .owner = mine}),
      element(0x2040, 4, record, "Power stage temperature", SERVODROME_FIELD(M, power_stage_hot_c), rw, none,
              {.default_value = 95, .unit = "degC", .saved = true, .owner = mine}),
      element(0x2040, 5, record, "Over-speed", SERVODROME_FIELD(M, over_speed_rpm), rw, none,
              {.default_value = 0, .unit = "rpm", .saved = true, .owner = mine}),
      var(0x2041, "Overload reaction", SERVODROME_FIELD(M, overload_reaction), rw, none,
          {.maximum = 1, .saved = true, .owner = mine}),
      highest_sub(0x2050, record, "Hard-stop homing", 4),
      element(0x2050, 1, record, "Stall torque", SERVODROME_FIELD(M, stall_torque), rw, none,
              {.default_value = 500, .minimum = 10, .maximum = 3000, .unit = "0.1%", .saved = true, .owner = mine}),
      element(0x2050, 2, record, "Stall time", SERVODROME_FIELD(M, stall_time_ms), rw, none,
              {.default_value = 50, .minimum = 1, .maximum = 65535, .unit = "ms", .saved = true, .owner = mine}),
      element(0x2050, 3, record, "Retraction", SERVODROME_FIELD(M, stall_retraction), rw, none,
              {.maximum = 2147483647, .unit = "inc", .saved = true, .owner = mine}),
      element(0x2050, 4, record, "Homing time limit", SERVODROME_FIELD(M, homing_timeout_ms), rw, none,
              {.unit = "ms", .saved = true, .owner = mine}),
      var(0x2060, "I2t utilisation", SERVODROME_FIELD(M, i2t_utilisation), Access::ro, Pdo::tpdo,
          {.unit = "%", .owner = mine}),
      var(0x2F00, "Node-ID", SERVODROME_FIELD(M, node_id), rw, none,
          {.default_value = 2, .minimum = 1, .maximum = 255, .saved = true, .owner = mine}),
      var(0x2F01, "Bit rate", SERVODROME_FIELD(M, bit_rate), rw, none,
          {.default_value = 1000000,
           .minimum = 10000,
           .maximum = 1000000,
           .unit = "bit/s",
           .saved = true,
           .owner = mine}),
      user_data,
      highest_sub(0x2F20, record, "RS485 port", 4),
      element(0x2F20, 1, record, "Modbus station", SERVODROME_FIELD(M, station), rw, none,
              {.maximum = modbus::highest_station, .saved = true}),
      element(0x2F20, 2, record, "Bit rate", SERVODROME_FIELD(M, serial_bit_rate), rw, none,
              {.default_value = 19200, .minimum = 1200, .maximum = 1000000, .unit = "bit/s", .saved = true}),
      element(0x2F20, 3, record, "Parity", SERVODROME_FIELD(M, serial_parity), rw, none,
              {.default_value = 1, .maximum = 2, .saved = true}),
      element(0x2F20, 4, record, "Stop bits", SERVODROME_FIELD(M, serial_stop_bits), rw, none,
              {.default_value = 1, .minimum = 1, .maximum = 2, .saved = true}),
  });
}();

// Appends the objects that all variants have: versions, CiA 402 and manufacturer. `at_drive` and `at_manufacturer` are
// the offsets of the structs with their values.
template <std::size_t Capacity>
constexpr void append_servo_objects(dictionary::TableBuilder<Capacity>& builder, std::size_t at_drive,
                                    std::size_t at_manufacturer) {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  builder.add(text_constant(0x1009, "Manufacturer hardware version", "simulated"));
  builder.add(text_constant(0x100A, "Manufacturer software version", "1.0"));
  builder.append(drive::cia402_section, at_drive);
  builder.append(drive::supported_homing_methods(drive::cia402_methods));
  builder.add(number_constant(0x67FF, 0, ObjectCode::var, "Single device type", Type::unsigned32, servo_drive));
  builder.append(manufacturer_section, at_manufacturer);
  builder.remove(0x6090).remove(0x6093).remove(0x6094);
  builder.set_default(0x6099, 1, 262144).set_default(0x6099, 2, 32768).set_default(0x609A, 0, 1310720);
}

inline constexpr auto object_table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using Communication = decltype(Objects::communication);
  constexpr std::size_t at_communication = offsetof(Objects, communication);
  TableBuilder<800> builder;
  builder.append(canopen::dummy_section);
  builder.append(canopen::general_section<Communication>, at_communication);
  builder.append(canopen::sdo_server_section<Communication>, at_communication);
  builder.append(canopen::rpdo_section<Communication>, at_communication);
  builder.append(canopen::tpdo_section<Communication>, at_communication);
  builder.add(text_constant(0x1008, "Manufacturer device name", "Servodrome CiA 402 reference drive"));
  append_servo_objects(builder, offsetof(Objects, drive), offsetof(Objects, manufacturer));
  builder.remove(0x1002);

  set_identity(builder, product_code, revision_number);

  // The default PDOs of CiA 402-2 for a drive of all modes. Each has the controlword or the statusword; PDO 2 adds the
  // mode, PDO 3 the position, PDO 4 the velocity. The inhibit time of TPDOs with actual values keeps axes in motion
  // from filling the bus.
  constexpr std::int64_t tpdo_inhibit_time = 100;  // 10 ms, in 100 us
  builder.set_default(0x1802, 3, tpdo_inhibit_time).set_default(0x1803, 3, tpdo_inhibit_time);
  builder.map_pdo(0x1600, {0x60400010});
  builder.map_pdo(0x1601, {0x60400010, 0x60600008});
  builder.map_pdo(0x1602, {0x60400010, 0x607A0020});
  builder.map_pdo(0x1603, {0x60400010, 0x60FF0020});
  builder.map_pdo(0x1A00, {0x60410010});
  builder.map_pdo(0x1A01, {0x60410010, 0x60610008});
  builder.map_pdo(0x1A02, {0x60410010, 0x60640020});
  builder.map_pdo(0x1A03, {0x60410010, 0x606C0020});
  return builder;
}>();
static_assert(dictionary::is_valid_table(object_table));

}  // namespace servodrome::products::generic402
