#pragma once

#include "ethercat/sii/image.hpp"
#include "ethercat/slave/communication_section.hpp"
#include "products/generic402/objects.hpp"

// The objects of the reference drive on EtherCAT: 1000h to 1FFFh are those of EtherCAT, the others are the same as on
// CAN.
namespace servodrome::products::generic402 {

struct EthercatObjects {
  ethercat::CommunicationObjects<5, 5, 16, 4> communication{};
  drive::Objects drive{};
  Manufacturer manufacturer{};
};

inline constexpr std::uint32_t ethercat_product_code = 0x34303245;  // "402E"

inline constexpr auto ethercat_object_table = dictionary::make_table<[] {
  using namespace dictionary;  // NOLINT(google-build-using-namespace)
  using Communication = decltype(EthercatObjects::communication);
  TableBuilder<800> builder;
  builder.append(ethercat::communication_section<Communication>, offsetof(EthercatObjects, communication));
  builder.append(ethercat::storage_section);
  builder.add(text_constant(0x1008, "Manufacturer device name", "Servodrome CiA 402 reference drive, EtherCAT"));
  append_servo_objects(builder, offsetof(EthercatObjects, drive), offsetof(EthercatObjects, manufacturer));
  // Removed: objects of the ports that this variant does not have, CANopen and RS485.
  builder.remove(0x1021).remove(0x1022).remove(0x2F00).remove(0x2F01).remove(0x2F20);
  set_identity(builder, ethercat_product_code, revision_number);
  // One pair of PDOs for all cyclic modes and homing, then a pair for each usual way of control.
  builder.map_pdo(0x1600, {0x60400010, 0x607A0020, 0x60FF0020, 0x60710010, 0x60600008, 0x00000008});
  builder.map_pdo(0x1601, {0x60400010, 0x607A0020});
  builder.map_pdo(0x1602, {0x60400010, 0x60FF0020});
  builder.map_pdo(0x1603, {0x60400010, 0x60710010});
  builder.map_pdo(0x1604, {0x60400010, 0x607A0020, 0x60810020, 0x60830020, 0x60840020, 0x60600008, 0x00000008});
  builder.map_pdo(0x1A00, {0x60410010, 0x60640020, 0x606C0020, 0x60770010, 0x60610008, 0x00000008});
  builder.map_pdo(0x1A01, {0x60410010, 0x60640020});
  builder.map_pdo(0x1A02, {0x60410010, 0x606C0020});
  builder.map_pdo(0x1A03, {0x60410010, 0x60770010});
  builder.map_pdo(0x1A04, {0x60410010, 0x60640020, 0x606C0020, 0x60FD0020, 0x60610008, 0x00000008});
  builder.set_default(0x1C12, 0, 1).set_default(0x1C12, 1, 0x1600);
  builder.set_default(0x1C13, 0, 1).set_default(0x1C13, 1, 0x1A00);
  return builder;
}>();
static_assert(dictionary::is_valid_table(ethercat_object_table));

}  // namespace servodrome::products::generic402
