// The recorder: where a recording begins and ends.
#include <gtest/gtest.h>

#include "scope/recordings.hpp"

namespace servodrome::scope {
namespace scope_recorder_test {
namespace {

using namespace std::chrono_literals;
using test::recorded;

TEST(ScopeRecorder, WithoutATriggerFromTheFirstSampleOn) {
  const Recording all = recorded({.duration = 10ms}, 100);
  EXPECT_EQ(all.rows(), 10U);
  EXPECT_EQ(all.zero, 5s);
  EXPECT_EQ(all.value(9, 1), 90);
  EXPECT_DOUBLE_EQ(all.seconds(9, 0), 0.009);
  EXPECT_DOUBLE_EQ(all.rate_hz(), 1000);
  EXPECT_EQ(recorded({}, 100).rows(), 100U) << "until somebody ends it";
}

TEST(ScopeRecorder, KeepsWhatWasBeforeTheTrigger) {
  const Trigger trigger{Condition::rises, 500};
  const Recording recording = recorded({.duration = 20ms, .pre = 5ms, .trigger = trigger, .trigger_channel = 1}, 200);
  ASSERT_EQ(recording.rows(), 25U);
  EXPECT_TRUE(recording.triggered);
  EXPECT_EQ(recording.value(0, 0), 45);
  EXPECT_EQ(recording.time(0, 0), -5ms);
  EXPECT_EQ(recording.value(5, 0), 50);
  EXPECT_EQ(recording.time(5, 0), 0ms);
  EXPECT_EQ(recording.value(24, 0), 69);
  EXPECT_EQ(recorded({.duration = 20ms, .trigger = trigger, .trigger_channel = 1}, 200).value(0, 0), 50)
      << "nothing before it";
  EXPECT_EQ(recorded({.duration = 20ms, .pre = 1s, .trigger = trigger, .trigger_channel = 1}, 200).value(0, 0), 0)
      << "all there was";
}

TEST(ScopeRecorder, OneThatWasNotTriggeredHasTheLastRows) {
  const Recording recording = recorded({.pre = 5ms, .trigger = {Condition::greater, 1e6}}, 100);
  EXPECT_FALSE(recording.triggered);
  EXPECT_EQ(recording.rows(), 6U);
  EXPECT_EQ(recording.value(5, 0), 99);
}

TEST(ScopeRecorder, EndsWhenItIsFull) { EXPECT_EQ(recorded({.most_values = 50}, 100).rows(), 25U); }

}  // namespace
}  // namespace scope_recorder_test
}  // namespace servodrome::scope
