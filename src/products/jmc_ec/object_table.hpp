#pragma once

#include "drive/cia402_section.hpp"
#include "ethercat/slave/communication_section.hpp"
#include "ethercat/slave/profile.hpp"
#include "products/jmc_ec/objects.hpp"

// The object dictionary of the JMC EC drives: Table 219, which lists the objects of their ESI file, and 60E0h and
// 60E1h, which a printed start-up list writes (routine for INovance, 'Set the zero return parameter'). Where the pages
// of single objects differ from Table 219, the table is right.
namespace servodrome::products::jmc_ec {

inline constexpr std::uint32_t vendor_id = 0x66668888;        // Table 219, 1018h
inline constexpr std::uint32_t device_type = 0x00060192;      // Table 219, 1000h, D-01
inline constexpr std::uint32_t revision_number = 0x00010000;  // printed XXXX
inline constexpr std::uint32_t empty_mapping = 0xFFFFFFFF;    // Table 219, 1600h
inline constexpr std::uint16_t pdo_bytes = 48;                // at most, of one PDO ('PDO mapping')
inline constexpr std::uint16_t process_data_bytes = 128;      // of all assigned PDOs together; not printed
inline constexpr const char* hardware_version = "1.0";        // printed XXXX
inline constexpr const char* software_version = "1.42";       // the manual's (title page)

// Both printed start-up lists (routines for INovance and CoDeSys) begin with this row. It is the only one with a
// comment, so it comes from the ESI file and not from the user.
inline constexpr std::array start_up{ethercat::StartUpParameter{
    .transition = "PS", .index = 0x6060, .sub = 0, .value = 8, .comment = "Modes of Operation"}};

// CiA 402 objects of the table.
inline constexpr auto cia402_objects = std::to_array<std::uint16_t>(
    {0x6007, 0x603F, 0x6040, 0x6041, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6060, 0x6061, 0x6063, 0x6064,
     0x6065, 0x6066, 0x6069, 0x606A, 0x606C, 0x6071, 0x6072, 0x6073, 0x6074, 0x6075, 0x6076, 0x6077, 0x6078,
     0x607A, 0x607C, 0x607D, 0x607E, 0x607F, 0x6080, 0x6081, 0x6082, 0x6083, 0x6084, 0x6085, 0x6086, 0x6087,
     0x6088, 0x608F, 0x6091, 0x6092, 0x6098, 0x6099, 0x609A, 0x60B0, 0x60B1, 0x60B8, 0x60B9, 0x60BA, 0x60BB,
     0x60BC, 0x60BD, 0x60C2, 0x60C5, 0x60C6, 0x60E0, 0x60E1, 0x60F4, 0x60FC, 0x60FD, 0x60FE, 0x60FF, 0x6502});

inline constexpr auto own_section = [] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  constexpr auto array = ObjectCode::array;
  constexpr auto mine = Owner::product;
  return std::to_array<Entry>({
      var(0x1008, "Manufacturer device name", SERVODROME_FIELD(Own, device_name), Access::ro),
      text_constant(0x1009, "Manufacturer hardware version", hardware_version),
      text_constant(0x100A, "Manufacturer software version", software_version),
      highest_sub(0x607B, array, "Position change limitation", 2),
      element(0x607B, 1, array, "Minimum position change", SERVODROME_FIELD(Own, min_position_change), Access::rw,
              Pdo::both, {.default_value = -100, .unit = "pos", .owner = mine}),
      element(0x607B, 2, array, "Maximum position change", SERVODROME_FIELD(Own, max_position_change), Access::rw,
              Pdo::both, {.default_value = 100, .unit = "pos", .owner = mine}),
      var(0x60B2, "Torque offset", SERVODROME_FIELD(Own, torque_offset), Access::rw, Pdo::both,
          {.unit = "0.1%", .owner = mine}),
  });
}();

inline constexpr auto object_table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using Communication = decltype(Objects::communication);
  TableBuilder<448> builder;
  builder.append(ethercat::communication_section<Communication>, offsetof(Objects, communication));
  builder.pick(drive::cia402_section, cia402_objects, offsetof(Objects, drive));
  builder.append(own_section, offsetof(Objects, own));
  builder.append(panel_section, offsetof(Objects, panel));
  builder.append(monitor_section, offsetof(Objects, monitor));

  builder.set_default(0x1000, 0, device_type);
  builder.set_default(0x1018, 1, vendor_id).set_default(0x1018, 3, revision_number);

  // Sub-index 0 has the real number of entries; the table prints 0Bh for every map (D-04).
  const auto map = [&builder](std::uint16_t index, std::initializer_list<std::uint32_t> objects) {
    for (std::uint8_t sub = 1; sub <= Communication::mapping_entries; ++sub) {
      builder.set_default(index, sub, empty_mapping);
    }
    builder.map_pdo(index, objects);
  };
  map(0x1600, {0x60400010, 0x60600008, 0x607A0020, 0x60B80010, 0x60FE0120, 0x60FE0220});
  map(0x1601, {0x60400010, 0x60600008, 0x60FF0020, 0x60B80010, 0x60FE0120, 0x60FE0220});
  map(0x1602, {0x605D0010, 0x60710010, 0x60810020, 0x60830020, 0x60840020, 0x60FE0120, 0x60FE0220});
  map(0x1603, {0x607C0020, 0x60980008, 0x60990120, 0x60990220, 0x609A0020});
  map(0x1A00, {0x60410010, 0x60610008, 0x60640020, 0x60B90010, 0x60BA0020, 0x60BB0020, 0x60BC0020, 0x60BD0020,
               0x60FD0010});  // D-05
  map(0x1A01, {0x60610008, 0x606C0020, 0x60F40020});
  map(0x1A02, {0x603F0010, 0x60770010});  // D-06
  map(0x1A03, {});
  builder.set_default(0x1C12, 0, 1).set_default(0x1C13, 0, 1);
  for (std::uint8_t i = 0; i < 4; ++i) {
    const auto sub = static_cast<std::uint8_t>(i + 1);
    builder.set_default(0x1C12, sub, 0x1600 + i).set_range(0x1C12, sub, 0x1600, 0x1603);
    builder.set_default(0x1C13, sub, 0x1A00 + i).set_range(0x1C13, sub, 0x1A00, 0x1A03);
  }

  // Types and access of the table, where they differ from the standard.
  builder.at(0x6007).type = Type::unsigned16;
  builder.at(0x6074).type = Type::unsigned16;
  for (const std::uint16_t index :
       std::to_array<std::uint16_t>({0x6069, 0x6075, 0x6076, 0x60BA, 0x60BB, 0x60BC, 0x60BD})) {
    builder.at(index).access = Access::rw;  // D-28: the next measured value overwrites a written one
  }
  // Column PDO: everything except encoder resolution, gear and feed may be mapped; settings in both directions,
  // measured values to the master only.
  for (std::size_t i = 0; i < builder.count; ++i) {
    Entry& entry = builder.entries[i];
    if (entry.index < 0x6000) continue;
    entry.saved = false;  // the table has no storage objects: a master writes its settings at every start
    const bool factor = entry.index == 0x608F || entry.index == 0x6091 || entry.index == 0x6092;
    const bool number_of_subs = entry.sub == 0 && entry.code != ObjectCode::var;
    entry.pdo = factor || number_of_subs ? Pdo::none : entry.access == Access::rw ? Pdo::both : Pdo::tpdo;
    // Effective only when set in Pre-Operational ('Electronic gear'), so the product checks the state of the bus first.
    if (factor && !number_of_subs) entry.owner = Owner::product;
    const std::string_view unit = entry.unit;
    if (unit == "pos") entry.unit = "command unit";
    if (unit == "vel") entry.unit = "command unit/s";
    if (unit == "acc") entry.unit = "command unit/s2";
    if (unit == "0.1%") entry.unit = "0.1 % of rated torque";
    if (unit == "0.1%/s") entry.unit = "0.1 % of rated torque per s";
    if (unit == "rpm") entry.unit = "r/min";
    if (unit == "inc") entry.unit = entry.index == 0x608F ? "increment" : "encoder increment";
    if (unit == "rev") entry.unit = "revolution";
  }
  builder.at(0x6073).unit = builder.at(0x6078).unit = "0.1 % of rated current";
  builder.at(0x60FF).owner = Owner::none;

  const auto defaults = [&builder](std::initializer_list<std::pair<std::uint32_t, std::int64_t>> values) {
    for (const auto& [key, value] : values) {
      builder.set_default(static_cast<std::uint16_t>(key >> 8), static_cast<std::uint8_t>(key & 0xFF), value);
    }
  };
  defaults({{0x604100, 0x0040},     {0x606500, 4000},      {0x606600, 1},      {0x607200, 1500},
            {0x607300, 1200},       {0x607500, 6000},      {0x607600, 4436},   {0x607D01, -2147483648},
            {0x607D02, 2147483647}, {0x607F00, 14400},     {0x608000, 14400},  {0x608100, 2400},
            {0x608300, 0},          {0x608400, 0},         {0x608500, 0},      {0x608700, 0},
            {0x608F01, 4000},       {0x609201, 4000},      {0x609800, 0},      {0x609901, 0},
            {0x609902, 80},         {0x60C500, 100000},    {0x60C600, 100000}, {0x60E000, 5000},
            {0x60E100, 5000},       {0x650200, 0x000003AD}});
  for (const std::uint16_t sync :
       {std::uint16_t{0x1C32}, std::uint16_t{0x1C33}}) {  // read only, unlike in ETG.1020 (Table 219)
    builder.at(sync, ethercat::sync_parameter::cycle_time).access = Access::ro;
    builder.at(sync, ethercat::sync_parameter::shift_time).access = Access::ro;
  }
  builder.at(0x6075).owner = Owner::product;  // above the current of the power stage it is AL.060
  // -128..-1 and 36..127 are refused with 0609 0030h by the drive, which knows its methods (D-23).
  builder.at(0x6098).minimum = 0;
  builder.at(0x6098).maximum = 35;
  builder.at(0x6098).has_range = false;
  return builder;
}>();
static_assert(dictionary::is_valid_table(object_table));

// Without panel parameters and monitoring items.
inline constexpr auto bus_object_table = dictionary::make_bus_table<object_table>();
static_assert(dictionary::is_valid_table(bus_object_table));

}  // namespace servodrome::products::jmc_ec
