// Triggers: their text, and the samples at which they fire.
#include <cmath>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <vector>

#include "scope/trigger.hpp"

namespace servodrome::scope {
namespace scope_trigger_test {
namespace {

using testing::HasSubstr;

TEST(ScopeTrigger, IsReadAsItIsWritten) {
  struct Row {
    const char* text;
    const char* channel;
    Condition condition;
    double value;
  };
  const Row rows[] = {
      {"position_actual > 1000", "position_actual", Condition::greater, 1000},
      {"position<=-1.5", "position", Condition::at_most, -1.5},
      {"  6064 >= 0x10 ", "6064", Condition::at_least, 16},
      {"Position actual value rises 0", "Position actual value", Condition::rises, 0},
      {"torque falls -20", "torque", Condition::falls, -20},
      {"statusword has 0400h", "statusword", Condition::has, 1024},
      {"statusword sets 8", "statusword", Condition::sets, 8},
      {"6041 lacks 0x40", "6041", Condition::lacks, 64},
      {"603F != 0", "603F", Condition::not_equal, 0},
      {"6061 == 8", "6061", Condition::equal, 8},
      {"mode changes", "mode", Condition::changes, 0},
      {"6061 becomes 6", "6061", Condition::becomes, 6},
      {"603F appears", "603F", Condition::appears, 0},
      {"fault", "statusword", Condition::sets, 8},
  };
  for (const Row& row : rows) {
    const TriggerText trigger = parse_trigger(row.text);
    EXPECT_EQ(trigger.channel, row.channel) << row.text;
    EXPECT_EQ(trigger.trigger.condition, row.condition) << row.text;
    EXPECT_EQ(trigger.trigger.value, row.value) << row.text;
  }
  for (const char* text : {"", "position", "> 3", "position >", "position > fast", "position > nan", " changes"}) {
    EXPECT_THAT([&] { parse_trigger(text); },
                testing::Throws<TriggerError>(testing::Property(&TriggerError::hint, HasSubstr("write CHANNEL"))))
        << text;
  }
}

struct FiringRow {
  Condition condition;
  double value;
  std::vector<double> samples;
  int at;  // sample at which the trigger fires; -1: never
};

int fires_at(const FiringRow& row) {
  const Trigger trigger{row.condition, row.value};
  std::optional<double> before;
  for (std::size_t i = 0; i < row.samples.size(); ++i) {
    if (trigger.fires(before, row.samples[i])) return static_cast<int>(i);
    before = trigger.next_before(before, row.samples[i]);
  }
  return -1;
}

TEST(ScopeTrigger, FiresWhereItSays) {
  const FiringRow rows[] = {
      {Condition::rises, 10, {20, 5, 9, 10, 30}, 3},
      {Condition::rises, 10, {20, 30}, -1},
      {Condition::falls, 10, {5, 20, 11, 9}, 3},
      {Condition::greater, 10, {20}, 0},
      {Condition::greater, 10, {10, 11}, 1},
      {Condition::at_least, 10, {9, 10}, 1},
      {Condition::less, 0, {0, -1}, 1},
      {Condition::at_most, 0, {1, 0}, 1},
      {Condition::equal, 3, {2, 4, 3}, 2},
      {Condition::not_equal, 3, {3, 3, 4}, 2},
      {Condition::changes, 0, {7, 7, 8}, 2},
      {Condition::changes, 0, {7, 7, 7}, -1},
      {Condition::becomes, 8, {8, 8, 6, 8}, 3},
      {Condition::becomes, 8, {6, 7}, -1},
      {Condition::appears, 0, {0, 0, 0x7300}, 2},
      {Condition::appears, 0, {0x7300, 0}, -1},
      {Condition::sets, 8, {0x0F, 0x07, 0x07, 0x0F}, 3},
      {Condition::sets, 8, {0x0F, 0x0F}, -1},
      {Condition::has, 0x0C, {0x08, 0x04, 0x0D}, 2},
      {Condition::lacks, 0x0C, {0x08, 0x03}, 1},
      {Condition::sets, 1e300, {0, 1e300}, -1},  // no bits
      {Condition::sets, 0x1p63, {0, 0x1p63}, 1},
  };
  for (const FiringRow& row : rows) EXPECT_EQ(fires_at(row), row.at) << word_of(row.condition) << " " << row.value;
}

// An axis without power has values that are not numbers. A level, an edge and a bit ignore them; a state that comes
// back, and a fault at power-on, are new.
TEST(ScopeTrigger, IgnoresWhatIsNoNumber) {
  const double off = std::nan("");
  const FiringRow rows[] = {
      {Condition::rises, 10, {5, off, off, 20}, 3},
      {Condition::falls, 10, {20, off, 5}, 2},
      {Condition::sets, 8, {0, off, 8}, 2},
      {Condition::sets, 8, {off, 8}, -1},
      {Condition::not_equal, 3, {3, off, 3}, -1},
      {Condition::changes, 0, {7, off, 7}, 2},
      {Condition::becomes, 7, {7, off, 7}, 2},
      {Condition::appears, 0, {0x10, off, 0x10}, 2},
      {Condition::now, 0, {off}, 0},
  };
  for (const FiringRow& row : rows) EXPECT_EQ(fires_at(row), row.at) << word_of(row.condition) << " " << row.value;
}

TEST(ScopeTrigger, EveryConditionHasAWord) {
  for (int i = 0; i <= static_cast<int>(Condition::at_least); ++i) {
    const auto condition = static_cast<Condition>(i);
    EXPECT_EQ(condition_of(word_of(condition)), condition);
  }
  EXPECT_EQ(condition_of("rise"), std::nullopt);
}

}  // namespace
}  // namespace scope_trigger_test
}  // namespace servodrome::scope
