#pragma once

#include <array>
#include <cstdint>
#include <istream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "dictionary/entry.hpp"

// What a maker's description of a device says: read from an EDS or DCF (CiA 306-1). Makers' files depart from their
// standards; what can be understood is taken, and said in `notes`.
namespace servodrome::describe {

// A file that cannot be used: which, where, what is wrong there and what to do.
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
  // Numbers of sizes that a dictionary does not have (24, 40, 48, 56 bits, REAL64, times) are octet strings of
  // `capacity` bytes.
  dictionary::Type type = dictionary::Type::unsigned32;
  std::uint32_t capacity = 0;  // of a string or domain, in bytes; 0: the file does not say
  dictionary::Access access = dictionary::Access::rw;
  dictionary::Pdo pdo = dictionary::Pdo::none;
  std::string object_name;  // of the whole object
  std::string name;         // of the sub-index; the same for a simple object
  std::string unit;
  std::optional<std::int64_t> default_value;  // REAL32: its bits
  bool default_adds_node_id = false;          // $NODEID
  std::optional<std::int64_t> minimum;
  std::optional<std::int64_t> maximum;
  std::optional<bool> saved;  // whether the device stores it; nothing where the file does not say
  std::string content;        // the default of a string or domain, as bytes
  unsigned line = 0;          // of the file; 0: made up, because the file only implies it

  std::uint32_t key() const { return static_cast<std::uint32_t>(index) << 8 | sub; }
};

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
  bool is_configuration = false;  // values are those of one device (a DCF), not what all come with
  std::array<bool, 7> dummy_usage{};
  std::vector<FileEntry> entries;  // sorted by key, each once; every object begins with a sub-index 0
  std::vector<std::string> notes;  // "drive.eds:12: ...": what was understood although it is not as the standard has it

  const FileEntry* find(std::uint16_t index, std::uint8_t sub) const;
};

// The largest file that is read; a longer one is no device description.
inline constexpr std::size_t most_file_bytes = std::size_t{32} << 20;

// The text of a device description. Throws DeviceFileError for what is too long or no text at all.
std::string read_text(std::istream& in, const std::string& file);

// All bytes of a file. Throws DeviceFileError when it cannot be read, or is too long.
std::string read_file(const std::string& path);

// An electronic data sheet or device configuration file, whose ParameterValues go before its DefaultValues. `file`
// stands in messages. Throws DeviceFileError.
DeviceFile read_eds(std::istream& in, const std::string& file);

// A number as CiA 306-1 has it: decimal, hexadecimal with 0x, octal with a leading 0. Nothing if it is none.
std::optional<std::int64_t> parse_file_number(std::string_view text);

// Puts entries in order: a later one of the same key replaces the earlier, and objects without a sub-index 0 get one.
// Notes what was not in order.
void settle(DeviceFile& device);

}  // namespace servodrome::describe
