// Decoding of serial lines and Modbus TCP: the examples of the iSMK manual byte for byte, streams split at any place,
// and captures.
#include <gtest/gtest.h>
#include <random>

#include "master/error.hpp"
#include "modbus/ismk_examples.hpp"
#include "modbus/ismk_modbus.hpp"
#include "serial10/ismk_examples.hpp"
#include "tools/sniff/capture_file.hpp"
#include "tools/sniff/modbus_tcp_decoder.hpp"
#include "tools/sniff/serial_decoder.hpp"

namespace servodrome::master {
namespace sniff_serial_test {
namespace {

using namespace std::chrono_literals;
using servodrome::test::bytes_of;

SerialModel ismk() {
  SerialModel model =
      SerialModel::of(servodrome::test::ismk_table, modbus::test::ismk_map, &modbus::test::ismk_profile);
  model.catalogue = ObjectCatalogue::standard();  // the table of the examples has no names
  return model;
}

std::vector<std::uint8_t> sealed(const std::string& text) {
  std::vector<std::uint8_t> bytes = bytes_of(text);
  const std::size_t size = bytes.size();
  bytes.resize(size + 2);
  modbus::seal_rtu_frame(bytes, size);
  return bytes;
}

std::string words_of(const std::vector<Decoded>& all) {
  std::string text;
  for (const Decoded& one : all) {
    text += (text.empty() ? "" : " | ") + (one.source.empty() ? one.text : one.source + " " + one.text);
  }
  return text;
}

class SniffSerial : public testing::Test {
 protected:
  SniffSerial() { decoder.set_model(0, ismk()); }
  std::string heard(const std::vector<std::uint8_t>& bytes, SerialSender sender = SerialSender::unknown) {
    all = decoder.decode(bytes, now += 5ms, sender);
    return words_of(all);
  }
  std::string heard(const std::string& bytes, SerialSender sender = SerialSender::unknown) {
    return heard(bytes_of(bytes), sender);
  }

  SerialDecoder decoder;
  Time now{};
  std::vector<Decoded> all;
};

// Every example of the manual (ch. 8.3): object and value as in its text; requests and answers are distinguished,
// although those of function 06 have the same bytes.
TEST_F(SniffSerial, ModbusExamplesOfTheIsmkManual) {
  for (const modbus::test::IsmkExample& example : modbus::test::ismk_examples) {
    const ObjectAddress object{example.index, example.sub};
    const bool reads = bytes_of(example.request)[1] == 3;
    heard(example.request);
    ASSERT_EQ(all.size(), 1U) << example.what;
    EXPECT_EQ(all[0].kind, FrameKind::modbus);
    EXPECT_EQ(all[0].node, 1U);
    EXPECT_TRUE(all[0].names(object, false)) << example.what << " " << all[0].text;
    EXPECT_TRUE(all[0].text.starts_with(reads ? "Modbus read " : "Modbus write ")) << all[0].text;
    const Decoded request = all[0];
    heard(example.response != nullptr ? example.response : example.request);
    ASSERT_EQ(all.size(), 1U) << example.what;
    EXPECT_TRUE(all[0].names(object, false)) << example.what << " " << all[0].text;
    EXPECT_FALSE(all[0].error) << all[0].text;
    EXPECT_TRUE(reads || all[0].text.starts_with("Modbus written ")) << all[0].text;
    const Decoded& carrier = reads ? all[0] : request;
    ASSERT_EQ(carrier.values.size(), 1U) << carrier.text;
    EXPECT_TRUE(carrier.values[0].text.starts_with(std::to_string(example.value)))
        << example.what << " " << carrier.text;
  }
  EXPECT_EQ(heard("01 03 32 00 00 02 CA B3"), "station 1 Modbus read 6041:00 Statusword");
}

TEST_F(SniffSerial, WordsOfSomeExamples) {
  EXPECT_EQ(heard("01 10 6F 00 00 02 04 F5 C3 00 28 D9 B3"),
            "station 1 Modbus write 60FF:00 Target velocity = 2684355");
  EXPECT_EQ(heard("01 10 6F 00 00 02 5C DC"), "station 1 Modbus written 60FF:00 Target velocity");
  heard("01 03 32 00 00 02 CA B3");
  EXPECT_EQ(heard("01 03 04 C0 37 FF FF 76 4D"),
            "station 1 Modbus 6041:00 Statusword is 49207 (C037h) operation enabled");
  // A refused read, with the function code of the manual (ch. 8.3.1) and with that of the standard.
  heard(sealed("01 03 99 00 00 01"));
  EXPECT_EQ(heard(sealed("01 81 02")), "station 1 Modbus exception 02h illegal data address: read register 9900h");
  EXPECT_TRUE(all[0].error);
  heard(sealed("01 10 40 00 00 02 04 00 00 00 00"));
  EXPECT_TRUE(heard(sealed("01 90 04")).starts_with("station 1 Modbus exception 04h "));
  // A broadcast has no answer, so the same frame again is another broadcast.
  EXPECT_TRUE(heard(sealed("00 06 31 00 00 06")).starts_with("all stations Modbus write 6040:00"));
  EXPECT_TRUE(heard(sealed("00 06 31 00 00 06")).starts_with("all stations Modbus write 6040:00"));
}

TEST_F(SniffSerial, ExamplesOfTheTenByteProtocol) {
  for (const serial10::IsmkExample& example : serial10::ismk_examples) {
    const std::vector<std::uint8_t> request = bytes_of(example.request);
    const ObjectAddress object{static_cast<std::uint16_t>(request[3] << 8 | request[2]), request[4]};
    heard(example.request);
    ASSERT_EQ(all.size(), 1U) << example.what;
    EXPECT_EQ(all[0].kind, FrameKind::serial10);
    EXPECT_TRUE(all[0].names(object, false)) << all[0].text;
    const bool reads = request[1] == 0x40;
    const Decoded asked = all[0];
    heard(example.answer);
    ASSERT_EQ(all.size(), 1U) << example.what;
    const Decoded& carrier = reads ? all[0] : asked;
    ASSERT_EQ(carrier.values.size(), 1U) << carrier.text;
    EXPECT_TRUE(carrier.values[0].text.starts_with(std::to_string(example.value)) ||
                carrier.values[0].text.starts_with(std::to_string(example.value - 0x10000)))
        << example.what << " " << carrier.text;
  }
  const serial10::Frame refusal = serial10::Frame::make(1, serial10::Command::error, 0x60FF, 0, 0x06090031);
  EXPECT_TRUE(heard(std::vector<std::uint8_t>(refusal.bytes.begin(), refusal.bytes.end()))
                  .ends_with(": 0609 0031h value too high"));
  EXPECT_TRUE(all[0].error);
}

// The text does not depend on how the bytes are split into pieces.
TEST_F(SniffSerial, AStreamInAnyPieces) {
  std::vector<std::uint8_t> stream;
  std::vector<std::string> expected;
  for (const modbus::test::IsmkExample& example : modbus::test::ismk_examples) {
    for (const char* frame : {example.request, example.response != nullptr ? example.response : example.request}) {
      const std::vector<std::uint8_t> bytes = bytes_of(frame);
      stream.insert(stream.end(), bytes.begin(), bytes.end());
      expected.push_back(heard(bytes));
    }
  }
  std::minstd_rand random(5);
  for (int round = 0; round < 50; ++round) {
    SerialDecoder again;
    again.set_model(0, ismk());
    std::vector<std::string> said;
    for (std::size_t at = 0; at < stream.size();) {
      const std::size_t size = std::min<std::size_t>(1 + random() % 40, stream.size() - at);
      for (const Decoded& one : again.decode(std::span(stream).subspan(at, size), Time{}))
        said.push_back(words_of({one}));
      at += size;
    }
    ASSERT_EQ(said, expected) << round;
  }
}

TEST_F(SniffSerial, WhatIsSpoiltIsSaidAndTheNextFrameFound) {
  // The misprinted frame of the manual (Table 8-1, register 5020), then a valid one.
  std::string said = heard(modbus::test::ismk_wrong_crc);
  said += words_of(all = decoder.finish());
  EXPECT_EQ(said, "13 bytes outside a frame: checksum or length is wrong");
  EXPECT_EQ(heard("01 03 32 00 00 02 CA B3"), "station 1 Modbus read 6041:00 Statusword");
  // A frame without its first bytes, followed by a complete one in the same piece.
  heard("04 C0 37 FF FF 76 4D 01 03 32 00 00 02 CA B3");
  ASSERT_EQ(all.size(), 2U) << words_of(all);
  EXPECT_EQ(all[0].kind, FrameKind::garbage);
  EXPECT_EQ(all[1].kind, FrameKind::modbus);
  // The start of a frame, then silence.
  EXPECT_EQ(heard("01 03 04 C0"), "");
  now += 1s;
  heard("01 03 32 00 00 02 CA B3");
  ASSERT_EQ(all.size(), 2U) << words_of(all);
  EXPECT_EQ(all[0].raw, "01 03 04 C0");
  EXPECT_EQ(heard("01 03"), "");
  EXPECT_EQ(words_of(decoder.finish()), "2 bytes outside a frame: checksum or length is wrong");
}

TEST_F(SniffSerial, WhoSentItDecidesWhereThatIsKnown) {
  EXPECT_TRUE(heard("01 06 35 00 00 03 C6 07", SerialSender::master).starts_with("station 1 Modbus write 6060:00"));
  // The master repeats the request because there was no answer.
  EXPECT_TRUE(heard("01 06 35 00 00 03 C6 07", SerialSender::master).starts_with("station 1 Modbus write 6060:00"));
  EXPECT_TRUE(heard("01 06 35 00 00 03 C6 07", SerialSender::drive).starts_with("station 1 Modbus written 6060:00"));
}

TEST_F(SniffSerial, WithoutAProductRegistersHaveNumbers) {
  SerialDecoder plain;
  EXPECT_EQ(words_of(plain.decode(sealed("05 03 32 00 00 02"), {})), "station 5 Modbus read 2 registers from 3200h");
  EXPECT_EQ(words_of(plain.decode(sealed("05 03 04 00 01 FF FF"), {})),
            "station 5 Modbus register 3200h is 1 (0001h), register 3201h is 65535 (FFFFh)");
  EXPECT_EQ(words_of(plain.decode(sealed("05 2B 0E 01 00"), {})),
            "station 5 Modbus read device identification from object 00h, code 1");
  EXPECT_EQ(words_of(plain.decode(sealed("05 2B 0E 01 01 00 00 01 00 03 41 42 43"), {})),
            "station 5 Modbus device identification 00h \"ABC\"");
}

TEST_F(SniffSerial, AnyBytesAreDecoded) {
  std::minstd_rand random(7);
  for (int i = 0; i < 20'000; ++i) {
    std::vector<std::uint8_t> bytes(random() % 40);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random() >> 8);
    if (random() % 3 == 0 && bytes.size() > 4) modbus::seal_rtu_frame(bytes, bytes.size() - 2);
    if (bytes.size() > 2) bytes[1] = static_cast<std::uint8_t>(random() % 0x30);
    for (const Decoded& one : decoder.decode(bytes, now += 1ms, static_cast<SerialSender>(random() % 3))) {
      EXPECT_FALSE(one.text.empty());
      EXPECT_FALSE(one.raw.empty());
    }
  }
}

// ---- Modbus TCP ----

// A TCP segment between a client (port 40000) and a server, in an Ethernet frame.
std::vector<std::uint8_t> tcp(bool from_client, std::uint32_t sequence, const std::string& data,
                              std::uint8_t flags = 0x18, std::uint16_t port = 502) {
  const std::vector<std::uint8_t> payload = bytes_of(data);
  std::vector<std::uint8_t> frame(12);
  const auto add16 = [&](std::size_t value) {
    frame.push_back(static_cast<std::uint8_t>(value >> 8));
    frame.push_back(static_cast<std::uint8_t>(value));
  };
  add16(0x0800);
  frame.push_back(0x45);
  frame.push_back(0);
  add16(40 + payload.size());
  add16(0);
  add16(0);
  frame.push_back(64);
  frame.push_back(6);
  add16(0);
  const std::uint8_t client[] = {10, 0, 0, 1};
  const std::uint8_t server[] = {10, 0, 0, 2};
  for (const auto* side : {from_client ? client : server, from_client ? server : client})
    frame.insert(frame.end(), side, side + 4);
  add16(from_client ? 40000 : port);
  add16(from_client ? port : 40000);
  add16(sequence >> 16);
  add16(sequence & 0xFFFF);
  add16(0);
  add16(0);
  frame.push_back(0x50);
  frame.push_back(flags);
  add16(1000);
  add16(0);
  add16(0);
  frame.insert(frame.end(), payload.begin(), payload.end());
  return frame;
}

TEST(SniffModbusTcp, RequestsAndAnswersOfAConnection) {
  ModbusTcpDecoder decoder;
  decoder.set_model(0, ismk());
  const auto heard = [&](const std::vector<std::uint8_t>& frame) {
    EXPECT_TRUE(decoder.takes(frame));
    return words_of(decoder.decode(frame, {}));
  };
  EXPECT_EQ(heard(tcp(true, 99, "", 2)), "");
  EXPECT_EQ(heard(tcp(true, 100, "00 01 00 00 00 06 01 03 32 00 00 02")), "unit 1 Modbus read 6041:00 Statusword");
  // TCP splits the second request in two, and the client sends it before the answer to the first. A retransmission adds
  // no text.
  EXPECT_EQ(heard(tcp(true, 112, "00 02 00 00 00 06 01 06")), "");
  EXPECT_EQ(heard(tcp(true, 112, "00 02 00 00 00 06 01 06")), "");
  EXPECT_TRUE(heard(tcp(true, 120, "35 00 00 03")).starts_with("unit 1 Modbus write 6060:00"));
  const std::string answers =
      heard(tcp(false, 7, "00 02 00 00 00 06 01 06 35 00 00 03 00 01 00 00 00 07 01 03 04 C0 37 FF FF"));
  EXPECT_NE(answers.find("Modbus written 6060:00"), std::string::npos) << answers;
  EXPECT_NE(answers.find("6041:00 Statusword is 49207 (C037h)"), std::string::npos) << answers;
  EXPECT_FALSE(decoder.takes(tcp(true, 1, "00", 0x18, 8080)));
  decoder.add_port(8080);
  EXPECT_TRUE(decoder.takes(tcp(true, 1, "00", 0x18, 8080)));
  EXPECT_EQ(heard(tcp(true, 124, "47 45 54 20 2F 20 48 54 54 50")), "no Modbus TCP: the header is wrong");
}

TEST(SniffModbusTcp, AnyBytesAreDecoded) {
  ModbusTcpDecoder decoder;
  std::minstd_rand random(3);
  for (int i = 0; i < 20'000; ++i) {
    auto frame = tcp(random() % 2 == 0, static_cast<std::uint32_t>(random() % 64),
                     "00 01 00 00 00 06 01 03 32 00 00 02 00 00 00 00 00 03 01 2B 0E 01", 0x18);
    for (int change = 0; change < 3; ++change)
      frame[12 + random() % (frame.size() - 12)] = static_cast<std::uint8_t>(random() >> 8);
    if (random() % 8 == 0) frame.resize(random() % frame.size());
    for (const Decoded& one : decoder.decode(frame, {})) EXPECT_FALSE(one.text.empty());
  }
}

// ---- Captures ----

std::vector<CapturedFrame> serial_frames_in(const std::string& content, std::string* error = nullptr) {
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

TEST(SerialCapture, TextLines) {
  const auto frames = serial_frames_in(
      "(1436509052.249713) rs485 > 01 03 32 00 00 02 CA B3\n0.5 < 01 03\n01 03 FF\n(2.0) rs485 tcp> 00 01\n"
      "(2.0) rs > 07\n(2.0) ba < 08\n");
  ASSERT_EQ(frames.size(), 6U);
  EXPECT_EQ(std::get<SerialBytes>(frames[4].content).bytes, bytes_of("07"));
  EXPECT_EQ(std::get<SerialBytes>(frames[5].content).bytes, bytes_of("08"));
  EXPECT_EQ(frames[0].time.count(), 1436509052249713000);
  const auto& first = std::get<SerialBytes>(frames[0].content);
  EXPECT_EQ(first.sender, SerialSender::master);
  EXPECT_EQ(first.bytes, bytes_of("01 03 32 00 00 02 CA B3"));
  EXPECT_EQ(std::get<SerialBytes>(frames[1].content).sender, SerialSender::drive);
  EXPECT_EQ(std::get<SerialBytes>(frames[2].content).sender, SerialSender::unknown);
  EXPECT_TRUE(std::get<SerialBytes>(frames[3].content).is_tcp);
  std::string error;
  EXPECT_TRUE(serial_frames_in("(1.0) rs485 > 01 0G\n", &error).empty());
  EXPECT_NE(error.find("x:1"), std::string::npos) << error;
  EXPECT_TRUE(serial_frames_in("(1.0) rs485 >\n", &error).empty());
}

TEST(SerialCapture, RtacSerialPackets) {
  const auto little = [](std::initializer_list<std::uint32_t> numbers) {
    std::string text;
    for (const std::uint32_t number : numbers) text.append(reinterpret_cast<const char*>(&number), sizeof number);
    return text;
  };
  std::string file = little({0xA1B2C3D4, 0x00040002, 0, 0, 65535, 250});
  for (const char event : {'\2', '\0', '\4'}) {
    file += little({7, 5, 14, 14}) + std::string(8, '\0') + event + std::string(3, '\0') + "\1\3";
  }
  const auto frames = serial_frames_in(file);
  ASSERT_EQ(frames.size(), 2U);  // a change of the control lines has no data
  EXPECT_EQ(std::get<SerialBytes>(frames[0].content).sender, SerialSender::drive);
  EXPECT_EQ(std::get<SerialBytes>(frames[0].content).bytes, bytes_of("01 03"));
}

}  // namespace
}  // namespace sniff_serial_test
}  // namespace servodrome::master
