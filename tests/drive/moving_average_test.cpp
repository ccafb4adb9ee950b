#include "drive/moving_average.hpp"

#include <deque>
#include <gtest/gtest.h>
#include <numeric>
#include <random>

namespace servodrome::drive {
namespace moving_average_test {
namespace {

// Compared with the sum over a queue, for any signal and any length.
TEST(MovingAverage, IsTheMeanOfTheLastValues) {
  for (const std::size_t length :
       {std::size_t{1}, std::size_t{2}, std::size_t{7}, std::size_t{255}, MovingAverage::longest}) {
    std::mt19937 random(static_cast<std::uint32_t>(length));
    MovingAverage average;
    std::int64_t value = std::int64_t{1} << 50;
    average.begin(value, length);
    EXPECT_EQ(average.length(), length);
    std::deque<std::int64_t> last(length, value);
    for (int i = 0; i < 5000; ++i) {
      value += static_cast<std::int64_t>(random() % 2'000'000'000U) - 900'000'000;
      last.push_back(value);
      last.pop_front();
      const std::int64_t newest = value;
      const auto below = [newest](std::int64_t sum, std::int64_t one) { return sum + one - newest; };
      const std::int64_t sum = std::accumulate(last.begin(), last.end(), std::int64_t{0}, below);
      ASSERT_EQ(average.update(value), newest + sum / static_cast<std::int64_t>(length)) << i;
    }
  }
}

TEST(MovingAverage, ArrivesExactlyAfterItsLength) {
  MovingAverage average;
  average.begin(0, 10);
  for (int i = 1; i < 10; ++i) EXPECT_EQ(average.update(1000), 100 * i);
  EXPECT_EQ(average.update(1000), 1000);
  EXPECT_EQ(average.update(1000), 1000);
}

}  // namespace
}  // namespace moving_average_test
}  // namespace servodrome::drive
