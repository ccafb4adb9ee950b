#pragma once

#include <string_view>

#include "canopen/301/communication_section.hpp"
#include "canopen/profile.hpp"
#include "drive/cia402_section.hpp"
#include "products/identity.hpp"
#include "products/pronet/parameters.hpp"
#include "products/pronet/policy.hpp"

namespace servodrome::products::pronet {

inline constexpr std::size_t alarm_record_length = 10;  // Fn000-0 to Fn000-9
inline constexpr std::size_t monitor_count = 15;        // Un000 to Un014

// Everything that is neither CiA 301 nor CiA 402.
struct Manufacturer {
  struct TransmitMask {  // 2000h to 2003h; a bit that is 0 hides the change of that bit of the PDO
    std::uint32_t low = 0xFFFFFFFF;
    std::uint32_t high = 0xFFFFFFFF;
  };
  std::array<TransmitMask, 4> transmit_mask{};
  std::uint32_t sync_time_period_us = 1000;                 // 2105h
  std::uint16_t pn201 = 1;                                  // 2F10h: 6093h:01 at power-on
  std::uint16_t pn202 = 1;                                  // 2F11h: 6093h:02 at power-on
  std::uint32_t encoder_counts = 0;                         // 2F12h: of the motor that is fitted
  ParameterValues parameters{};                             // 3000h to 3100h
  std::array<std::uint16_t, alarm_record_length> alarms{};  // 3200h.., newest first
  std::array<std::uint16_t, monitor_count> monitors{};      // 320Ah..
  std::uint16_t rotates = 0;                                // 3300h
  std::uint16_t single_position = 0;                        // 3301h
  std::int32_t interpolation_data_record_2 = 0;             // 60C1h:02, stored and not used (ch. 7.5.3)
};

struct Objects {
  canopen::CommunicationObjects<4, 4, 4, 1, 4> communication{};
  drive::Objects drive{};
  Manufacturer manufacturer{};
};

// 1000h and 1018h are not printed (C43).
inline constexpr std::uint32_t product_code = 0x50524E54;     // "PRNT"
inline constexpr std::uint32_t revision_number = 0x00010004;  // manual V1.04
inline constexpr std::uint16_t dsp_edition = 0x0104;          // 321Eh, likewise

// 6060h and 6061h have 8 bits and are mapped with 16 (ch. 3.3, C7).
inline constexpr auto padded_mappings = std::to_array<std::uint32_t>({0x60600010, 0x60610010});
// Printed for TPDO 1 only (ch. 3.3, 1800h).
inline constexpr auto cob_id_ranges = std::to_array<canopen::CobIdRange>({{0x1800, 0x181, 0x1FF}});

inline constexpr auto transmit_mask_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using Mask = Manufacturer::TransmitMask;
  constexpr const char* names[] = {"TPDO 1 transmit mask", "TPDO 2 transmit mask", "TPDO 3 transmit mask",
                                   "TPDO 4 transmit mask"};
  std::array<Entry, 12> section{};
  std::size_t n = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto index = static_cast<std::uint16_t>(0x2000 + i);
    const std::size_t base = offsetof(Manufacturer, transmit_mask) + i * sizeof(Mask);
    section[n++] = highest_sub(index, ObjectCode::array, names[i], 2);
    section[n++] =
        element(index, 1, ObjectCode::array, "Transmit mask low", field_at<std::uint32_t>(base + offsetof(Mask, low)),
                Access::rw, Pdo::none, {.default_value = 0xFFFFFFFF, .owner = Owner::product});
    section[n++] =
        element(index, 2, ObjectCode::array, "Transmit mask high", field_at<std::uint32_t>(base + offsetof(Mask, high)),
                Access::rw, Pdo::none, {.default_value = 0xFFFFFFFF, .owner = Owner::product});
  }
  return section;
}();

inline constexpr auto parameter_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  std::array<Entry, parameters.size()> section{};
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Parameter& parameter = parameters[i];
    Field field = field_at<std::uint16_t>(offsetof(Manufacturer, parameters) + offsetof(ParameterValues, values) +
                                          i * sizeof(std::uint16_t));
    if (parameter.number == 505) field.type = Type::integer16;  // the only signed one (appendix)
    section[i] =
        var(parameter.index, parameter.name, field, Access::rw, Pdo::none,
            {.default_value = parameter.factory_value, .unit = parameter.unit, .saved = true, .owner = Owner::product});
  }
  return section;
}();

// 3200h to 3301h: monitors of the drive (appendix). Only their names and units are printed, not their meanings.
inline constexpr auto monitor_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  struct Row {
    const char* name;
    const char* unit;
  };
  constexpr const char* alarms[alarm_record_length] = {"Fn000-0", "Fn000-1", "Fn000-2", "Fn000-3", "Fn000-4",
                                                       "Fn000-5", "Fn000-6", "Fn000-7", "Fn000-8", "Fn000-9"};
  constexpr Row monitors[monitor_count] = {{"Un000", "r/min"}, {"Un001", "r/min"}, {"Un002", "%"}, {"Un003", "%"},
                                           {"Un004", "pulse"}, {"Un005", ""},      {"Un006", ""},  {"Un007", ""},
                                           {"Un008", "1kHz"},  {"Un009", "pulse"}, {"Un010", ""},  {"Un011", ""},
                                           {"Un012", ""},      {"Un013", ""},      {"Un014", ""}};
  std::array<Entry, alarm_record_length + monitor_count> section{};
  std::size_t n = 0;
  for (std::size_t i = 0; i < alarm_record_length; ++i) {
    section[n++] = var(static_cast<std::uint16_t>(0x3200 + i), alarms[i],
                       field_at<std::uint16_t>(offsetof(Manufacturer, alarms) + 2 * i), Access::ro);
  }
  for (std::size_t i = 0; i < monitor_count; ++i) {
    section[n++] = var(static_cast<std::uint16_t>(0x320A + i), monitors[i].name,
                       field_at<std::uint16_t>(offsetof(Manufacturer, monitors) + 2 * i), Access::ro, Pdo::none,
                       {.unit = monitors[i].unit, .owner = Owner::product});
  }
  return section;
}();

inline constexpr auto manufacturer_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using M = Manufacturer;
  return std::to_array<Entry>({
      var(0x2105, "Sync time period", SERVODROME_FIELD(M, sync_time_period_us), Access::rw, Pdo::none,
          {.default_value = 1000, .unit = "us", .owner = Owner::product}),
      var(0x2F10, "Pn201", SERVODROME_FIELD(M, pn201), Access::rw, Pdo::none,
          {.default_value = 1, .saved = true, .owner = Owner::product}),
      var(0x2F11, "Pn202", SERVODROME_FIELD(M, pn202), Access::rw, Pdo::none,
          {.default_value = 1, .saved = true, .owner = Owner::product}),
      var(0x2F12, "Encoder counts per revolution", SERVODROME_FIELD(M, encoder_counts), Access::ro),
      number_constant(0x321E, 0, ObjectCode::var, "DSP-Edition", Type::unsigned16, dsp_edition),
      var(0x3300, "rotates", SERVODROME_FIELD(M, rotates), Access::ro, Pdo::none, {.owner = Owner::product}),
      var(0x3301, "singlePos", SERVODROME_FIELD(M, single_position), Access::ro, Pdo::none, {.owner = Owner::product}),
  });
}();

// The CiA 402 objects in the list of the appendix.
inline constexpr auto cia402_objects = std::to_array<std::uint16_t>(
    {0x603F, 0x6040, 0x6041, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6060, 0x6061, 0x6062, 0x6063, 0x6064,
     0x6065, 0x6066, 0x6067, 0x6068, 0x6069, 0x606B, 0x606C, 0x606D, 0x606E, 0x606F, 0x6070, 0x607A, 0x607B,
     0x607C, 0x6081, 0x6082, 0x6083, 0x6084, 0x6085, 0x6086, 0x6093, 0x6094, 0x6097, 0x6098, 0x6099, 0x609A,
     0x60A3, 0x60A4, 0x60C0, 0x60C1, 0x60C2, 0x60FA, 0x60FC, 0x60FD, 0x60FE, 0x60FF});

inline constexpr auto object_table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using Communication = decltype(Objects::communication);
  constexpr std::size_t at_communication = offsetof(Objects, communication);
  constexpr std::size_t at_drive = offsetof(Objects, drive);
  constexpr std::size_t at_manufacturer = offsetof(Objects, manufacturer);
  TableBuilder<400> builder;
  constexpr auto dummies = std::to_array<std::uint16_t>({2, 3, 4, 5, 6, 7});  // appendix
  builder.pick(canopen::dummy_section, dummies);
  constexpr auto general = std::to_array<std::uint16_t>(
      {0x1000, 0x1001, 0x1003, 0x1005, 0x1006, 0x1007, 0x1014, 0x1016, 0x1017, 0x1018, 0x1029});
  builder.pick(canopen::general_section<Communication>, general, at_communication);
  builder.append(canopen::sdo_server_section<Communication>, at_communication);
  constexpr canopen::PdoSubIndices rpdo_subs{.inhibit_time = false, .event_timer = false, .sync_start_value = false};
  constexpr canopen::PdoSubIndices tpdo_subs{.sync_start_value = false, .highest_sub = 4};  // C3
  builder.append(canopen::rpdo_section<Communication, rpdo_subs>, at_communication);
  builder.append(canopen::tpdo_section<Communication, tpdo_subs>, at_communication);
  builder.pick(drive::cia402_section, cia402_objects, at_drive);
  builder.append(transmit_mask_section, at_manufacturer);
  builder.append(parameter_section, at_manufacturer);
  builder.append(monitor_section, at_manufacturer);
  builder.append(manufacturer_section, at_manufacturer);
  builder.add(highest_sub(0x60C1, ObjectCode::array, "Interpolation data record", 2));
  builder.add(
      element(0x60C1, 2, ObjectCode::array, "Interpolation data record 2",
              SERVODROME_FIELD(Manufacturer, interpolation_data_record_2), Access::rw, Pdo::rpdo, {.unit = "pos"}),
      at_manufacturer);
  builder.add(highest_sub(0x60A4, ObjectCode::array, "Profile jerk", 1));

  // Only the parameters Pn are non-volatile. An object that may be mapped into an RPDO may be mapped into a TPDO as
  // well, because the manual has a single "PDO mapping YES" for both.
  std::size_t kept = 0;
  for (std::size_t i = 0; i < builder.count; ++i) {
    Entry entry = builder.entries[i];
    const bool absent = (entry.index == 0x60A4 && entry.sub > 1);
    if (absent) continue;
    if (area_of(entry.index) != Area::manufacturer) entry.saved = false;
    if (area_of(entry.index) == Area::profile && entry.pdo == Pdo::rpdo) entry.pdo = Pdo::both;
    const auto is = [&entry](const char* unit) { return std::string_view(entry.unit) == unit; };
    if (is("pos")) entry.unit = "position units";
    if (is("vel")) entry.unit = "speed units";
    if (is("acc")) entry.unit = "acceleration units";
    builder.entries[kept++] = entry;
  }
  builder.count = kept;

  set_identity(builder, product_code, revision_number);

  // PDOs from the factory (ch. 3.3; identifiers of PDO 3 and 4: C1).
  builder.map_pdo(0x1600, {0x60400010, 0x60FF0020});
  builder.map_pdo(0x1A00, {0x60410010, 0x60640020});
  for (std::uint16_t pdo = 1; pdo < 4; ++pdo) {
    builder.map_pdo(static_cast<std::uint16_t>(0x1600 + pdo), {0x60FF0020, 0x60600010});
    builder.map_pdo(static_cast<std::uint16_t>(0x1A00 + pdo), {0x60640020, 0x60610010});
  }
  for (std::uint16_t pdo = 0; pdo < 4; ++pdo) {
    const auto index = static_cast<std::uint16_t>(0x1800 + pdo);
    builder.set_default(index, 3, 100).set_default(index, 5, 10);
  }

  builder.set_range(0x3100, 0, 1, 127);  // Pn704, an address on the bus

  // Defaults, access and types that the manual prints differently from the reference section.
  for (const std::uint16_t index : dummies) builder.at(index).access = Access::rw;
  builder.set_default(0x605A, 0, 0).set_default(0x605C, 0, 0).set_default(0x605D, 0, 0).set_default(0x605E, 0, 0);
  builder.set_default(0x6065, 0, 256).set_default(0x6066, 0, 0).set_range(0x6065, 0, 0, 0x7FFFFFFF);
  builder.set_default(0x6067, 0, 400).set_default(0x6068, 0, 0);
  builder.set_default(0x606D, 0, 20).set_default(0x606E, 0, 0);
  builder.set_default(0x606F, 0, 10).set_default(0x6070, 0, 0);
  builder.set_default(0x6081, 0, 0).set_default(0x6083, 0, 100000).set_default(0x6084, 0, 100000);
  builder.set_default(0x6085, 0, 200000).at(0x6085).pdo = Pdo::both;
  builder.set_range(0x6086, 0, -32768, 32767);  // 0 and 2: the drive refuses the others
  builder.set_default(0x6098, 0, 1);
  builder.at(0x607C).pdo = Pdo::both;
  for (const std::uint16_t index : std::to_array<std::uint16_t>({0x6093, 0x6094, 0x6097})) {  // C26
    builder.at(index, 1).pdo = builder.at(index, 2).pdo = Pdo::both;
  }
  builder.at(0x6069).unit = "0.1rpm";
  builder.at(0x1001).pdo = Pdo::none;
  builder.at(0x60A3).access = Access::ro;
  builder.set_default(0x60A4, 1, 5).set_range(0x60A4, 1, 1, 20);  // ch. 7.4.3
  builder.at(0x60A4, 1).pdo = Pdo::both;
  builder.at(0x60A4, 1).unit = "pulse/(s*100us*100us)";
  builder.at(0x60FE, 2).pdo = Pdo::both;
  return builder;
}>();
static_assert(dictionary::is_valid_table(object_table));

}  // namespace servodrome::products::pronet
