// Decoding of captures: the examples of the manuals, complete conversations, and invalid files.
#include <cstring>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <random>

#include "canopen/test_device.hpp"
#include "describe/device_file.hpp"
#include "master/error.hpp"
#include "tools/sniff/can_decoder.hpp"
#include "tools/sniff/capture_file.hpp"
#include "tools/sniff/ethercat_decoder.hpp"
#include "tools/sniff/summary.hpp"

namespace servodrome::master {
namespace sniff_test {
namespace {

using canopen::test::frame_of;

// Source and text of a frame.
std::string said(CanDecoder& decoder, const char* frame) {
  const Decoded decoded = decoder.decode(frame_of(frame), {});
  return decoded.source.empty() ? decoded.text : decoded.source + " " + decoded.text;
}

TEST(SniffCan, ServicesWithoutMemory) {
  CanDecoder decoder;
  const std::pair<const char*, const char*> frames[] = {
      {"000 # 01 05", "NMT start: node 5"},
      {"000 # 81 00", "NMT reset node: all nodes"},
      {"080 # 07", "SYNC 7"},
      {"080 #", "SYNC"},
      {"100 # 00 00 00 00 01 00", "TIME 1984-01-02 00:00:00.000"},
      {"605 # 40 41 60 00 00 00 00 00", "node 5 SDO read 6041:00 Statusword"},
      {"585 # 4B 41 60 00 37 02 00 00", "node 5 SDO 6041:00 Statusword is 567 (0237h) operation enabled"},
      {"605 # 23 7A 60 00 FE FF FF FF", "node 5 SDO write 607A:00 Target position = -2"},
      {"585 # 60 7A 60 00 00 00 00 00", "node 5 SDO written 607A:00 Target position"},
      {"585 # 80 99 60 01 32 00 09 06",
       "node 5 SDO abort 6099:01 Homing speeds.Speed during search for switch: 0609 0032h value too low"},
      {"705 # 00", "node 5 boot-up"},
      {"705 # 05", "node 5 heartbeat operational"},
      {"705 RTR", "node 5 guarding request"},
      {"285 # 01 02", "node 5 TPDO2 01 02"},
      {"505 # FF", "node 5 RPDO4 FF"},
      {"185 # 37 02", "node 5 TPDO1 6041:00 Statusword = 567 (0237h) operation enabled"},
      {"305 # 0F 00 08",
       "node 5 RPDO2 6040:00 Controlword = 15 (000Fh), 6060:00 Modes of operation = 8 cyclic "
       "synchronous position"},
      {"085 # 10 32 05 00 00 00 00 00",
       "node 5 EMCY 3210h DC link over-voltage, error register 05h, vendor 00 00 00 00 00"},
      {"7E5 # 04 01 00 00 00 00 00 00", "LSS switch all to configuration"},
      {"7E5 # 11 07 00 00 00 00 00 00", "LSS configure node-ID 7"},
      {"7E4 # 11 00 00 00 00 00 00 00", "LSS node-ID taken"},
      {"785 # 00", ""},
  };
  for (const auto& [frame, words] : frames) EXPECT_EQ(said(decoder, frame), words) << frame;
}

// Mode -3 of the iSMK is no mode of CiA 402.
TEST(SniffCan, AModeHasTheNameOfTheProduct) {
  CanDecoder decoder;
  decoder.set_model(4, DeviceModel::of(std::span<const dictionary::Entry>{}, "ismk"));
  const char* const write = "# 2F 60 60 00 FD 00 00 00";
  EXPECT_TRUE(said(decoder, fmt::format("604 {}", write).c_str()).ends_with(" immediate velocity"));
  EXPECT_EQ(said(decoder, fmt::format("605 {}", write).c_str()).find("immediate velocity"), std::string::npos);
}

// The SDO examples of the ISMC manual (tests/products/ismc_examples_test.cpp runs them against the drive).
TEST(SniffCan, ExamplesOfTheIsmcManual) {
  CanDecoder decoder;
  const std::pair<const char*, const char*> frames[] = {
      {"602 # 23 FF 60 00 E8 03 00 00", "node 2 SDO write 60FF:00 Target velocity = 1000"},
      {"582 # 60 FF 60 00 00 00 00 00", "node 2 SDO written 60FF:00 Target velocity"},
      {"602 # 2B FF 60 00 E8 03 00 00", "node 2 SDO write 60FF:00 Target velocity = 1000"},
      {"582 # 80 FF 60 00 10 00 07 06",
       "node 2 SDO abort 60FF:00 Target velocity: 0607 0010h data type does not match: length of the parameter does "
       "not "
       "match"},
      {"602 # 2F 60 60 00 03 00 00 00", "node 2 SDO write 6060:00 Modes of operation = 3 profile velocity"},
      {"602 # 40 61 60 00 00 00 00 00", "node 2 SDO read 6061:00 Modes of operation display"},
      {"582 # 4F 61 60 00 03 00 00 00", "node 2 SDO 6061:00 Modes of operation display is 3 profile velocity"},
      {"602 # E0 61 60 00 00 00 00 00", "node 2 SDO command E0h is not an SDO command"},
      {"582 # 80 61 60 00 01 00 04 05",
       "node 2 SDO abort 6061:00 Modes of operation display: 0504 0001h command specifier not valid or unknown"},
      {"601 # 23 81 60 00 40 42 0F 00", "node 1 SDO write 6081:00 Profile velocity = 1000000 (000F4240h)"},
      {"601 # 23 7A 60 00 A0 86 01 00", "node 1 SDO write 607A:00 Target position = 100000"},
      {"601 # 40 02 18 01 00 00 00 00", "node 1 SDO read 1802:01 TPDO 3 communication parameter.COB-ID used by PDO"},
      {"581 # 43 02 18 01 81 03 00 80",
       "node 1 SDO 1802:01 TPDO 3 communication parameter.COB-ID used by PDO is 2147484545 (80000381h)"},
  };
  for (const auto& [frame, words] : frames) EXPECT_EQ(said(decoder, frame), words) << frame;
}

TEST(SniffCan, ASegmentedTransferIsPutTogether) {
  CanDecoder decoder;
  EXPECT_EQ(said(decoder, "601 # 40 08 10 00 00 00 00 00"), "node 1 SDO read 1008:00 Manufacturer device name");
  EXPECT_EQ(said(decoder, "581 # 41 08 10 00 09 00 00 00"), "node 1 SDO 1008:00 Manufacturer device name has 9 bytes");
  EXPECT_EQ(said(decoder, "601 # 60 00 00 00 00 00 00 00"),
            "node 1 SDO next segment of 1008:00 Manufacturer device name");
  EXPECT_EQ(said(decoder, "581 # 00 49 53 4D 43 20 53 65"),
            "node 1 SDO segment of 1008:00 Manufacturer device name, bytes 0 to 7");
  said(decoder, "601 # 70 00 00 00 00 00 00 00");
  EXPECT_EQ(said(decoder, "581 # 1B 72 76 00 00 00 00 00"),
            "node 1 SDO last segment: 1008:00 Manufacturer device name is \"ISMC Serv\"");
}

// CiA 301 7.2.4.3.9 and 10: the size is optional, and segments after a gap are repeated in the next sub-block.
TEST(SniffCan, ABlockOfUnknownSizeWithRepeatedSegments) {
  CanDecoder decoder;
  EXPECT_EQ(said(decoder, "602 # C4 10 2F 00 00 00 00 00"), "node 2 SDO block write 2F10:00, size unknown");
  said(decoder, "582 # A4 10 2F 00 03 00 00 00");
  said(decoder, "602 # 01 61 62 63 64 65 66 67");
  said(decoder, "602 # 03 6F 70 71 72 73 74 75");
  EXPECT_EQ(said(decoder, "582 # A2 01 03 00 00 00 00 00"), "node 2 SDO block taken up to segment 1");
  said(decoder, "602 # 01 68 69 6A 6B 6C 6D 6E");
  EXPECT_EQ(said(decoder, "602 # 82 6F 00 00 00 00 00 00"), "node 2 SDO last segment 2 of a block");
  said(decoder, "582 # A2 02 03 00 00 00 00 00");
  EXPECT_EQ(said(decoder, "602 # D9 00 00 00 00 00 00 00"), "node 2 SDO block ends: 2F10:00 = \"abcdefghijklmno\"");
  EXPECT_EQ(said(decoder, "582 # A1 00 00 00 00 00 00 00"), "node 2 SDO block written 2F10:00");
}

TEST(SniffCan, ABlockTransferIsPutTogether) {
  CanDecoder decoder;
  EXPECT_EQ(said(decoder, "602 # C6 10 2F 00 0A 00 00 00"), "node 2 SDO block write 2F10:00, 10 bytes");
  EXPECT_EQ(said(decoder, "582 # A4 10 2F 00 7F 00 00 00"), "node 2 SDO block write goes ahead");
  EXPECT_EQ(said(decoder, "602 # 01 61 62 63 64 65 66 67"), "node 2 SDO segment 1 of a block");
  EXPECT_EQ(said(decoder, "602 # 82 68 69 6A 00 00 00 00"), "node 2 SDO last segment 2 of a block");
  EXPECT_EQ(said(decoder, "582 # A2 02 7F 00 00 00 00 00"), "node 2 SDO block taken up to segment 2");
  EXPECT_EQ(said(decoder, "602 # D1 00 00 00 00 00 00 00"), "node 2 SDO block ends: 2F10:00 = \"abcdefghij\"");
  EXPECT_EQ(said(decoder, "582 # A1 00 00 00 00 00 00 00"), "node 2 SDO block written 2F10:00");
}

// A master maps controlword and mode to RPDO1 and changes its COB-ID.
TEST(SniffCan, AMappingThatIsWrittenIsUsed) {
  CanDecoder decoder;
  for (const char* frame :
       {"603 # 2F 00 16 00 02 00 00 00", "583 # 60 00 16 00 00 00 00 00", "603 # 23 00 16 01 10 00 40 60",
        "583 # 60 00 16 01 00 00 00 00", "603 # 23 00 16 02 08 00 60 60", "583 # 60 00 16 02 00 00 00 00",
        "603 # 23 00 14 01 20 02 00 00"}) {
    decoder.decode(frame_of(frame), {});
  }
  // The change takes effect only after the drive's confirmation.
  EXPECT_EQ(said(decoder, "220 # 06 00 01"), "node 32 RPDO1 06 00 01");
  decoder.decode(frame_of("583 # 60 00 14 01 00 00 00 00"), {});
  EXPECT_EQ(said(decoder, "220 # 06 00 01"),
            "node 3 RPDO1 6040:00 Controlword = 6 (0006h), 6060:00 Modes of operation = 1 profile position");
  const Decoded shorter = decoder.decode(frame_of("220 # 06 00"), {});
  EXPECT_TRUE(shorter.error);
  EXPECT_EQ(shorter.text, "RPDO1 6040:00 Controlword = 6 (0006h), 1 bytes missing");
  // An aborted write has no effect.
  decoder.decode(frame_of("603 # 2F 00 16 00 01 00 00 00"), {});
  decoder.decode(frame_of("583 # 80 00 16 00 00 00 01 06"), {});
  EXPECT_EQ(decoder.decode(frame_of("220 # 06 00 01"), {}).values.size(), 2U);
}

TEST(SniffCan, ADataSheetGivesNamesAndDefaultPdos) {
  std::istringstream eds(
      "[DeviceInfo]\nVendorName=x\n[1800]\nParameterName=TPDO1\nObjectType=9\n[1800sub0]\nDataType=5\nDefaultValue=2\n"
      "[1800sub1]\nDataType=7\nDefaultValue=$NODEID+0x3A0\n[1A00]\nParameterName=Map\nObjectType=0x9\n[1A00sub0]\n"
      "DataType=5\nDefaultValue=1\n[1A00sub1]\nDataType=7\nDefaultValue=0x22000010\n[2200]\nParameterName=Warmth\n"
      "DataType=3\nAccessType=ro\nPDOMapping=1\n");
  CanDecoder decoder;
  decoder.set_model(4, DeviceModel::of(describe::read_eds(eds, "x.eds")));
  EXPECT_EQ(said(decoder, "3A4 # FF FF"), "node 4 TPDO1 2200:00 Warmth = -1");
  EXPECT_EQ(said(decoder, "584 # 4B 00 22 00 05 00 00 00"), "node 4 SDO 2200:00 Warmth is 5");
}

TEST(SniffCan, AnyFrameIsDecoded) {
  CanDecoder decoder;
  std::minstd_rand random(1);
  for (int i = 0; i < 200'000; ++i) {
    canopen::Frame frame;
    frame.id = random() % 4 == 0 ? random() & 0x7FFU : 0x580 + (random() & 0x83U);
    frame.remote = random() % 32 == 0;
    frame.length = static_cast<std::uint8_t>(random() % 8 == 0 ? random() % 16 : 8);
    for (auto& byte : frame.data) byte = static_cast<std::uint8_t>(random() >> 8);
    EXPECT_FALSE(decoder.decode(frame, {}).raw.empty());
  }
}

// ---- EtherCAT ----

std::vector<std::uint8_t> ethercat_frame(bool returned, unsigned command, unsigned address, unsigned offset,
                                         std::vector<std::uint8_t> data, unsigned working_counter) {
  std::vector<std::uint8_t> frame{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x88, 0xA4};
  if (returned) frame[6] |= 2;
  const auto word = [&frame](std::size_t value) {
    frame.push_back(static_cast<std::uint8_t>(value));
    frame.push_back(static_cast<std::uint8_t>(value >> 8));
  };
  word(0x1000 | (12 + data.size()));
  frame.push_back(static_cast<std::uint8_t>(command));
  frame.push_back(0);
  word(address);
  word(offset);
  word(data.size());
  word(0);
  frame.insert(frame.end(), data.begin(), data.end());
  word(working_counter);
  return frame;
}

class SniffEthercat : public testing::Test {
 protected:
  // Sends a datagram and receives it back; returns the text.
  std::string exchange(unsigned command, unsigned address, unsigned offset, const std::vector<std::uint8_t>& there,
                       const std::vector<std::uint8_t>& back, unsigned working_counter, bool positional = false) {
    EXPECT_TRUE(decoder.decode(ethercat_frame(false, command, address, offset, there, 0), {}).empty());
    const auto all = decoder.decode(
        ethercat_frame(true, command, positional ? address + 1 : address, offset, back, working_counter), {});
    if (all.size() != 1) return "no datagram";
    last = all[0];
    return last.source.empty() ? last.text : last.source + " " + last.text;
  }
  std::string write(unsigned offset, const std::vector<std::uint8_t>& data) {
    return exchange(5, 0x1001, offset, data, data, 1);
  }
  std::string mail(const std::vector<std::uint8_t>& message, bool in) {
    std::vector<std::uint8_t> mailbox{static_cast<std::uint8_t>(message.size()), 0, 0, 0, 0, 0x13};
    mailbox.insert(mailbox.end(), message.begin(), message.end());
    mailbox.resize(48);
    return in ? exchange(4, 0x1001, 0x1100, std::vector<std::uint8_t>(48), mailbox, 1) : write(0x1000, mailbox);
  }

  EthercatDecoder decoder;
  Decoded last;
};

TEST_F(SniffEthercat, FromTheFirstFrameToProcessData) {
  EXPECT_EQ(exchange(7, 0, 0x0130, {0, 0}, {1, 0}, 3, true), "all slaves AL status INIT, 3 of them");
  EXPECT_EQ(exchange(2, 0xFFFF, 0x0010, {0x01, 0x10}, {0x01, 0x10}, 1, true), "slave 2 write station address 1001h");
  EXPECT_EQ(write(0x0120, {2, 0}), "slave 2 write AL control PREOP");
  EXPECT_EQ(exchange(4, 0x1001, 0x0130, {0, 0, 0, 0, 0, 0}, {0x11, 0, 0, 0, 0x16, 0}, 1),
            "slave 2 AL status INIT with error 0016h invalid mailbox configuration");
  EXPECT_TRUE(last.error);
  EXPECT_EQ(exchange(4, 0x1001, 0x0130, {0, 0}, {0, 0}, 0), "slave 2 no slave answered: read AL status");
  write(0x0800, {0x00, 0x10, 48, 0, 0x26, 0, 1, 0, 0x00, 0x11, 48, 0, 0x22, 0, 1, 0});
  EXPECT_EQ(mail({0x00, 0x20, 0x40, 0x41, 0x60, 0, 0, 0, 0, 0}, false), "slave 2 SDO read 6041:00 Statusword");
  EXPECT_EQ(mail({0x00, 0x30, 0x4B, 0x41, 0x60, 0, 0x37, 0x02, 0, 0}, true),
            "slave 2 SDO 6041:00 Statusword is 567 (0237h) operation enabled");
  EXPECT_EQ(mail({0x00, 0x20, 0x80, 0x99, 0x60, 1, 0x32, 0x00, 0x09, 0x06}, true),
            "slave 2 SDO abort 6099:01 Homing speeds.Speed during search for switch: 0609 0032h value too low");
  EXPECT_EQ(mail({0x00, 0x10, 0x10, 0x32, 5, 0, 0, 0, 0, 0}, true),
            "slave 2 EMCY 3210h DC link over-voltage, error register 05h, vendor 00 00 00 00 00");
  // Mapping and assignment, then sync manager 3 and its FMMU.
  const auto set = [&](std::vector<std::uint8_t> request) {
    mail({0x00, 0x20, request[0], request[1], request[2], request[3], request[4], request[5], request[6], request[7]},
         false);
    mail({0x00, 0x30, 0x60, request[1], request[2], request[3], 0, 0, 0, 0}, true);
  };
  set({0x2F, 0x00, 0x1A, 0, 2, 0, 0, 0});
  set({0x23, 0x00, 0x1A, 1, 0x10, 0x00, 0x41, 0x60});
  set({0x23, 0x00, 0x1A, 2, 0x20, 0x00, 0x64, 0x60});
  set({0x2F, 0x13, 0x1C, 0, 1, 0, 0, 0});
  set({0x2B, 0x13, 0x1C, 1, 0x00, 0x1A, 0, 0});
  write(0x0818, {0x00, 0x15, 6, 0, 0x20, 0, 1, 0});
  write(0x0600, {0, 0, 1, 0, 6, 0, 0, 7, 0x00, 0x15, 0, 1, 1, 0, 0, 0});
  const std::vector<std::uint8_t> data{0x37, 0x02, 0xFE, 0xFF, 0xFF, 0xFF};
  EXPECT_EQ(exchange(10, 0, 1, std::vector<std::uint8_t>(6), data, 1),
            "slave 2 in: 6041:00 Statusword = 567 (0237h) operation enabled, 6064:00 Position actual value = -2");
  EXPECT_EQ(last.kind, FrameKind::process_data);
  EXPECT_FALSE(last.error);
  exchange(10, 0, 1, std::vector<std::uint8_t>(6), data, 0);
  EXPECT_TRUE(last.error);
  EXPECT_NE(last.text.find("(working counter 0, it was 1)"), std::string::npos);
}

TEST_F(SniffEthercat, LostFramesAreCounted) {
  for (int i = 0; i < 3; ++i) decoder.decode(ethercat_frame(false, 7, 0, 0x130, {0, 0}, 0), {});
  decoder.decode(ethercat_frame(true, 7, 3, 0x130, {8, 0}, 3), {});
  EXPECT_EQ(decoder.sent_frames(), 3U);
  EXPECT_EQ(decoder.returned_frames(), 1U);
  EXPECT_EQ(decoder.lost(), 2U);
}

TEST_F(SniffEthercat, AnyBytesAreDecoded) {
  std::minstd_rand random(2);
  for (int i = 0; i < 50'000; ++i) {
    std::vector<std::uint8_t> data(random() % 64);
    for (auto& byte : data) byte = static_cast<std::uint8_t>(random() >> 8);
    // Mostly addresses in use, so that sync managers, FMMUs and mailboxes get random settings.
    const unsigned offsets[] = {0x0800, 0x0600, 0x1000, 0x1100, 0x0010, static_cast<unsigned>(random() & 0xFFFF)};
    auto frame = ethercat_frame(random() % 4 != 0, static_cast<unsigned>(random() % 16),
                                static_cast<unsigned>(0x1001 + random() % 2), offsets[random() % 6], data, 1);
    if (random() % 8 == 0) frame.resize(random() % frame.size());
    for (const Decoded& decoded : decoder.decode(frame, {})) EXPECT_FALSE(decoded.text.empty());
  }
}

// ---- Files ----

std::vector<CapturedFrame> frames_in(const std::string& content, std::string* error = nullptr) {
  std::FILE* file = std::tmpfile();
  std::fwrite(content.data(), 1, content.size(), file);
  std::rewind(file);
  std::vector<CapturedFrame> frames;
  try {
    CaptureFile capture(file, "x");
    while (auto frame = capture.next()) frames.push_back(std::move(*frame));
  } catch (const MasterError& caught) {
    if (error != nullptr) *error = caught.what();
  }
  std::fclose(file);
  return frames;
}

template <typename... Numbers>
std::string words(Numbers... numbers) {
  std::string text;
  const auto add = [&text](std::uint32_t number) {
    text.append(reinterpret_cast<const char*>(&number), sizeof number);
  };
  (add(static_cast<std::uint32_t>(numbers)), ...);
  return text;
}

TEST(CaptureFile, Candump) {
  const auto frames = frames_in(
      "(1436509052.249713) can0 123#1122\n\n(1436509052.25) can0 00000123#R2\r\n(1.0) can0 20000080#0000000000000000\n"
      "(2.0) can0 080#");
  ASSERT_EQ(frames.size(), 4U);
  EXPECT_EQ(frames[0].time.count(), 1436509052249713000);
  EXPECT_EQ(std::get<canopen::Frame>(frames[0].content), frame_of("123 # 11 22"));
  const auto& remote = std::get<canopen::Frame>(frames[1].content);
  EXPECT_TRUE(remote.remote && remote.extended);
  EXPECT_EQ(remote.length, 2);
  EXPECT_EQ(std::get<CanErrorFrame>(frames[2].content).error_class, 0x80U);
  EXPECT_EQ(std::get<canopen::Frame>(frames[3].content).length, 0);
}

TEST(CaptureFile, PcapOfEitherByteOrder) {
  const std::string header = words(0xA1B23C4D, 0x00040002, 0, 0, 65535, 227);
  std::string packet = words(7, 5, 16, 16);
  packet += std::string("\0\0\1\x85\2\0\0\0\x37\2\0\0\0\0\0\0", 16);
  auto frames = frames_in(header + packet + packet);
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0].time.count(), 7'000'000'005);
  EXPECT_EQ(std::get<canopen::Frame>(frames[0].content), frame_of("185 # 37 02"));
  std::string error;
  EXPECT_EQ(frames_in(header + packet + packet.substr(0, 20), &error).size(), 1U);
  EXPECT_EQ(error.substr(0, 45), "x, byte 76: the file ends within a packet; gi");
  frames_in(header + words(7, 5, 0x7FFFFFFF, 16), &error);
  EXPECT_NE(error.find("byte 40: a packet length of 2147483647 bytes is not possible"), std::string::npos) << error;
  // Big-endian, microseconds.
  frames = frames_in(words(0xD4C3B2A1, 0x04000200, 0, 0, 0xFFFF0000, 0xE3000000) +
                     words(0x07000000, 0x05000000, 0x10000000, 0x10000000) + packet.substr(16));
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].time.count(), 7'000'005'000);
}

TEST(CaptureFile, PcapNg) {
  const std::string section = words(0x0A0D0D0A, 28, 0x1A2B3C4D, 1, -1, -1, 28);
  const std::string interface = words(1, 32, 1, 65535, 0x00010009, 9, 0, 32);
  std::string packet = words(6, 44, 0, 1, 5, 12, 12) + words(0x04030201, 2, 3, 44);
  const auto frames = frames_in(section + interface + packet);
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].time.count(), (std::int64_t{1} << 32) + 5);
  EXPECT_EQ(std::get<EthernetBytes>(frames[0].content).size(), 12U);
  std::string error;
  frames_in(section + packet, &error);
  EXPECT_NE(error.find("there is no interface 0"), std::string::npos) << error;
}

TEST(CaptureFile, WhatIsNoneIsRefusedAtItsPlace) {
  std::string error;
  frames_in("(1.0) can0 123#11\nhello\n", &error);
  EXPECT_EQ(error,
            "x:2: \"hello\" is not a line of a candump log or a serial log; give a candump log (candump -L), a serial "
            "log (time and bytes), or a pcap or pcapng file");
  for (const std::string& bad : {std::string("(1.0) can0 123#1"), std::string("(1.0) can0 12#11"),
                                 std::string("(1.0 can0 123#11"), std::string(100'000, 'x'), std::string(8, '\0')}) {
    error.clear();
    EXPECT_TRUE(frames_in(bad, &error).empty());
    EXPECT_FALSE(error.empty()) << bad.substr(0, 20);
  }
  EXPECT_TRUE(frames_in("").empty());
  // An endless input.
  std::FILE* zero = std::fopen("/dev/zero", "rb");
  ASSERT_NE(zero, nullptr);
  CaptureFile endless(zero, "/dev/zero");
  EXPECT_THROW(endless.next(), MasterError);
  std::fclose(zero);
}

TEST(SniffFilter, AllOfItMustFit) {
  CanDecoder decoder;
  SniffFilter filter;
  filter.add("node=5,6", ObjectCatalogue::standard());
  filter.add("object=statusword", ObjectCatalogue::standard());
  EXPECT_TRUE(filter.passes(decoder.decode(frame_of("605 # 40 41 60 00 00 00 00 00"), {})));
  EXPECT_FALSE(filter.passes(decoder.decode(frame_of("604 # 40 41 60 00 00 00 00 00"), {})));
  EXPECT_FALSE(filter.passes(decoder.decode(frame_of("605 # 40 40 60 00 00 00 00 00"), {})));
  EXPECT_TRUE(filter.passes(decoder.decode(frame_of("185 # 37 02"), {})));
  filter.add("kind=sdo", ObjectCatalogue::standard());
  EXPECT_FALSE(filter.passes(decoder.decode(frame_of("185 # 37 02"), {})));
  for (const char* wrong : {"node", "node=", "node=x", "kind=frog", "object=frog", "colour=red"}) {
    EXPECT_THROW(filter.add(wrong, ObjectCatalogue::standard()), MasterError) << wrong;
  }
}

}  // namespace
}  // namespace sniff_test
}  // namespace servodrome::master
