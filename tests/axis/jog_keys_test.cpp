#include "axis/jog_keys.hpp"

#include <gtest/gtest.h>
#include <limits>

namespace servodrome::master {
namespace jog_keys_test {
namespace {

using namespace std::chrono_literals;

TEST(JogKeys, AHeldKeyMovesAndOneThatIsLetGoStops) {
  JogKeys keys(1000, 600ms);
  EXPECT_EQ(keys.velocity(0ms), 0);
  keys.feed("\x1b[C", 10ms);  // right
  EXPECT_EQ(keys.velocity(20ms), 1000);
  EXPECT_EQ(keys.velocity(609ms), 1000);
  EXPECT_EQ(keys.velocity(610ms), 0);
  keys.feed("\x1b[D\x1b[D", 700ms);  // left, repeated
  EXPECT_EQ(keys.velocity(700ms), -1000);
  keys.feed("\x1bOD", 1200ms);
  EXPECT_EQ(keys.velocity(1700ms), -1000);
  keys.feed("l", 1750ms);
  EXPECT_EQ(keys.velocity(1750ms), 1000);
  keys.feed(" ", 1760ms);
  EXPECT_EQ(keys.velocity(1760ms), 0);
}

TEST(JogKeys, UpAndDownChangeTheVelocityWithinBounds) {
  JogKeys keys(100, 600ms);
  keys.feed("l\x1b[A", 0ms);
  EXPECT_EQ(keys.velocity(0ms), 200);
  keys.feed("kkkkkkkk", 1ms);
  EXPECT_EQ(keys.velocity(1ms), 1600);
  EXPECT_EQ(keys.velocity(650ms), 0) << "they do not hold a direction";
  keys.feed("jjjjjjjjjjjj-", 700ms);
  EXPECT_EQ(keys.velocity(700ms), -6) << "100/16, rounded";
  EXPECT_EQ(keys.speed(), 6);
}

TEST(JogKeys, TheKeysSelectTheDirectionWhateverTheSignOfTheVelocity) {
  JogKeys keys(-1000, 600ms);
  keys.feed("\x1b[C", 0ms);  // right
  EXPECT_EQ(keys.velocity(0ms), 1000);
  keys.feed("\x1b[D", 1ms);  // left
  EXPECT_EQ(keys.velocity(1ms), -1000);
}

TEST(JogKeys, EndsOnSeveralKeysAndForGood) {
  for (const char* end : {"q", "\x03", "\x04", "\x1b"}) {
    JogKeys keys(1, 600ms);
    keys.feed("l", 0ms);
    keys.feed(end, 1ms);
    EXPECT_FALSE(keys.velocity(2ms));
    keys.feed("l", 3ms);
    EXPECT_FALSE(keys.velocity(3ms));
  }
}

TEST(JogKeys, NoVelocityOverflows) {
  JogKeys keys(std::numeric_limits<std::int32_t>::min(), 600ms);
  keys.feed("-kkkk", 0ms);
  EXPECT_EQ(keys.velocity(0ms), -std::numeric_limits<std::int32_t>::max());
  keys.feed("\x1b[Z", 1ms);  // another function key stops
  EXPECT_EQ(keys.velocity(1ms), 0);
}

}  // namespace
}  // namespace jog_keys_test
}  // namespace servodrome::master
