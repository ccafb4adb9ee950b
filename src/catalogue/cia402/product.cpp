#include "catalogue/product.hpp"

#include "catalogue/cia402/fault_texts.hpp"
#include "catalogue/cia402/object_texts.hpp"
#include "catalogue/cia402/status_rows.hpp"
#include "catalogue/cia402/store.hpp"

namespace servodrome::catalogue {

std::span<const FaultText> standard_fault_texts() { return cia402::fault_texts; }

std::span<const ObjectText> standard_object_texts() { return cia402::object_texts; }

namespace cia402 {

constinit const Product product{.rules = {.store = store}, .status_words = status_words, .mode_names = mode_names};

}  // namespace cia402
}  // namespace servodrome::catalogue
