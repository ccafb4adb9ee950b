#include "canopen/301/sdo_server.hpp"
#include "test_device.hpp"

namespace servodrome::canopen::test {
namespace canopen_sdo_server_test {
namespace {

struct Exchange {
  const char* what;
  const char* request;
  Frames answers;
};

void run(TestDevice<>& device, const std::vector<Exchange>& dialogue) {
  for (const Exchange& exchange : dialogue) {
    EXPECT_EQ(device.send(exchange.request), exchange.answers) << exchange.what << ": " << exchange.request;
  }
}

// ISMC manual, ch. 2.5.2 and ESTUN manual, ch. 3.2 as generic cases.
TEST(SdoServer, ExpeditedFramesOfTheManuals) {
  auto device = make_device<>({}, 2);
  device->start(2);
  device->objects.modes_of_operation_display = 3;
  device->objects.statusword = 0x1234;
  run(*device,
      {
          {"write 60FFh", "602 # 23 FF 60 00 E8 03 00 00", {"582 # 60 FF 60 00 00 00 00 00"}},
          {"read it back", "602 # 40 FF 60 00 00 00 00 00", {"582 # 43 FF 60 00 E8 03 00 00"}},
          {"one byte", "602 # 40 61 60 00 00 00 00 00", {"582 # 4F 61 60 00 03 00 00 00"}},
          {"two bytes", "602 # 40 41 60 00 00 00 00 00", {"582 # 4B 41 60 00 34 12 00 00"}},
          {"unused bytes are ignored", "602 # 2B 40 60 00 0F 00 AA BB", {"582 # 60 40 60 00 00 00 00 00"}},
          {"size not indicated", "602 # 22 40 60 00 1F 00 AA BB", {"582 # 60 40 60 00 00 00 00 00"}},
          {"read 6040h", "602 # 40 40 60 00 00 00 00 00", {"582 # 4B 40 60 00 1F 00 00 00"}},
          {"too short", "602 # 2B FF 60 00 E8 03 00 00", {"582 # 80 FF 60 00 13 00 07 06"}},
          {"too long", "602 # 23 40 60 00 E8 03 00 00", {"582 # 80 40 60 00 12 00 07 06"}},
          {"unknown specifier", "602 # E0 61 60 00 00 00 00 00", {"582 # 80 61 60 00 01 00 04 05"}},
          {"read only", "602 # 2B 41 60 00 00 00 00 00", {"582 # 80 41 60 00 02 00 01 06"}},
          {"constant", "602 # 23 08 20 00 00 00 00 00", {"582 # 80 08 20 00 02 00 01 06"}},
          {"write only", "602 # 40 05 20 00 00 00 00 00", {"582 # 80 05 20 00 01 00 01 06"}},
          {"no object", "602 # 40 00 30 00 00 00 00 00", {"582 # 80 00 30 00 00 00 02 06"}},
          {"no sub-index", "602 # 40 40 60 01 00 00 00 00", {"582 # 80 40 60 01 11 00 09 06"}},
          {"too high", "602 # 2B 06 20 00 65 00 00 00", {"582 # 80 06 20 00 31 00 09 06"}},
          {"too low", "602 # 2B 06 20 00 9B FF 00 00", {"582 # 80 06 20 00 32 00 09 06"}},
          {"eight bytes cannot be expedited", "602 # 23 03 20 00 01 00 00 00", {"582 # 80 03 20 00 13 00 07 06"}},
          {"short frames are no SDO", "602 # 40 61 60 00", {}},
          {"another node's", "603 # 40 61 60 00 00 00 00 00", {}},
          {"abort is not answered", "602 # 80 61 60 00 00 00 00 08", {}},
          {"whatever its reserved bits", "602 # 9F 61 60 00 00 00 00 08", {}},
          {"segment out of the blue", "602 # 60 00 00 00 00 00 00 00", {"582 # 80 03 20 00 01 00 04 05"}},
      });
  EXPECT_EQ(device->objects.target_velocity, 1000);
  EXPECT_EQ(device->objects.ranged, 0);
}

TEST(SdoServer, LengthAbortsAreTheDictionarys) {
  auto device = make_device<>({}, 2, {AbortCode::length_mismatch, AbortCode::length_mismatch});
  device->start(2);
  // ISMC manual, Table 2-16
  EXPECT_EQ(device->send("602 # 2B FF 60 00 E8 03 00 00"), (Frames{"582 # 80 FF 60 00 10 00 07 06"}));
  EXPECT_EQ(device->send("602 # 21 FF 60 00 05 00 00 00"), (Frames{"582 # 80 FF 60 00 10 00 07 06"}));
}

TEST(SdoServer, ProductVariantsOfTheResponses) {
  auto device = make_device<>({.sdo_download_response_echoes_data = true, .sdo_expedited_upload_sign_extends = true});
  device->start();
  device->objects.modes_of_operation_display = -2;
  device->objects.statusword = 0xC031;
  EXPECT_EQ(device->send("601 # 23 7A 60 00 03 9D 36 00"), (Frames{"581 # 60 7A 60 00 03 9D 36 00"}));
  EXPECT_EQ(device->send("601 # 40 61 60 00 00 00 00 00"), (Frames{"581 # 4F 61 60 00 FE FF FF FF"}));
  EXPECT_EQ(device->send("601 # 40 41 60 00 00 00 00 00"), (Frames{"581 # 4B 41 60 00 31 C0 FF FF"}));
}

TEST(SdoServer, SegmentedUpload) {
  auto device = make_device();
  device->start();
  run(*device, {
                   {"22 bytes", "601 # 40 08 10 00 00 00 00 00", {"581 # 41 08 10 00 16 00 00 00"}},
                   {"1", "601 # 60 00 00 00 00 00 00 00", {"581 # 00 53 65 72 76 6F 64 72"}},
                   {"2", "601 # 70 00 00 00 00 00 00 00", {"581 # 10 6F 6D 65 20 74 65 73"}},
                   {"3", "601 # 60 00 00 00 00 00 00 00", {"581 # 00 74 20 64 65 76 69 63"}},
                   {"4", "601 # 70 00 00 00 00 00 00 00", {"581 # 1D 65 00 00 00 00 00 00"}},
                   {"over", "601 # 60 00 00 00 00 00 00 00", {"581 # 80 08 10 00 01 00 04 05"}},
                   {"again", "601 # 40 08 10 00 00 00 00 00", {"581 # 41 08 10 00 16 00 00 00"}},
                   {"toggle error", "601 # 70 00 00 00 00 00 00 00", {"581 # 80 08 10 00 00 00 03 05"}},
                   {"and it is over", "601 # 60 00 00 00 00 00 00 00", {"581 # 80 08 10 00 01 00 04 05"}},
                   {"empty string", "601 # 40 01 20 00 00 00 00 00", {"581 # 41 01 20 00 00 00 00 00"}},
                   {"no bytes", "601 # 60 00 00 00 00 00 00 00", {"581 # 0F 00 00 00 00 00 00 00"}},
               });
  device->objects.wide = 0x0102030405060708;
  run(*device, {
                   {"64 bits", "601 # 40 03 20 00 00 00 00 00", {"581 # 41 03 20 00 08 00 00 00"}},
                   {"1", "601 # 60 00 00 00 00 00 00 00", {"581 # 00 08 07 06 05 04 03 02"}},
               });
  device->objects.wide = 0;  // the transfer continues with the value at its start
  run(*device, {{"2", "601 # 70 00 00 00 00 00 00 00", {"581 # 1D 01 00 00 00 00 00 00"}}});
}

TEST(SdoServer, SegmentedDownload) {
  auto device = make_device();
  device->start();
  run(*device, {
                   {"announce 10", "601 # 21 01 20 00 0A 00 00 00", {"581 # 60 01 20 00 00 00 00 00"}},
                   {"1", "601 # 00 41 42 43 44 45 46 47", {"581 # 20 00 00 00 00 00 00 00"}},
                   {"2", "601 # 19 48 49 4A 00 00 00 00", {"581 # 30 00 00 00 00 00 00 00"}},
               });
  EXPECT_EQ(std::string(device->objects.name.bytes.data(), device->objects.name.length), "ABCDEFGHIJ");
  run(*device, {
                   {"announce 2", "601 # 21 01 20 00 02 00 00 00", {"581 # 60 01 20 00 00 00 00 00"}},
                   {"three come", "601 # 09 41 42 43 00 00 00 00", {"581 # 80 01 20 00 12 00 07 06"}},
                   {"announce 9", "601 # 21 01 20 00 09 00 00 00", {"581 # 60 01 20 00 00 00 00 00"}},
                   {"three come", "601 # 09 41 42 43 00 00 00 00", {"581 # 80 01 20 00 13 00 07 06"}},
                   {"41 of 40 bytes", "601 # 21 01 20 00 29 00 00 00", {"581 # 80 01 20 00 12 00 07 06"}},
                   {"size unknown", "601 # 20 01 20 00 00 00 00 00", {"581 # 60 01 20 00 00 00 00 00"}},
                   {"toggle error", "601 # 10 41 42 43 44 45 46 47", {"581 # 80 01 20 00 00 00 03 05"}},
                   {"read only", "601 # 21 08 10 00 05 00 00 00", {"581 # 80 08 10 00 02 00 01 06"}},
                   {"4 bytes of 8", "601 # 21 03 20 00 04 00 00 00", {"581 # 80 03 20 00 13 00 07 06"}},
                   {"two bytes in a segment", "601 # 21 40 60 00 02 00 00 00", {"581 # 60 40 60 00 00 00 00 00"}},
                   {"the two", "601 # 0B 34 12 00 00 00 00 00", {"581 # 20 00 00 00 00 00 00 00"}},
                   {"range is checked at the end", "601 # 20 06 20 00 00 00 00 00", {"581 # 60 06 20 00 00 00 00 00"}},
                   {"1000", "601 # 0B E8 03 00 00 00 00 00", {"581 # 80 06 20 00 31 00 09 06"}},
               });
  EXPECT_EQ(std::string(device->objects.name.bytes.data(), device->objects.name.length), "ABCDEFGHIJ");
  EXPECT_EQ(device->objects.controlword, 0x1234);
}

TEST(SdoServer, DownloadLargerThanTheBufferOrTheObject) {
  auto device = make_device<4, 8, 64>();
  device->start();
  // 6000 bytes fit into 2002h, but this device's transfer buffer has only 64.
  EXPECT_EQ(device->send("601 # 21 02 20 00 41 00 00 00"), (Frames{"581 # 80 02 20 00 05 00 04 05"}));
  EXPECT_EQ(device->send("601 # 20 02 20 00 00 00 00 00"), (Frames{"581 # 60 02 20 00 00 00 00 00"}));
  for (int i = 0; i < 9; ++i) {
    EXPECT_EQ(device->send(i % 2 == 0 ? "601 # 00 1 2 3 4 5 6 7" : "601 # 10 1 2 3 4 5 6 7").size(), 1U);
  }
  EXPECT_EQ(device->send("601 # 10 1 2 3 4 5 6 7"), (Frames{"581 # 80 02 20 00 05 00 04 05"}));
  // 2001h has 40 bytes: the 41st is too many for the object.
  device->send("601 # 20 01 20 00 00 00 00 00");
  for (int i = 0; i < 5; ++i) device->send(i % 2 == 0 ? "601 # 00 1 2 3 4 5 6 7" : "601 # 10 1 2 3 4 5 6 7");
  EXPECT_EQ(device->send("601 # 13 1 2 3 4 5 6 0"), (Frames{"581 # 80 01 20 00 12 00 07 06"}));
}

TEST(SdoServer, ServicesThatAreNotOffered) {
  auto device = make_device<>({.sdo_segmented = false, .sdo_block = false});
  device->start();
  run(*device, {
                   {"upload", "601 # 40 08 10 00 00 00 00 00", {"581 # 80 08 10 00 01 00 04 05"}},
                   {"download", "601 # 21 01 20 00 02 00 00 00", {"581 # 80 01 20 00 01 00 04 05"}},
                   {"block upload", "601 # A4 08 10 00 7F 00 00 00", {"581 # 80 08 10 00 01 00 04 05"}},
                   {"block download", "601 # C6 01 20 00 02 00 00 00", {"581 # 80 01 20 00 01 00 04 05"}},
                   {"expedited works", "601 # 40 61 60 00 00 00 00 00", {"581 # 4F 61 60 00 00 00 00 00"}},
               });
}

TEST(SdoServer, TimeoutAndAbort) {
  auto device = make_device<>({.sdo_timeout = 500ms});
  device->start();
  device->send("601 # 40 08 10 00 00 00 00 00");
  EXPECT_EQ(device->advance(499ms), Frames{});
  EXPECT_EQ(device->advance(1ms), (Frames{"581 # 80 08 10 00 00 00 04 05"}));
  EXPECT_EQ(device->advance(10s), Frames{});
  device->send("601 # 40 08 10 00 00 00 00 00");
  EXPECT_EQ(device->send("601 # 80 08 10 00 00 00 00 08"), Frames{});
  EXPECT_EQ(device->advance(10s), Frames{});
  // The server accepts a client that starts a new transfer.
  device->send("601 # 40 08 10 00 00 00 00 00");
  device->send("601 # 60 00 00 00 00 00 00 00");
  EXPECT_EQ(device->send("601 # 40 08 10 00 00 00 00 00"), (Frames{"581 # 41 08 10 00 16 00 00 00"}));
  EXPECT_EQ(device->send("601 # 60 00 00 00 00 00 00 00"), (Frames{"581 # 00 53 65 72 76 6F 64 72"}));
}

TEST(SdoServer, BlockUploadFrames) {
  auto device = make_device();
  device->start();
  run(*device,
      {
          {"initiate, CRC, 2 per block", "601 # A4 08 10 00 02 00 00 00", {"581 # C6 08 10 00 16 00 00 00"}},
          {"start",
           "601 # A3 00 00 00 00 00 00 00",
           {"581 # 01 53 65 72 76 6F 64 72", "581 # 02 6F 6D 65 20 74 65 73"}},
          {"the first of two arrived",
           "601 # A2 01 03 00 00 00 00 00",
           {"581 # 01 6F 6D 65 20 74 65 73", "581 # 02 74 20 64 65 76 69 63", "581 # 83 65 00 00 00 00 00 00"}},
          // CRC-16/XMODEM of the 22 bytes, from an independent implementation (python binascii.crc_hqx).
          {"all three arrived", "601 # A2 03 03 00 00 00 00 00", {"581 # D9 90 FA 00 00 00 00 00"}},
          {"confirm", "601 # A1 00 00 00 00 00 00 00", {}},
          {"no more", "601 # A1 00 00 00 00 00 00 00", {"581 # 80 08 10 00 01 00 04 05"}},
          {"block size 0", "601 # A4 08 10 00 00 00 00 00", {"581 # 80 08 10 00 02 00 04 05"}},
          {"block size 128", "601 # A4 08 10 00 80 00 00 00", {"581 # 80 08 10 00 02 00 04 05"}},
          {"protocol switch at 22", "601 # A4 08 10 00 7F 16 00 00", {"581 # 41 08 10 00 16 00 00 00"}},
          {"no switch at 21", "601 # A4 08 10 00 7F 15 00 00", {"581 # C6 08 10 00 16 00 00 00"}},
          {"start twice",
           "601 # A3 00 00 00 00 00 00 00",
           {"581 # 01 53 65 72 76 6F 64 72", "581 # 02 6F 6D 65 20 74 65 73", "581 # 03 74 20 64 65 76 69 63",
            "581 # 84 65 00 00 00 00 00 00"}},
          {"more than was sent", "601 # A2 05 7F 00 00 00 00 00", {"581 # 80 08 10 00 03 00 04 05"}},
      });
}

TEST(SdoServer, BlockDownloadFrames) {
  auto device = make_device();
  device->start();
  run(*device, {
                   {"initiate, CRC, 9 bytes", "601 # C6 01 20 00 09 00 00 00", {"581 # A4 01 20 00 7F 00 00 00"}},
                   {"1", "601 # 01 31 32 33 34 35 36 37", {}},
                   {"2, last", "601 # 82 38 39 00 00 00 00 00", {"581 # A2 02 7F 00 00 00 00 00"}},
                   {"end, 5 unused, CRC 31C3h", "601 # D5 C3 31 00 00 00 00 00", {"581 # A1 00 00 00 00 00 00 00"}},
               });
  EXPECT_EQ(std::string(device->objects.name.bytes.data(), device->objects.name.length), "123456789");
  run(*device, {
                   {"initiate", "601 # C4 01 20 00 00 00 00 00", {"581 # A4 01 20 00 7F 00 00 00"}},
                   {"2 before 1", "601 # 02 38 39 00 00 00 00 00", {}},
                   {"3, last: nothing arrived", "601 # 83 38 39 00 00 00 00 00", {"581 # A2 00 7F 00 00 00 00 00"}},
                   {"again 1", "601 # 01 31 32 33 34 35 36 37", {}},
                   {"2 twice", "601 # 02 38 39 30 31 32 33 34", {}},
                   {"2 twice", "601 # 02 38 39 30 31 32 33 34", {}},
                   {"3, last", "601 # 83 38 39 00 00 00 00 00", {"581 # A2 03 7F 00 00 00 00 00"}},
                   {"wrong CRC", "601 # D5 00 00 00 00 00 00 00", {"581 # 80 01 20 00 04 00 04 05"}},
                   {"initiate", "601 # C4 01 20 00 00 00 00 00", {"581 # A4 01 20 00 7F 00 00 00"}},
                   {"sequence number 0", "601 # 00 31 32 33 34 35 36 37", {"581 # 80 01 20 00 03 00 04 05"}},
                   {"announces 41", "601 # C6 01 20 00 29 00 00 00", {"581 # 80 01 20 00 12 00 07 06"}},
                   {"announces 9", "601 # C6 01 20 00 09 00 00 00", {"581 # A4 01 20 00 7F 00 00 00"}},
                   {"1", "601 # 81 31 32 33 34 35 36 37", {"581 # A2 01 7F 00 00 00 00 00"}},
                   {"sends 7", "601 # C1 00 00 00 00 00 00 00", {"581 # 80 01 20 00 13 00 07 06"}},
                   {"initiate", "601 # C0 01 20 00 00 00 00 00", {"581 # A4 01 20 00 7F 00 00 00"}},
                   {"client aborts", "601 # 80 01 20 00 00 00 00 08", {}},
                   {"free again", "601 # 40 61 60 00 00 00 00 00", {"581 # 4F 61 60 00 00 00 00 00"}},
               });
  EXPECT_EQ(std::string(device->objects.name.bytes.data(), device->objects.name.length), "123456789");
}

// The buffer of 64 bytes takes ten segments; the last one has a single byte and six bytes of padding. An eleventh
// segment is too long. The object takes 40 bytes: exactly 40 are accepted, 41 are refused.
TEST(SdoServer, BlockDownloadUpToTheLastByte) {
  auto device = make_device();
  device->start();
  const auto segment = [](unsigned command, const char* bytes) {
    constexpr const char* digits = "0123456789ABCDEF";
    return std::string("601 # ") + digits[command >> 4] + digits[command & 15] + bytes;
  };
  const auto download = [&](unsigned bytes) {
    device->send("601 # C0 01 20 00 00 00 00 00");
    const unsigned segments = (bytes + 6) / 7;
    Frames answers;
    for (unsigned n = 1; n <= segments; ++n) {
      answers = device->send(segment(n == segments ? 0x80 | n : n, " 41 41 41 41 41 41 41"));
      if (!answers.empty() && answers[0].substr(6, 2) == "80") return answers[0];
    }
    answers = device->send(segment(0xC1 | (7 * segments - bytes) << 2, " 00 00 00 00 00 00 00"));
    return answers.empty() ? std::string() : answers[0];
  };
  const std::size_t capacity = device->objects.name.bytes.size();
  ASSERT_EQ(capacity, 40U);
  EXPECT_EQ(download(40), "581 # A1 00 00 00 00 00 00 00");
  EXPECT_EQ(device->objects.name.length, 40U);
  EXPECT_EQ(download(41), "581 # 80 01 20 00 12 00 07 06");
  EXPECT_EQ(device->objects.name.length, 40U);
  EXPECT_EQ(download(70).substr(6, 2), "80");
  EXPECT_EQ(download(39), "581 # A1 00 00 00 00 00 00 00");
}

// One segment more than announced: the error is "too long for the object", even if the data do not fit into the buffer
// either.
TEST(SdoServer, BlockDownloadOfMoreThanWasAnnounced) {
  auto device = make_device<4, 8, 14>();
  device->start();
  EXPECT_EQ(device->send("601 # C2 01 20 00 0E 00 00 00"), (Frames{"581 # A4 01 20 00 02 00 00 00"}));
  device->send("601 # 01 41 41 41 41 41 41 41");
  EXPECT_EQ(device->send("601 # 02 41 41 41 41 41 41 41"), (Frames{"581 # A2 02 02 00 00 00 00 00"}));
  EXPECT_EQ(device->send("601 # 01 41 41 41 41 41 41 41"), (Frames{"581 # 80 01 20 00 12 00 07 06"}));
}

// Half of the timeout, and at most half a second.
TEST(SdoServer, BlockDownloadAsksAgainInTime) {
  for (const auto& [timeout, after] : {std::pair{100ms, 50ms}, {999ms, 499ms}, {1000ms, 500ms}, {10000ms, 500ms}}) {
    auto device = make_device<>({.sdo_timeout = timeout});
    device->start();
    device->send("601 # C4 01 20 00 00 00 00 00");
    device->send("601 # 01 31 32 33 34 35 36 37");
    EXPECT_EQ(device->advance(after - 1ms), Frames{}) << timeout.count();
    EXPECT_EQ(device->advance(2ms).size(), 1U) << timeout.count();
  }
}

TEST(SdoServer, BlockDownloadAsksAgainWhenTheEndOfABlockIsLost) {
  auto device = make_device<>({.sdo_timeout = 1s});
  device->start();
  device->send("601 # C4 01 20 00 00 00 00 00");
  device->send("601 # 01 31 32 33 34 35 36 37");
  EXPECT_EQ(device->advance(499ms), Frames{});
  EXPECT_EQ(device->advance(1ms), (Frames{"581 # A2 01 7F 00 00 00 00 00"}));
  device->send("601 # 81 38 39 00 00 00 00 00");
  EXPECT_EQ(device->send("601 # D5 C3 31 00 00 00 00 00"), (Frames{"581 # A1 00 00 00 00 00 00 00"}));
  EXPECT_EQ(std::string(device->objects.name.bytes.data(), device->objects.name.length), "123456789");
  device->send("601 # C4 01 20 00 00 00 00 00");
  EXPECT_EQ(device->advance(2s), (Frames{"581 # 80 01 20 00 00 00 04 05"}));
}

// The requests of a client that restarts without an abort look like segments out of sequence. They do not restart the
// timeout.
TEST(SdoServer, BlockDownloadOfAClientThatRestartsTimesOut) {
  auto device = make_device<>({.sdo_timeout = 5s});
  device->start();
  device->send("601 # C4 01 20 00 00 00 00 00");
  device->send("601 # 01 31 32 33 34 35 36 37");
  Frames answers;
  for (int i = 0; i < 3; ++i) {
    for (const std::string& frame : device->advance(2s)) answers.push_back(frame);
    if (i < 2) device->send("601 # 40 00 10 00 00 00 00 00");
  }
  EXPECT_EQ(answers.back(), "581 # 80 01 20 00 00 00 04 05");
  EXPECT_EQ(device->send("601 # 40 61 60 00 00 00 00 00"), (Frames{"581 # 4F 61 60 00 00 00 00 00"}));
}

}  // namespace
}  // namespace canopen_sdo_server_test
}  // namespace servodrome::canopen::test
