#include <fmt/format.h>
#include <gtest/gtest.h>

#include "api/error.hpp"
#include "ethercat/frame/frame_writer.hpp"
#include "ethercat/slave/slave.hpp"
#include "line/bench/line_bench.hpp"
#include "links/ethercat/memory_client.hpp"
#include "support.hpp"

// EtherCAT segments of a line: their slaves, the times of events, and disturbances by the bench API. tests/ethercat
// tests the protocol itself.
namespace servodrome::line {
namespace ethercat_line_test {
namespace {

using namespace test;
using ethercat::Command;

constexpr std::string_view three_slaves = R"(
clock = "virtual"
[[bus]]
name = "ecat"
type = "ethercat"
[[axis]]
name = "a"
product = "generic402-ec"
alias = 11
sync_error_limit = 600
[[axis]]
name = "b"
product = "generic402-ec"
oscillator_ppm = 50
cable_ns = 1000
[[axis]]
name = "c"
product = "generic402-ec"
)";

class EthercatLine : public testing::Test {
 protected:
  struct Answer {
    std::uint16_t working_counter = 0;
    std::uint64_t data = 0;
  };

  // Sends one datagram. The working counter is 0 if nothing came back.
  Answer ask(Command command, std::uint16_t adp, std::uint16_t ado, std::size_t length, std::uint64_t data = 0) {
    std::array<std::uint8_t, 64> memory{};
    auto writer = ethercat::FrameWriter::payload(memory);
    std::memcpy(writer.add(command, 1, ethercat::address_of(adp, ado), length).data(), &data, length);
    master.send(writer.bytes());
    std::array<std::uint8_t, 64> back{};
    if (master.receive(back, 1ms) == 0) return {};
    Answer answer;
    std::memcpy(&answer.data, &back[12], length);
    answer.working_counter = ethercat::load_u16(&back[12 + length]);
    return answer;
  }
  unsigned count() { return ask(Command::brd, 0, 0x0130, 2).working_counter; }

  Line line{settings_of(three_slaves)};
  links::MemoryEthercatClient master{line.ethercat_buses().at(0)->bus, line};
};

TEST_F(EthercatLine, TheOrderOfTheFileIsTheOrderOnTheWire) {
  EXPECT_EQ(count(), 3U);
  for (std::uint16_t i = 0; i < 3; ++i) {
    EXPECT_EQ(line.axes()[i]->position(), i + 1U);
    // 0012h: the alias; only the first slave has one.
    const Answer answer = ask(Command::aprd, static_cast<std::uint16_t>(-i), 0x0012, 2);
    EXPECT_EQ(answer.working_counter, 1U);
    EXPECT_EQ(answer.data, i == 0 ? 11U : 0U);
  }
}

// 10F1h:02 has the value of the line file after each power-on. A value that a master writes is kept until then.
TEST_F(EthercatLine, SyncErrorLimitIsThatOfTheFile) {
  const auto limit = [this](const char* name) { return line.find_axis(name)->device().dictionary().number(0x10F1, 2); };
  EXPECT_EQ(limit("a"), 600);
  EXPECT_EQ(limit("b"), 4);
  line.find_axis("a")->device().dictionary().set_number(0x10F1, 2, 7);
  EXPECT_EQ(limit("a"), 7);
  line.find_axis("a")->power_off(line.now());
  line.run_until(5ms);
  line.find_axis("a")->power_on(line.now());
  EXPECT_EQ(limit("a"), 600);
}

TEST_F(EthercatLine, AnAxisWithoutPowerEndsTheLineAndComesBack) {
  line.run_until(5ms);
  line.find_axis("b")->power_off(line.now());
  EXPECT_EQ(count(), 1U);
  line.run_until(50ms);
  line.find_axis("b")->power_on(line.now());
  EXPECT_EQ(count(), 3U);
  EXPECT_EQ(ask(Command::aprd, 0xFFFF, 0x0130, 2).data & 0x1F, 1U);  // Init
}

// A clock that is 50 ppm too fast counts 50 us more in a second.
TEST_F(EthercatLine, ASlavesClockGoesAsFastAsItsOscillator) {
  const auto local_time = [this](std::uint16_t slave) {
    ask(Command::bwr, 0, 0x0900, 4);  // latch
    return ask(Command::aprd, static_cast<std::uint16_t>(-slave), 0x0910, 8).data;
  };
  const std::uint64_t a = local_time(0);
  const std::uint64_t b = local_time(1);
  line.run_until(line.now() + 1s);
  const auto gone_a = static_cast<std::int64_t>(local_time(0) - a);
  const auto gone_b = static_cast<std::int64_t>(local_time(1) - b);
  EXPECT_NEAR(static_cast<double>(gone_b - gone_a), 50'000.0, 10.0);
}

TEST_F(EthercatLine, HowTimeIsCutIntoCallsChangesNothing) {
  Line other(settings_of(three_slaves));
  links::MemoryEthercatClient its_master(other.ethercat_buses().at(0)->bus, other);
  line.run_until(100ms);
  for (int i = 1; i <= 3000; ++i) other.run_until(Time(33'333) * i);
  other.run_until(100ms);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(line.axes()[i]->plant().position_counts(), other.axes()[i]->plant().position_counts());
    const std::uint64_t here = line.axes()[i]->device().ethercat_controller()->clock().local_time(line.now());
    EXPECT_EQ(here, other.axes()[i]->device().ethercat_controller()->clock().local_time(other.now()));
  }
}

TEST_F(EthercatLine, TheBenchUnplugsCablesAndClosesTheRing) {
  const auto disturb = [this](const std::string& body) {
    return bench::handle(line, {api::Method::post, "/api/v1/buses/ecat/disturb", body}).status;
  };
  EXPECT_EQ(disturb(R"({"unplug": 2})"), 200U);
  EXPECT_EQ(count(), 1U);
  EXPECT_EQ(disturb(R"({"unplug": 4})"), 422U);
  EXPECT_EQ(disturb(R"({"unplug": 0})"), 422U);
  EXPECT_EQ(disturb(R"({"unplugg": 1})"), 400U);
  EXPECT_EQ(count(), 1U);  // unchanged
  EXPECT_EQ(disturb(R"({"drop": 1})"), 200U);
  EXPECT_EQ(count(), 0U);
  EXPECT_EQ(bench::handle(line, {api::Method::delete_, "/api/v1/buses/ecat/disturb", ""}).status, 200U);
  EXPECT_EQ(count(), 3U);

  const auto view = api::Json::parse(bench::handle(line, {api::Method::get, "/api/v1/buses/ecat", ""}).body);
  EXPECT_EQ(view["type"], "ethercat");
  EXPECT_EQ(view["frames"], 4);
  EXPECT_EQ(view["dropped"], 1);
  EXPECT_EQ(view["axes"]["b"]["position"], 2);
  EXPECT_EQ(view["unplugged"].size(), 0U);
}

TEST_F(EthercatLine, EachProductDescribesItself) {
  for (const Product& product : all_products()) {
    if (product.fieldbus != Fieldbus::ethercat) continue;
    Line alone(
        settings_of(fmt::format("[[bus]]\nname='e'\ntype='ethercat'\n[[axis]]\nname='x'\nproduct='{}'\n"
                                "serial_number=77\n",
                                product.name)));
    alone.run_until(10ms);
    products::Device& device = alone.axes()[0]->device();
    EXPECT_EQ(device.dictionary().number(0x1018, 4), 77) << product.name;
    EXPECT_EQ(device.ethercat_slave()->state(), ethercat::AlState::init) << product.name;
    EXPECT_EQ(product.describe().table.data(), device.bus_dictionary().table().data()) << product.name;
    // The information memory is large enough for all its categories.
    const std::vector<std::uint8_t> sii = describe::sii(product.describe());
    const auto word = [&sii](std::size_t at) { return sii.at(2 * at) | sii.at(2 * at + 1) << 8; };
    std::size_t category = 0x40;
    while (word(category) != 0xFFFF) category += 2 + static_cast<std::size_t>(word(category + 1));
    EXPECT_GT(category, 0x40U) << product.name;
  }
}

}  // namespace
}  // namespace ethercat_line_test
}  // namespace servodrome::line
