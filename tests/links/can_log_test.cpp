#include <cstdint>
#include <filesystem>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <iterator>
#include <string>
#include <unistd.h>

#include "links/can/log.hpp"
#include "links/can/memory_port.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace can_log_test {
namespace {

using canopen::Frame;
using std::chrono::seconds;

std::string read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::filesystem::path temporary(const char* name) {
  return std::filesystem::path(testing::TempDir()) / ("servodrome_can_log_" + std::to_string(::getpid()) + name);
}

// The example line of can-utils' candump -L.
TEST(CandumpLine, Format) {
  const Time timestamp = std::chrono::microseconds(1436509052249713);
  Frame frame{.id = 0x123, .length = 2, .data = {0x11, 0x22}};
  EXPECT_EQ(candump_line(frame, timestamp, "can0"), "(1436509052.249713) can0 123#1122");
  frame.extended = true;
  EXPECT_EQ(candump_line(frame, timestamp, "can0"), "(1436509052.249713) can0 00000123#1122");
  EXPECT_EQ(candump_line({.id = 0x80}, timestamp, "vcan1"), "(1436509052.249713) vcan1 080#");
  EXPECT_EQ(candump_line({.id = 0x701, .remote = true}, Time{}, "can0"), "(0000000000.000000) can0 701#R");
  EXPECT_EQ(candump_line({.id = 0x701, .remote = true, .length = 1}, Time(999), "can0"),
            "(0000000000.000000) can0 701#R1");
}

struct CanLogTest : testing::Test {
  CanBus bus{BusConfig{.bit_rate = 1'000'000}};
  MemoryPort a{bus}, b{bus};

  void traffic() {
    a.send({.id = 0x123, .length = 2, .data = {0x11, 0x22}}, Time{});  // 62 bits: 62 us
    a.send({.id = 0x18DAF110, .extended = true, .remote = true, .length = 8}, seconds(1));
    bus.advance(seconds(2));
    bus.disturb({.corrupt = 1.0, .limit = 1});
    b.send({.id = 0x1}, seconds(3));
    bus.advance(seconds(4));
  }
};

TEST_F(CanLogTest, CandumpFile) {
  const auto path = temporary("candump.log");
  {
    CanLog log(path.string(), CanLog::Format::candump, "can0", seconds(1436509052));
    bus.add_observer(log);
    traffic();
    EXPECT_FALSE(log.failed());
    bus.remove_observer(log);
  }
  const std::string text = read_file(path);
  std::filesystem::remove(path);
  EXPECT_THAT(text, testing::StartsWith("(1436509052.000062) can0 123#1122\n(1436509053."));
  EXPECT_THAT(text, testing::HasSubstr(") can0 18DAF110#R8\n(1436509055."));
  EXPECT_THAT(text, testing::HasSubstr(") can0 20000080#0000000000000000\n"));
  EXPECT_THAT(text, testing::EndsWith(") can0 001#\n"));
}

TEST_F(CanLogTest, PcapFile) {
  const auto path = temporary("capture.pcap");
  {
    CanLog log(path.string(), CanLog::Format::pcap, "can0", seconds(5));
    bus.add_observer(log);
    traffic();
    bus.remove_observer(log);
  }
  const std::string bytes = read_file(path);
  std::filesystem::remove(path);
  ASSERT_EQ(bytes.size(), 24U + 4U * 32U);
  const auto word = [&bytes](std::size_t offset) {
    std::uint32_t value = 0;
    for (unsigned i = 0; i < 4; ++i)
      value |= static_cast<std::uint32_t>(static_cast<std::uint8_t>(bytes[offset + i])) << (8 * i);
    return value;
  };
  EXPECT_EQ(word(0), 0xA1B23C4DU);
  EXPECT_EQ(word(20), 227U);
  EXPECT_EQ(word(24), 5U);
  EXPECT_EQ(word(28), 62'000U);
  EXPECT_EQ(bytes.substr(24 + 16, 16),
            std::string("\x00\x00\x01\x23\x02\x00\x00\x00\x11\x22\x00\x00\x00\x00\x00\x00", 16));
  EXPECT_EQ(bytes.substr(24 + 32 + 16, 8), std::string("\xD8\xDA\xF1\x10\x08\x00\x00\x00", 8));
  EXPECT_EQ(bytes.substr(24 + 64 + 16, 5), std::string("\x20\x00\x00\x80\x08", 5));
}

TEST(CanLog, ErrorsSayWhatToDo) {
  try {
    CanLog log("/nonexistent/folder/x.log", CanLog::Format::candump, "can0", Time{});
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("/nonexistent/folder/x.log"));
    EXPECT_THAT(error.what(), testing::HasSubstr("choose a folder"));
    EXPECT_EQ(error.code(), std::errc::no_such_file_or_directory);
  }
  CanBus bus;
  MemoryPort a(bus), b(bus);
  CanLog full("/dev/full", CanLog::Format::candump, "can0", Time{});
  bus.add_observer(full);
  a.send({.id = 1}, Time{});
  bus.advance(seconds(1));
  full.flush();
  EXPECT_TRUE(full.failed());
}

}  // namespace
}  // namespace can_log_test
}  // namespace servodrome::links
