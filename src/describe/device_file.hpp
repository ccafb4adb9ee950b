#pragma once

#include <array>
#include <cstdint>
#include <istream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dictionary/entry.hpp"

// Content of a device description file, read from an EDS or DCF (CiA 306-1). Files of makers deviate from the
// standards: the reader accepts the content that it can interpret, and lists the deviations in `notes`.
namespace servodrome::describe {

struct Description;

// A file that cannot be used: location, problem and remedy.
class DeviceFileError : public std::runtime_error {
 public:
  DeviceFileError(std::string file, unsigned line, std::string key, std::string problem, std::string remedy);

  const std::string& where() const { return where_; }  // "drive.eds:120, [6041] DataType"
  const std::string& problem() const { return problem_; }
  const std::string& remedy() const { return remedy_; }

 private:
  DeviceFileError(std::string where, std::string problem, std::string remedy);

  std::string where_;
  std::string problem_;
  std::string remedy_;
};

// A sub-index of an object, or a simple object.
struct FileEntry {
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  dictionary::ObjectCode code = dictionary::ObjectCode::var;
  // Numbers whose size a dictionary does not support (24, 40, 48, 56 bits, REAL64, times) are octet strings of
  // `capacity` bytes.
  dictionary::Type type = dictionary::Type::unsigned32;
  std::uint32_t capacity = 0;  // of a string or domain, in bytes; 0: unknown
  dictionary::Access access = dictionary::Access::rw;
  dictionary::Pdo pdo = dictionary::Pdo::none;
  std::string object_name;  // name of the whole object
  std::string name;         // name of the sub-index; the same for a simple object
  std::string unit;
  std::optional<std::int64_t> default_value;  // REAL32: the bits of the value
  bool default_adds_node_id = false;          // $NODEID
  std::optional<std::int64_t> minimum;
  std::optional<std::int64_t> maximum;
  std::optional<bool> saved;  // does the device store it? empty: unknown
  std::string content;        // default of a string or domain, as bytes
  unsigned line = 0;          // line in the file; 0: added by the reader, because the file only implies it

  std::uint32_t key() const { return static_cast<std::uint32_t>(index) << 8 | sub; }
};

// The entry of a file with address, type, access and names of a table's entry.
FileEntry file_entry_of(const dictionary::Entry& entry, const std::string& object_name);
// The reverse, with the unit; refers to the strings of `entry`.
dictionary::Entry entry_of(const FileEntry& entry);

struct DeviceFile {
  std::string file;
  std::string vendor_name;
  std::string product_name;
  std::string order_code;
  std::optional<std::uint32_t> vendor_id;
  std::optional<std::uint32_t> product_code;
  std::optional<std::uint32_t> revision_number;
  std::vector<unsigned> bit_rates_kbit;  // of a CAN device
  bool lss_supported = false;
  bool is_configuration = false;  // the values are those of one device (a DCF), not factory defaults
  std::array<bool, 7> dummy_usage{};
  std::vector<FileEntry> entries;  // sorted by key without duplicates; every object begins with sub-index 0
  std::vector<std::string> notes;  // "drive.eds:12: ...": accepted deviations from the standard

  const FileEntry* find(std::uint16_t index, std::uint8_t sub) const;
};

// Describes the device of the file for its documents, without object tables and EtherCAT data.
Description description_of(const DeviceFile& device);

// Size limit: a larger file cannot be a device description.
inline constexpr std::size_t most_file_bytes = std::size_t{32} << 20;

// Reads the text of a device description. Throws DeviceFileError if it is too long or not a text.
std::string read_text(std::istream& in, const std::string& file);

// Reads all bytes of a file. Throws DeviceFileError if it cannot be read or is too long.
std::string read_file(const std::string& path);

// Reads an electronic data sheet or device configuration file; a ParameterValue has priority over a DefaultValue.
// `file` is the name in messages. Throws DeviceFileError.
DeviceFile read_eds(std::istream& in, const std::string& file);

// Parses a number of CiA 306-1: decimal, hexadecimal with 0x, octal with a leading 0. Empty if it is not a number.
std::optional<std::int64_t> parse_file_number(std::string_view text);

// Adds the entries that a reader finds. A short file may describe very many: arrays of an EDS, types of an ESI file.
class EntryAdder {
 public:
  explicit EntryAdder(DeviceFile& device) : device_(device) {}
  // Returns the entry in the device. Throws DeviceFileError before the file takes more memory than any device needs.
  FileEntry& add(FileEntry&& entry);

 private:
  DeviceFile& device_;
  std::size_t text_bytes_ = 0;
};

// Sorts the entries: a later entry replaces an earlier one with the same key, and an object without sub-index 0 gets
// one. Adds notes about what it changed.
void settle(DeviceFile& device);

}  // namespace servodrome::describe
