#pragma once

#include <cstdint>
#include <span>
#include <string_view>

// The objects by which a drive's terminals are set up and seen, and what their numbers mean.
namespace servodrome::line::bench {

struct NamedNumber {
  int number;
  std::string_view name;
};

struct TerminalWords {
  std::uint16_t index;
  std::uint8_t first_sub;
  std::uint8_t last_sub;
  std::string_view set;                  // objects of one set stand together
  std::string_view key{};                // "enumeration": the numbers are values; "bits": they are places of bits
  std::span<const NamedNumber> words{};  // empty: nothing is known, or the policy knows it
};

// Of CiA 402-2, or of the product. nullptr: the object is none of terminals'.
const TerminalWords* find_terminal(std::string_view product, std::uint16_t index, std::uint8_t sub);

}  // namespace servodrome::line::bench
