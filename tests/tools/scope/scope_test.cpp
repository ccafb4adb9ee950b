// Parts of a recording without a bus: names, triggers, recorder, measurements, files.
#include <cmath>
#include <cstring>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <map>
#include <numbers>

#include "master/problem_of.hpp"
#include "tools/scope/export.hpp"
#include "tools/scope/measurements.hpp"
#include "tools/scope/recorder.hpp"

namespace servodrome::master::scope {
namespace scope_test {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

using master::test::problem_of;

TEST(ScopeChannel, IsFoundByItsNames) {
  const ObjectCatalogue& catalogue = ObjectCatalogue::standard();
  for (const char* text : {"position", "position_actual", "Position actual value", "6064", "6064:00", "0x6064"}) {
    const Channel channel = named_channel(text, catalogue);
    EXPECT_EQ(channel.object, (ObjectAddress{0x6064, 0})) << text;
    EXPECT_EQ(channel.name, "position_actual_value") << text;
    EXPECT_EQ(channel.type, dictionary::Type::integer32) << text;
    EXPECT_EQ(channel.unit, "pos") << text;
  }
  EXPECT_EQ(named_channel("following_error", catalogue).object.index, 0x60F4);
  EXPECT_EQ(named_channel("6099:01", catalogue).name, "homing_speeds_speed_during_search_for_switch");
  const Channel vendor = named_channel("2105:01@i16", catalogue);
  EXPECT_EQ(vendor.name, "2105_01");
  EXPECT_EQ(vendor.type, dictionary::Type::integer16);
  EXPECT_THAT(problem_of([&] { named_channel("2105:01@string", catalogue); }), HasSubstr("not a numeric type"));
  EXPECT_THAT(problem_of([&] { named_channel("pozition", catalogue); }), HasSubstr("\"pozition\""));
}

TEST(ScopeChannel, NumbersHaveTheirSignAndLength) {
  using dictionary::Type;
  EXPECT_EQ(number_of(Type::integer32, 0xFFFFFFFF, 32), -1);
  EXPECT_EQ(number_of(Type::integer32, 0xFFFF8000, 16), -32768) << "a mapped length shorter than the object";
  EXPECT_EQ(number_of(Type::unsigned16, 0xFFFFFFFF, 16), 65535);
  EXPECT_EQ(number_of(Type::integer64, ~std::uint64_t{0}, 64), -1);
  EXPECT_EQ(number_of(Type::real32, 0x3FC00000, 32), 1.5);
  EXPECT_EQ(number_of(Type::boolean, 1, 8), 1);
  EXPECT_EQ(text_of_number(-131072), "-131072");
  EXPECT_EQ(text_of_number(0.25), "0.25");
}

TEST(ScopeChannel, SixteenAndEachOnce) {
  std::vector<Channel> channels;
  for (std::uint8_t i = 0; i < most_channels; ++i) {
    EXPECT_EQ(add_channel(channels, {.object = {0x2000, i}, .name = "same"}), i);
  }
  EXPECT_EQ(add_channel(channels, {.object = {0x2000, 3}, .name = "same"}), 3U);
  EXPECT_NE(channels[0].name, channels[1].name);
  EXPECT_THAT(problem_of([&] { add_channel(channels, {.object = {0x2001, 0}}); }), HasSubstr("more than 16"));
}

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
      {"fault", "statusword", Condition::sets, 8},
  };
  for (const Row& row : rows) {
    const TriggerText trigger = parse_trigger(row.text);
    EXPECT_EQ(trigger.channel, row.channel) << row.text;
    EXPECT_EQ(trigger.condition, row.condition) << row.text;
    EXPECT_EQ(trigger.value, row.value) << row.text;
  }
  for (const char* text : {"", "position", "> 3", "position >", "position > fast", "position > nan", " changes"}) {
    EXPECT_THAT(problem_of([&] { parse_trigger(text); }), HasSubstr("write CHANNEL")) << text;
  }
}

TEST(ScopeTrigger, FiresWhereItSays) {
  struct Row {
    Condition condition;
    double value;
    std::vector<double> samples;
    int at;  // row at which the trigger fires; -1: never
  };
  const Row rows[] = {
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
      {Condition::sets, 8, {0x0F, 0x07, 0x07, 0x0F}, 3},
      {Condition::sets, 8, {0x0F, 0x0F}, -1},
      {Condition::has, 0x0C, {0x08, 0x04, 0x0D}, 2},
      {Condition::lacks, 0x0C, {0x08, 0x03}, 1},
  };
  for (const Row& row : rows) {
    const Trigger trigger{0, row.condition, row.value};
    std::optional<double> before;
    int at = -1;
    for (std::size_t i = 0; i < row.samples.size() && at < 0; ++i) {
      if (trigger.fires(before, row.samples[i])) at = static_cast<int>(i);
      before = row.samples[i];
    }
    EXPECT_EQ(at, row.at) << static_cast<int>(row.condition) << " " << row.value;
  }
}

std::vector<Channel> two_channels() {
  return {{.object = {0x6064, 0}, .type = dictionary::Type::integer32, .bits = 32, .name = "position", .unit = "pos"},
          {.object = {0x6041, 0}, .type = dictionary::Type::unsigned16, .bits = 16, .name = "statusword"}};
}

// Rows at 1 ms; the first channel is the row number, the second ten times that.
Recording recorded(RecorderOptions options, int rows, Time start = 5s) {
  Recorder recorder(two_channels(), {0, 0}, 1, options);
  for (int i = 0; i < rows && !recorder.done(); ++i) {
    const Time time = start + i * 1ms;
    const double values[] = {static_cast<double>(i), 10.0 * i};
    recorder.take({std::span(&time, 1), values});
  }
  return recorder.recording();
}

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
  const Trigger trigger{1, Condition::rises, 500};
  const Recording recording = recorded({.duration = 20ms, .pre = 5ms, .trigger = trigger}, 200);
  ASSERT_EQ(recording.rows(), 25U);
  EXPECT_TRUE(recording.triggered);
  EXPECT_EQ(recording.value(0, 0), 45);
  EXPECT_EQ(recording.time(0, 0), -5ms);
  EXPECT_EQ(recording.value(5, 0), 50);
  EXPECT_EQ(recording.time(5, 0), 0ms);
  EXPECT_EQ(recording.value(24, 0), 69);
  EXPECT_EQ(recorded({.duration = 20ms, .trigger = trigger}, 200).value(0, 0), 50) << "nothing before it";
  EXPECT_EQ(recorded({.duration = 20ms, .pre = 1s, .trigger = trigger}, 200).value(0, 0), 0) << "all there was";
}

TEST(ScopeRecorder, OneThatWasNotTriggeredHasTheLastRows) {
  const Recording recording = recorded({.pre = 5ms, .trigger = Trigger{0, Condition::greater, 1e6}}, 100);
  EXPECT_FALSE(recording.triggered);
  EXPECT_EQ(recording.rows(), 6U);
  EXPECT_EQ(recording.value(5, 0), 99);
}

TEST(ScopeRecorder, EndsWhenItIsFull) { EXPECT_EQ(recorded({.most_values = 50}, 100).rows(), 25U); }

// ---- Measurements ----

Recording made_of(const std::vector<double>& values, Time period) {
  Recording recording{.channels = {two_channels()[0]}, .groups = {0}, .period = period};
  for (std::size_t i = 0; i < values.size(); ++i) {
    recording.times.push_back(period * static_cast<std::int64_t>(i));
    recording.values.push_back(values[i]);
  }
  return recording;
}

TEST(ScopeMeasurements, OfASine) {
  std::vector<double> sine;
  for (int i = 0; i < 1000; ++i) sine.push_back(3 + 2 * std::sin(2 * std::numbers::pi * i / 100));
  const Measurement measured = measure(made_of(sine, 1ms), 0);
  EXPECT_NEAR(measured.mean, 3, 1e-12);
  EXPECT_NEAR(measured.rms, std::sqrt(9 + 2), 1e-12);
  EXPECT_NEAR(measured.greatest, 5, 1e-12);
  EXPECT_NEAR(measured.least, 1, 1e-12);
  EXPECT_FALSE(measured.step);
}

// A second-order system: overshoot exp(-pi d / sqrt(1 - d^2)); it settles at the last crossing of the 2 % band.
TEST(ScopeMeasurements, OfAStep) {
  constexpr double damping = 0.4;
  constexpr double frequency = 2 * std::numbers::pi * 10;
  const double damped = frequency * std::sqrt(1 - damping * damping);
  std::vector<double> response(400, -50.0);
  const auto exact = [&](double t) {
    return 1 - std::exp(-damping * frequency * t) *
                   (std::cos(damped * t) + damping / std::sqrt(1 - damping * damping) * std::sin(damped * t));
  };
  for (int i = 0; i < 4000; ++i) response.push_back(-50 + 100 * exact(i * 0.1e-3));
  double settled = 0;
  for (int i = 0; i < 4000; ++i) {
    if (std::abs(exact(i * 0.1e-3) - 1) > 0.02) settled = (i + 1) * 0.1e-3;
  }
  double tenth = 0, nine_tenths = 0;
  while (exact(tenth) < 0.1) tenth += 1e-6;
  while (exact(nine_tenths) < 0.9) nine_tenths += 1e-6;
  for (const double sign : {1.0, -1.0}) {
    std::vector<double> signed_response = response;
    for (double& value : signed_response) value *= sign;
    const Measurement measured = measure(made_of(signed_response, 100us), 0);
    ASSERT_TRUE(measured.step);
    EXPECT_NEAR(measured.step->from, sign * -50, 1e-9);
    EXPECT_NEAR(measured.step->to, sign * 50, 1e-2);
    EXPECT_NEAR(measured.step->overshoot_percent,
                100 * std::exp(-std::numbers::pi * damping / std::sqrt(1 - damping * damping)), 0.1);
    EXPECT_NEAR(measured.step->settling_s, settled, 1e-3);
    EXPECT_NEAR(measured.step->rise_s, nine_tenths - tenth, 0.2e-3);
    EXPECT_NEAR(measured.step->begin_s, 0.04, 1e-3);
  }
}

TEST(ScopeMeasurements, WhatMovesAtTheEndIsNoStep) {
  std::vector<double> ramp(100, 0.0);
  for (int i = 0; i < 100; ++i) ramp.push_back(i);
  EXPECT_FALSE(measure(made_of(ramp, 1ms), 0).step);
  EXPECT_FALSE(measure(made_of(std::vector<double>(100, 4.0), 1ms), 0).step) << "a line";
  EXPECT_FALSE(measure(made_of({1}, 1ms), 0).step);
}

// The end differs a little from the start: this difference does not count as a step, and the motion does not count as
// overshoot.
TEST(ScopeMeasurements, ThereAndBackIsNoStep) {
  std::vector<double> way(100, 0.0);
  for (int i = 0; i <= 100; ++i) way.push_back(131072.0 * i / 100);
  for (int i = 100; i >= 0; --i) way.push_back(131072.0 * i / 100 + 230);
  way.insert(way.end(), 100, 230.0);
  EXPECT_FALSE(measure(made_of(way, 1ms), 0).step);
}

// ---- Files ----

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
  const std::vector<Channel> channels{
      {.name = "a", .unit = "pos"}, {.name = "b"}, {.name = "c", .unit = "pos"}, {.name = "d"}};
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

}  // namespace
}  // namespace scope_test
}  // namespace servodrome::master::scope
