// Only the traffic around the events of a trial is kept; the record of the rules' actions is limited.
#include "scenario/excerpt.hpp"

#include "scenario/support.hpp"

namespace servodrome::scenario::test {
namespace {

std::vector<TrafficLine> excerpt_of(std::vector<Moment> moments, int lines) {
  Excerpt excerpt(std::move(moments));
  for (int n = 0; n < lines; ++n) {
    TrafficLine line;
    line.at = n * 1ms;
    line.text = std::to_string(n);
    excerpt.add(line);
  }
  return excerpt.finish();
}

std::vector<std::string> texts(const std::vector<TrafficLine>& lines) {
  std::vector<std::string> all;
  for (const TrafficLine& line : lines) all.push_back(line.text);
  return all;
}

TEST(Excerpt, FortyLinesBeforeAMomentAndTwentyBehind) {
  const auto lines = excerpt_of({{100ms, "here"}}, 1000);
  ASSERT_EQ(lines.size(), 1 + Excerpt::lines_before + 1 + Excerpt::lines_behind);
  EXPECT_EQ(lines[0].kind, TrafficLine::Kind::gap);
  EXPECT_EQ(lines[0].text, "61 lines are left out");
  EXPECT_EQ(lines[1].text, "61");
  EXPECT_EQ(lines[40].text, "100");
  EXPECT_EQ(lines[41].kind, TrafficLine::Kind::moment);
  EXPECT_EQ(lines[41].text, "here");
  EXPECT_EQ(lines.back().text, "120");
}

TEST(Excerpt, NearMomentsShareTheirLines) {
  const auto lines = excerpt_of({{2ms, "a"}, {4ms, "b"}}, 7);
  EXPECT_EQ(texts(lines), (std::vector<std::string>{"0", "1", "2", "a", "3", "4", "b", "5", "6"}));
}

TEST(Excerpt, AMomentBehindTheLastLineHasTheLinesBeforeIt) {
  const auto lines = excerpt_of({{1h, "end"}}, 50);
  ASSERT_EQ(lines.size(), 1 + Excerpt::lines_before + 1);
  EXPECT_EQ(lines[1].text, "10");
  EXPECT_EQ(lines.back().text, "end");
}

TEST(Excerpt, WithoutMomentsNothingIsShown) { EXPECT_TRUE(excerpt_of({}, 100).empty()); }

TEST(ActLog, SaysWhatBecameOfAMessage) {
  Stage stage(R"(
[[rule]]
name = "late"
on = { message = "sdo_answer", object = "1000" }
do = "delay"
ms = 5
[[rule]]
name = "other"
on = { message = "sdo_request", object = "1018:01" }
do = "alter"
byte = 3
set = 2
[[rule]]
name = "lie"
do = "show"
object = "6041"
value = 0
)");
  stage.read(0x1000);
  stage.read(0x1018, 1);
  const std::vector<ActRecord> acts = stage.director.acts();
  ASSERT_EQ(acts.size(), 3U);
  EXPECT_EQ(acts[0].what, "show 6041h:00");
  EXPECT_TRUE(acts[0].raw.empty());
  EXPECT_EQ(acts[1].what, "delay sdo_answer 1000h:00");
  EXPECT_EQ(acts[1].result, "passes: the same 5.0 ms later");
  EXPECT_EQ(acts[1].axis, "x");
  ASSERT_TRUE(acts[1].frame);
  EXPECT_EQ(acts[1].frame->id, 0x581U);
  EXPECT_EQ(acts[2].raw, "40 18 10 01 00 00 00 00");
  EXPECT_EQ(acts[2].result, "passes: 40 18 10 02 00 00 00 00");
}

TEST(ActLog, KeepsTheFirstAndTheLatestActs) {
  Stage stage("[[rule]]\non = { message = \"sdo_answer\" }\ndo = \"delay\"\nms = 0.1\n");
  const std::size_t all = ActLog::first_of_each + ActLog::latest + 10;
  for (std::size_t n = 0; n < all; ++n) stage.sdo(line::test::sdo_read(1, 0x1000, 0), 1ms);
  const std::vector<ActRecord> acts = stage.director.acts();
  EXPECT_EQ(stage.director.rules().front().acts, all);
  ASSERT_EQ(acts.size(), ActLog::first_of_each + ActLog::latest);
  EXPECT_LT(acts.front().at, 2ms);
  EXPECT_GT(acts.back().at, Time(1ms) * static_cast<std::int64_t>(all - 1));
}

}  // namespace
}  // namespace servodrome::scenario::test
