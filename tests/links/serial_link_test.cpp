// Outside programs on a line: through a pty, through a serial port (here the far end of another pty), over TCP.
#include <filesystem>
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "links/link_error.hpp"
#include "links/listen.hpp"
#include "links/pty.hpp"
#include "links/serial/modbus_tcp_listener.hpp"
#include "links/serial_rig.hpp"

namespace servodrome::links::test {
namespace serial_link_test {
namespace {

const std::string enable = "01 06 31 00 00 0F C7 32";

struct SerialLinkTest : testing::Test {
  SerialLinkTest() { rig.add_rtu(1); }
  RawClient open_tty() const {
    return RawClient(FileDescriptor(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)));
  }
  std::filesystem::path path =
      std::filesystem::path(testing::TempDir()) / fmt::format("servodrome_serial_{}", ::getpid());
  SerialRig rig;
};

TEST_F(SerialLinkTest, PtyCarriesRequestsAndAnswers) {
  const auto link = rig.open("pty:" + path.string());
  EXPECT_EQ(link->name(), "pty:" + path.string());
  EXPECT_EQ(link->counters().clients, 0U);
  const RawClient client = open_tty();
  client.write(text_of(enable));
  ASSERT_TRUE(rig.until([&] { return hex_of_text(client.text()) == enable; })) << hex_of_text(client.text());
  EXPECT_EQ(rig.drives[1]->device.objects.controlword, 0x0F);
  EXPECT_EQ(link->counters().clients, 1U);
  EXPECT_EQ(link->counters().to_bus, 8U);
  EXPECT_EQ(link->counters().from_bus, 8U);
  EXPECT_GE(rig.time, 16 * SerialRig::format.character_time());
}

TEST_F(SerialLinkTest, PtySurvivesClientsThatComeAndGo) {
  const auto link = rig.open("pty:" + path.string());
  for (int i = 0; i < 5; ++i) {
    RawClient client = open_tty();
    client.write(text_of(enable));
    ASSERT_TRUE(rig.until([&] { return hex_of_text(client.text()) == enable; })) << i << hex_of_text(client.text());
    client.write(text_of("01 06 31"));  // half a request, and an answer that stays unread
    ASSERT_TRUE(rig.until([&] { return link->counters().to_bus == 11U * static_cast<unsigned>(i + 1); }));
    client.close();
    ASSERT_TRUE(rig.until([&] { return link->counters().clients == 0; }));
  }
  EXPECT_TRUE(std::filesystem::is_symlink(path));
}

// All 256 values pass unchanged: none is treated as a control character.
TEST_F(SerialLinkTest, PtyIsRaw) {
  rig.line.detach(rig.drives[1]->port);
  struct Echo : SerialStation {
    void receive(std::uint8_t character, bool, Time) override { to_send.push_back(character); }
    std::span<const std::uint8_t> take() override {
      sent = std::exchange(to_send, {});
      return sent;
    }
    std::vector<std::uint8_t> to_send, sent;
  } echo;
  rig.line.attach(echo);
  const auto link = rig.open("pty:" + path.string());
  const RawClient client = open_tty();
  std::string all;
  for (int i = 0; i < 256; ++i) {
    all = std::string(1, static_cast<char>(i));
    const std::size_t before = client.text().size();
    client.write(all);
    ASSERT_TRUE(rig.until([&] { return client.text().size() == before + 1; })) << i;
    EXPECT_EQ(client.text().back(), all[0]) << i;
  }
}

// Bytes that the line cannot send at once wait and are not lost.
TEST_F(SerialLinkTest, PtySlowsAProgramDown) {
  rig.line.detach(rig.drives[1]->port);
  struct Ear : SerialStation {
    void receive(std::uint8_t character, bool, Time) override { heard += static_cast<char>(character); }
    std::string heard;
  } ear;
  rig.line.attach(ear);
  const auto link = rig.open("pty:" + path.string());
  const RawClient client = open_tty();
  std::string sent;
  for (int i = 0; i < 3500; ++i) sent += static_cast<char>(i % 251);
  client.write(sent);
  ASSERT_TRUE(rig.until([&] { return ear.heard.size() == sent.size(); })) << ear.heard.size();
  EXPECT_EQ(ear.heard, sent);
}

TEST_F(SerialLinkTest, SerialPort) {
  const Pty far_end(path.string());
  const auto link = rig.open("serial:" + path.string());
  EXPECT_EQ(link->counters().clients, 1U);
  const RawClient client{FileDescriptor(::dup(far_end.master()))};
  client.write(text_of(enable));
  ASSERT_TRUE(rig.until([&] { return hex_of_text(client.text()) == enable; })) << hex_of_text(client.text());
}

TEST_F(SerialLinkTest, WhatCannotBeOpened) {
  const auto error_of = [this](const std::string& name) -> std::string {
    try {
      rig.open(name);
    } catch (const LinkError& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_THAT(error_of("serial:/nonexistent/tty"), testing::HasSubstr("\"/nonexistent/tty\" cannot be opened"));
  EXPECT_THAT(error_of("serial:/dev/null"), testing::HasSubstr("is not a serial port"));
  EXPECT_THAT(error_of("pty:/nonexistent/x"), testing::HasSubstr("choose a path"));
  EXPECT_THAT(error_of("mem:"), testing::HasSubstr("same process"));
  EXPECT_THAT(error_of("tcp:no.such.host.invalid:1"), testing::HasSubstr("is unknown"));
  const auto listener = rig.open("tcp:127.0.0.1:0");
  EXPECT_THAT(error_of(listener->name()), testing::HasSubstr("stop it or choose another port"));
  // A station that a refused link left on the line would get these characters, through a pointer to nothing.
  const auto link = rig.open("pty:" + path.string());
  const RawClient client = open_tty();
  client.write(text_of(enable));
  EXPECT_TRUE(rig.until([&] { return hex_of_text(client.text()) == enable; }));
  SerialLine odd({.bit_rate = 12345});
  EXPECT_THROW(open_serial_link(TtyName{"/dev/null"}, odd, rig, rig.io, rig), LinkError);
}

struct ModbusTcpTest : SerialLinkTest {
  std::unique_ptr<SerialLink> link = rig.open("tcp:127.0.0.1:0");
  std::uint16_t port = std::get<ModbusTcpName>(parse_serial_link(link->name())).endpoint.port;
};

TEST_F(ModbusTcpTest, SeveralClients) {
  std::vector<RawClient> clients;
  for (int i = 0; i < 5; ++i) clients.push_back(RawClient::tcp(port));
  ASSERT_TRUE(rig.until([&] { return link->counters().clients == 5; }));
  clients[0].write(text_of("00 07 00 00 00 06 01"));  // half a request of one client does not delay the others
  for (int i = 1; i < 5; ++i) {
    const RawClient& client = clients[static_cast<std::size_t>(i)];
    client.write(text_of(fmt::format("00 0{} 00 00 00 06 01 06 31 00 00 0{}", i, i)));
    ASSERT_TRUE(rig.until([&] { return client.text().size() == 12; }));
    EXPECT_EQ(hex_of_text(client.text()), fmt::format("00 0{} 00 00 00 06 01 06 31 00 00 0{}", i, i));
    EXPECT_EQ(rig.drives[1]->device.objects.controlword, i);
  }
  clients[0].write(text_of("03 31 00 00 01"));
  ASSERT_TRUE(rig.until([&] { return hex_of_text(clients[0].text()) == "00 07 00 00 00 05 01 03 02 00 04"; }));
  clients.clear();
  ASSERT_TRUE(rig.until([&] { return link->counters().clients == 0; }));
}

TEST_F(ModbusTcpTest, WhoSpeaksAnotherProtocolIsDisconnected) {
  const RawClient client = RawClient::tcp(port);
  client.write(text_of("00 01 00 00 00 06 01 03 31 00 00 01") + "GET / HTTP/1.1\r\n\r\n");
  ASSERT_TRUE(rig.until([&] { return client.ended(); }));
  EXPECT_EQ(hex_of_text(client.text()), "00 01 00 00 00 05 01 03 02 00 06") << "what came before is answered";
  EXPECT_EQ(link->counters().malformed, 1U);
  EXPECT_EQ(link->counters().clients, 0U);
}

// A client that sends without reading gets all its responses when it reads.
TEST_F(ModbusTcpTest, ClientsThatDoNotRead) {
  const RawClient client = RawClient::tcp(port);
  const std::string request = text_of("00 01 00 00 00 06 01 03 31 00 00 01");
  constexpr std::size_t count = 20'000;
  std::string unsent;
  for (std::size_t i = 0; i < count; ++i) unsent += request;
  bool is_reading = false;
  std::size_t stalled = 0;
  std::size_t received = 0;
  ASSERT_TRUE(rig.until([&] {
    const ssize_t written = ::send(client.descriptor(), unsent.data(), unsent.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (written > 0) unsent.erase(0, static_cast<std::size_t>(written));
    stalled = written > 0 ? 0 : stalled + 1;
    is_reading = is_reading || unsent.empty() || stalled > 20;
    if (is_reading) received = client.text().size();
    return received == count * 11;
  })) << received;
  EXPECT_EQ(link->counters().to_bus, count);
}

TEST_F(ModbusTcpTest, TooManyClients) {
  std::vector<RawClient> clients;
  for (std::size_t i = 0; i < ModbusTcpListener::most_clients; ++i) clients.push_back(RawClient::tcp(port));
  ASSERT_TRUE(rig.until([&] { return link->counters().clients == ModbusTcpListener::most_clients; }));
  const RawClient extra = RawClient::tcp(port);
  ASSERT_TRUE(rig.until([&] { return extra.ended(); }));
  clients[0].write(text_of("00 01 00 00 00 06 01 03 31 00 00 01"));
  ASSERT_TRUE(rig.until([&] { return clients[0].text().size() == 11; }));
  // After client_patience a silent client makes room for a new one.
  std::this_thread::sleep_for(client_patience + std::chrono::milliseconds(50));
  clients[0].write(text_of("00 01 00 00 00 06 01 03 31 00 00 01"));
  ASSERT_TRUE(rig.until([&] { return clients[0].text().size() == 22; }));
  const RawClient late = RawClient::tcp(port);
  late.write(text_of("00 01 00 00 00 06 01 03 31 00 00 01"));
  EXPECT_TRUE(rig.until([&] { return late.text().size() == 11; }));
  EXPECT_TRUE(rig.until([&] { return clients[1].ended(); }));
  EXPECT_FALSE(clients[0].ended());
}

}  // namespace
}  // namespace serial_link_test
}  // namespace servodrome::links::test
