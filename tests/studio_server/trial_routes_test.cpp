// A trial on a running line, over the bench API.
#include "studio/trial_routes.hpp"

#include <array>
#include <cstdlib>
#include <gtest/gtest.h>
#include <new>
#include <nlohmann/json.hpp>

#include "line/bench/line_bench.hpp"
#include "line/support.hpp"
#include "master/restored.hpp"

namespace {
// Refuses large blocks of memory, such as that of the record of a trial.
bool is_memory_short = false;
}  // namespace

// Not inlined, because GCC 12 would otherwise report new and delete as mismatched.
[[gnu::noinline]] void* operator new(std::size_t size) {
  constexpr std::size_t large = std::size_t{1} << 20;
  void* memory = is_memory_short && size >= large ? nullptr : std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
// std::stable_sort asks for its buffer this way. AddressSanitizer would otherwise report its own new and our delete as
// mismatched.
[[gnu::noinline]] void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return std::malloc(size); }
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace servodrome::studio {
namespace trial_routes_test {
namespace {

using api::Method;

class Trials : public testing::Test {
 protected:
  unsigned ask(Method method, const std::string& target, const std::string& title = {}) {
    const std::array groups{scenarios.group(), trials.group()};
    std::string body;
    if (!title.empty()) body = nlohmann::json{{"text", "title = \"" + title + "\"\n"}}.dump();
    const api::Response response =
        line::bench::begin(line, {.method = method, .target = "/api/v1/" + target, .body = body}, groups);
    answer = response.body;
    return response.status;
  }

  line::Line line{line::test::settings_of(line::test::two_axes)};
  scenario::Routes scenarios{line};
  TrialRoutes trials{line, scenarios};
  std::string answer;
};

TEST_F(Trials, NoOtherScenarioBeginsUntilItsEnd) {
  EXPECT_EQ(ask(Method::put, "trial", "trial"), 200U) << answer;
  EXPECT_EQ(ask(Method::put, "scenario", "other"), 409U);
  EXPECT_EQ(ask(Method::delete_, "scenario"), 409U);
  EXPECT_EQ(ask(Method::delete_, "trial"), 200U) << answer;
  EXPECT_EQ(ask(Method::put, "scenario", "other"), 200U) << answer;
}

// Neither does one that takes the place of another trial.
TEST_F(Trials, OneThatCannotBeRecordedBlocksNothing) {
  for (const bool is_second : {false, true}) {
    if (is_second) {
      ASSERT_EQ(ask(Method::put, "trial", "trial"), 200U) << answer;
    }
    {
      const master::Restored memory(is_memory_short, true);
      EXPECT_EQ(ask(Method::put, "trial", "trial"), 500U);
    }
    EXPECT_EQ(ask(Method::delete_, "trial"), 409U);
    EXPECT_EQ(ask(Method::put, "scenario", "other"), 200U) << answer;
    EXPECT_EQ(ask(Method::delete_, "scenario"), 200U) << answer;
    EXPECT_EQ(ask(Method::put, "trial", "trial"), 200U) << answer;
    EXPECT_EQ(ask(Method::delete_, "trial"), 200U) << answer;
  }
}

}  // namespace
}  // namespace trial_routes_test
}  // namespace servodrome::studio
