#include "catalogue/product.hpp"

#include <algorithm>
#include <array>

#include "catalogue/list.hpp"

namespace servodrome::catalogue {

namespace {
constexpr std::array products{
    &ismc::product,          &pronet::product, &generic402::product, &ismk::product, &generic402::ethercat_product,
    &ismk::ethercat_product, &jmc_ec::product};
}

std::span<const Product* const> all_products() { return products; }

const Product& product_of(std::string_view name) {
  const auto* const found =
      std::find_if(products.begin(), products.end(), [name](const Product* product) { return product->name == name; });
  return found != products.end() ? **found : cia402::product;
}

}  // namespace servodrome::catalogue
