#include <algorithm>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sstream>
#include <string>
#include <vector>

#include "describe/sample.hpp"

namespace servodrome::describe {
namespace reference_test {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string line_beginning(const std::string& text, const std::string& beginning) {
  for (const std::string& line : lines_of(text)) {
    if (line.compare(0, beginning.size(), beginning) == 0) return line;
  }
  return "(no line begins with " + beginning + ")";
}

TEST(Csv, HasTheColumnsAndOneLineForEachEntry) {
  const auto lines = lines_of(csv(sample::table));
  ASSERT_EQ(lines.size(), sample::table.size() + 1);
  EXPECT_EQ(lines[0], "index,sub,name,type,access,pdo,default,min,max,unit,saved");
}

TEST(Csv, RowsOfEveryKind) {
  const std::string text = csv(sample::table);
  const auto row = [&text](const char* key) { return line_beginning(text, key); };
  EXPECT_EQ(row("0x1000,0x00"), "0x1000,0x00,Device type,UNSIGNED32,const,none,0x00020192,,,,");
  EXPECT_EQ(row("0x1006,0x00"), "0x1006,0x00,Communication cycle period,UNSIGNED32,rw,none,1000,,,us,yes");
  EXPECT_EQ(row("0x1008,0x00"),
            R"(0x1008,0x00,Manufacturer device name,VISIBLE_STRING,const,none,"Sample; ""drive""",,,,)");
  EXPECT_EQ(row("0x1014,0x00"), "0x1014,0x00,COB-ID EMCY,UNSIGNED32,rw,none,0x80+NodeID,,,,yes");
  EXPECT_EQ(row("0x1600,0x00"), "0x1600,0x00,RPDO 1 mapping,UNSIGNED8,rw,none,2,0,10,,");
  EXPECT_EQ(row("0x1600,0x0A"), "0x1600,0x0A,Mapped object,UNSIGNED32,rw,none,0x00000000,,,,");
  EXPECT_EQ(row("0x2001,0x00"), R"(0x2001,0x00,"Gain, ""proportional""",REAL32,rw,none,0.1,,,1/s,yes)");
  EXPECT_EQ(row("0x2004,0x00"), "0x2004,0x00,Trace,DOMAIN,ro,none,,,,,");
  EXPECT_EQ(row("0x2005,0x01"), "0x2005,0x01,Serial,UNSIGNED64,rw,none,18446744073709551615,,,,");
  EXPECT_EQ(row("0x6040,0x00"), "0x6040,0x00,Controlword,UNSIGNED16,rw,rx,0,,,,");
  EXPECT_EQ(row("0x6041,0x00"), "0x6041,0x00,Statusword,UNSIGNED16,ro,tx,0,,,,");
  EXPECT_EQ(row("0x6060,0x00"), "0x6060,0x00,Modes of operation,INTEGER8,rw,both,-1,-3,10,,");
  EXPECT_EQ(row("0x6071,0x00"), "0x6071,0x00,Target torque,INTEGER16,wo,rx,0,,,,");
}

TEST(Markdown, GroupsEveryEntryOnce) {
  const std::string page = markdown(sample::description());
  const auto lines = lines_of(page);
  EXPECT_EQ(lines.front(), "# Sample\\_1: objects");
  const auto rows =
      std::count_if(lines.begin(), lines.end(), [](const std::string& line) { return line.rfind("| 0x", 0) == 0; });
  EXPECT_EQ(static_cast<std::size_t>(rows), sample::table.size());
  std::vector<std::string> titles;
  std::copy_if(lines.begin(), lines.end(), std::back_inserter(titles),
               [](const std::string& line) { return line.rfind("## ", 0) == 0; });
  EXPECT_THAT(titles, testing::ElementsAre("## Data types", "## General communication objects",
                                           "## RPDO communication parameters", "## RPDO mapping parameters",
                                           "## TPDO communication parameters", "## TPDO mapping parameters",
                                           "## Manufacturer-specific objects", "## Device profile objects"));
}

TEST(Markdown, RowsHaveTheSameNumberOfCellsWhateverTheNames) {
  const std::string page = markdown(sample::description());
  for (const std::string& line : lines_of(page)) {
    if (line.rfind("| 0x", 0) != 0) continue;
    unsigned bars = 0;
    for (std::size_t i = 0; i < line.size(); ++i) bars += line[i] == '|' && (i == 0 || line[i - 1] != '\\') ? 1U : 0U;
    EXPECT_EQ(bars, 11U) << line;
  }
  EXPECT_EQ(line_beginning(page, "| 0x2005 | 0"),
            "| 0x2005 | 0 | Long numbers \\| \\<wide> | UNSIGNED8 | const | none | 2 |  |  |  |");
  EXPECT_EQ(line_beginning(page, "| 0x6060"),
            "| 0x6060 | 0 | Modes of operation | INTEGER8 | rw | both | -1 | -3 to 10 |  |  |");
  EXPECT_EQ(line_beginning(page, "| 0x1400 | 1"),
            "| 0x1400 | 1 | COB-ID | UNSIGNED32 | rw | none | 0x80000200 + NodeID |  |  | yes |");
}

TEST(Markdown, BeginsWithTheDevice) {
  const std::string page = markdown(sample::description());
  EXPECT_EQ(line_beginning(page, "| Vendor"), "| Vendor | Servodrome (0x12345678) |");
  EXPECT_EQ(line_beginning(page, "| Product code"), "| Product code | 0x9ABCDEF0 |");
  EXPECT_EQ(line_beginning(page, "| CAN bit"), "| CAN bit rates, kbit/s | 125, 500, 1000 |");
  EXPECT_EQ(line_beginning(page, "| RPDOs"), "| RPDOs, TPDOs | 1, 1 |");
}

}  // namespace
}  // namespace reference_test
}  // namespace servodrome::describe
