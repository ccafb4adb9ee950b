#include <fmt/format.h>
#include <gmock/gmock.h>

#include "master/serial10/objects.hpp"
#include "master/serial_master_line.hpp"

namespace servodrome::master::test {
namespace serial10_client_test {
namespace {

using dictionary::AbortCode;
using serial10::Command;
using serial10::Frame;

struct Serial10ClientTest : testing::Test {
  SerialMasterLine line;
  servodrome::test::IsmkObjects& objects = line.add_serial10(5).device.objects;
  Serial10Client master{line.client(), "mem:"};
};

TEST_F(Serial10ClientTest, ReadsAndWrites) {
  master.write<std::uint16_t>(5, 0x6040, 0, 0x0F);
  EXPECT_EQ(objects.controlword, 0x0F);
  master.write<std::int8_t>(5, 0x6060, 0, -3);
  EXPECT_EQ(objects.mode, -3);
  EXPECT_EQ(master.read<std::int8_t>(5, 0x6060), -3);
  EXPECT_EQ(master.read<std::int32_t>(5, 0x6060), -3) << "extended by the drive";
  master.write<std::int32_t>(5, 0x607A, 0, -50000);
  EXPECT_EQ(master.read<std::int32_t>(5, 0x607A), -50000);
  objects.statusword = 0xC031;
  EXPECT_EQ(master.read<std::uint16_t>(5, 0x6041), 0xC031);
  EXPECT_EQ(master.read<std::uint16_t>(127, 0x6041), 0xC031);
}

TEST_F(Serial10ClientTest, Errors) {
  try {
    master.write<std::uint16_t>(5, 0x6041, 0, 1);
    FAIL();
  } catch (const Serial10Error& error) {
    EXPECT_EQ(error.code(), AbortCode::read_only);
    EXPECT_TRUE(error.from_drive());
    EXPECT_THAT(error.what(), testing::HasSubstr("mem:, drive 5: object 6041:00 was refused: 06010002h"));
  }
  try {
    master.read<std::uint16_t>(6, 0x6041);
    FAIL();
  } catch (const Serial10Error& error) {
    EXPECT_EQ(error.code(), AbortCode::protocol_timed_out);
    EXPECT_FALSE(error.from_drive());
  }
  EXPECT_EQ(master.read<std::uint16_t>(5, 0x6040), 6);
}

TEST_F(Serial10ClientTest, ALimitOfTheWait) {
  Serial10Objects silent(master, 6);
  const auto seconds = [&](const auto& access) {
    const Time before = line.now();
    EXPECT_THROW(access(), ObjectError);
    return std::chrono::duration<double>(line.now() - before).count();
  };
  const auto read = [&] { silent.read<std::uint16_t>(0x6041); };
  EXPECT_NEAR(seconds(read), 1.060, 0.005) << "twice 500 ms, and a pause";
  const LimitedWait limited(silent, 20ms);
  EXPECT_NEAR(seconds(read), 0.021, 0.001);
  EXPECT_NEAR(seconds([&] { silent.write<std::uint16_t>(0x6040, 0, 6); }), 0.021, 0.001);
}

TEST(Serial10Client, AnswersThatDoNotFit) {
  const auto bytes = [](const Frame& frame) { return ScriptedClient::Bytes(frame.bytes.begin(), frame.bytes.end()); };
  const auto good = bytes(Frame::make(1, Command::read_2, 0x6041, 0, 0x31));
  const Frame bad[] = {
      Frame::make(2, Command::read_2, 0x6041, 0, 0x31), Frame::make(1, Command::read_2, 0x6040, 0, 0x31),
      Frame::make(1, Command::read_2, 0x6041, 1, 0x31), Frame::make(1, Command::written, 0x6041, 0, 0)};
  for (const Frame& frame : bad) {
    Serial10Client master(std::make_unique<ScriptedClient>(std::vector{bytes(frame), good}), "script");
    EXPECT_EQ(master.read<std::uint16_t>(1, 0x6041), 0x31) << "asked again";
  }
  auto damaged = good;
  damaged[9] = static_cast<std::uint8_t>(damaged[9] ^ 1);
  Serial10Client master(std::make_unique<ScriptedClient>(std::vector{damaged, damaged, good}), "script");
  EXPECT_THROW(master.read<std::uint16_t>(1, 0x6041), Serial10Error);
  EXPECT_EQ(master.read<std::uint16_t>(1, 0x6041), 0x31);
  const auto confirmed = bytes(Frame::make(1, Command::written, 0x6040, 0, 6));
  Serial10Client writer(std::make_unique<ScriptedClient>(std::vector{ScriptedClient::Bytes{}, confirmed}), "script");
  EXPECT_THROW(writer.write<std::uint16_t>(1, 0x6040, 0, 6), Serial10Error) << "a write is not repeated";
}

// Through the operating system's ptys.
TEST(Serial10Client, OverAPty) {
  const std::string path = fmt::format("{}servodrome_serial10_{}", testing::TempDir(), ::getpid());
  links::test::SerialRig rig;
  rig.add_serial10(1);
  const auto pty = rig.open("pty:" + path);
  const links::test::SerialRigThread thread(rig);
  Serial10Client master = Serial10Client::open("pty:" + path);
  for (int i = 0; i < 100; ++i) {
    master.write<std::int32_t>(1, 0x607A, 0, i);
    ASSERT_EQ(master.read<std::int32_t>(1, 0x607A), i);
  }
  EXPECT_THROW(Serial10Client::open("pty:/nonexistent"), MasterError);
}

}  // namespace
}  // namespace serial10_client_test
}  // namespace servodrome::master::test
