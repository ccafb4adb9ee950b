// The simulated line: characters take time, all stations receive all characters, and characters sent at once are
// garbled.
#include <cmath>

#include "links/serial/client.hpp"
#include "links/serial_rig.hpp"

namespace servodrome::links::test {
namespace serial_line_test {
namespace {

using namespace std::chrono_literals;
using servodrome::test::bytes_of;
using servodrome::test::hex_of;

struct Heard {
  std::uint8_t character;
  bool intact;
  Time at;
};

// Records all characters that it receives and sends the given ones.
struct Ear : SerialStation {
  explicit Ear(SerialLine& to) : line(to), port(to.attach(*this)) {}
  void receive(std::uint8_t character, bool intact, Time at) override { heard.push_back({character, intact, at}); }
  void say(const std::string& text, Time at) { line.transmit(port, bytes_of(text), at); }
  std::string text() const {
    std::vector<std::uint8_t> bytes;
    for (const Heard& one : heard) bytes.push_back(one.character);
    return hex_of(bytes);
  }
  bool all_intact() const {
    return std::all_of(heard.begin(), heard.end(), [](const Heard& one) { return one.intact; });
  }

  SerialLine& line;
  SerialPortId port;
  std::vector<Heard> heard;
};

TEST(SerialLine, CharactersTakeTenOrElevenBits) {
  for (const std::uint32_t bit_rate : {9600U, 19200U, 38400U, 115200U}) {
    for (const modbus::Parity parity : {modbus::Parity::none, modbus::Parity::even}) {
      SerialLine line({.bit_rate = bit_rate, .parity = parity});
      Ear speaker(line);
      Ear listener(line);
      EXPECT_EQ(line.next_event(), never);
      speaker.say("01 02 03", 1ms);
      EXPECT_EQ(line.pending(speaker.port), 3U);
      line.advance(1s);
      const Time bits = Time((parity == modbus::Parity::none ? 10 : 11) * 1'000'000'000LL / bit_rate);
      ASSERT_EQ(listener.heard.size(), 3U);
      for (std::size_t i = 0; i < 3; ++i) {
        EXPECT_EQ(listener.heard[i].character, i + 1);
        EXPECT_TRUE(listener.heard[i].intact);
        EXPECT_EQ(listener.heard[i].at, 1ms + bits * (i + 1));
      }
      EXPECT_TRUE(speaker.heard.empty()) << "not its own";
      EXPECT_EQ(line.pending(speaker.port), 0U);
      EXPECT_EQ(line.now(), 1s);
    }
  }
}

TEST(SerialLine, WhatIsAddedGoesBehind) {
  SerialLine line(SerialRig::format);
  Ear speaker(line);
  Ear listener(line);
  speaker.say("01 02", 0ms);
  line.advance(100us);
  speaker.say("03", 100us);
  line.advance(1s);
  EXPECT_EQ(listener.text(), "01 02 03");
  EXPECT_EQ(listener.heard[2].at, 3 * SerialRig::format.character_time());
  speaker.say("04", 0ms);
  line.advance(2s);
  EXPECT_EQ(listener.heard[3].at, 1s + SerialRig::format.character_time()) << "not in the past";
}

TEST(SerialLine, TwoAtOnceGarbleEachOther) {
  SerialLine line(SerialRig::format);
  Ear first(line);
  Ear second(line);
  Ear listener(line);
  const Time character = SerialRig::format.character_time();
  first.say("F1 F2 F3", 0ms);
  second.say("1F", character + 1ns);  // collides with the second and the third
  line.advance(1s);
  ASSERT_EQ(listener.heard.size(), 4U);
  EXPECT_TRUE(listener.heard[0].intact);
  for (std::size_t i = 1; i < 4; ++i) EXPECT_FALSE(listener.heard[i].intact) << i;
  EXPECT_EQ(line.counters().characters, 4U);
  EXPECT_EQ(line.counters().collisions, 3U);
  // A character that begins when the other one ends does not collide.
  listener.heard.clear();
  first.say("01", 2s);
  second.say("02", 2s + character);
  line.advance(3s);
  EXPECT_EQ(listener.text(), "01 02");
  EXPECT_TRUE(listener.all_intact());
}

TEST(SerialLine, OtherFormatsAreGarbled) {
  SerialLine line(SerialRig::format);
  Ear speaker(line);
  Ear listener(line);
  line.set_format(speaker.port, {.bit_rate = 9600, .parity = modbus::Parity::none});
  speaker.say("01", 0ms);
  line.advance(1s);
  ASSERT_EQ(listener.heard.size(), 1U);
  EXPECT_FALSE(listener.heard[0].intact);
  EXPECT_EQ(listener.heard[0].at, 1041666ns);
  line.set_format(listener.port, {.bit_rate = 9600, .parity = modbus::Parity::none});
  speaker.say("01", 1s);
  line.advance(2s);
  EXPECT_TRUE(listener.heard[1].intact);
}

TEST(SerialLine, StationsComeAndGo) {
  SerialLine line(SerialRig::format);
  Ear speaker(line);
  auto gone = std::make_unique<Ear>(line);
  gone->say("01 02 03", 0ms);
  line.detach(gone->port);
  gone.reset();
  Ear listener(line);
  speaker.say("04", 0ms);
  line.advance(1s);
  EXPECT_EQ(listener.text(), "04");
  EXPECT_TRUE(listener.all_intact());
}

TEST(SerialLine, Disturbances) {
  const auto heard = [](const SerialDisturbance& disturbance, std::uint64_t& disturbed) {
    SerialLine line(SerialRig::format);
    Ear speaker(line);
    Ear listener(line);
    line.disturb(disturbance);
    line.transmit(speaker.port, std::vector<std::uint8_t>(10'000, 0x55), 0ms);
    line.advance(10s);
    disturbed = line.counters().disturbed;
    EXPECT_TRUE(listener.all_intact());
    return listener.text();
  };
  std::uint64_t disturbed = 0;
  const std::string undisturbed = heard({}, disturbed);
  EXPECT_EQ(undisturbed.size(), 29'999U);
  EXPECT_EQ(disturbed, 0U);
  const std::string thinned = heard({.drop = 0.1}, disturbed);
  EXPECT_EQ(thinned.size() + 1, 3 * (10'000 - disturbed));
  EXPECT_NEAR(static_cast<double>(disturbed), 1000, 150);
  EXPECT_EQ(heard({.drop = 0.1}, disturbed), thinned) << "the same again";
  EXPECT_NE(heard({.drop = 0.1, .seed = 2}, disturbed), thinned);
  EXPECT_EQ(heard({.cut = true}, disturbed), "");
  EXPECT_EQ(disturbed, 10'000U);
  const std::string corrupted = heard({.corrupt = 0.1}, disturbed);
  std::uint64_t changed = 0;
  for (std::size_t i = 0; i < corrupted.size(); i += 3) changed += corrupted.substr(i, 2) != "55" ? 1U : 0U;
  EXPECT_EQ(changed, disturbed);
  EXPECT_NEAR(static_cast<double>(disturbed), 1000, 150);
}

// Lost or changed characters must never make a drive execute a different command, and the line works afterwards.
TEST(SerialLine, DisturbedRequestsAreNotExecuted) {
  SerialRig rig;
  rig.add_rtu(1);
  Ear master(rig.line);
  rig.line.disturb({.drop = 0.02, .corrupt = 0.02});
  unsigned answered = 0;
  for (unsigned round = 0; round < 5000; ++round) {
    const std::string request = "01 06 31 00 00 0F C7 32";
    master.heard.clear();
    master.say(request, rig.line.now());
    rig.line.advance(rig.line.now() + 10ms);
    answered += master.text() == request ? 1U : 0U;
    ASSERT_TRUE(rig.drives[1]->device.objects.controlword == 0x0F || rig.drives[1]->device.objects.controlword == 6);
    rig.drives[1]->device.objects.controlword = 6;
  }
  EXPECT_NEAR(answered, 5000 * std::pow(0.96, 16), 300);
  rig.line.disturb({});
  master.heard.clear();
  master.say("01 06 31 00 00 0F C7 32", rig.line.now());
  rig.line.advance(rig.line.now() + 10ms);
  EXPECT_EQ(master.text(), "01 06 31 00 00 0F C7 32");
}

// Request, 3.5 characters of silence, response: exact to the nanosecond, whether time advances in one call or in many.
TEST(SerialLine, ModbusAnswersOnTime) {
  for (const Time stride : {Time(1s), Time(62500ns), Time(7us)}) {
    SerialRig rig;
    rig.add_rtu(1);
    Ear master(rig.line);
    master.say("01 06 31 00 00 0F C7 32", 0ms);
    for (Time now = stride; now <= 10ms || master.heard.empty(); now += stride) rig.line.advance(now);
    EXPECT_EQ(master.text(), "01 06 31 00 00 0F C7 32");
    const Time character = SerialRig::format.character_time();
    EXPECT_EQ(master.heard[0].at, 8 * character + modbus::character_timing(SerialRig::format).silence + character);
    EXPECT_EQ(master.heard[7].at, master.heard[0].at + 7 * character);
  }
}

// A master sends requests to four drives on one line in turn, a thousand times, in Modbus and the 10-byte protocol. No
// drive disturbs another.
TEST(SerialLine, FourDrivesOnOneLine) {
  for (const bool is_modbus : {true, false}) {
    SerialRig rig;
    for (std::uint8_t id = 1; id <= 4; ++id) {
      if (is_modbus) {
        rig.add_rtu(id);
      } else {
        rig.add_serial10(id);
      }
    }
    Ear master(rig.line);
    for (unsigned round = 0; round < 1000; ++round) {
      const auto id = static_cast<std::uint8_t>(1 + round % 4);
      std::vector<std::uint8_t> request;
      std::string answer;
      if (is_modbus) {
        request = {id, 0x06, 0x31, 0x00, static_cast<std::uint8_t>(round >> 8), static_cast<std::uint8_t>(round), 0, 0};
        modbus::seal_rtu_frame(request, 6);
        answer = hex_of(request);
      } else {
        const auto frame = serial10::Frame::make(id, serial10::Command::write_2, 0x6040, 0, round);
        request.assign(frame.bytes.begin(), frame.bytes.end());
        answer = hex_of(serial10::Frame::make(id, serial10::Command::written, 0x6040, 0, round).bytes);
      }
      master.heard.clear();
      rig.line.transmit(master.port, request, rig.line.now());
      rig.line.advance(rig.line.now() + 10ms);
      ASSERT_EQ(master.text(), answer);
      ASSERT_EQ(rig.drives[id]->device.objects.controlword, round);
    }
    EXPECT_EQ(rig.line.counters().collisions, 0U);
  }
}

// The universal id on a line with two drives: both answer, and the master understands neither.
TEST(SerialLine, UniversalIdIsForOneDrive) {
  SerialRig rig;
  rig.add_serial10(1);
  Ear master(rig.line);
  const auto request = serial10::Frame::make(127, serial10::Command::read, 0x6040, 0, 0);
  rig.line.transmit(master.port, request.bytes, 0ms);
  rig.line.advance(10ms);
  EXPECT_EQ(master.text(), hex_of(serial10::Frame::make(1, serial10::Command::read_2, 0x6040, 0, 6).bytes));
  EXPECT_TRUE(master.all_intact());
  master.heard.clear();
  rig.add_serial10(2);
  rig.line.transmit(master.port, request.bytes, 100ms);
  rig.line.advance(200ms);
  EXPECT_FALSE(master.all_intact());
  EXPECT_EQ(rig.line.counters().collisions, 20U);
}

}  // namespace
}  // namespace serial_line_test
}  // namespace servodrome::links::test
