#pragma once

#include <cstdint>
#include <span>
#include <string_view>

// The objects that configure or show a drive's terminals, and the meaning of their numbers.
namespace servodrome::catalogue {

struct NamedNumber {
  int number;
  std::string_view name;
};

struct TerminalWords {
  std::uint16_t index;
  std::uint8_t first_sub;
  std::uint8_t last_sub;
  std::string_view set;                  // the group in which the object is shown
  std::string_view key{};                // "enumeration": the numbers are values; "bits": they are bit numbers
  std::span<const NamedNumber> words{};  // empty: no names are known, or drive::Policy has them
};

// The groups in which a user sees the objects.
namespace terminal_sets {

inline constexpr std::string_view inputs = "Inputs";
inline constexpr std::string_view input_functions = "Functions of the inputs";
inline constexpr std::string_view outputs = "Outputs";
inline constexpr std::string_view output_functions = "Functions of the outputs";
inline constexpr std::string_view probes = "Touch probes";

}  // namespace terminal_sets

// Returns the row of CiA 402-2 or of the product; nullptr if the object does not belong to terminals.
const TerminalWords* find_terminal(std::string_view product, std::uint16_t index, std::uint8_t sub);

}  // namespace servodrome::catalogue
