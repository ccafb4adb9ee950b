#pragma once

#include <istream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/entry.hpp"
#include "master/canopen/sdo_transfer.hpp"

namespace servodrome::describe {
struct DeviceFile;
}

namespace servodrome::master {

// An object as described in an EDS or an object table.
struct NamedObject {
  ObjectAddress address;
  std::string object_name;  // of the whole object
  std::string name;         // of the sub-index; the same for a simple object
  std::optional<dictionary::Type> type;
  // From an EDS; nullopt where unknown.
  std::optional<dictionary::Access> access{};
  std::optional<std::int64_t> default_value{};  // for REAL32: the bit pattern
  bool default_adds_node_id = false;
  std::optional<std::int64_t> minimum{};
  std::optional<std::int64_t> maximum{};
  std::string unit{};  // "" if unknown or dimensionless
};

// Finds objects and their types by name or number.
class ObjectCatalogue {
 public:
  // The objects of CiA 301 and CiA 402.
  static const ObjectCatalogue& standard();
  // Reads an electronic data sheet or device configuration file (CiA 306-1). `file` is its name for error messages.
  // Throws MasterError.
  static ObjectCatalogue read_eds(std::istream& in, const std::string& file);

  static ObjectCatalogue of(const describe::DeviceFile& device);
  // `product`, as `servodrome products` lists it, selects the names of its modes.
  static ObjectCatalogue of(std::span<const dictionary::Entry> table, std::string_view product = {});

  const NamedObject* find(ObjectAddress address) const;

  // Accepts `INDEX` or `INDEX:SUB` (hexadecimal, with or without 0x or h) or a name: that of an object with a single
  // value, `OBJECT.SUB-INDEX NAME`, the name of a sub-index that is unique, or the maker's number at the start of a
  // name ("P01-02"). Ignores case, blanks, underscores and hyphens. Throws MasterError.
  ObjectAddress resolve(std::string_view text) const;

  std::string title(ObjectAddress address) const;  // "6099:01 Homing speeds.Speed during search for switch"
  const std::vector<NamedObject>& objects() const { return objects_; }
  const std::string& product() const { return product_; }  // empty: unknown

 private:
  void add(const dictionary::Entry& entry);
  void sort();
  std::vector<const NamedObject*> find_short(std::string_view wanted) const;

  std::vector<NamedObject> objects_;  // sorted by address
  std::string product_;
};

// Accepts CiA 301's name ("INTEGER16") or a short one: i8 .. i64, u8 .. u64, bool, f32, string, bytes. nullopt if
// unknown.
std::optional<dictionary::Type> parse_type(std::string_view word);
// The short name of a type; "bytes" for a DOMAIN as well.
std::string_view short_word(dictionary::Type type);

// A value as text: integers in decimal, UNSIGNED as "55 (0037h)", strings in quotes, other bytes in hexadecimal.
// Without a type: 1, 2, 4 or 8 bytes as UNSIGNED, otherwise text if it is printable, otherwise bytes.
std::string text_of_value(std::span<const std::byte> bytes, std::optional<dictionary::Type> type);

// Converts a value from text to the bytes to send; integers in decimal, or hexadecimal with 0x or h. Throws MasterError
// if the text is not a value of the type.
std::vector<std::byte> parse_value(std::string_view text, dictionary::Type type);

}  // namespace servodrome::master
