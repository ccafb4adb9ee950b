#pragma once

#include <istream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/entry.hpp"
#include "host/canopen/sdo_transfer.hpp"

namespace servodrome::describe {
struct DeviceFile;
}

namespace servodrome::host {

// An object as documents know it.
struct NamedObject {
  ObjectAddress address;
  std::string object_name;  // of the whole object
  std::string name;         // of the sub-index; the same for a simple object
  std::optional<dictionary::Type> type;
  // As an EDS says; nothing where it is not known.
  std::optional<dictionary::Access> access{};
  std::optional<std::int64_t> default_value{};  // REAL32: its bits
  bool default_adds_node_id = false;
  std::optional<std::int64_t> minimum{};
  std::optional<std::int64_t> maximum{};
  std::string unit{};  // "" if it is not known, or has none
};

// What a person calls objects, and their types.
class ObjectCatalogue {
 public:
  // The objects of CiA 301 and CiA 402.
  static const ObjectCatalogue& standard();
  // An electronic data sheet or device configuration file (CiA 306-1). `file` stands in error messages. Throws
  // HostError.
  static ObjectCatalogue read_eds(std::istream& in, const std::string& file);

  static ObjectCatalogue of(const describe::DeviceFile& device);
  static ObjectCatalogue of(std::span<const dictionary::Entry> table);

  const NamedObject* find(ObjectAddress address) const;

  // Reads `INDEX`, `INDEX:SUB` (both hexadecimal, with or without 0x or h) or a name: the object's, for its only
  // sub-index, or `OBJECT.SUB-INDEX NAME`, or what only one sub-index is called, or the maker's number that its name
  // begins with ("P01-02"). Case, blanks and underscores do not matter. Throws HostError.
  ObjectAddress resolve(std::string_view text) const;

  std::string title(ObjectAddress address) const;  // "6099:01 Homing speeds.Speed during search for switch"
  const std::vector<NamedObject>& objects() const { return objects_; }

 private:
  void add(const dictionary::Entry& entry);
  void sort();
  std::vector<const NamedObject*> find_short(std::string_view wanted) const;

  std::vector<NamedObject> objects_;  // in order of address
};

// Type by CiA 301's word ("INTEGER16"), or short: i8 .. i64, u8 .. u64, bool, f32, string, bytes. Nothing if unknown.
std::optional<dictionary::Type> parse_type(std::string_view word);
// The short word for it; "bytes" for a DOMAIN as well.
std::string_view short_word(dictionary::Type type);

// A value as people write it: numbers in decimal, UNSIGNED as "55 (0037h)", text in quotes, other bytes in hexadecimal.
// Without type: as an UNSIGNED of that size, or text if it is printable, or bytes.
std::string text_of_value(std::span<const std::byte> bytes, std::optional<dictionary::Type> type);

// The bytes to be sent for a value as people write it; numbers decimal, 0x or with h. Throws HostError when it is no
// value of the type.
std::vector<std::byte> parse_value(std::string_view text, dictionary::Type type);

}  // namespace servodrome::host
