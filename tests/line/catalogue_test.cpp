// The catalogue and the simulated products agree.
#include <algorithm>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <set>

#include "catalogue/product.hpp"
#include "line/registry.hpp"
#include "products/ismk/terminals.hpp"

namespace servodrome::line {
namespace catalogue_test {
namespace {

TEST(Catalogue, ListsTheProductsOfALine) {
  std::vector<std::string_view> known;
  for (const catalogue::Product* product : catalogue::all_products()) known.push_back(product->name);
  std::vector<std::string_view> simulated;
  for (const Product& product : all_products()) simulated.push_back(product.name);
  EXPECT_EQ(known, simulated);
}

TEST(Catalogue, KnowsOnlyTheStandardsOfAnyOtherDrive) {
  for (const char* name : {"", "unheard of", "ISMC"}) {
    EXPECT_EQ(&catalogue::product_of(name), &catalogue::cia402::product) << name;
  }
  EXPECT_EQ(catalogue::cia402::product.rules.store.size(), 1U);
  EXPECT_TRUE(catalogue::cia402::product.tuning.gains.empty());
  EXPECT_TRUE(catalogue::fault_texts("").empty());
}

// 0 is "none".
template <typename Rows>
std::set<int> codes(const Rows& rows) {
  std::set<int> all{0};
  for (const auto& row : rows) all.insert(row.code);
  return all;
}

std::set<int> numbers(const catalogue::TerminalWords* terminal) {
  std::set<int> all;
  for (const catalogue::NamedNumber& word : terminal->words) all.insert(word.number);
  return all;
}

TEST(Catalogue, NamesTheFunctionWordsThatTheIsmkHas) {
  EXPECT_EQ(numbers(catalogue::find_terminal("ismk", 0x2010, 0x03)), codes(products::ismk::input_functions));
  EXPECT_EQ(numbers(catalogue::find_terminal("ismk", 0x2010, 0x0F)), codes(products::ismk::output_functions));
}

}  // namespace
}  // namespace catalogue_test
}  // namespace servodrome::line
