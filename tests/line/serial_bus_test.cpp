// RS485 lines: drives that answer Modbus on a simulated line, with or without a CAN bus.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "line/bench/line_bench.hpp"
#include "links/serial/client.hpp"
#include "modbus/rtu_server.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace serial_bus_test {
namespace {

using namespace test;
using nlohmann::json;

constexpr std::string_view serial_line = R"(
clock = "virtual"
[[bus]]
name = "can0"
[[bus]]
name = "rs"
type = "rs485"
bit_rate = 19200
format = "8E1"
[[axis]]
name = "both"
product = "generic402"
bus = "can0"
serial = "rs"
node = 2
[[axis]]
name = "alone"
product = "generic402"
serial = "rs"
station = 200
node = 2
)";

using Bytes = std::vector<std::uint8_t>;

class SerialBus : public testing::Test {
 protected:
  SerialBus() { line_.run_until(50ms); }

  // Returns the answer to a request, without CRC; empty: none came.
  Bytes ask(Bytes request, Time patience = 100ms) {
    const std::size_t size = request.size();
    request.resize(size + 2);
    modbus::seal_rtu_frame(request, size);
    master_.send(request);
    Bytes answer;
    const Time deadline = line_.now() + patience;
    while (line_.now() < deadline) master_.receive(answer, 5ms);
    if (answer.empty()) return answer;
    EXPECT_TRUE(modbus::is_rtu_frame(answer));
    answer.resize(answer.size() < 2 ? 0 : answer.size() - 2);
    return answer;
  }
  json bench(const std::string& target, const std::string& body = {}) {
    const api::Response response = bench::handle(
        line_,
        {.method = body.empty() ? api::Method::get : api::Method::post, .target = "/api/v1" + target, .body = body});
    EXPECT_EQ(response.status, 200U) << response.body;
    return json::parse(response.body);
  }

  Line line_{settings_of(serial_line)};
  NamedSerialBus& bus_ = *line_.find_serial_bus("rs");
  links::MemoryByteClient master_{bus_.line, line_};
};

TEST_F(SerialBus, EachStationAnswersForItself) {
  // Statusword at 0100h, controlword at 0.
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), (Bytes{2, 3, 2, 0x02, 0x50}));
  EXPECT_EQ(ask({200, 3, 1, 0, 0, 1}), (Bytes{200, 3, 2, 0x02, 0x50}));
  EXPECT_EQ(ask({2, 6, 0, 0, 0, 6}), (Bytes{2, 6, 0, 0, 0, 6}));
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), (Bytes{2, 3, 2, 0x02, 0x31}));
  EXPECT_EQ(ask({200, 3, 1, 0, 0, 1}), (Bytes{200, 3, 2, 0x02, 0x50}));
  EXPECT_EQ(ask({3, 3, 1, 0, 0, 1}), Bytes{});
  // All drives receive a broadcast, and none answers.
  EXPECT_EQ(ask({0, 6, 0, 0, 0, 6}), Bytes{});
  EXPECT_EQ(ask({200, 3, 1, 0, 0, 1}), (Bytes{200, 3, 2, 0x02, 0x31}));
}

// Two requests at the same moment: no drive understands them, and the line works again afterwards.
TEST_F(SerialBus, TwoMastersCollide) {
  links::MemoryByteClient other(bus_.line, line_);
  Bytes request{2, 3, 1, 0, 0, 1, 0, 0};
  modbus::seal_rtu_frame(request, 6);
  other.send(request);
  master_.send(request);
  master_.wait(100ms);
  EXPECT_EQ(bus_.line.counters().collisions, 16U);
  EXPECT_EQ(bus_.line.counters().characters, 16U) << "an answer";
  Bytes heard;
  master_.receive(heard, 0ms);
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), (Bytes{2, 3, 2, 0x02, 0x50}));
}

TEST_F(SerialBus, AnAnswerTakesItsTime) {
  const Time start = line_.now();
  Bytes request{2, 3, 1, 0, 0, 1, 0, 0};
  modbus::seal_rtu_frame(request, 6);
  master_.send(request);
  Bytes answer;
  while (answer.size() < 7) ASSERT_TRUE(master_.receive(answer, 100ms));
  // 8 characters, 3.5 of silence, 7 of answer, 11 bits each.
  const modbus::CharacterFormat& format = bus_.line.format();
  EXPECT_EQ(line_.now() - start, 15 * format.character_time() + format.half_characters(7));
}

TEST_F(SerialBus, WithoutPowerItIsSilent) {
  Axis& axis = *line_.find_axis("both");
  axis.power_off(line_.now());
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), Bytes{});
  EXPECT_EQ(line_.find_unit(bus_, 2), nullptr);
  axis.power_on(line_.now());
  line_.run_until(line_.now() + 50ms);
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), (Bytes{2, 3, 2, 0x02, 0x50}));
  // Power is lost in the middle of an answer: the rest is not sent.
  Bytes request{2, 3, 1, 0, 0, 1, 0, 0};
  modbus::seal_rtu_frame(request, 6);
  master_.send(request);
  Bytes answer;
  ASSERT_TRUE(master_.receive(answer, 100ms));
  axis.power_off(line_.now());
  line_.run_until(line_.now() + 100ms);
  while (master_.receive(answer, 0ms)) {
  }
  EXPECT_EQ(answer, Bytes{2});
}

TEST_F(SerialBus, UnitsAreTheStations) {
  ASSERT_NE(line_.find_unit(bus_, 2), nullptr);
  ASSERT_NE(line_.find_unit(bus_, 200), nullptr);
  EXPECT_NE(line_.find_unit(bus_, 2), line_.find_unit(bus_, 200));
  EXPECT_EQ(line_.find_unit(bus_, 3), nullptr);
  EXPECT_EQ(line_.find_unit(bus_, 255), nullptr) << "which of the two?";
  LineSettings single = settings_of(serial_line);
  single.axes.resize(1);
  const Line line(single);
  const NamedSerialBus& bus = *line.find_serial_bus("rs");
  EXPECT_EQ(line.find_unit(bus, 255), line.find_unit(bus, 2));
  EXPECT_EQ(line.find_unit(bus, 0), line.find_unit(bus, 2));
}

// The drive with a different bit rate cannot communicate.
TEST_F(SerialBus, ABitRateOfItsOwnIsNoContact) {
  const auto dictionary = [this]() -> dictionary::Dictionary& {
    return line_.find_axis("both")->device().dictionary();
  };
  ASSERT_EQ(dictionary().set_number(0x2F20, 2, 9600), dictionary::AbortCode::none);
  ASSERT_EQ(dictionary().set_number(0x1010, 1, 0x65766173), dictionary::AbortCode::none);
  EXPECT_FALSE(ask({2, 3, 1, 0, 0, 1}).empty()) << "from the next restart on";
  line_.find_axis("both")->power_off(line_.now());
  line_.find_axis("both")->power_on(line_.now());
  line_.run_until(line_.now() + 50ms);
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), Bytes{});
  EXPECT_EQ(bench("/buses/rs")["axes"]["both"]["bit_rate"], 9600);
}

TEST_F(SerialBus, TheBenchShowsAndDisturbsIt) {
  const json buses = bench("/buses")["buses"];
  ASSERT_EQ(buses.size(), 2U);
  EXPECT_EQ(buses[0]["type"], "can");
  EXPECT_EQ(buses[1], bench("/buses/rs"));
  EXPECT_EQ(buses[1]["type"], "rs485");
  EXPECT_EQ(buses[1]["bit_rate"], 19200);
  EXPECT_EQ(buses[1]["format"], "8E1");
  EXPECT_EQ(buses[1]["disturbance"], nullptr);
  EXPECT_EQ(buses[1]["axes"]["alone"],
            (json{{"station", 200}, {"protocol", "modbus"}, {"bit_rate", 19200}, {"format", "8E1"}}));
  EXPECT_EQ(bench("/axes/alone")["bus"], nullptr);
  EXPECT_EQ(bench("/axes/alone")["serial"], (json{{"bus", "rs"}, {"station", 200}, {"protocol", "modbus"}}));

  EXPECT_EQ(bench("/buses/rs/disturb", R"({"corrupt": 1, "seed": 5})")["disturbance"],
            (json{{"drop", 0.0}, {"corrupt", 1.0}, {"seed", 5}}));
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), Bytes{});
  EXPECT_EQ(bench("/buses/rs")["disturbed"], 8);
  EXPECT_EQ(bench("/buses/rs/disturb", R"({"cut": true})")["cut"], true);
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), Bytes{});
  const api::Response calmed =
      bench::handle(line_, {.method = api::Method::delete_, .target = "/api/v1/buses/rs/disturb", .body = {}});
  EXPECT_EQ(calmed.status, 200U);
  EXPECT_EQ(ask({2, 3, 1, 0, 0, 1}), (Bytes{2, 3, 2, 0x02, 0x50}));
  const api::Response refused = bench::handle(
      line_, {.method = api::Method::post, .target = "/api/v1/buses/rs/disturb", .body = R"({"delay": 1})"});
  EXPECT_EQ(refused.status, 400U);
}

}  // namespace
}  // namespace serial_bus_test
}  // namespace servodrome::line
