#include "catalogue/status_words.hpp"

#include "catalogue/product.hpp"

namespace servodrome::catalogue {

std::span<const StatusWord> status_words(std::string_view product) { return product_of(product).status_words; }

std::string_view status_bit_name(std::string_view product, unsigned bit, std::int8_t mode) {
  for (const StatusWord& row : status_words(product)) {
    if (row.bit == bit && (row.mode == mode || row.mode == every_mode)) return row.name;
  }
  return {};
}

std::span<const ModeName> mode_names(std::string_view product) { return product_of(product).mode_names; }

std::string_view mode_name(std::string_view product, std::int8_t mode) {
  for (const ModeName& row : mode_names(product)) {
    if (row.mode == mode) return row.name;
  }
  return mode < 0 ? "manufacturer-specific mode" : "reserved mode";
}

}  // namespace servodrome::catalogue
