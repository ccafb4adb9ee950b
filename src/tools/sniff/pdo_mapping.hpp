#pragma once

#include <map>
#include <memory>
#include <span>

#include "tools/sniff/decoded.hpp"

namespace servodrome::master {

// An entry of a mapping object (1600h.., 1A00h..).
struct MappedField {
  ObjectAddress object;
  unsigned bits = 0;

  static MappedField of(std::uint32_t entry) {
    return {{static_cast<std::uint16_t>(entry >> 16), static_cast<std::uint8_t>(entry >> 8)}, entry & 0xFFU};
  }
  bool is_gap() const { return object.index < 0x1000; }  // data types as dummy entries
};

unsigned bits_of(std::span<const MappedField> mapping);

// The values of process data that start at bit `first_bit` of `data`. Gaps, and objects beyond the end of `data`, are
// left out.
std::vector<DecodedValue> values_of(std::span<const MappedField> mapping, std::span<const std::uint8_t> data,
                                    unsigned first_bit, const ObjectCatalogue& catalogue);

// For example "6041:00 Statusword = ..., 6064:00 ...".
std::string text_of(std::span<const DecodedValue> values);

// Values of a device's communication and mapping objects (1400h to 1BFFh, 1C12h, 1C13h): first the defaults of its
// device description, then the values read or written on the bus.
class PdoObjects {
 public:
  static constexpr std::uint16_t output_assignment = 0x1C12;  // the assignment of inputs is the next object

  static bool concerns(std::uint16_t index) {
    return (index >= 0x1400 && index < 0x1C00) || index == 0x1C12 || index == 0x1C13;
  }

  void set(ObjectAddress object, std::uint32_t value) { values_[object] = value; }
  void set(ObjectAddress object, std::span<const std::byte> bytes);
  // Complete access: sub-index 0 (8 bits, padded to 16 by the master) and the sub-indices after it.
  void set_all(ObjectAddress first, std::span<const std::byte> bytes);
  std::optional<std::uint32_t> get(std::uint16_t index, std::uint8_t sub) const;
  // Content of a mapping object; nullopt if some of its entries are unknown.
  std::optional<std::vector<MappedField>> mapping(std::uint16_t index) const;
  // All PDOs assigned to a sync manager by 1C12h or 1C13h.
  std::optional<std::vector<MappedField>> assigned(std::uint16_t assignment) const;

 private:
  std::map<ObjectAddress, std::uint32_t> values_;
};

// Prior knowledge about a device: names of its objects and its default PDOs.
struct DeviceModel {
  ObjectCatalogue catalogue;
  struct Default {
    ObjectAddress object;
    std::uint32_t value;
    bool adds_node_id;
  };
  std::vector<Default> pdo_defaults;

  // The objects of CiA 301 and CiA 402, without default PDOs. All decoders share it.
  static const std::shared_ptr<const DeviceModel>& standard();
  static DeviceModel of(const describe::DeviceFile& device);
  static DeviceModel of(std::span<const dictionary::Entry> table, std::string_view product = {});
  PdoObjects pdo_objects(std::uint8_t node_id) const;
};

}  // namespace servodrome::master
