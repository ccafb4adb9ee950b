#pragma once

#include <cstdint>
#include <span>
#include <string_view>

// Purpose and use of an object, in one or two sentences of our own.
namespace servodrome::catalogue {

inline constexpr std::uint8_t any_sub = 0xFF;

struct ObjectText {
  std::uint16_t index;
  std::uint8_t sub;  // any_sub: for all sub-indices without their own text
  std::string_view text;
};

// The objects of CiA 301, CiA 402-2 and ETG.1000.6, in order. PDO parameters appear once, at the first PDO.
std::span<const ObjectText> standard_object_texts();
// A product's own objects, and those that it uses in another way than the standard, in order. Empty if there are no
// texts.
std::span<const ObjectText> product_object_texts(std::string_view product);

// The text of the product, otherwise of the standard; for the sub-index, otherwise for the object. Empty: there is
// none.
std::string_view find_object_text(std::string_view product, std::uint16_t index, std::uint8_t sub);

}  // namespace servodrome::catalogue
