#include "line/pacing/vigil.hpp"

#include <gtest/gtest.h>

namespace servodrome::line {
namespace vigil_test {
namespace {

using namespace std::chrono_literals;

class Awaiting : public testing::Test {
 protected:
  // Frames at intervals of `gap`.
  void frames(int count, Vigil::Moment::duration gap) {
    for (int i = 0; i < count; ++i) vigil.served(now += gap);
  }

  Vigil::Moment now = Vigil::Moment(1234s);
  Vigil vigil;
};

TEST_F(Awaiting, AMasterThatAnswersAtOnceIsAwaitedAwake) {
  frames(1, 0s);  // no frame came before the first one
  frames(Vigil::proof - 1, 50us);
  EXPECT_FALSE(vigil.worthwhile());
  frames(1, 100us);
  EXPECT_TRUE(vigil.worthwhile());
  EXPECT_FALSE(vigil.over(now + 100us));
  EXPECT_TRUE(vigil.over(now + 101us));
}

TEST_F(Awaiting, ACycleOfAMillisecondIsAwaitedAsleep) {
  frames(1000, 1ms);
  EXPECT_FALSE(vigil.worthwhile());
  for (int i = 0; i < 1000; ++i) {  // two frames each
    frames(1, 1ms);
    frames(1, 20us);
    EXPECT_FALSE(vigil.worthwhile());
  }
}

TEST_F(Awaiting, AMasterThatPausesHasToProveItAgain) {
  frames(20, 10us);
  ASSERT_TRUE(vigil.worthwhile());
  frames(1, 101us);
  EXPECT_FALSE(vigil.worthwhile());
  frames(Vigil::proof, 10us);
  EXPECT_TRUE(vigil.worthwhile());
  vigil.in_vain();
  EXPECT_FALSE(vigil.worthwhile());
}

// Answering many frames at once may take longer than the wait for a frame.
TEST_F(Awaiting, WhoIsAwakeIsNotPutToSleepByItsOwnWork) {
  frames(20, 10us);
  vigil.answered(now += 5ms);
  EXPECT_TRUE(vigil.worthwhile());
  EXPECT_FALSE(vigil.over(now + 100us));
  EXPECT_TRUE(vigil.over(now + 101us));
}

TEST_F(Awaiting, WhereOthersComputeWithoutEndItSleeps) {
  frames(20, 10us);
  vigil.lent(1ms);
  EXPECT_TRUE(vigil.worthwhile());
  vigil.lent(1001us);
  vigil.in_vain();  // again no frame came
  frames(Vigil::respite + Vigil::proof - 1, 10us);
  EXPECT_FALSE(vigil.worthwhile());
  frames(1, 10us);
  EXPECT_TRUE(vigil.worthwhile());
}

}  // namespace
}  // namespace vigil_test
}  // namespace servodrome::line
