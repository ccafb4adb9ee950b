#include "line/registry.hpp"

#include <atomic>
#include <gtest/gtest.h>
#include <thread>

#include "line/support.hpp"

namespace servodrome::line {
namespace registry_test {
namespace {

using namespace std::chrono_literals;

constexpr std::string_view one_axis = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[axis]]
name = "x"
product = "ismc-of-two-threads"
node = 1
)";

// The data sheet is created lazily and shared by all lines. The thread that creates it waits for the other thread, so
// that without a lock both would create it at the same time.
TEST(Registry, TwoThreadsThatBuildALineMakeTheDataSheetOnce) {
  std::atomic<bool> builds = false;
  std::atomic<unsigned> made = 0;
  Product product = *find_product(all_products(), "ismc");
  const std::string expected = describe::eds(product.describe());
  product.name = "ismc-of-two-threads";
  product.describe = [&builds, &made, describe = product.describe] {
    if (builds) ++made;
    const auto give_up = std::chrono::steady_clock::now() + 200ms;
    while (builds && made < 2 && std::chrono::steady_clock::now() < give_up) std::this_thread::yield();
    return describe();
  };
  const std::array products{product};
  const LineSettings settings = test::settings_of(one_axis, products);
  builds = true;
  const auto build_a_line = [&settings] { const Line line{settings}; };
  std::thread other(build_a_line);
  build_a_line();
  other.join();
  EXPECT_EQ(made, 1U);
  const std::span<const std::byte> sheet = data_sheet(products[0]);
  EXPECT_EQ(std::string_view(reinterpret_cast<const char*>(sheet.data()), sheet.size()), expected);
}

}  // namespace
}  // namespace registry_test
}  // namespace servodrome::line
