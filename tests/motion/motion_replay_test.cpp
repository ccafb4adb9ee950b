#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <sstream>

#include "machine.hpp"
#include "source_dir.hpp"

// Replays the failures that motion_fuzz found, with all its invariants; each file of tests/data/motion contains one
// case.
namespace servodrome::motion {
namespace motion_replay_test {
namespace {

const std::filesystem::path folder = std::filesystem::path(SERVODROME_SOURCE_DIR) / "tests/data/motion";

std::string text_of(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(MotionReplay, WhatWasFoundStaysRepaired) {
  std::size_t cases = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() != ".case") continue;
    const std::string text = text_of(file.path());
    const ParsedSequence parsed = parse_sequence(text);
    ASSERT_EQ(parsed.error, "") << file.path();
    const RunOptions options{.recover = text.find("# recover") != std::string::npos};
    const Outcome outcome = run_checked(parsed.sequence, options, true);
    EXPECT_FALSE(outcome.finding) << file.path().filename() << ": " << outcome.finding->invariant << ": "
                                  << outcome.finding->text;
    ++cases;
  }
  EXPECT_GE(cases, 40U);
}

TEST(MotionReplay, ACaseIsReadAsItIsWritten) {
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    const Sequence sequence = parse_sequence(text_of(file.path())).sequence;
    EXPECT_EQ(parse_sequence(to_text(sequence)).sequence, sequence) << file.path();
  }
}

TEST(MotionReplay, AHeartbeatAndHardStopsAreReadAsTheyAreWritten) {
  const Sequence sequence = parse_sequence("axis ismc stops 90000\n1.0 a0 heartbeat 10\n").sequence;
  EXPECT_EQ(sequence.axes.at(0).stop_counts, 90000);
  ASSERT_EQ(sequence.events.size(), 1U);
  EXPECT_EQ(sequence.events[0].kind, Kind::heartbeat);
  EXPECT_EQ(sequence.events[0].value, 10);
  EXPECT_EQ(parse_sequence(to_text(sequence)).sequence, sequence);
}

TEST(MotionReplay, AValueIsDecimalOrHexadecimalWithAPrefix) {
  const auto value_of = [](const std::string& text) {
    const ParsedSequence parsed = parse_sequence("axis ismc\n1.0 a0 heartbeat " + text + "\n");
    return parsed.error.empty() ? parsed.sequence.events.at(0).value : -1;
  };
  EXPECT_EQ(value_of("010"), 10);
  EXPECT_EQ(value_of("-010"), -10);
  EXPECT_EQ(value_of("09"), 9);
  EXPECT_EQ(value_of("0x10"), 16);
  EXPECT_EQ(value_of("-0x10"), -16);
  EXPECT_EQ(parse_sequence("axis ismc\n1.0 a0 heartbeat 0x\n").error, "2: \"0x\" is no number");
  EXPECT_EQ(parse_sequence("axis ismc\n1.0 a0 heartbeat 1F\n").error, "2: \"1F\" is no number");
}

TEST(MotionReplay, AMistakeIsToldWithItsLine) {
  EXPECT_EQ(parse_sequence("axis ismc\n1.0 a0 jump 3\n").error, "2: there is no event \"jump\"");
  EXPECT_EQ(parse_sequence("axis ismc\n1.0 a1 enable\n").error, "2: \"a1\" is none of the axes; the first is a0");
}

}  // namespace
}  // namespace motion_replay_test
}  // namespace servodrome::motion
