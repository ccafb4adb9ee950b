#include <array>
#include <cmath>
#include <cstring>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <servodrome.h>
#include <string>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace capi_test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr const char* two_axes = R"(
[[bus]]
name = "can0"
[[bus]]
name = "ecat"
type = "ethercat"
[[bus]]
name = "rs485a"
type = "rs485"
[[axis]]
name = "x"
product = "generic402"
bus = "can0"
node = 1
[[axis]]
name = "y"
product = "jmc_ec"
bus = "ecat"
[[axis]]
name = "z"
product = "ismk"
bus = "can0"
node = 5
serial = "rs485a"
serial_protocol = "modbus"
)";

json last_error() { return json::parse(servodrome_last_error()); }

class LineOfThreeAxes : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(servodrome_line_open(two_axes, std::strlen(two_axes), "test.toml", &line), SERVODROME_OK)
        << servodrome_last_error();
  }
  void TearDown() override { servodrome_line_close(line); }

  std::int64_t now() const {
    std::int64_t now_ns = -1;
    EXPECT_EQ(servodrome_line_now(line, &now_ns), SERVODROME_OK);
    return now_ns;
  }
  std::uint32_t channel(const char* axis, const char* value) const {
    std::uint32_t number = 0;
    EXPECT_EQ(servodrome_channel(line, axis, value, &number), SERVODROME_OK) << servodrome_last_error();
    return number;
  }
  double value(const char* axis, const char* name) const {
    const std::uint32_t number = channel(axis, name);
    double result = std::nan("");
    EXPECT_EQ(servodrome_read(line, &number, 1, &result), SERVODROME_OK);
    return result;
  }
  json request(const char* method, const std::string& target, const std::string& body = {},
               unsigned status = 200) const {
    servodrome_answer answer{};
    EXPECT_EQ(servodrome_line_request(line, method, target.c_str(), body.data(), body.size(), &answer), SERVODROME_OK);
    EXPECT_EQ(answer.status, status) << std::string_view(answer.body, answer.size);
    return answer.size == 0 ? json() : json::parse(answer.body, answer.body + answer.size);
  }

  servodrome_handle line = 0;
};

TEST_F(LineOfThreeAxes, TimePassesInTicksAndNeverBack) {
  EXPECT_EQ(now(), 0);
  EXPECT_EQ(servodrome_line_run_ticks(line, 3), SERVODROME_OK);
  EXPECT_EQ(now(), 3 * SERVODROME_TICK_NS);
  EXPECT_EQ(servodrome_line_run_until(line, 200'000), SERVODROME_OK);
  EXPECT_EQ(now(), 200'000);
  EXPECT_EQ(servodrome_line_run_ticks(line, 1), SERVODROME_OK);  // tick 3 was the last that has ended
  EXPECT_EQ(now(), 4 * SERVODROME_TICK_NS);
  std::int64_t after = 0;
  EXPECT_EQ(servodrome_line_advance(line, 0, &after), SERVODROME_OK);
  EXPECT_EQ(after, now());
  EXPECT_EQ(servodrome_line_advance(line, SERVODROME_TICK_NS, nullptr), SERVODROME_OK);
  EXPECT_EQ(now(), 5 * SERVODROME_TICK_NS);
  EXPECT_EQ(servodrome_line_advance(line, -1, &after), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(servodrome_line_run_until(line, 1), SERVODROME_BAD_ARGUMENT);
  EXPECT_THAT(last_error()["where"], "time_ns");
  EXPECT_EQ(servodrome_line_run_ticks(line, -1), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(servodrome_line_run_until(line, INT64_MAX), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(now(), 5 * SERVODROME_TICK_NS);
}

TEST_F(LineOfThreeAxes, AClosedHandleIsAnErrorEverywhere) {
  servodrome_handle can = 0;
  ASSERT_EQ(servodrome_can_open(line, "can0", &can), SERVODROME_OK);
  std::int64_t time = 0;
  EXPECT_EQ(servodrome_line_now(can, &time), SERVODROME_CLOSED) << "a port is no line";
  servodrome_can_frame frame{};
  EXPECT_EQ(servodrome_can_receive(line, 0, &frame), SERVODROME_CLOSED) << "a line is no port";
  EXPECT_EQ(servodrome_recorder_close(can), SERVODROME_CLOSED);
  EXPECT_EQ(servodrome_port_close(can), SERVODROME_OK);
  EXPECT_EQ(servodrome_port_close(can), SERVODROME_CLOSED);
  ASSERT_EQ(servodrome_can_open(line, "can0", &can), SERVODROME_OK);
  EXPECT_EQ(servodrome_line_close(line), SERVODROME_OK);
  EXPECT_EQ(servodrome_can_receive(can, 0, &frame), SERVODROME_CLOSED);
  EXPECT_EQ(servodrome_line_run_ticks(line, 1), SERVODROME_CLOSED);
  EXPECT_EQ(servodrome_line_close(line), SERVODROME_CLOSED);
  EXPECT_EQ(servodrome_line_run_ticks(0, 1), SERVODROME_CLOSED);
}

TEST(CapiLine, AFaultyFileGivesEveryPlace) {
  servodrome_handle line = 0;
  const std::string text = "[[bus]]\nname = \"can0\"\n[[axis]]\nname = \"x\"\nproduct = \"ismd\"\n";
  EXPECT_EQ(servodrome_line_open(text.data(), text.size(), "cell.toml", &line), SERVODROME_BAD_LINE);
  const json error = last_error();
  ASSERT_FALSE(error["diagnostics"].empty());
  EXPECT_EQ(error["diagnostics"][0]["file"], "cell.toml");
  EXPECT_EQ(error["diagnostics"][0]["line"], 5);
  EXPECT_THAT(error["diagnostics"][0]["hint"].get<std::string>(), HasSubstr("ismc"));
  EXPECT_EQ(line, 0U);
}

TEST(CapiLine, TheBuiltInLineNeedsNoFile) {
  servodrome_handle line = 0;
  ASSERT_EQ(servodrome_line_open(nullptr, 0, nullptr, &line), SERVODROME_OK);
  const char* warnings = nullptr;
  EXPECT_EQ(servodrome_line_warnings(line, &warnings), SERVODROME_OK);
  EXPECT_EQ(json::parse(warnings), json::array());
  EXPECT_EQ(servodrome_line_close(line), SERVODROME_OK);
}

TEST_F(LineOfThreeAxes, ARequestIsThatOfTheBenchApi) {
  EXPECT_EQ(request("GET", "/api/v1/axes")["axes"].size(), 3U);
  EXPECT_EQ(request("POST", "/api/v1/clock/advance", R"({"ms": 100})")["ticks"], 1600);
  EXPECT_EQ(now(), 100'000'000);
  const json refused = request("GET", "/api/v1/axes/w", {}, 404);
  EXPECT_THAT(refused["error"]["what"].get<std::string>(), HasSubstr("\"w\""));
  servodrome_answer answer{};
  EXPECT_EQ(servodrome_line_request(line, "PATCH", "/api/v1/axes", nullptr, 0, &answer), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(servodrome_line_request(line, "GET", nullptr, nullptr, 0, &answer), SERVODROME_BAD_ARGUMENT);
}

TEST_F(LineOfThreeAxes, JobsRunInLineTime) {
  request("POST", "/api/v1/clock/advance", R"({"ms": 1000})");
  const auto enable = request("POST", "/api/v1/axes/y/jobs", R"({"do": "enable"})", 201)["id"].get<int>();
  EXPECT_EQ(servodrome_line_run_ticks(line, 16'000), SERVODROME_OK);
  EXPECT_EQ(request("GET", "/api/v1/jobs/" + std::to_string(enable))["state"], "done");
  request("POST", "/api/v1/axes/y/jobs", R"({"do": "move", "by": 1, "velocity": 1, "units": "revolutions"})", 201);
  EXPECT_EQ(servodrome_line_run_ticks(line, 16'000 * 5), SERVODROME_OK);
  EXPECT_NEAR(value("y", "position_counts"), 4000, 3);
}

TEST_F(LineOfThreeAxes, ValuesAreSignalsInputsAndObjects) {
  servodrome_line_run_ticks(line, 16'000);
  EXPECT_EQ(channel("x", "supply_v"), channel("x", "supply_v"));
  EXPECT_NEAR(value("x", "supply_v"), 310, 1);
  EXPECT_EQ(value("x", "DI0"), 0);
  EXPECT_EQ(value("x", "6041:00"), value("x", "statusword"));
  std::uint32_t number = 0;
  EXPECT_EQ(servodrome_channel(line, "x", "suply_v", &number), SERVODROME_UNKNOWN);
  EXPECT_THAT(last_error()["hint"].get<std::string>(), HasSubstr("supply_v"));
  EXPECT_EQ(servodrome_channel(line, "w", "supply_v", &number), SERVODROME_UNKNOWN);
  EXPECT_EQ(servodrome_channel(line, "x", "9999:00", &number), SERVODROME_UNKNOWN);
  number = 1000;
  double result = 0;
  EXPECT_EQ(servodrome_read(line, &number, 1, &result), SERVODROME_BAD_ARGUMENT);
}

TEST_F(LineOfThreeAxes, ARecorderHasEveryRow) {
  const std::array channels{channel("x", "temperature_c"), channel("x", "supply_v"), channel("y", "supply_v")};
  servodrome_line_run_ticks(line, 5);
  servodrome_handle recorder = 0;
  ASSERT_EQ(servodrome_recorder_open(line, channels.data(), channels.size(), 4, &recorder), SERVODROME_OK);
  servodrome_line_run_ticks(line, 10'000);  // more rows than the ring buffer behind it has
  std::uint64_t rows = 0;
  std::int64_t first = 0;
  ASSERT_EQ(servodrome_recorder_rows(recorder, &rows, &first), SERVODROME_OK);
  EXPECT_EQ(first, 8);
  EXPECT_EQ(rows, (10'005U - 8U) / 4U + 1U);
  std::vector<double> values(rows * channels.size());
  ASSERT_EQ(servodrome_recorder_copy(recorder, 0, rows, values.data()), SERVODROME_OK);
  EXPECT_NEAR(values[values.size() - 2], 310, 1);
  EXPECT_NEAR(values[values.size() - 1], 36, 1);
  EXPECT_EQ(servodrome_recorder_copy(recorder, 1, rows, values.data()), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(servodrome_recorder_close(recorder), SERVODROME_OK);
  EXPECT_EQ(servodrome_recorder_open(line, channels.data(), 0, 4, &recorder), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(servodrome_recorder_open(line, channels.data(), 3, 0, &recorder), SERVODROME_BAD_ARGUMENT);
}

TEST_F(LineOfThreeAxes, CanFramesTakeTheirTimeOnTheBus) {
  servodrome_handle can = 0;
  ASSERT_EQ(servodrome_can_open(line, "can0", &can), SERVODROME_OK);
  servodrome_line_run_ticks(line, 16'000);
  servodrome_can_frame frame{};
  while (servodrome_can_receive(can, 0, &frame) == SERVODROME_OK) continue;  // boot-up messages
  servodrome_can_frame upload{};
  upload.id = 0x601;
  upload.length = 8;
  upload.data[0] = 0x40;
  upload.data[2] = 0x10;  // 1000h
  ASSERT_EQ(servodrome_can_send(can, &upload), SERVODROME_OK);
  const std::int64_t before = now();
  ASSERT_EQ(servodrome_can_receive(can, 50'000'000, &frame), SERVODROME_OK);
  EXPECT_EQ(frame.id, 0x581U);
  EXPECT_EQ(frame.data[0], 0x43);
  EXPECT_EQ(frame.data[4] | frame.data[5] << 8, 402);
  EXPECT_GE(frame.time_ns - before, 200'000) << "two frames of some 110 bits at 1 Mbit/s";
  EXPECT_LE(frame.time_ns, now());
  const std::int64_t end = now() + 10'000'000;
  EXPECT_EQ(servodrome_can_receive(can, 10'000'000, &frame), SERVODROME_NOTHING);
  EXPECT_EQ(now(), end);
  upload.id = 0x800;
  EXPECT_EQ(servodrome_can_send(can, &upload), SERVODROME_BAD_ARGUMENT);
  upload.id = 0x601;
  upload.length = 9;
  EXPECT_EQ(servodrome_can_send(can, &upload), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(servodrome_can_open(line, "can1", &can), SERVODROME_UNKNOWN);
  EXPECT_THAT(last_error()["hint"].get<std::string>(), HasSubstr("can0"));
}

TEST_F(LineOfThreeAxes, WaitingEndsAtTheFirstPortThatHasSomething) {
  servodrome_handle silent = 0;
  servodrome_handle can = 0;
  ASSERT_EQ(servodrome_serial_open(line, "rs485a", &silent), SERVODROME_OK);
  ASSERT_EQ(servodrome_can_open(line, "can0", &can), SERVODROME_OK);
  const std::array ports{silent, can};
  std::size_t ready = 99;
  ASSERT_EQ(servodrome_line_wait(line, 10'000'000'000, ports.data(), 2, &ready), SERVODROME_OK);
  EXPECT_EQ(ready, 1U);  // a boot-up message
  EXPECT_LT(now(), 10'000'000'000);
  servodrome_can_frame frame{};
  while (servodrome_can_receive(can, 5'000'000'000, &frame) == SERVODROME_OK) continue;
  const std::int64_t end = now() + 1'000'000;
  EXPECT_EQ(servodrome_line_wait(line, end, ports.data(), 2, &ready), SERVODROME_NOTHING);
  EXPECT_EQ(now(), end);
  servodrome_port_close(silent);
  EXPECT_EQ(servodrome_line_wait(line, end, ports.data(), 2, &ready), SERVODROME_CLOSED);
}

TEST_F(LineOfThreeAxes, ModbusRtuAnswersOnTheSerialPort) {
  servodrome_handle port = 0;
  ASSERT_EQ(servodrome_serial_open(line, "rs485a", &port), SERVODROME_OK);
  servodrome_line_run_ticks(line, 16'000);
  // Station 5, read one holding register from an address that no drive has: exception 2.
  const std::array<std::uint8_t, 8> read{0x05, 0x03, 0xFF, 0xF0, 0x00, 0x01, 0xB5, 0xA9};
  ASSERT_EQ(servodrome_serial_send(port, read.data(), read.size()), SERVODROME_OK);
  std::vector<std::uint8_t> bytes;
  std::array<std::uint8_t, 3> some{};
  std::size_t size = 0;
  while (servodrome_serial_receive(port, 100'000'000, some.data(), some.size(), &size) == SERVODROME_OK)
    bytes.insert(bytes.end(), some.begin(), some.begin() + static_cast<std::ptrdiff_t>(size));
  ASSERT_EQ(bytes.size(), 5U);
  EXPECT_EQ(bytes[0], 0x05);
  EXPECT_NE(bytes[1] & 0x80, 0) << "an exception";
  EXPECT_EQ(servodrome_serial_configure(port, 115200, 8, 'X', 1), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(servodrome_serial_configure(port, 9600, 8, 'E', 1), SERVODROME_OK);
  ASSERT_EQ(servodrome_serial_send(port, read.data(), read.size()), SERVODROME_OK);
  EXPECT_EQ(servodrome_serial_receive(port, 100'000'000, some.data(), some.size(), &size), SERVODROME_NOTHING)
      << "the drive has another bit rate";
}

// BRD of register 0130h (AL status), 2 bytes.
std::vector<std::uint8_t> broadcast_read() {
  std::vector<std::uint8_t> frame(60);
  std::fill_n(frame.begin(), 6, 0xFF);
  frame[12] = 0x88;
  frame[13] = 0xA4;
  frame[14] = 0x0E;  // length 14, type 1
  frame[15] = 0x10;
  frame[16] = 0x07;  // BRD
  frame[20] = 0x30;
  frame[21] = 0x01;
  frame[22] = 2;
  return frame;
}

TEST_F(LineOfThreeAxes, AnEthernetFrameComesBackAfterItsWay) {
  servodrome_handle port = 0;
  ASSERT_EQ(servodrome_ethercat_open(line, "ecat", 0, &port), SERVODROME_OK);
  servodrome_handle same = 0;
  EXPECT_EQ(servodrome_ethercat_open(line, "ecat", 0, &same), SERVODROME_REFUSED);
  servodrome_line_run_ticks(line, 16'000);
  const std::vector<std::uint8_t> frame = broadcast_read();
  ASSERT_EQ(servodrome_ethercat_send(port, frame.data(), frame.size()), SERVODROME_OK);
  std::array<std::uint8_t, 1514> back{};
  std::size_t size = 0;
  EXPECT_EQ(servodrome_ethercat_receive(port, 0, back.data(), back.size(), &size), SERVODROME_NOTHING);
  EXPECT_EQ(servodrome_ethercat_receive(port, 1'000'000, back.data(), 59, &size), SERVODROME_BAD_ARGUMENT);
  EXPECT_EQ(size, 60U);
  ASSERT_EQ(servodrome_ethercat_receive(port, 1'000'000, back.data(), back.size(), &size), SERVODROME_OK);
  EXPECT_EQ(back[26], 1);  // Init
  EXPECT_EQ(back[28], 1);  // working counter
  EXPECT_EQ(servodrome_ethercat_send(port, frame.data(), 13), SERVODROME_BAD_ARGUMENT);
}

TEST_F(LineOfThreeAxes, ARingDeliversFramesAtItsOtherEnd) {
  servodrome_handle first = 0;
  servodrome_handle second = 0;
  ASSERT_EQ(servodrome_ethercat_open(line, "ecat", 0, &first), SERVODROME_OK);
  ASSERT_EQ(servodrome_ethercat_open(line, "ecat", 1, &second), SERVODROME_OK);
  servodrome_line_run_ticks(line, 16'000);
  const std::vector<std::uint8_t> frame = broadcast_read();
  ASSERT_EQ(servodrome_ethercat_send(first, frame.data(), frame.size()), SERVODROME_OK);
  std::array<std::uint8_t, 1514> back{};
  std::size_t size = 0;
  EXPECT_EQ(servodrome_ethercat_receive(second, 1'000'000, back.data(), back.size(), &size), SERVODROME_OK);
  EXPECT_EQ(back[28], 1);
  EXPECT_EQ(servodrome_port_close(second), SERVODROME_OK);
  ASSERT_EQ(servodrome_ethercat_send(first, frame.data(), frame.size()), SERVODROME_OK);
  EXPECT_EQ(servodrome_ethercat_receive(first, 1'000'000, back.data(), back.size(), &size), SERVODROME_OK);
}

TEST(CapiThreads, LinesRunAtTheSameTimeAndGiveTheSame) {
  const auto run = [](std::vector<double>& values) {
    servodrome_handle line = 0;
    ASSERT_EQ(servodrome_line_open(nullptr, 0, nullptr, &line), SERVODROME_OK);
    std::uint32_t channel = 0;
    ASSERT_EQ(servodrome_channel(line, "ismc", "supply_v", &channel), SERVODROME_OK);
    for (int i = 0; i < 50; ++i) {
      ASSERT_EQ(servodrome_line_run_ticks(line, 100), SERVODROME_OK);
      double value = 0;
      ASSERT_EQ(servodrome_read(line, &channel, 1, &value), SERVODROME_OK);
      values.push_back(value);
    }
    servodrome_line_close(line);
  };
  std::array<std::vector<double>, 4> values;
  std::vector<std::thread> threads;
  for (auto& one : values) threads.emplace_back(run, std::ref(one));
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(values[0].size(), 50U);
  for (const auto& one : values) EXPECT_EQ(one, values[0]);
}

TEST(CapiThreads, ALineThatIsClosedDuringACallEndsIt) {
  for (int round = 0; round < 20; ++round) {
    servodrome_handle line = 0;
    ASSERT_EQ(servodrome_line_open(two_axes, std::strlen(two_axes), "test.toml", &line), SERVODROME_OK);
    servodrome_handle can = 0;
    ASSERT_EQ(servodrome_can_open(line, "can0", &can), SERVODROME_OK);
    int result = SERVODROME_OK;
    std::thread other([&] {
      servodrome_can_frame frame{};
      while (result >= 0) result = servodrome_can_receive(can, 100'000, &frame);
    });
    servodrome_line_run_ticks(line, 50);
    EXPECT_EQ(servodrome_line_close(line), SERVODROME_OK);
    other.join();
    EXPECT_EQ(result, SERVODROME_CLOSED);
  }
}

TEST(CapiFork, AChildOpensALineOfItsOwn) {
  servodrome_handle line = 0;
  ASSERT_EQ(servodrome_line_open(two_axes, std::strlen(two_axes), "test.toml", &line), SERVODROME_OK);
  const pid_t child = ::fork();
  if (child == 0) {
    servodrome_handle own = 0;
    const bool good = servodrome_line_open(two_axes, std::strlen(two_axes), "test.toml", &own) == SERVODROME_OK &&
                      servodrome_line_run_ticks(own, 10) == SERVODROME_OK;
    ::_exit(good ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(servodrome_line_close(line), SERVODROME_OK);
}

}  // namespace
}  // namespace capi_test
