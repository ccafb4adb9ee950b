#include <algorithm>
#include <gtest/gtest.h>

#include "line/registry.hpp"

namespace servodrome::line {
namespace service_registers_test {
namespace {

// The objects of a product's Modbus registers are in the table of its service port; the table of the fieldbus may have
// fewer objects.
TEST(ServiceRegisters, AreInTheTableOfTheServicePort) {
  for (const Product& product : all_products()) {
    if (product.serial == nullptr) continue;
    const describe::Description description = product.describe();
    EXPECT_TRUE(modbus::is_valid_map(product.serial->registers, description.service_table)) << product.name;
    EXPECT_GE(description.service_table.size(), description.table.size()) << product.name;
    const bool seen = modbus::is_valid_map(product.serial->registers, description.table);
    EXPECT_EQ(seen, product.name != "jmc_ec") << product.name << ": its panel parameters are not for the bus";
    for (const dictionary::Entry& entry : description.table) EXPECT_FALSE(entry.local) << product.name;
  }
}

}  // namespace
}  // namespace service_registers_test
}  // namespace servodrome::line
