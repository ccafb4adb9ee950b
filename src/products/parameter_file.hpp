#pragma once

#include <array>

#include "dictionary/store.hpp"
#include "drive/drive.hpp"
#include "ethercat/slave/foe_server.hpp"

namespace servodrome::products {

// The parameters of a drive as a text file for FoE: "parameters.txt".
//
// Lines end with LF, or CR LF. Empty lines and lines that begin with # are comments, except the first line, which is
//     # servodrome parameters 1
// Every other line is INDEX:SUB=VALUE. Index and sub-index are hexadecimal after 0x. A number is decimal, or
// hexadecimal after 0x (REAL32: its bits). A string or block of bytes is written as pairs of hexadecimal digits:
//     0x1018:01=0x53455256
//     0x2011:02=150
//     0x6098:00=-3
// A master that reads the file gets vendor and product of 1018h and the present values of all objects that are stored.
// A file that a master writes is checked as a whole first: it must be of this vendor and product, name stored objects
// only, and have values that the drive accepts. Only then are the values applied and all stored objects saved. If one
// line conflicts with another, or the memory fails, all objects get their old values back. Objects that the file does
// not name keep their values. The motor must be without power.
class ParameterFile final : public ethercat::FoeFiles {
 public:
  static constexpr std::string_view name = "parameters.txt";
  static constexpr std::size_t capacity = 16384;  // bytes of text
  static constexpr std::size_t longest_value = 1024;

  // `medium` is the memory for stored parameters; without one a file can be read but not written.
  ParameterFile(dictionary::Dictionary& dictionary, const drive::Drive& drive, dictionary::Medium* medium)
      : dictionary_(dictionary), drive_(drive), medium_(medium) {}

  // Errors, each with a reason as text: not_found (another name), access_denied (the motor has power, no memory),
  // disk_full (longer than `capacity`), illegal (a line has the wrong form, or its value is refused), program_error
  // (the memory failed).
  ethercat::FoeError open(std::string_view file, std::uint32_t password, bool writes) override;
  ethercat::FoeError read(std::uint32_t position, std::span<std::uint8_t> into, std::size_t& count) override;
  ethercat::FoeError write(std::uint32_t position, std::span<const std::uint8_t> data, bool last) override;
  std::string_view reason() const override { return {reason_.data(), reason_length_}; }

 private:
  // A line's object and its raw value.
  struct Assignment {
    const dictionary::Entry* entry = nullptr;
    std::size_t size = 0;
  };
  // The kind of a line. Parsing an assignment puts its value into `value_`.
  enum class Line : std::uint8_t { comment, assignment, wrong };

  void compose();
  void compose_line(const dictionary::Entry& entry);
  ethercat::FoeError take();
  ethercat::FoeError apply();
  ethercat::FoeError assign(unsigned number, std::string_view line);
  bool remember(const dictionary::Entry& entry);
  void undo();
  template <typename Visit>
  ethercat::FoeError for_each_line(Visit visit);
  Line parse(std::string_view line, Assignment& assignment);
  bool parse_value(std::string_view text, Assignment& assignment);
  const char* objection(const Assignment& assignment) const;

  void put(char letter);
  void put(std::string_view words);
  void put_hex(std::uint32_t number, unsigned digits);
  void put_decimal(std::int64_t number);

  ethercat::FoeError refuse(ethercat::FoeError error, std::string_view words, unsigned line = 0);

  dictionary::Dictionary& dictionary_;
  const drive::Drive& drive_;
  dictionary::Medium* medium_;
  std::array<char, capacity> text_{};
  std::size_t length_ = 0;
  std::array<std::byte, longest_value> value_{};
  // A stack of the values before the file was applied: value, its size, and the place of its object in the table.
  // `capacity` is enough for all numbers of a file: a number takes no more bytes here than its line has characters.
  struct OldValue {
    std::uint16_t size = 0;
    std::uint16_t place = 0;
  };
  std::array<std::byte, capacity> old_values_{};
  std::size_t old_length_ = 0;
  std::array<char, 80> reason_{};
  std::size_t reason_length_ = 0;
};

}  // namespace servodrome::products
