#include "catalogue/object_texts.hpp"

#include <algorithm>

#include "catalogue/product.hpp"

namespace servodrome::catalogue {
namespace {

// The parameters of all PDOs have the same texts (CiA 301 7.5.2.34 to 7.5.2.38).
std::uint16_t described_index(std::uint16_t index) {
  for (const unsigned first : {0x1400U, 0x1600U, 0x1800U, 0x1A00U}) {
    if (index >= first && index < first + 0x200U) return static_cast<std::uint16_t>(first);
  }
  return index;
}

std::string_view find(std::span<const ObjectText> texts, std::uint16_t index, std::uint8_t sub) {
  const auto before = [](const ObjectText& row, std::uint16_t wanted) { return row.index < wanted; };
  std::string_view of_object;
  for (auto row = std::lower_bound(texts.begin(), texts.end(), index, before);
       row != texts.end() && row->index == index; ++row) {
    if (row->sub == sub) return row->text;
    if (row->sub == any_sub) of_object = row->text;
  }
  return of_object;
}

}  // namespace

std::span<const ObjectText> product_object_texts(std::string_view product) { return product_of(product).object_texts; }

std::string_view find_object_text(std::string_view product, std::uint16_t index, std::uint8_t sub) {
  const std::span<const ObjectText> own = product_object_texts(product);
  std::string_view text = find(own, index, sub);
  if (text.empty()) text = find(own, described_index(index), sub);
  return text.empty() ? find(standard_object_texts(), described_index(index), sub) : text;
}

}  // namespace servodrome::catalogue
