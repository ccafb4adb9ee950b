// Modbus TCP framing (Modbus Messaging on TCP/IP V1.0b).
#include "modbus/ismk_modbus.hpp"
#include "modbus/tcp_connection.hpp"

namespace servodrome::modbus::test {
namespace modbus_tcp_test {
namespace {

struct TcpTest : testing::Test, Units {
  Server* find(std::uint8_t unit) override { return unit == 1 || unit == 0xFF ? &server : nullptr; }

  // Sends in pieces of `piece` bytes and reads answers as they arrive.
  std::string send(TcpConnection& connection, const std::string& text, std::size_t piece = 1000) {
    const std::vector<std::uint8_t> bytes = bytes_of(text);
    std::vector<std::uint8_t> answers;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t size = std::min(piece, bytes.size() - at);
      const std::size_t taken = connection.receive(std::span(bytes).subspan(at, size));
      EXPECT_GT(taken, 0U);
      at += taken;
      const auto answer = connection.take();
      answers.insert(answers.end(), answer.begin(), answer.end());
    }
    return hex_of(answers);
  }

  servodrome::test::IsmkDevice device;
  Profile profile{};
  Server server{device.dictionary, ismk_map, profile};
};

TEST_F(TcpTest, AnswersWithTheTransactionOfTheRequest) {
  TcpConnection connection(*this);
  EXPECT_EQ(send(connection, "15 01 00 00 00 06 FF 06 31 00 00 0F"), "15 01 00 00 00 06 FF 06 31 00 00 0F");
  EXPECT_EQ(send(connection, "15 02 00 00 00 06 01 03 31 00 00 01"), "15 02 00 00 00 05 01 03 02 00 0F");
  EXPECT_EQ(send(connection, "15 03 00 00 00 06 01 03 00 00 00 01"), "15 03 00 00 00 03 01 83 02");
  EXPECT_EQ(send(connection, "15 04 00 00 00 06 07 03 31 00 00 01"), "15 04 00 00 00 03 07 83 0B") << "nobody there";
}

TEST_F(TcpTest, AnyPiecesAndSeveralRequestsAtOnce) {
  const std::string requests =
      "00 01 00 00 00 06 01 06 31 00 00 0F 00 02 00 00 00 02 01 41 "
      "00 03 00 00 00 06 01 03 31 00 00 01 00 04 00 00 00 0B 01 10 40 00 00 02 04 00 00 C3 50";
  const std::string answers =
      "00 01 00 00 00 06 01 06 31 00 00 0F 00 02 00 00 00 03 01 C1 01 "
      "00 03 00 00 00 05 01 03 02 00 0F 00 04 00 00 00 06 01 10 40 00 00 02";
  for (std::size_t piece = 1; piece < 60; ++piece) {
    TcpConnection connection(*this);
    EXPECT_EQ(send(connection, requests, piece), answers) << piece;
    EXPECT_FALSE(connection.is_broken());
  }
  EXPECT_EQ(device.objects.target_position, 50000);
}

TEST_F(TcpTest, ClientsDoNotDisturbEachOther) {
  TcpConnection first(*this);
  TcpConnection second(*this);
  EXPECT_EQ(send(first, "00 01 00 00 00 06 01 03"), "");
  EXPECT_EQ(send(second, "00 09 00 00 00 06 01 06 31 00 00 0F"), "00 09 00 00 00 06 01 06 31 00 00 0F");
  EXPECT_EQ(send(first, "31 00 00 01"), "00 01 00 00 00 05 01 03 02 00 0F");
}

TEST_F(TcpTest, WhatIsNoModbusBreaksTheConnection) {
  for (const char* header : {"00 01 00 01 00 06 01", "00 01 00 00 00 00 01", "00 01 00 00 00 01 01",
                             "00 01 00 00 00 FF 01", "47 45 54 20 2F 20 48"}) {
    TcpConnection connection(*this);
    EXPECT_EQ(send(connection, header), "");
    EXPECT_TRUE(connection.is_broken()) << header;
    EXPECT_EQ(send(connection, "15 01 00 00 00 06 FF 06 31 00 00 0F"), "") << "for good";
  }
  TcpConnection connection(*this);
  std::string longest = "00 01 00 00 00 FE 01 64";
  for (int i = 0; i < 252; ++i) longest += " 00";
  EXPECT_EQ(send(connection, longest), "00 01 00 00 00 03 01 E4 01");
}

}  // namespace
}  // namespace modbus_tcp_test
}  // namespace servodrome::modbus::test
