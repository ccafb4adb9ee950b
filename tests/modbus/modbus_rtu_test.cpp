// RTU framing: CRC, silence, addresses (Modbus over Serial Line V1.02, 2.5.1).
#include "modbus/ismk_modbus.hpp"

namespace servodrome::modbus::test {
namespace modbus_rtu_test {
namespace {

using Device = servodrome::test::IsmkDevice;
constexpr const char* enable = "01 06 31 00 00 0F C7 32";

TEST(Crc16, CheckValues) {
  constexpr std::array<std::uint8_t, 9> digits = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  static_assert(crc16(digits) == 0x4B37);
  static_assert(crc16({}) == 0xFFFF);
  // The example of the standard (appendix B): station 02, function 07 gives 1241h, low byte 41h first.
  EXPECT_EQ(crc16(bytes_of("02 07")), 0x1241);
  EXPECT_EQ(crc16(bytes_of("02 07 41 12")), 0);
  for (unsigned size = 0; size < 40; ++size) {  // compared with the definition, bit by bit
    std::vector<std::uint8_t> bytes;
    unsigned crc = 0xFFFF;
    for (unsigned i = 0; i < size; ++i) {
      bytes.push_back(static_cast<std::uint8_t>(i * 37 + size));
      crc ^= bytes.back();
      for (int bit = 0; bit < 8; ++bit) crc = (crc & 1U) != 0 ? crc >> 1 ^ 0xA001U : crc >> 1;
    }
    EXPECT_EQ(crc16(bytes), crc);
  }
}

TEST(CharacterFormat, TimesOfCharactersAndPauses) {
  constexpr CharacterFormat standard;
  static_assert(standard.bits() == 11);
  static_assert(CharacterFormat{.parity = Parity::none}.bits() == 10);
  static_assert(CharacterFormat{.parity = Parity::none, .stop_bits = 2}.bits() == 11);
  static_assert(standard.character_time() == 572916ns);
  static_assert(standard_timing(standard).silence == 2005208ns);
  static_assert(standard_timing(standard).inter_character == 859375ns);
  static_assert(standard_timing(standard) == character_timing(standard));
  constexpr CharacterFormat fast{.bit_rate = 115200, .parity = Parity::none};
  static_assert(fast.character_time() == 86805ns);
  static_assert(character_timing(fast).silence == 303819ns);
  static_assert(standard_timing(fast).silence == 1750us);
  static_assert(standard_timing(fast).inter_character == 750us);
  static_assert(standard_timing(fast).character == 86805ns);
}

// At each of the iSMK's bit rates the frame is answered 3.5 characters after its last, and not before.
TEST(RtuServer, AnswersAfterTheSilence) {
  for (const std::uint32_t bit_rate : {9600U, 19200U, 38400U, 115200U}) {
    const CharacterFormat format{.bit_rate = bit_rate, .parity = Parity::none};
    Station<Device> station(ismk_profile, ismk_map, 1, character_timing(format));
    EXPECT_EQ(station.rtu.next_deadline(), never);
    station.send(bytes_of(enable));
    const Time silence_ends = station.now + Time(35'000'000'000 / bit_rate);
    EXPECT_EQ(station.rtu.next_deadline(), silence_ends);
    station.rtu.poll(silence_ends - 1ns);
    EXPECT_TRUE(station.rtu.take().empty());
    EXPECT_EQ(station.device.objects.controlword, 6);
    station.rtu.poll(silence_ends);
    EXPECT_EQ(hex_of(station.rtu.take()), enable);
    EXPECT_TRUE(station.rtu.take().empty()) << "once";
    EXPECT_EQ(station.rtu.next_deadline(), never);
  }
}

// Pauses of up to 1.5 characters are valid anywhere in a frame, longer ones invalidate it, and 3.5 characters begin a
// new frame.
TEST(RtuServer, PausesWithinAFrame) {
  const std::vector<std::uint8_t> bytes = bytes_of(enable);
  for (std::size_t split = 1; split < bytes.size(); ++split) {
    for (const bool too_long : {false, true}) {
      Station<Device> station(ismk_profile, ismk_map);
      station.send(std::span(bytes).first(split));
      station.now += station.timing.inter_character + (too_long ? 1ns : 0ns);
      station.send(std::span(bytes).subspan(split));
      EXPECT_EQ(station.answer(), too_long ? "" : enable) << split;
    }
    // Two incomplete frames; the station answers the next frame.
    Station<Device> station(ismk_profile, ismk_map);
    station.send(std::span(bytes).first(split));
    EXPECT_EQ(station.answer(), "");
    station.send(std::span(bytes).subspan(split));
    EXPECT_EQ(station.answer(), "");
    EXPECT_EQ(station.ask(enable), enable);
  }
}

// A master need not wait longer than the answers of other stations last: for a station that is not addressed, a
// complete frame ends after 1.5 characters.
TEST(RtuServer, AFrameSoonAfterAnothersIsUnderstood) {
  for (const bool patient : {false, true}) {
    const RtuTiming timing = at_least(patient ? Time(20ms) : Time{}, standard_timing(ismk_format));
    Station<Device> station(ismk_profile, ismk_map, 1, timing);
    for (const char* other : {"02 03 32 00 00 02 CA 80", "02 03 04 C0 37 FF FF 45 4D"}) {
      std::vector<std::uint8_t> bytes = bytes_of(other);
      seal_rtu_frame(bytes, bytes.size() - 2);
      station.send(bytes);
      station.now += timing.character * 3 / 2 + 1ns;
    }
    EXPECT_EQ(station.ask(enable), enable);
    // A request to the station itself is not executed if the master continues to send before the answer.
    std::vector<std::uint8_t> shut_down = bytes_of("01 06 31 00 00 06 00 00");
    seal_rtu_frame(shut_down, 6);
    station.send(shut_down);
    station.now += timing.character * 2;
    EXPECT_EQ(station.ask("01 03 32 00 00 02 CA B3").substr(0, 5), "01 03");
    EXPECT_EQ(station.device.objects.controlword, 0x0F);
  }
}

TEST(RtuServer, PausesDoNotMatterIfSoConfigured) {
  RtuTiming patient = character_timing(ismk_format);
  patient.inter_character = Time{0};
  patient.silence = 20ms;
  Station<Device> station(ismk_profile, ismk_map, 1, patient);
  for (const std::uint8_t byte : bytes_of(enable)) {
    station.now += 19ms;
    station.rtu.receive(byte, station.now);
  }
  EXPECT_EQ(station.answer(), enable);
}

// A poll that comes late, or only after the next frame has begun, changes only the time of the answer.
TEST(RtuServer, LatePollsLoseNoFrame) {
  Station<Device> station(ismk_profile, ismk_map);
  station.send(bytes_of(enable));
  station.now += 1s;
  station.send(std::span<const std::uint8_t>(bytes_of(enable)).first(1));
  EXPECT_EQ(station.device.objects.controlword, 0x0F) << "executed";
  EXPECT_TRUE(station.rtu.take().empty()) << "but the master has gone on";
}

TEST(RtuServer, SpoiltCharactersSpoilTheFrame) {
  Station<Device> station(ismk_profile, ismk_map);
  const std::vector<std::uint8_t> bytes = bytes_of(enable);
  station.send(bytes);
  station.rtu.receive_garbled(station.now += station.timing.character);
  EXPECT_EQ(station.answer(), "");
  station.rtu.receive_garbled(station.now += station.timing.character);
  station.send(bytes);
  EXPECT_EQ(station.answer(), "");
  EXPECT_EQ(station.ask(enable), enable);
}

TEST(RtuServer, FramesOfAllLengths) {
  Station<Device> station(ismk_profile, ismk_map);
  for (std::size_t size = 1; size < 600; ++size) {
    std::vector<std::uint8_t> frame(size + 2, 0xFF);
    frame[0] = 1;
    seal_rtu_frame(frame, size);
    station.send(frame);
    // Minimum: station, function and CRC; maximum: 256 bytes; FFh is not a valid function.
    EXPECT_EQ(station.answer(), size >= 2 && size <= 254 ? "01 FF 01 A0 30" : "") << size;
  }
}

// The longest possible frame, and the same with one more character.
TEST(RtuServer, NoFrameIsLongerThan256) {
  Station<Device> station(ismk_profile, ismk_map);
  std::vector<std::uint8_t> frame(longest_rtu_frame, 0xFF);
  frame[0] = 1;
  seal_rtu_frame(frame, longest_rtu_frame - 2);
  station.send(frame);
  EXPECT_EQ(station.answer(), "01 FF 01 A0 30");
  frame.push_back(0);
  station.send(frame);
  EXPECT_EQ(station.answer(), "");
}

// Four drives on one line: each receives everything, including answers, and sends only if it is addressed.
TEST(RtuServer, OnlyTheAddressedStationAnswers) {
  std::array<Station<Device>, 4> stations{
      Station<Device>{ismk_profile, ismk_map, 1}, Station<Device>{ismk_profile, ismk_map, 2},
      Station<Device>{ismk_profile, ismk_map, 3}, Station<Device>{ismk_profile, ismk_map, 247}};
  for (auto& asked : stations) {
    std::vector<std::uint8_t> request = bytes_of("00 06 31 00 00 0F 00 00");
    request[0] = asked.rtu.station();
    seal_rtu_frame(request, 6);
    std::vector<std::uint8_t> answer;
    for (auto& station : stations) {
      station.send(request);
      const std::string text = station.answer();
      EXPECT_EQ(text, &station == &asked ? hex_of(request) : "");
      if (!text.empty()) answer = bytes_of(text);
    }
    for (auto& station : stations) {
      if (&station == &asked) continue;
      station.send(answer);
      EXPECT_EQ(station.answer(), "");
    }
  }
  for (auto& station : stations) {
    EXPECT_EQ(station.device.objects.controlword, 0x0F);
    EXPECT_EQ(station.ask_sealed("00 06 31 00 00 06"), "") << "all of them, silently";
    EXPECT_EQ(station.device.objects.controlword, 6);
  }
  EXPECT_EQ(stations[0].ask_sealed("FF 06 31 00 00 0F"), "");
}

TEST(RtuServer, IsSetUpAnew) {
  Station<Device> station(ismk_profile, ismk_map);
  station.send(bytes_of(enable));
  station.timing = character_timing({.bit_rate = 9600, .parity = Parity::none});
  station.rtu.reset(station.timing);
  station.rtu.set_station(9);
  EXPECT_EQ(station.answer(), "");
  EXPECT_EQ(station.ask(enable), "");
  EXPECT_EQ(station.ask_sealed("09 06 31 00 00 0F"), "09 06 31 00 00 0F");
}

}  // namespace
}  // namespace modbus_rtu_test
}  // namespace servodrome::modbus::test
