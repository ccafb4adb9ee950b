#pragma once

#include "catalogue/product.hpp"

// The products with a folder here.
namespace servodrome::catalogue {

namespace generic402 {
extern const Product product;
extern const Product ethercat_product;
}  // namespace generic402
namespace ismc {
extern const Product product;
}
namespace ismk {
extern const Product product;
extern const Product ethercat_product;
}  // namespace ismk
namespace jmc_ec {
extern const Product product;
}
namespace pronet {
extern const Product product;
}

}  // namespace servodrome::catalogue
