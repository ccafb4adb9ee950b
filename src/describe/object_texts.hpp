#pragma once

#include <cstdint>
#include <span>
#include <string_view>

// What an object does and how it is used, in a sentence or two of our own.
namespace servodrome::describe {

inline constexpr std::uint8_t any_sub = 0xFF;

struct ObjectText {
  std::uint16_t index;
  std::uint8_t sub;  // any_sub: the whole object, where a sub-index has no text of its own
  std::string_view text;
};

// The objects of CiA 301, CiA 402-2 and ETG.1000.6, in order. PDO parameters stand once, under the first PDO.
std::span<const ObjectText> standard_object_texts();
// What a product has of its own or uses otherwise than the standard, in order. Empty if nothing was written for it.
std::span<const ObjectText> product_object_texts(std::string_view product);

// The product's text, else the standard's, of the sub-index, else of the object. Empty: there is none.
std::string_view find_object_text(std::string_view product, std::uint16_t index, std::uint8_t sub);

}  // namespace servodrome::describe
