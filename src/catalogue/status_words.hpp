#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

// Names of the statusword's bits and of the modes of operation, as a product uses them.
namespace servodrome::catalogue {

inline constexpr std::int8_t every_mode = -128;

struct StatusWord {
  std::uint8_t bit;
  std::string_view name;  // of the bit that is 1; bit 5 is 0 during a quick stop
  std::int8_t mode = every_mode;
};

// The product's bits, without those that have no meaning. A row of one mode precedes the row of every mode; its name is
// empty if the bit has no meaning in that mode only. For an unknown product: those of CiA 402-2 (IEC 61800-7-201),
// table 27 and the tables of the modes.
std::span<const StatusWord> status_words(std::string_view product);

// Empty: the bit has no meaning in this mode (6061h). `bit` is 0 .. 15.
std::string_view status_bit_name(std::string_view product, unsigned bit, std::int8_t mode);

struct ModeName {
  std::int8_t mode;
  std::string_view name;
};

// The modes of CiA 402 and those of the product, in ascending order.
std::span<const ModeName> mode_names(std::string_view product);

// "manufacturer-specific mode" or "reserved mode" if the mode has no name.
std::string_view mode_name(std::string_view product, std::int8_t mode);

}  // namespace servodrome::catalogue
