// An interposer between a drive and its line, or its clients over Modbus TCP: answers that are changed, lost, late,
// repeated or in pieces.
#include <cerrno>
#include <gmock/gmock.h>

#include "links/serial/modbus_tcp_listener.hpp"
#include "links/serial_rig.hpp"
#include "modbus/tcp_connection.hpp"

namespace servodrome::links::test {
namespace serial_interposer_test {
namespace {

using namespace std::chrono_literals;
using servodrome::test::bytes_of;
using servodrome::test::hex_of;
using testing::ElementsAre;

const std::string enable = "01 06 31 00 00 0F C7 32";  // the answer has the same bytes
constexpr std::size_t length = 8;

struct Master : SerialStation {
  void receive(std::uint8_t character, bool, Time at) override {
    characters.push_back(character);
    times.push_back(at);
  }
  std::string text() const { return hex_of(characters); }
  std::vector<std::uint8_t> characters;
  std::vector<Time> times;
};

struct Meddler final : SerialInterposer {
  std::vector<SerialPiece> answers(std::span<const std::uint8_t> answer, Time at) override {
    seen.push_back(hex_of({answer.begin(), answer.end()}));
    times.push_back(at);
    return make ? make({answer.begin(), answer.end()}) : SerialInterposer::answers(answer, at);
  }
  bool receives(std::uint8_t& character, bool& intact, Time) override {
    const std::size_t n = received++;
    return !on_character || on_character(n, character, intact);
  }

  std::function<std::vector<SerialPiece>(std::vector<std::uint8_t>)> make;
  std::function<bool(std::size_t, std::uint8_t&, bool&)> on_character;
  std::vector<std::string> seen;
  std::vector<Time> times;
  std::size_t received = 0;
};

class SerialInterposition : public testing::Test {
 protected:
  SerialInterposition() { rig.line.interpose(drive.port, &meddler); }
  void ask(const std::string& request = enable) { rig.line.transmit(port, bytes_of(request), rig.line.now()); }
  // The time at which the undisturbed drive answers a request that begins now.
  Time answer_begins() const {
    return rig.line.now() + length * character + modbus::character_timing(SerialRig::format).silence;
  }

  const Time character = SerialRig::format.character_time();
  SerialRig rig;
  SerialRig::Drive& drive = rig.add_rtu(1);
  Master master;
  SerialPortId port = rig.line.attach(master);
  Meddler meddler;
};

TEST_F(SerialInterposition, SeesEachAnswerBeforeTheLineAndChangesNothingByItself) {
  const Time begins = answer_begins();
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), enable);
  EXPECT_THAT(meddler.seen, ElementsAre(enable));
  EXPECT_THAT(meddler.times, ElementsAre(begins));
  EXPECT_EQ(meddler.received, length);
  for (std::size_t i = 0; i < length; ++i) EXPECT_EQ(master.times[i], begins + (i + 1) * character);
  rig.line.interpose(drive.port, nullptr);
  ask();
  rig.run_line();
  EXPECT_EQ(master.characters.size(), 2 * length);
  EXPECT_EQ(meddler.seen.size(), 1U);
}

TEST_F(SerialInterposition, ChangesShortensLengthensAndWithholds) {
  meddler.make = [](auto answer) {
    answer[1] = 0x86;
    return std::vector<SerialPiece>{{{}, answer}};
  };
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), "01 86 31 00 00 0F C7 32");
  master.characters.clear();
  meddler.make = [](auto answer) {
    answer.resize(3);
    return std::vector<SerialPiece>{{{}, answer}};
  };
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), "01 06 31");
  master.characters.clear();
  meddler.make = [](auto answer) {
    answer.push_back(0xAA);
    return std::vector<SerialPiece>{{{}, answer}};
  };
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), enable + " AA");
  master.characters.clear();
  meddler.make = [](auto) { return std::vector<SerialPiece>{}; };
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), "");
  EXPECT_EQ(meddler.seen.size(), 4U);
  EXPECT_EQ(drive.device.objects.controlword, 0x0F);  // the drive has acted on the request
}

TEST_F(SerialInterposition, ADelayedAnswerComesAtItsTime) {
  const Time begins = answer_begins();
  meddler.make = [](auto answer) { return std::vector<SerialPiece>{{300ms, answer}}; };
  ask();
  rig.line.advance(begins);
  EXPECT_EQ(rig.line.next_event(), begins + 300ms);
  EXPECT_EQ(rig.line.pending(drive.port), length);
  rig.run_line();
  EXPECT_EQ(master.times.front(), begins + 300ms + character);
  EXPECT_EQ(rig.line.pending(drive.port), 0U);
}

TEST_F(SerialInterposition, ARepeatedAnswerFollowsAfterItsGap) {
  meddler.make = [](auto answer) { return std::vector<SerialPiece>{{{}, answer}, {2ms, answer}, {{}, answer}}; };
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), enable + " " + enable + " " + enable);
  EXPECT_EQ(master.times[length] - master.times[length - 1], 2ms + character);
  EXPECT_EQ(master.times[2 * length] - master.times[2 * length - 1], character);
}

TEST_F(SerialInterposition, PausesBetweenCharacters) {
  meddler.make = [](auto answer) {
    std::vector<SerialPiece> pieces;
    for (const std::uint8_t one : answer) pieces.push_back({5ms, {one}});
    return pieces;
  };
  const Time begins = answer_begins();
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), enable);
  for (std::size_t i = 0; i < length; ++i) EXPECT_EQ(master.times[i], begins + (i + 1) * (5ms + character));
}

// The master gave up and asks again: it first gets the answer to its first request.
TEST_F(SerialInterposition, AnAnswerWaitsBehindALateOne) {
  const std::string other = "01 06 31 00 00 06 07 34";
  meddler.make = [](auto answer) { return std::vector<SerialPiece>{{100ms, answer}}; };
  ask();
  rig.line.advance(50ms);
  meddler.make = {};
  ask(other);
  rig.line.advance(90ms);
  EXPECT_EQ(meddler.seen.size(), 2U);
  EXPECT_EQ(master.text(), "");
  rig.line.interpose(drive.port, nullptr);  // waiting bytes are still sent
  rig.run_line();
  EXPECT_EQ(master.text(), enable + " " + other);
  EXPECT_EQ(master.times[length] - master.times[length - 1], character);
}

TEST_F(SerialInterposition, APieceWithoutCharactersIsAPause) {
  const Time begins = answer_begins();
  meddler.make = [](auto answer) { return std::vector<SerialPiece>{{1ms, {}}, {2ms, answer}, {3ms, {}}}; };
  ask();
  rig.run_line();
  EXPECT_EQ(master.times.front(), begins + 3ms + character);
  EXPECT_EQ(rig.line.next_event(), never);
}

TEST_F(SerialInterposition, AStationWithoutPowerSendsNoPieces) {
  meddler.make = [](auto answer) { return std::vector<SerialPiece>{{100ms, answer}}; };
  ask();
  rig.line.advance(50ms);
  rig.line.discard(drive.port);
  rig.run_line();
  EXPECT_EQ(master.text(), "");
  EXPECT_EQ(rig.line.pending(drive.port), 0U);
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), enable);
}

TEST_F(SerialInterposition, ACharacterIsWithheldChangedOrGarbled) {
  const unsigned before = drive.device.objects.controlword;
  for (const int how : {0, 1, 2}) {
    meddler.on_character = [how](std::size_t n, std::uint8_t& heard, bool& intact) {
      if (n % length != 5) return true;
      if (how == 1) heard = 0x06;
      if (how == 2) intact = false;
      return how != 0;
    };
    ask();
    rig.run_line();
    EXPECT_EQ(master.text(), "") << how;
    EXPECT_EQ(drive.device.objects.controlword, before) << how;
  }
  meddler.on_character = {};
  ask();
  rig.run_line();
  EXPECT_EQ(master.text(), enable);
}

TEST_F(SerialInterposition, OtherStationsReceiveTheCharactersAsTheyAre) {
  Master listener;
  rig.line.attach(listener);
  meddler.on_character = [](std::size_t, std::uint8_t& heard, bool&) {
    heard = 0;
    return true;
  };
  ask();
  rig.run_line();
  EXPECT_EQ(listener.text(), enable);
}

// ---- Modbus TCP ----

const std::string request = "12 34 00 00 00 06 01 06 31 00 00 0F";

struct TcpMeddler final : ModbusTcpInterposer {
  Admission connects() override {
    ++connections;
    return admission;
  }
  TcpReply answers(std::span<const std::uint8_t> asked, std::span<const std::uint8_t> answer, Time) override {
    requests.push_back(hex_of({asked.begin(), asked.end()}));
    TcpReply reply{{answer.begin(), answer.end()}};
    if (change) change(reply);
    return reply;
  }
  Admission admission = Admission::serve;
  std::function<void(TcpReply&)> change;
  std::vector<std::string> requests;
  int connections = 0;
};

class ModbusTcpInterposition : public testing::Test {
 protected:
  ModbusTcpInterposition() {
    rig.add_rtu(1);
    rig.line.interpose_tcp(&meddler);
  }
  RawClient client() const { return RawClient::tcp(port); }
  static std::string received(const RawClient& client) { return hex_of_text(client.text()); }
  void pass(std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    while (std::chrono::steady_clock::now() < end) rig.step();
  }

  SerialRig rig;
  std::unique_ptr<SerialLink> link = rig.open("tcp:127.0.0.1:0");
  std::uint16_t port = std::get<ModbusTcpName>(parse_serial_link(link->name())).endpoint.port;
  TcpMeddler meddler;
};

TEST_F(ModbusTcpInterposition, ChangesTransactionLengthAndUnit) {
  const RawClient one = client();
  one.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return received(one) == request; }));
  EXPECT_THAT(meddler.requests, ElementsAre(request));
  one.write(text_of(request.substr(0, 12)));  // a request in two parts
  pass(20ms);
  meddler.change = [](TcpReply& reply) {
    modbus::Mbap header = modbus::Mbap::read(reply.bytes.data());
    ++header.transaction;
    header.length = 7;
    header.unit = 9;
    header.write(reply.bytes.data());
  };
  one.write(text_of(request.substr(12)));
  ASSERT_TRUE(rig.until([&] { return received(one).size() == 2 * request.size() + 1; }));
  EXPECT_EQ(received(one).substr(request.size() + 1), "12 35 00 00 00 07 09 06 31 00 00 0F");
  EXPECT_EQ(meddler.requests.back(), request);
}

TEST_F(ModbusTcpInterposition, WithholdsAnAnswer) {
  meddler.change = [](TcpReply& reply) { reply.bytes.clear(); };
  const RawClient one = client();
  one.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return meddler.requests.size() == 1; }));
  meddler.change = {};
  one.write(text_of("00 02" + request.substr(5)));
  ASSERT_TRUE(rig.until([&] { return !one.text().empty(); }));
  EXPECT_EQ(received(one), "00 02" + request.substr(5));
  EXPECT_EQ(link->counters().to_bus, 2U);
  EXPECT_EQ(link->counters().from_bus, 1U);
  EXPECT_FALSE(one.ended());
}

TEST_F(ModbusTcpInterposition, ALateAnswerHoldsBackTheNextOnes) {
  meddler.change = [](TcpReply& reply) { reply.delay = 100ms; };
  const RawClient one = client();
  const auto began = std::chrono::steady_clock::now();
  one.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return meddler.requests.size() == 1; }));
  meddler.change = {};
  one.write(text_of("00 02" + request.substr(5)));
  const RawClient other = client();  // is not concerned
  other.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return received(other) == request; }));
  ASSERT_TRUE(rig.until([&] { return received(one).size() > request.size(); }));
  EXPECT_GE(std::chrono::steady_clock::now() - began, 100ms);
  EXPECT_EQ(received(one), request + " 00 02" + request.substr(5));
}

TEST_F(ModbusTcpInterposition, AllRequestsOfOnePacketAreLate) {
  meddler.change = [](TcpReply& reply) { reply.delay = 30ms; };
  const RawClient one = client();
  const auto began = std::chrono::steady_clock::now();
  one.write(text_of(request + " " + request + " " + request));
  ASSERT_TRUE(rig.until([&] { return received(one) == request + " " + request + " " + request; }));
  EXPECT_GE(std::chrono::steady_clock::now() - began, 90ms);
}

TEST_F(ModbusTcpInterposition, HalfAnAnswerAndTheConnectionIsClosed) {
  meddler.change = [](TcpReply& reply) {
    reply.bytes.resize(reply.bytes.size() / 2);
    reply.closes = true;
  };
  const RawClient one = client();
  one.write(text_of(request + " " + request));
  ASSERT_TRUE(rig.until([&] { return one.ended(); }));
  EXPECT_EQ(received(one), "12 34 00 00 00 06");
  EXPECT_EQ(meddler.requests.size(), 1U);
  EXPECT_EQ(link->counters().clients, 0U);
  EXPECT_EQ(link->counters().malformed, 0U);
}

TEST_F(ModbusTcpInterposition, ClosesInPlaceOfAnAnswerAlsoLater) {
  for (const Time delay : {Time{0}, Time{30ms}}) {
    meddler.change = [delay](TcpReply& reply) { reply = {{}, delay, true}; };
    const RawClient one = client();
    one.write(text_of(request));
    ASSERT_TRUE(rig.until([&] { return one.ended(); }));
    EXPECT_EQ(received(one), "");
  }
}

TEST_F(ModbusTcpInterposition, AClientThatLeavesGetsNoLateAnswer) {
  meddler.change = [](TcpReply& reply) { reply.delay = 50ms; };
  RawClient one = client();
  one.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return meddler.requests.size() == 1; }));
  one.close();
  ASSERT_TRUE(rig.until([&] { return link->counters().clients == 0; }));
  one = client();
  one.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return meddler.requests.size() == 2; }));
  link.reset();  // with an answer that is still due
  pass(80ms);
  EXPECT_TRUE(one.ended());
}

TEST_F(ModbusTcpInterposition, ConnectionsAreClosedResetOrIgnored) {
  meddler.admission = ModbusTcpInterposer::Admission::close;
  const RawClient closed = client();
  ASSERT_TRUE(rig.until([&] { return closed.ended(); }));
  meddler.admission = ModbusTcpInterposer::Admission::reset;
  const RawClient reset = client();
  ASSERT_TRUE(rig.until([&] {
    char byte;
    return ::recv(reset.descriptor(), &byte, 1, MSG_DONTWAIT) < 0 && errno == ECONNRESET;
  }));
  EXPECT_EQ(link->counters().clients, 0U);
  meddler.admission = ModbusTcpInterposer::Admission::ignore;
  const RawClient ignored = client();
  ignored.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return link->counters().clients == 1; }));
  pass(50ms);
  EXPECT_EQ(received(ignored), "");
  EXPECT_FALSE(ignored.ended());
  meddler.admission = ModbusTcpInterposer::Admission::serve;
  const RawClient served = client();
  served.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return received(served) == request; }));
  EXPECT_EQ(meddler.connections, 4);
}

struct Witness final : SerialObserver {
  void on_character(SerialSender, SerialPortId, std::uint8_t, Time) override {}
  void on_tcp_message(SerialSender side, std::span<const std::uint8_t> message, Time) override {
    if (side == SerialSender::drive) answers.push_back(hex_of({message.begin(), message.end()}));
  }
  std::vector<std::string> answers;
};

TEST_F(ModbusTcpInterposition, ObserversSeeWhatTheClientGets) {
  Witness witness;
  rig.line.add_observer(witness);
  meddler.change = [](TcpReply& reply) {
    reply.bytes.resize(4);
    reply.delay = 20ms;
  };
  const RawClient one = client();
  one.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return meddler.requests.size() == 1; }));
  EXPECT_TRUE(witness.answers.empty());
  ASSERT_TRUE(rig.until([&] { return !one.text().empty(); }));
  EXPECT_THAT(witness.answers, ElementsAre("12 34 00 00"));
  meddler.change = [](TcpReply& reply) { reply.bytes.clear(); };
  one.write(text_of(request));
  ASSERT_TRUE(rig.until([&] { return meddler.requests.size() == 2; }));
  EXPECT_EQ(witness.answers.size(), 1U);
  rig.line.remove_observer(witness);
}

}  // namespace
}  // namespace serial_interposer_test
}  // namespace servodrome::links::test
