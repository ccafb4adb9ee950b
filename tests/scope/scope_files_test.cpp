// Files and pictures of a recording.
#include <cstring>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>

#include "scope/files.hpp"
#include "scope/recordings.hpp"

namespace servodrome::scope {
namespace scope_files_test {
namespace {

using namespace std::chrono_literals;
using test::made_of;
using test::recorded;
using test::two_channels;
using testing::ElementsAre;
using testing::HasSubstr;

Recording of_two_groups() {
  Recording recording{.channels = two_channels(),
                      .groups = {1, 0},
                      .group_count = 2,
                      .zero = 2s,
                      .triggered = true,
                      .source = "mem: <1> & \"2\"",
                      .way = "SDO",
                      .zero_unix_ns = 1'700'000'000'000'000'000};
  for (int i = -1; i <= 1; ++i) {
    recording.times.insert(recording.times.end(), {2s + i * 4ms, 2s + i * 4ms + 1500us});
    recording.values.insert(recording.values.end(), {100.5 * i, 55});
  }
  return recording;
}

TEST(ScopeCsv, HasALineForEachRow) {
  EXPECT_EQ(csv_of(recorded({.duration = 2ms}, 10)),
            "seconds,position [pos],statusword\n0.000000000,0,0\n0.001000000,1,10\n");
  EXPECT_EQ(csv_of(of_two_groups()),
            "seconds,statusword,seconds_position,position [pos]\n"
            "-0.004000000,55,-0.002500000,-100.5\n0.000000000,55,0.001500000,0\n0.004000000,55,0.005500000,100.5\n");
}

// Reads the records by the specification.
TEST(ScopeMcap, IsAChainOfRecords) {
  const std::string file = mcap_of(of_two_groups());
  ASSERT_EQ(file.substr(0, 8), "\x89MCAP0\r\n");
  ASSERT_EQ(file.substr(file.size() - 8), "\x89MCAP0\r\n");
  std::map<unsigned, int> kinds;
  std::size_t at = 8;
  std::map<std::size_t, unsigned> starts;
  while (at + 9 <= file.size() - 8) {
    std::uint64_t length = 0;
    std::memcpy(&length, &file[at + 1], sizeof length);
    ASSERT_LE(length, file.size() - at);
    starts[at] = static_cast<unsigned char>(file[at]);
    ++kinds[static_cast<unsigned char>(file[at])];
    at += 9 + length;
  }
  EXPECT_EQ(at, file.size() - 8);
  EXPECT_EQ(kinds[0x01], 1);
  EXPECT_EQ(kinds[0x06], 1) << "a chunk";
  EXPECT_EQ(kinds[0x07], 2) << "an index for each topic";
  EXPECT_EQ(kinds[0x03], 2);
  EXPECT_EQ(kinds[0x0F], 1);
  EXPECT_EQ(kinds[0x02], 1);
  std::uint64_t summary = 0, offsets = 0;
  std::memcpy(&summary, &file[file.size() - 8 - 20], sizeof summary);
  std::memcpy(&offsets, &file[file.size() - 8 - 12], sizeof offsets);
  EXPECT_EQ(starts[summary], 0x03U);
  EXPECT_EQ(starts[offsets], 0x0EU);
  EXPECT_THAT(file, HasSubstr("{\"position\":-100.5}"));
  EXPECT_THAT(file, HasSubstr("\"description\":\"pos\""));
}

TEST(ScopeMcap, LongOnesAreOfSeveralChunks) {
  const std::string file = mcap_of(recorded({}, 60000));
  int chunks = 0;
  for (std::size_t at = 8; at + 9 <= file.size() - 8;) {
    std::uint64_t length = 0;
    std::memcpy(&length, &file[at + 1], sizeof length);
    chunks += file[at] == 0x06;
    at += 9 + length;
  }
  EXPECT_GT(chunks, 2);
}

TEST(ScopePicture, PutsChannelsOfAUnitTogether) {
  const std::vector<Channel> channels{{"a", "pos"}, {"b", ""}, {"c", "pos"}, {"d", ""}};
  EXPECT_THAT(panels_of(channels), ElementsAre(ElementsAre(0U, 2U), ElementsAre(1U), ElementsAre(3U)));
}

TEST(ScopePicture, HasRoundScales) {
  EXPECT_THAT(round_ticks(0, 1, 5).at, ElementsAre(0, testing::DoubleEq(0.2), testing::DoubleEq(0.4),
                                                   testing::DoubleNear(0.6, 1e-12), testing::DoubleEq(0.8), 1));
  EXPECT_THAT(round_ticks(-7, 12, 4).at, ElementsAre(-5, 0, 5, 10));
  EXPECT_THAT(round_ticks(99, 301, 5).at, ElementsAre(100, 150, 200, 250, 300));
  EXPECT_EQ(round_ticks(3, 3, 4).at.size(), 1U);
}

TEST(ScopePicture, ShowsEveryChannelAndTheTrigger) {
  const std::string svg = svg_of(of_two_groups());
  EXPECT_THAT(svg, HasSubstr(">position</text>"));
  EXPECT_THAT(svg, HasSubstr(">statusword</text>"));
  EXPECT_THAT(svg, HasSubstr("seconds from the trigger"));
  EXPECT_THAT(svg, HasSubstr("mem: &lt;1&gt; &amp; &quot;2&quot;"));
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  // A peak of one sample must be visible, regardless of the number of rows.
  std::vector<double> flat(200'000, 0.0);
  flat[123'456] = 1000;
  const std::string many = svg_of(made_of(flat, 10us));
  EXPECT_LT(many.size(), 200'000U);
  EXPECT_THAT(many, HasSubstr(">1000</text>"));
  const std::size_t peak = many.find(",66.");  // near the upper edge of the panel, which is at 56
  EXPECT_NE(peak, std::string::npos);
  EXPECT_NE(svg_of(Recording{}).find("</svg>"), std::string::npos);
}

TEST(ScopePicture, LeavesAGapWhereSamplesAreMissing) {
  Recording recording = recorded({.duration = 10ms}, 100);
  recording.period = 1ms;
  const auto lines = [](const std::string& svg) {
    std::size_t count = 0;
    for (std::size_t at = svg.find("<polyline"); at != std::string::npos; at = svg.find("<polyline", at + 1)) ++count;
    return count;
  };
  EXPECT_EQ(lines(svg_of(recording)), 2U);
  for (std::size_t row = 5; row < 10; ++row) recording.times[row] += 20ms;
  EXPECT_EQ(lines(svg_of(recording)), 4U);
}

TEST(ScopePicture, IsDrawnInDots) {
  const std::string plot = terminal_plot_of(recorded({.duration = 3ms}, 10), 2, 2);
  // Three samples from the lower left to the upper right corner of 4 by 8 dots.
  EXPECT_THAT(plot, HasSubstr("position [pos]\n"));
  EXPECT_THAT(plot, HasSubstr("           2 "));
  EXPECT_THAT(plot, HasSubstr("           0 "));
  EXPECT_THAT(plot, HasSubstr("0.002 s"));
  EXPECT_EQ(terminal_plot_of(Recording{}, 10, 4), "");
}

TEST(ScopeNumber, HasAShortText) {
  EXPECT_EQ(text_of_number(-131072), "-131072");
  EXPECT_EQ(text_of_number(0.25), "0.25");
}

}  // namespace
}  // namespace scope_files_test
}  // namespace servodrome::scope
