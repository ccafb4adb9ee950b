#include <algorithm>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <string>

#include "links/can/client.hpp"
#include "links/can/socketcand_server.hpp"
#include "links/can_rig.hpp"
#include "links/link_error.hpp"
#include "links/listen.hpp"

namespace servodrome::links {
namespace can_socketcand_test {
namespace {

using canopen::Frame;
using test::RawClient;
using test::Rig;
using test::RigThread;

struct SocketcandTest : testing::Test {
  Rig rig;
  std::unique_ptr<CanLink> link = open_can_link(parse_can_link("socketcand:127.0.0.1:0/can0"), rig.bus, rig.io, rig);
  std::uint16_t port = std::get<SocketcandName>(parse_can_link(link->name())).port;

  RawClient raw_client() {
    RawClient client = RawClient::tcp(port);
    client.write("< open can0 >< rawmode >");
    EXPECT_TRUE(rig.until([&] { return client.text() == "< hi >< ok >< ok >"; })) << client.text();
    client.clear();
    return client;
  }
};

TEST_F(SocketcandTest, GreetsOpensAndSwitchesToRawMode) {
  EXPECT_NE(port, 0);
  RawClient client = RawClient::tcp(port);
  ASSERT_TRUE(rig.until([&] { return client.text() == "< hi >"; }));
  client.write("< open can0 >");
  ASSERT_TRUE(rig.until([&] { return client.text() == "< hi >< ok >"; }));
  client.write("< rawmode >");
  ASSERT_TRUE(rig.until([&] { return client.text() == "< hi >< ok >< ok >"; }));
  client.write("< echo >");
  ASSERT_TRUE(rig.until([&] { return client.text() == "< hi >< ok >< ok >< echo >"; }));
  EXPECT_EQ(link->counters().clients, 1U);
  EXPECT_EQ(rig.wakes, 1) << "a line that naps hears that there is somebody now";
  client.close();
  EXPECT_TRUE(rig.until([&] { return link->counters().clients == 0; }));
}

TEST_F(SocketcandTest, FramesBothWaysWithTimestampOfTheirEnd) {
  RawClient client = raw_client();
  const Time start = rig.time;
  rig.wakes = 0;
  client.write("< send 605 2 11 22 >");
  ASSERT_TRUE(rig.until([&] { return client.has(">"); }));
  ASSERT_EQ(rig.received.size(), 1U);
  EXPECT_EQ(rig.received[0], (Frame{.id = 0x605, .length = 2, .data = {0x11, 0x22}}));
  EXPECT_EQ(client.text(), fmt::format("< frame 585 1000.{:06} 1122 >", rig.time.count() / 1000));
  EXPECT_GT(rig.time, start);
  EXPECT_GT(rig.wakes, 0);
  EXPECT_EQ(link->counters().to_bus, 1U);
  EXPECT_EQ(link->counters().from_bus, 1U);
}

TEST_F(SocketcandTest, ByteByByteAndManyAtOnce) {
  RawClient client = raw_client();
  const std::string text = "garbage < send 601 1 AA >\r\n< send 1234ABCD 1 BB >";
  for (const char byte : text) {
    client.write(std::string_view(&byte, 1));
    rig.io.restart();
    rig.io.poll();
  }
  ASSERT_TRUE(rig.until([&] { return rig.received.size() == 2; }));
  EXPECT_TRUE(rig.received[1].extended);
  rig.received.clear();
  std::string burst;
  for (int i = 0; i < 5000; ++i) burst += "< send 123 2 " + fmt::format("{:X} {:X}", i / 256, i % 256) + " >";
  client.write(burst);
  // Far more frames than the queue of 256 holds: the link pauses reading, and no frame is lost.
  ASSERT_TRUE(rig.until([&] { return rig.received.size() == 5000; })) << rig.received.size();
  for (std::size_t i = 0; i < 5000; ++i) ASSERT_EQ(rig.received[i].data[0] * 256U + rig.received[i].data[1], i);
  EXPECT_EQ(link->counters().refused, 0U);
}

TEST_F(SocketcandTest, RemoteFrames) {
  RawClient one = raw_client();
  RawClient other = raw_client();
  one.write("< sendrtr 701 1 >< send 702 8  >");
  ASSERT_TRUE(rig.until([&] { return rig.received.size() == 2; }));
  EXPECT_EQ(rig.received[0], (Frame{.id = 0x701, .remote = true, .length = 1}));
  EXPECT_EQ(rig.received[1], (Frame{.id = 0x702, .remote = true, .length = 8}));
  ASSERT_TRUE(rig.until([&] { return other.has("< rtr 702 "); }));
  EXPECT_THAT(other.text(), testing::StartsWith("< rtr 701 1000."));
}

// As on a bus: the other clients receive a client's frame before its answer, and the sender does not receive it.
TEST_F(SocketcandTest, ClientsSeeEachOther) {
  RawClient one = raw_client();
  RawClient two = raw_client();
  RawClient three = raw_client();
  one.write("< send 601 1 55 >");
  ASSERT_TRUE(rig.until([&] { return two.has("< frame 581") && three.has("< frame 581") && one.has("< frame 581"); }));
  EXPECT_LT(two.text().find("< frame 601"), two.text().find("< frame 581"));
  EXPECT_TRUE(three.has("< frame 601"));
  EXPECT_FALSE(one.has("< frame 601"));
  two.close();
  ASSERT_TRUE(rig.until([&] { return link->counters().clients == 2; }));
  three.write("< send 602 0 >");
  ASSERT_TRUE(rig.until([&] { return one.has("< frame 602") && one.has("< frame 582"); }));
}

TEST_F(SocketcandTest, ClearErrors) {
  RawClient client = RawClient::tcp(port);
  client.write("< rawmode >");
  ASSERT_TRUE(rig.until([&] { return client.has("< error no bus is open, begin with: open can0 >"); }));
  client.write("< open can0 >");
  ASSERT_TRUE(rig.until([&] { return client.has("< ok >"); }));
  for (const char* command : {"subscribe", "add", "update", "delete", "filter", "muxfilter", "unsubscribe", "isotpmode",
                              "controlmode", "nonsense"}) {
    client.clear();
    client.write("< " + std::string(command) + " 0 0 123 >");
    const std::string expected =
        "< error command \"" + std::string(command) + "\" is not supported, use rawmode, send and sendrtr >";
    ASSERT_TRUE(rig.until([&] { return client.text() == expected; })) << client.text();
  }
  client.clear();
  client.write("< send 123 9 >");
  ASSERT_TRUE(rig.until([&] { return client.has("< error send takes an identifier"); }));
  client.clear();
  client.write("< " + std::string(5000, 'x') + " >< echo >");
  ASSERT_TRUE(rig.until([&] { return client.has("< echo >"); }));
  EXPECT_EQ(client.text(), "< error an element is longer than 256 characters >< echo >");
  EXPECT_TRUE(rig.received.empty());
  EXPECT_EQ(link->counters().malformed, 13U);
}

TEST_F(SocketcandTest, OtherBusIsRefusedAndTheConnectionClosed) {
  RawClient client = RawClient::tcp(port);
  client.write("< open can7 >");
  ASSERT_TRUE(rig.until([&] { return client.ended(); }));
  EXPECT_EQ(client.text(), "< hi >< error could not open bus, the one here is can0 >");
}

TEST_F(SocketcandTest, NoFramesBeforeRawMode) {
  RawClient client = RawClient::tcp(port);
  client.write("< open can0 >");
  ASSERT_TRUE(rig.until([&] { return client.text() == "< hi >< ok >"; }));
  rig.bus.transmit(rig.node, {.id = 0x81}, rig.time);
  client.write("< send 601 0 >");  // allowed in BCM mode
  ASSERT_TRUE(rig.until([&] { return rig.received.size() == 1; }));
  client.write("< rawmode >< echo >");
  ASSERT_TRUE(rig.until([&] { return client.has("< echo >"); }));
  EXPECT_EQ(client.text(), "< hi >< ok >< ok >< echo >");
}

// python-can reads the answer to rawmode and fails if a frame follows in the same read.
TEST_F(SocketcandTest, FramesWaitUntilTheClientHasSeenRawmodeConfirmed) {
  RawClient client = RawClient::tcp(port);
  client.write("< open can0 >< rawmode >");
  ASSERT_TRUE(rig.until([&] { return client.text() == "< hi >< ok >< ok >"; }));
  client.clear();
  rig.bus.transmit(rig.node, {.id = 0x81}, rig.time);
  rig.run_bus();
  rig.io.restart();
  rig.io.poll();
  client.write("< echo >");
  ASSERT_TRUE(rig.until([&] { return client.has("< echo >"); }));
  EXPECT_TRUE(client.has("< frame 081 "));
  // Without a command the frames are sent after the quiet time.
  RawClient listener = raw_client();
  rig.bus.transmit(rig.node, {.id = 0x82}, rig.time);
  EXPECT_TRUE(rig.until([&] { return listener.has("< frame 082 "); }));
}

TEST_F(SocketcandTest, SlowReaderLosesFramesAndHoldsUpNobody) {
  RawClient sleeper = raw_client();
  RawClient reader = raw_client();
  constexpr int count = 60'000;
  std::size_t seen = 0;
  for (int i = 0; i < count; ++i) {
    rig.bus.transmit(rig.node, {.id = 0x181, .length = 8}, rig.time);
    if (i % 100 != 99) continue;
    rig.run_bus();
    ASSERT_TRUE(rig.until([&] {
      const std::string& text = reader.text();
      seen += static_cast<std::size_t>(std::count(text.begin(), text.end(), '>'));
      reader.clear();
      return seen == static_cast<std::size_t>(i) + 1;
    }));
  }
  EXPECT_GT(link->counters().dropped, 0U);
  EXPECT_EQ(link->counters().from_bus + link->counters().dropped, 2U * count);
  EXPECT_EQ(link->counters().clients, 2U);
  // All elements that the client receives are complete.
  std::size_t elements = 0;
  ASSERT_TRUE(rig.until([&] {
    const std::string text = sleeper.text();
    elements = static_cast<std::size_t>(std::count(text.begin(), text.end(), '>'));
    return elements == count - link->counters().dropped;
  }));
  EXPECT_THAT(sleeper.text(), testing::StartsWith("< frame 181 1000."));
  EXPECT_THAT(sleeper.text(), testing::EndsWith(" 0000000000000000 >"));
}

TEST_F(SocketcandTest, ClientThatDoesNotReadItsAnswersIsNotReadEither) {
  RawClient client = raw_client();
  std::string echoes;
  for (int i = 0; i < 1000; ++i) echoes += "< echo >";
  std::size_t written = 0;
  for (int i = 0; i < 2000; ++i) {
    const ssize_t size = ::write(client.descriptor(), echoes.data(), echoes.size());
    if (size < 0) break;
    // Only complete elements are written, so that the count below is exact.
    written += static_cast<std::size_t>(size);
    rig.io.restart();
    rig.io.poll();
    if (static_cast<std::size_t>(size) != echoes.size()) break;
  }
  ASSERT_LT(written, 2000 * echoes.size());
  ASSERT_TRUE(rig.until([&] { return client.text().size() == written / 8 * 8; }));
}

TEST_F(SocketcandTest, BlockedBusDiscardsInsteadOfBlockingTheClient) {
  RawClient client = raw_client();
  rig.bus.cut(link->port(), true);
  std::string burst;
  for (int i = 0; i < 1000; ++i) burst += "< send 123 0 >";
  client.write(burst + "< echo >");
  ASSERT_TRUE(rig.until([&] { return client.has("< echo >"); }));
  EXPECT_GE(link->counters().refused, 1000U - 256U);
  EXPECT_EQ(rig.bus.error_state(link->port()), ErrorState::passive);
}

TEST_F(SocketcandTest, TooManyClients) {
  std::vector<RawClient> clients;
  for (std::size_t i = 0; i < SocketcandServer::most_clients; ++i) clients.push_back(raw_client());
  RawClient last = RawClient::tcp(port);
  ASSERT_TRUE(rig.until([&] { return last.ended(); }));
  EXPECT_EQ(last.text(), "< error too many clients >");
  clients.clear();
  ASSERT_TRUE(rig.until([&] { return link->counters().clients == 0; }));
  raw_client();
}

// Silent clients do not block new ones forever, and clients that send stay connected.
TEST_F(SocketcandTest, TheClientThatIsSilentLongestMakesRoom) {
  std::vector<RawClient> clients;
  for (std::size_t i = 0; i < SocketcandServer::most_clients; ++i) clients.push_back(raw_client());
  std::this_thread::sleep_for(client_patience + std::chrono::milliseconds(50));
  for (std::size_t i = 0; i < clients.size(); ++i) {
    if (i == 7) continue;
    clients[i].write("< echo >");
    ASSERT_TRUE(rig.until([&] { return clients[i].has("< echo >"); }));
  }
  RawClient last = raw_client();
  EXPECT_TRUE(rig.until([&] { return clients[7].ended(); }));
  EXPECT_EQ(link->counters().clients, SocketcandServer::most_clients);
  for (std::size_t i = 0; i < clients.size(); ++i) EXPECT_EQ(clients[i].ended(), i == 7) << i;
}

// Clients take turns frame by frame: the queued frames of one client delay another client's frame by only one frame.
TEST_F(SocketcandTest, AFloodOfOneClientDelaysTheOthersByOneFrame) {
  RawClient flood = raw_client();
  RawClient master = raw_client();
  rig.frozen = true;
  std::string burst;
  for (int i = 0; i < 250; ++i) burst += "< send 001 8 00 00 00 00 00 00 00 00 >";
  flood.write(burst + "< echo >");
  ASSERT_TRUE(rig.until([&] { return flood.has("< echo >"); }));
  master.write("< send 605 0 >< send 605 0 >< send 605 0 >< echo >");
  ASSERT_TRUE(rig.until([&] { return master.has("< echo >"); }));
  rig.frozen = false;
  ASSERT_TRUE(rig.until([&] { return rig.received.size() == 253; }));
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < rig.received.size(); ++i) {
    if (rig.received[i].id == 0x605) places.push_back(i);
  }
  EXPECT_THAT(places, testing::ElementsAre(1U, 3U, 5U)) << "one frame of the flood was in the controller";
}

// A program may send and exit: the frames that a client has queued are sent after it has disconnected.
TEST_F(SocketcandTest, WhatAClientQueuedIsSentAfterItHasGone) {
  RawClient client = raw_client();
  rig.frozen = true;
  std::string burst;
  for (int i = 0; i < 100; ++i) burst += "< send 123 0 >";
  client.write(burst + "< echo >");
  ASSERT_TRUE(rig.until([&] { return client.has("< echo >"); }));
  client.close();
  ASSERT_TRUE(rig.until([&] { return link->counters().clients == 0; }));
  rig.frozen = false;
  EXPECT_TRUE(rig.until([&] { return rig.received.size() == 100; }));
}

TEST_F(SocketcandTest, LinkMayGoWhileClientsAreConnected) {
  RawClient client = raw_client();
  client.write("< send 601 0 >");
  link.reset();
  ASSERT_TRUE(rig.until([&] { return client.ended(); }));
  // The TCP port can be used again.
  link = open_can_link(SocketcandName{"127.0.0.1", port, "can0"}, rig.bus, rig.io, rig);
  raw_client();
}

TEST_F(SocketcandTest, BusyPortIsAnErrorThatSaysSo) {
  try {
    open_can_link(SocketcandName{"127.0.0.1", port, "can0"}, rig.bus, rig.io, rig);
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::address_in_use);
    EXPECT_THAT(error.what(), testing::HasSubstr(fmt::format("socketcand:127.0.0.1:{}/can0", port)));
    EXPECT_THAT(error.what(), testing::HasSubstr("stop it or choose another port"));
  }
  try {
    open_can_link(SocketcandName{"192.0.2.1", 0, "can0"}, rig.bus, rig.io, rig);
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("must be an address of this computer"));
  }
}

// --- our own client

TEST_F(SocketcandTest, BlockingClient) {
  RigThread thread(rig);
  const auto client = open_can_client(link->name());
  EXPECT_GE(client->native_handle(), 0);
  EXPECT_FALSE(client->receive(std::chrono::milliseconds(0)));
  for (std::uint8_t i = 1; i < 100; ++i) {
    const Frame request{.id = 0x600U + i, .length = 2, .data = {i, 0xEE}};
    client->send(request);
    Frame expected = request;
    expected.id -= 0x80;
    ASSERT_EQ(client->receive(std::chrono::seconds(10)), expected);
  }
  const auto other = open_can_client(link->name());
  const Frame remote{.id = 0x18FF0001, .extended = true, .remote = true, .length = 3};
  other->send(remote);
  EXPECT_EQ(client->receive(std::chrono::seconds(10)), remote);
}

TEST_F(SocketcandTest, ClientErrors) {
  {
    RigThread thread(rig);
    try {
      open_can_client(fmt::format("socketcand:127.0.0.1:{}/other", port));
      FAIL();
    } catch (const LinkError& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("could not open bus, the one here is can0"));
    }
  }
  std::unique_ptr<CanClient> client;
  {
    RigThread thread(rig);
    client = open_can_client(link->name());
  }
  link.reset();
  EXPECT_THROW(client->receive(std::chrono::seconds(10)), LinkError);
  try {
    open_can_client(fmt::format("socketcand:127.0.0.1:{}/can0", port));
    FAIL();
  } catch (const LinkError& error) {
    EXPECT_EQ(error.code(), std::errc::connection_refused);
    EXPECT_THAT(error.what(), testing::HasSubstr("is the line up"));
  }
}

struct Stepper : VirtualClock {
  explicit Stepper(Rig& its_rig) : rig(its_rig) {}
  Time now() const override { return time; }
  void step(Time /*latest*/) override {
    time += std::chrono::microseconds(250);
    rig.bus.advance(time);
  }
  Rig& rig;
  Time time{};
};

TEST(MemoryCanClient, RunsVirtualTime) {
  Rig rig;
  Stepper clock(rig);
  MemoryCanClient client(rig.bus, clock);
  client.send({.id = 0x601, .length = 1, .data = {7}});
  EXPECT_EQ(client.receive(std::chrono::seconds(1)), (Frame{.id = 0x581, .length = 1, .data = {7}}));
  EXPECT_LE(clock.time, std::chrono::microseconds(250));
  EXPECT_FALSE(client.receive(std::chrono::seconds(1)));
  EXPECT_EQ(clock.time, std::chrono::microseconds(1'000'250));
}

}  // namespace
}  // namespace can_socketcand_test
}  // namespace servodrome::links
