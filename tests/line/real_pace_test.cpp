#include "line/pacing/real_pace.hpp"

#include <gtest/gtest.h>

namespace servodrome::line {
namespace real_pace_test {
namespace {

using namespace std::chrono_literals;

class Paced : public testing::Test {
 protected:
  // Runs the line to the time that is due `passed` after the start.
  Time run_at(Time passed) { return line_now = pace.due(start + passed, line_now); }

  RealPace::Moment start = RealPace::Moment(1234ms);
  Time line_now = 5ms;  // the line has run before
  RealPace pace = [this] {
    RealPace begun;
    begun.begin(start, line_now);
    return begun;
  }();
};

TEST_F(Paced, FollowsTheClock) {
  EXPECT_EQ(run_at(0ms), 5ms);
  EXPECT_EQ(run_at(1ms), 6ms);
  EXPECT_EQ(run_at(21ms), 26ms) << "20 ms are caught up with";
  EXPECT_EQ(pace.given_up(), 0ms);
  EXPECT_EQ(pace.moment_of(30ms), start + 25ms);
}

TEST_F(Paced, NeverGoesBack) {
  run_at(10ms);
  EXPECT_EQ(run_at(9ms), 15ms);
  line_now += 3ms;  // a request has advanced the line
  EXPECT_EQ(run_at(11ms), 18ms);
}

TEST_F(Paced, GivesUpWhatIsTooMuch) {
  run_at(10ms);
  EXPECT_EQ(run_at(10ms + 95ms + 300us), 15ms + 3ms + 300us) << "four times 23 are given up";
  EXPECT_EQ(pace.given_up(), 92ms);
  EXPECT_EQ(run_at(10ms + 96ms), 15ms + 4ms) << "and stay so";
  EXPECT_EQ(pace.given_up(), 0ms);
  EXPECT_EQ(pace.moment_of(19ms), start + 106ms);
}

TEST_F(Paced, ANapIsNoPause) {
  constexpr Time nap = 10ms;
  EXPECT_EQ(pace.due(start + 30ms, 5ms, nap), 35ms) << "20 ms too late out of a nap";
  EXPECT_EQ(pace.given_up(), 0ms);
  EXPECT_EQ(pace.due(start + 31ms, 5ms, nap), 8ms);
  EXPECT_EQ(pace.given_up(), 28ms);
}

TEST_F(Paced, IsNeverFurtherBehindThanSaid) {
  for (Time pause = 0ms; pause < 500ms; pause += 1700us) {
    const Time before = line_now;
    const Time after = pace.due(start += pause, before);
    EXPECT_LE(after - before, RealPace::most_behind);
    EXPECT_EQ(pace.given_up() % RealPace::step, 0ms);
    EXPECT_EQ(after - before + pace.given_up(), pause);
    line_now = after;
  }
}

}  // namespace
}  // namespace real_pace_test
}  // namespace servodrome::line
