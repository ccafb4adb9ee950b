// Interposers on the buses and slaves of a line: their delays are events of the line's time, and a power cycle clears
// all state that a drive's hardware would lose.
#include <gtest/gtest.h>

#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/slave/slave.hpp"
#include "links/ethercat/memory_client.hpp"
#include "links/serial/client.hpp"
#include "modbus/rtu_server.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace interposer_test {
namespace {

using namespace test;
using ethercat::Command;
using Bytes = std::vector<std::uint8_t>;

constexpr std::string_view settings = R"(
clock = "virtual"
[[bus]]
name = "ecat"
type = "ethercat"
[[bus]]
name = "rs"
type = "rs485"
[[axis]]
name = "slave"
product = "generic402-ec"
oscillator_ppm = 50
[[axis]]
name = "station"
product = "generic402"
serial = "rs"
node = 2
)";

class Interposers : public testing::Test {
 protected:
  Interposers() { line.run_until(50ms); }

  std::uint64_t read(std::uint16_t ado, std::size_t length) {
    std::array<std::uint8_t, 64> memory{};
    auto writer = ethercat::FrameWriter::payload(memory);
    writer.add(Command::aprd, 1, ethercat::address_of(0, ado), length);
    master.send(writer.bytes());
    std::array<std::uint8_t, 64> back{};
    if (master.receive(back, 1ms) == 0) return 0;
    std::uint64_t value = 0;
    std::memcpy(&value, &back[12], length);
    return value;
  }
  void power_cycle() {
    slave.power_off(line.now());
    line.run_until(line.now() + 5ms);
    slave.power_on(line.now());
  }
  // The local time that passes in a second.
  std::int64_t local_second() {
    const ethercat::DistributedClock& clock = esc().clock();
    const std::uint64_t before = clock.local_time(line.now());
    line.run_until(line.now() + 1s);
    return static_cast<std::int64_t>(clock.local_time(line.now()) - before);
  }
  ethercat::Esc& esc() { return *slave.device().ethercat_controller(); }

  Line line{settings_of(settings)};
  Axis& slave = *line.find_axis("slave");
  Axis& station = *line.find_axis("station");
  links::SerialLine& rs = line.find_serial_bus("rs")->line;
  links::MemoryEthercatClient master{line.ethercat_buses().at(0)->bus, line};
  links::MemoryByteClient bytes{rs, line};
};

TEST_F(Interposers, ALateSerialAnswerIsAnEventOfTheLine) {
  struct Late final : links::SerialInterposer {
    std::vector<links::SerialPiece> answers(std::span<const std::uint8_t> answer, Time at) override {
      answered = at;
      return {{70ms, {answer.begin(), answer.begin() + 3}}, {1ms, {answer.begin() + 3, answer.end()}}};
    }
    Time answered{};
  } late;
  rs.interpose(station.serial_line_port(), &late);
  Bytes request{2, 3, 1, 0, 0, 1, 0, 0};
  modbus::seal_rtu_frame(request, 6);
  bytes.send(request);
  while (late.answered == Time{} && line.now() < 1s) line.step();
  EXPECT_EQ(line.next_bus_event(), late.answered + 70ms);
  line.run_until(late.answered + 70ms);
  Bytes answer;
  while (answer.size() < 7 && line.now() < 1s) bytes.receive(answer, 1ms);
  Bytes wanted{2, 3, 2, 0x02, 0x50, 0, 0};
  modbus::seal_rtu_frame(wanted, 5);
  EXPECT_EQ(answer, wanted);
  // A drive without power sends no part of a late answer.
  bytes.send(request);
  const Time before = late.answered;
  while (late.answered == before && line.now() < 1s) line.step();
  ASSERT_NE(late.answered, before);
  station.power_off(line.now());
  line.run_until(line.now() + 1s);
  answer.clear();
  bytes.receive(answer, 1ms);
  EXPECT_TRUE(answer.empty());
}

TEST_F(Interposers, ADriveFallsBackByItselfAndItsMasterSeesIt) {
  EXPECT_EQ(read(0x0130, 2), 1U);
  slave.device().ethercat_slave()->fall_back(ethercat::AlState::init, ethercat::AlStatusCode::supply_voltage_too_low,
                                             line.now());
  EXPECT_EQ(read(0x0130, 2), 0x11U);
  EXPECT_EQ(read(0x0134, 2), 0x80U);
  power_cycle();
  EXPECT_EQ(read(0x0130, 2), 1U);
}

TEST_F(Interposers, APatchedSiiSurvivesAPowerCycle) {
  const std::span<std::uint8_t> image = esc().sii().memory();
  ASSERT_GE(image.size(), 128U);
  ethercat::store_u16(&image[2 * 10], 0x4242);  // the low word of the product code
  image[14] ^= 0xFF;
  EXPECT_EQ(read(0x0502, 2) & 0x0800U, 0U);
  power_cycle();
  EXPECT_EQ(ethercat::load_u16(&esc().sii().memory()[2 * 10]), 0x4242);
  EXPECT_EQ(read(0x0502, 2) & 0x0800U, 0x0800U);  // checksum error
}

TEST_F(Interposers, AFaultOfTheClockSurvivesAPowerCycle) {
  EXPECT_EQ(local_second(), 1'000'050'000);
  esc().stop_clock(true, line.now());
  EXPECT_EQ(local_second(), 0);
  power_cycle();
  EXPECT_EQ(local_second(), 0);
  esc().stop_clock(false, line.now());
  EXPECT_NEAR(static_cast<double>(local_second()), 1'000'050'000.0, 1.0);
  esc().set_oscillator(2'000'000, line.now());
  EXPECT_NEAR(static_cast<double>(local_second()), 1'002'000'000.0, 1.0);
  power_cycle();
  EXPECT_NEAR(static_cast<double>(local_second()), 1'002'000'000.0, 1.0);
}

}  // namespace
}  // namespace interposer_test
}  // namespace servodrome::line
