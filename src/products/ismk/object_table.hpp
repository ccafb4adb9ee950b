#pragma once

#include <string_view>

#include "canopen/301/communication_section.hpp"
#include "drive/cia402_section.hpp"
#include "products/identity.hpp"
#include "products/ismk/sections.hpp"

// The object dictionary of the iSMK, AA variant: chapters 7 and 9 and the objects that other chapters name. README.md
// describes those that the manual does not number (PDO parameters, identity).
namespace servodrome::products::ismk {

inline constexpr std::uint32_t product_code = 0x49534D4B;  // "ISMK"
inline constexpr std::uint32_t revision_number = 0x00010000;

// CiA 402 objects of the manual, and 6061h, 6064h and 6502h for masters that look for them.
inline constexpr auto cia402_objects = std::to_array<std::uint16_t>(
    {0x6007, 0x603F, 0x6040, 0x6041, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6060, 0x6061, 0x6063, 0x6064,
     0x6065, 0x6067, 0x6068, 0x606C, 0x6071, 0x6073, 0x6078, 0x607A, 0x607C, 0x607D, 0x607E, 0x607F, 0x6080,
     0x6081, 0x6083, 0x6084, 0x6085, 0x6098, 0x6099, 0x609A, 0x60F4, 0x60FC, 0x60FD, 0x60FF, 0x6502});

// Appends the objects that all variants have: 2000h to FFFFh, the station number 100Bh and the COB-ID 100Eh. `at` is
// the offset of the ServoObjects.
template <std::size_t Capacity>
constexpr void append_servo_objects(dictionary::TableBuilder<Capacity>& builder, std::size_t at) {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  const std::size_t at_drive = at + offsetof(ServoObjects, drive);
  builder.pick(drive::cia402_section, cia402_objects, at_drive);
  builder.append(section::io, at + offsetof(ServoObjects, io));
  builder.append(section::tables, at + offsetof(ServoObjects, tables));
  builder.append(section::gains, at + offsetof(ServoObjects, gains));
  builder.append(section::tuning, at + offsetof(ServoObjects, tuning));
  builder.append(section::motion, at + offsetof(ServoObjects, motion));
  builder.append(section::alarms, at + offsetof(ServoObjects, alarms));
  builder.append(section::buses, at + offsetof(ServoObjects, buses));
  builder.append(section::device, at + offsetof(ServoObjects, device));

  // 2508h sub 9 and 6068h are one value (ch. 7.5 and 7.9).
  builder.add(element(0x2508, 9, ObjectCode::record, "Reach position time window",
                      SERVODROME_FIELD(drive::Objects, position_window_time_ms), Access::rw, Pdo::both,
                      {.default_value = 10, .unit = "ms", .saved = true}),
              at_drive);
  builder.set_default(0x6068, 0, 10);
  builder.at(0x6068, 0).saved = false;

  builder.at(0x6007, 0).type = Type::unsigned16;
  builder.set_default(0x6007, 0, 0).set_range(0x6007, 0, 0, 1);  // Table 9-26
  builder.set_default(0x6040, 0, 0x06);                          // ch. 7.1
  builder.set_default(0x605A, 0, 0).set_range(0x605A, 0, 0, 18);
  builder.set_default(0x605B, 0, 0).set_range(0x605B, 0, 0, 18);
  builder.set_default(0x605C, 0, 0).set_range(0x605C, 0, 0, 18);
  builder.set_default(0x605D, 0, 1).set_range(0x605D, 0, 1, 2);
  builder.set_default(0x605E, 0, 0).set_range(0x605E, 0, 0, 18);
  builder.set_default(0x6060, 0, -4).set_range(0x6060, 0, -4, 7);
  builder.set_default(0x6065, 0, 524288);
  builder.set_default(0x6067, 0, 327);
  builder.set_default(0x6073, 0, 2048);
  builder.set_default(0x607F, 0, 89478485).set_default(0x6080, 0, 5000);
  builder.at(0x6080, 0).type = Type::unsigned16;
  builder.at(0x6080, 0).maximum = 65535;
  builder.set_default(0x6081, 0, 0);
  builder.set_default(0x6083, 0, 107374).set_default(0x6084, 0, 107374).set_default(0x6085, 0, 654983);
  builder.set_default(0x6098, 0, 0);
  builder.at(0x6099, 0).default_value = 6;
  builder.set_default(0x6099, 1, 5368709).set_default(0x6099, 2, 1789570).set_default(0x609A, 0, 53687);
  builder.set_range(0x607E, 0, 0, 1);
  for (Entry& entry : builder.entries) {
    if (entry.index == 0x6099) entry.code = ObjectCode::record;  // one object with the manufacturer's sub-indices
  }
  // 607Dh sub 1 is the positive limit here (ch. 7.5), the minimum in CiA 402.
  std::swap(builder.at(0x607D, 1).offset, builder.at(0x607D, 2).offset);
  builder.at(0x607D, 1).name = "Soft_Positive_Limit";
  builder.at(0x607D, 2).name = "Soft_Negative_Limit";

  // Attribute letters M and S of chapter 7.
  for (const std::uint16_t index : std::to_array<std::uint16_t>(
           {0x6040, 0x6060, 0x6065, 0x6073, 0x607A, 0x607C, 0x6081, 0x6083, 0x6084, 0x6098, 0x60FF})) {
    builder.at(index, 0).pdo = Pdo::both;
  }
  builder.at(0x6099, 1).pdo = builder.at(0x6099, 2).pdo = Pdo::both;
  for (const std::uint16_t index : std::to_array<std::uint16_t>({0x6067, 0x6068, 0x6071, 0x607F, 0x609A, 0x6502})) {
    builder.at(index, 0).pdo = Pdo::none;
  }
  for (const std::uint16_t index : std::to_array<std::uint16_t>({0x607F, 0x6080, 0x6081}))
    builder.at(index, 0).saved = false;

  // The device handles these as well, because they are coupled to other objects (MotionControl::written).
  for (const std::uint16_t index : std::to_array<std::uint16_t>({0x6063, 0x6071, 0x607F, 0x6080, 0x60FC})) {
    builder.at(index, 0).owner = Owner::product;
  }
  for (std::size_t i = 0; i < builder.count; ++i) {
    Entry& entry = builder.entries[i];
    const std::string_view unit = entry.unit;
    if (unit == "pos") entry.unit = "inc";
    if (unit == "vel") entry.unit = "rpm (DEC raw)";
    if (unit == "acc") entry.unit = "rps/s (DEC raw)";
  }
  builder.at(0x6071, 0).unit = "%";
  builder.at(0x6073, 0).unit = builder.at(0x6078, 0).unit = "Ap (DEC raw)";
}

inline constexpr auto object_table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using Communication = decltype(Objects::communication);
  constexpr std::size_t at_communication = offsetof(Objects, communication);
  TableBuilder<400> builder;
  constexpr auto general =
      std::to_array<std::uint16_t>({0x1000, 0x1001, 0x1005, 0x100C, 0x100D, 0x1014, 0x1016, 0x1017, 0x1018});
  builder.pick(canopen::general_section<Communication>, general, at_communication);
  builder.append(canopen::sdo_server_section<Communication>, at_communication);
  constexpr canopen::PdoSubIndices rpdo_subs{.inhibit_time = false, .event_timer = false, .sync_start_value = false};
  constexpr canopen::PdoSubIndices tpdo_subs{.sync_start_value = false};
  builder.append(canopen::rpdo_section<Communication, rpdo_subs>, at_communication);
  builder.append(canopen::tpdo_section<Communication, tpdo_subs>, at_communication);
  builder.add(text_constant(0x1008, "Manufacturer device name", "iSMK"));
  append_servo_objects(builder, offsetof(Objects, servo));

  set_identity(builder, product_code, revision_number);
  builder.set_default(0x100C, 0, 1000).set_default(0x100D, 0, 3);  // Table 9-26
  // The station number is the only communication object that the manual prints as savable: the master configures the
  // node at every start (ch. 9.3.3.4 and 9.4).
  for (std::size_t i = 0; i < builder.count; ++i) {
    Entry& entry = builder.entries[i];
    if (area_of(entry.index) == Area::communication && entry.index != 0x100B) entry.saved = false;
  }
  for (std::uint16_t pdo = 0; pdo < 4; ++pdo) {
    builder.set_default(static_cast<std::uint16_t>(0x1400 + pdo), 2, 254);  // ch. 9.3.3.3
    builder.set_default(static_cast<std::uint16_t>(0x1800 + pdo), 2, 254);
    builder.at(static_cast<std::uint16_t>(0x1800 + pdo), 3).unit = "ms";  // Table 9-14, ch. 9.3.3.3
  }
  builder.set_default(0x1600, 1, 0x60400010).set_default(0x1600, 0, 1);
  builder.set_default(0x1A00, 1, 0x60410010).set_default(0x1A00, 0, 1);
  return builder;
}>();
static_assert(dictionary::is_valid_table(object_table));

}  // namespace servodrome::products::ismk
