#pragma once

#include <cstdint>

#include "describe/description.hpp"
#include "dictionary/table.hpp"

// A device with one entry of every kind that a description must represent.
namespace servodrome::describe::sample {

using namespace dictionary;  // NOLINT: the vocabulary of the table

struct Objects {
  std::uint8_t error_register;
  std::uint8_t number_of_errors;
  std::uint32_t error;
  std::uint32_t emergency_identifier;
  std::uint16_t heartbeat_ms;
  std::uint32_t cycle_us;
  std::uint32_t pdo_identifier;
  std::uint8_t transmission_type;
  std::uint8_t mapped_count;
  std::uint32_t mapped[10];
  std::uint32_t other_identifier;
  bool enabled;
  float gain;
  Blob<16> label;
  Blob<16> key;
  std::uint64_t serial;
  std::int64_t offset_counts;
  std::uint16_t controlword;
  std::uint16_t statusword;
  std::int8_t mode;
  std::int8_t mode_display;
  std::int16_t torque;
  std::int32_t position;
  std::int32_t target;
};

constexpr Field octets{Type::octet_string, offsetof(Objects, key), 16};

constexpr auto build = [] {
  TableBuilder<64> builder;
  constexpr auto record = ObjectCode::record;
  constexpr auto array = ObjectCode::array;
  builder.add(number_constant(0x0002, 0, ObjectCode::var, "INTEGER8 dummy", Type::integer8, 0));
  builder.add(number_constant(0x1000, 0, ObjectCode::var, "Device type", Type::unsigned32, 0x00020192));
  builder.add(var(0x1001, "Error register", SERVODROME_FIELD(Objects, error_register), Access::ro, Pdo::tpdo));
  Entry errors = highest_sub(0x1003, array, "Pre-defined error field", 1);
  errors.access = Access::rw;
  errors.offset = offsetof(Objects, number_of_errors);
  errors.default_value = 0;
  builder.add(errors);
  builder.add(element(0x1003, 1, array, "Newest error", SERVODROME_FIELD(Objects, error), Access::ro));
  builder.add(var(0x1006, "Communication cycle period", SERVODROME_FIELD(Objects, cycle_us), Access::rw, Pdo::none,
                  {.default_value = 1000, .unit = "us", .saved = true}));
  builder.add(text_constant(0x1008, "Manufacturer device name", "Sample; \"drive\""));
  builder.add(var(0x1014, "COB-ID EMCY", SERVODROME_FIELD(Objects, emergency_identifier), Access::rw, Pdo::none,
                  {.default_value = 0x80, .saved = true, .adds_node_id = true}));
  builder.add(var(0x1017, "Producer heartbeat time", SERVODROME_FIELD(Objects, heartbeat_ms), Access::rw, Pdo::none,
                  {.unit = "ms", .saved = true}));
  builder.add(highest_sub(0x1018, record, "Identity", 4));
  builder.add(number_constant(0x1018, 1, record, "Vendor-ID", Type::unsigned32, 0x12345678));
  builder.add(number_constant(0x1018, 2, record, "Product code", Type::unsigned32, 0x9ABCDEF0));
  builder.add(number_constant(0x1018, 3, record, "Revision number", Type::unsigned32, 0x00010002));
  builder.add(number_constant(0x1018, 4, record, "Serial number", Type::unsigned32, 7));
  builder.add(highest_sub(0x1400, record, "RPDO 1 communication parameter", 2));
  builder.add(element(0x1400, 1, record, "COB-ID", SERVODROME_FIELD(Objects, pdo_identifier), Access::rw, Pdo::none,
                      {.default_value = 0x80000200, .saved = true, .adds_node_id = true}));
  builder.add(element(0x1400, 2, record, "Transmission type", SERVODROME_FIELD(Objects, transmission_type), Access::rw,
                      Pdo::none, {.default_value = 255}));
  Entry mapped = highest_sub(0x1600, record, "RPDO 1 mapping", 2);
  mapped.access = Access::rw;
  mapped.offset = offsetof(Objects, mapped_count);
  mapped.has_range = true;
  mapped.maximum = 10;
  builder.add(mapped);
  for (std::uint8_t sub = 1; sub <= 10; ++sub) {  // 1600subA: sub-indices are hexadecimal
    builder.add(element(0x1600, sub, record, "Mapped object",
                        {Type::unsigned32, static_cast<std::uint32_t>(offsetof(Objects, mapped) + 4U * (sub - 1U))},
                        Access::rw, Pdo::none,
                        {.default_value = sub == 1   ? 0x60400010
                                          : sub == 2 ? 0x60710010
                                                     : 0}));
  }
  builder.add(highest_sub(0x1800, record, "TPDO 1 communication parameter", 1));
  builder.add(highest_sub(0x1A00, record, "TPDO 1 mapping", 1));
  builder.add(number_constant(0x1A00, 1, record, "Mapped object", Type::unsigned32, 0x60410010));
  builder.add(element(0x1800, 1, record, "COB-ID", SERVODROME_FIELD(Objects, other_identifier), Access::rw, Pdo::none,
                      {.default_value = 0x180, .adds_node_id = true}));
  builder.add(var(0x2000, "Enabled", SERVODROME_FIELD(Objects, enabled), Access::rw, Pdo::none, {.default_value = 1}));
  builder.add(var(0x2001, "Gain, \"proportional\"", SERVODROME_FIELD(Objects, gain), Access::rw, Pdo::none,
                  {.default_value = 0x3DCCCCCD, .unit = "1/s", .saved = true}));  // 0.1f
  builder.add(var(0x2002, "Label", SERVODROME_FIELD(Objects, label), Access::rw));
  builder.add(var(0x2003, "Key", octets, Access::wo));
  builder.add(var(0x2004, "Trace", {Type::domain}, Access::ro));
  builder.add(highest_sub(0x2005, record, "Long numbers | <wide>", 2));
  builder.add(element(0x2005, 1, record, "Serial", SERVODROME_FIELD(Objects, serial), Access::rw, Pdo::none,
                      {.default_value = -1}));  // 2^64 - 1
  builder.add(element(0x2005, 2, record, "Offset", SERVODROME_FIELD(Objects, offset_counts), Access::rw, Pdo::none,
                      {.default_value = -5000000000,
                       .minimum = -(std::int64_t{1} << 62),
                       .maximum = std::int64_t{1} << 62,
                       .unit = "counts"}));
  builder.add(var(0x6040, "Controlword", SERVODROME_FIELD(Objects, controlword), Access::rw, Pdo::rpdo));
  builder.add(var(0x6041, "Statusword", SERVODROME_FIELD(Objects, statusword), Access::ro, Pdo::tpdo));
  builder.add(var(0x6060, "Modes of operation", SERVODROME_FIELD(Objects, mode), Access::rw, Pdo::both,
                  {.default_value = -1, .minimum = -3, .maximum = 10}));
  builder.add(var(0x6061, "Modes of operation display", SERVODROME_FIELD(Objects, mode_display), Access::ro));
  builder.add(var(0x6064, "Position actual value", SERVODROME_FIELD(Objects, position), Access::ro, Pdo::tpdo,
                  {.unit = "counts"}));
  builder.add(var(0x6071, "Target torque", SERVODROME_FIELD(Objects, torque), Access::wo, Pdo::rpdo));
  builder.add(var(0x607A, "Target position", SERVODROME_FIELD(Objects, target), Access::rw, Pdo::tpdo,
                  {.default_value = -123456, .minimum = -1000000}));
  return builder;
};

constexpr auto table = make_table<build>();
static_assert(is_valid_table(table));

inline Description description() {
  return {.vendor_name = "Servodrome",
          .product_name = "Sample_1",
          .order_code = "S-1",
          .bit_rates_kbit = {125, 500, 1000},
          .lss_supported = true,
          .dummy_usage = {false, true, true, false, false, false, false},
          .table = table,
          .file = {.name = "sample.eds",
                   .version = 2,
                   .revision = 1,
                   .description = "A sample\nwith \xC2\xB5",
                   .created_by = "somebody",
                   .created = {2024, 2, 9, 0, 5},
                   .modified_by = "somebody else",
                   .modified = {2024, 12, 31, 23, 59},
                   .comments = {"first", "second"}}};
}

}  // namespace servodrome::describe::sample
