#pragma once

#include "ethercat/sii/image.hpp"
#include "ethercat/slave/communication_section.hpp"
#include "products/ismk/object_table.hpp"

// The dictionary of variant EA: that of AA, with objects of EtherCAT instead of CANopen from 1000h to 1FFFh. The manual
// names the variant but prints none of these objects (README.md).
namespace servodrome::products::ismk {

struct EthercatObjects {
  ethercat::CommunicationObjects<4, 4, 12, 4> communication{};
  ServoObjects servo{};
};

inline constexpr std::uint32_t ethercat_product_code = 0x49534541;  // "ISEA"

inline constexpr auto ethercat_object_table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using Communication = decltype(EthercatObjects::communication);
  TableBuilder<500> builder;
  builder.append(ethercat::communication_section<Communication>, offsetof(EthercatObjects, communication));
  builder.add(text_constant(0x1008, "Manufacturer device name", "iSMK-EA"));
  append_servo_objects(builder, offsetof(EthercatObjects, servo));
  builder.remove(0x100E);  // belongs to CANopen's node guarding
  builder.at(0x6060).maximum = 8;
  // 60C2h, for mode 8: the same period as 3011h sub 1, whose factory value is 4 ms.
  constexpr auto period = std::to_array<std::uint16_t>({0x60C2});
  builder.pick(drive::cia402_section, period, offsetof(EthercatObjects, servo) + offsetof(ServoObjects, drive));
  builder.set_default(0x60C2, 1, 4);
  for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}}) builder.at(0x60C2, sub).saved = false;

  set_identity(builder, ethercat_product_code, revision_number);
  // A pair of PDOs for all modes, and one pair each for position, speed and current.
  builder.map_pdo(0x1600, {0x60400010, 0x607A0020, 0x60FF0020, 0x60F60810, 0x60600008, 0x00000008});
  builder.map_pdo(0x1601, {0x60400010, 0x607A0020, 0x60810020});
  builder.map_pdo(0x1602, {0x60400010, 0x60FF0020});
  builder.map_pdo(0x1603, {0x60400010, 0x60F60810});
  builder.map_pdo(0x1A00, {0x60410010, 0x60630020, 0x606C0020, 0x60780010, 0x60610008, 0x00000008});
  builder.map_pdo(0x1A01, {0x60410010, 0x60630020});
  builder.map_pdo(0x1A02, {0x60410010, 0x606C0020});
  builder.map_pdo(0x1A03, {0x60410010, 0x60780010});
  builder.set_default(0x1C12, 0, 1).set_default(0x1C12, 1, 0x1600);
  builder.set_default(0x1C13, 0, 1).set_default(0x1C13, 1, 0x1A00);
  return builder;
}>();
static_assert(dictionary::is_valid_table(ethercat_object_table));

}  // namespace servodrome::products::ismk
