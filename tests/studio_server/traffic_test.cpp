// Traffic of CAN buses and RS485 lines over the bench API, in virtual time (EtherCAT: tests/interop/test_traffic.py).
#include "studio/traffic.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "line/bench/line_bench.hpp"
#include "line/support.hpp"
#include "links/serial/client.hpp"
#include "modbus/rtu_server.hpp"
#include "tools/sniff/capture_file.hpp"

namespace servodrome::studio {
namespace traffic_test {
namespace {

using namespace std::chrono_literals;
using api::Method;
using api::Response;
using nlohmann::json;
using testing::HasSubstr;

class TrafficTest : public testing::Test {
 protected:
  Response ask(Method method, const std::string& target, const std::string& body = {}) {
    const api::RouteGroup group = traffic.routes();
    Response response =
        line::bench::begin(line, {.method = method, .target = "/api/v1/buses/" + target, .body = body}, {&group, 1});
    while (response.piece) api::carry_out_piece(response);
    if (response.more) {
      for (std::string part = response.more(); !part.empty(); part = response.more()) {
        ++pieces;
        longest_piece = std::max(longest_piece, part.size());
        response.body += part;
      }
    }
    return response;
  }
  json get(const std::string& target) {
    const Response response = ask(Method::get, target);
    EXPECT_EQ(response.status, 200U) << response.body;
    return json::parse(response.body, nullptr, false);
  }
  void record(const std::string& bus, bool on = true) {
    EXPECT_EQ(ask(Method::put, bus + "/traffic", on ? R"({"record": true})" : R"({"record": false})").status, 200U);
  }
  void send(const canopen::Frame& frame) {
    port.send(frame, line.now());
    line.run_until(line.now() + 5ms);
  }
  static canopen::Frame sdo(std::uint32_t id, std::array<std::uint8_t, 8> data) {
    canopen::Frame frame;
    frame.id = id;
    frame.length = 8;
    frame.data = data;
    return frame;
  }

  line::Line line{line::test::settings_of(line::test::two_axes_and_rs485)};
  Traffic traffic{[this](const api::Call& call) { return find_line_traffic(line, call); },
                  [] { return line::Time(1'000'000'000'000); }};
  links::MemoryPort port{line.find_bus("can0")->bus};
  std::size_t pieces = 0;
  std::size_t longest_piece = 0;
};

TEST_F(TrafficTest, ACanBusInWords) {
  line.run_until(100ms);
  EXPECT_EQ(get("can0/traffic")["recording"], false);
  EXPECT_TRUE(get("can0/traffic")["rows"].empty());
  record("can0");
  send(sdo(0x601, {0x40, 0x41, 0x60, 0, 0, 0, 0, 0}));
  send(sdo(0x602, {0x40, 0x00, 0x55, 0, 0, 0, 0, 0}));
  const json all = get("can0/traffic");
  EXPECT_EQ(all["recording"], true);
  ASSERT_EQ(all["rows"].size(), 4U) << all.dump(1);
  EXPECT_EQ(all["rows"][0]["from"], "master");
  EXPECT_EQ(all["rows"][0]["kind"], "sdo");
  EXPECT_EQ(all["rows"][0]["node"], 1);
  EXPECT_EQ(all["rows"][0]["text"], "SDO read 6041:00 Statusword");
  EXPECT_EQ(all["rows"][0]["bytes"], "601 [8] 40 41 60 00 00 00 00 00");
  EXPECT_GT(all["rows"][0]["time_ns"], 100'000'000);
  EXPECT_EQ(all["rows"][1]["from"], "left");
  EXPECT_EQ(all["rows"][1]["values"][0]["object"], "6041:00");
  EXPECT_EQ(all["rows"][3]["from"], "right");
  EXPECT_EQ(all["rows"][3]["error"], true);
  EXPECT_EQ(all["next"], 4);
  // The new traffic, filtered.
  send(sdo(0x601, {0x40, 0x61, 0x60, 0, 0, 0, 0, 0}));
  EXPECT_EQ(get("can0/traffic?since=4")["rows"].size(), 2U);
  EXPECT_EQ(get("can0/traffic?node=2")["rows"].size(), 2U);
  EXPECT_EQ(get("can0/traffic?object=6041")["rows"].size(), 2U);
  EXPECT_EQ(get("can0/traffic?kind=emcy,pdo")["rows"].size(), 0U);
  EXPECT_EQ(get("can0/traffic?errors=true")["rows"].size(), 1U);
  EXPECT_EQ(get("can0/traffic?text=STATUSword")["rows"].size(), 2U);
  EXPECT_EQ(get("can0/traffic?text=modes%20of")["rows"].size(), 2U);
  EXPECT_EQ(get("can0/traffic?text=left&kind=sdo")["rows"].size(), 2U);
  // Nothing is added after the stop; the recorded traffic stays until it is cleared.
  record("can0", false);
  send(sdo(0x601, {0x40, 0x41, 0x60, 0, 0, 0, 0, 0}));
  EXPECT_EQ(get("can0/traffic")["rows"].size(), 6U);
  EXPECT_EQ(ask(Method::delete_, "can0/traffic").status, 200U);
  EXPECT_TRUE(get("can0/traffic")["rows"].empty());
}

TEST_F(TrafficTest, PagesAndTheNewest) {
  record("can0");
  for (int i = 0; i < 50; ++i) send(sdo(0x601, {0x40, 0x41, 0x60, 0, 0, 0, 0, 0}));
  std::size_t rows = 0;
  std::uint64_t since = 0;
  for (;;) {
    const json page = get("can0/traffic?limit=7&since=" + std::to_string(since));
    if (page["rows"].empty()) break;
    EXPECT_EQ(page["left_out"], 0);
    for (const json& row : page["rows"]) EXPECT_EQ(row["number"], ++rows);
    since = page["next"];
  }
  const std::uint64_t total = get("can0/traffic?limit=1")["frames"];
  EXPECT_EQ(rows, total);
  EXPECT_GE(total, 100U);
  const json newest = get("can0/traffic?limit=7&newest=true");
  EXPECT_EQ(newest["rows"].size(), 7U);
  EXPECT_EQ(newest["rows"][6]["number"], total);
  EXPECT_EQ(newest["left_out"], total - 7);
  EXPECT_EQ(newest["next"], total);
}

// A PDO that was mapped before the recording has the names of its objects, because the drive knows its mapping.
TEST_F(TrafficTest, PdosAreKnownFromTheDrive) {
  line.run_until(300ms);
  const std::array<std::array<std::uint8_t, 8>, 5> writes{{{0x23, 0x00, 0x18, 1, 0x82, 0x01, 0x00, 0x80},
                                                           {0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0},
                                                           {0x23, 0x00, 0x1A, 1, 0x20, 0x00, 0x64, 0x60},
                                                           {0x2F, 0x00, 0x1A, 0, 1, 0, 0, 0},
                                                           {0x2F, 0x00, 0x18, 2, 1, 0, 0, 0}}};
  for (const auto& data : writes) send(sdo(0x602, data));
  send(sdo(0x602, {0x23, 0x00, 0x18, 1, 0x82, 0x01, 0x00, 0x00}));
  canopen::Frame start;
  start.length = 2;
  start.data = {1, 2};
  send(start);
  record("can0");
  canopen::Frame sync;
  sync.id = 0x80;
  send(sync);
  const json pdos = get("can0/traffic?kind=pdo");
  ASSERT_GE(pdos["rows"].size(), 1U) << get("can0/traffic").dump(1);
  EXPECT_THAT(pdos["rows"][0]["text"].get<std::string>(), HasSubstr("TPDO1 6064:00 Position actual value = "));
  EXPECT_EQ(pdos["rows"][0]["from"], "right");
}

TEST_F(TrafficTest, AnRs485LineInWordsAndAsCaptures) {
  links::MemoryByteClient master(line.find_serial_bus("rs")->line, line);
  line.run_until(100ms);
  record("rs");
  const auto ask_drive = [&](std::vector<std::uint8_t> request) {
    const std::size_t size = request.size();
    request.resize(size + 2);
    modbus::seal_rtu_frame(request, size);
    master.send(request);
    master.wait(50ms);
  };
  const std::uint8_t station = line.find_axis("right")->serial_port()->station();
  ask_drive({station, 0x2B, 0x0E, 1, 0});
  ask_drive({station, 0x03, 0xFF, 0xFF, 0, 1});
  const json all = get("rs/traffic");
  ASSERT_EQ(all["rows"].size(), 4U) << all.dump(1);
  EXPECT_EQ(all["rows"][0]["from"], "master");
  EXPECT_EQ(all["rows"][1]["from"], "right");
  EXPECT_EQ(all["rows"][0]["kind"], "modbus");
  EXPECT_THAT(all["rows"][1]["text"].get<std::string>(), HasSubstr("device identification"));
  EXPECT_THAT(all["rows"][3]["text"].get<std::string>(), HasSubstr("exception 02h illegal data address"));
  EXPECT_EQ(all["rows"][3]["error"], true);
  // The exported file is read again and compared byte for byte.
  line.find_serial_bus("rs")->line.passed_by(links::SerialSender::master,
                                             std::vector<std::uint8_t>{0, 1, 0, 0, 0, 2, 1, 7});
  for (const char* format : {"pcap", "text"}) {
    const Response capture = ask(Method::get, std::string("rs/capture?format=") + format);
    ASSERT_EQ(capture.status, 200U);
    std::FILE* file = std::tmpfile();
    std::fwrite(capture.body.data(), 1, capture.body.size(), file);
    std::rewind(file);
    master::CaptureFile reader(file, "capture");
    std::vector<master::CapturedFrame> frames;
    while (auto frame = reader.next()) frames.push_back(std::move(*frame));
    std::fclose(file);
    ASSERT_EQ(frames.size(), 5U) << format;
    const auto& first = std::get<master::SerialBytes>(frames[0].content);
    EXPECT_EQ(master::hex_text(first.bytes), all["rows"][0]["bytes"]);
    EXPECT_EQ(first.sender, links::SerialSender::master);
    EXPECT_EQ(std::get<master::SerialBytes>(frames[1].content).sender, links::SerialSender::drive);
    EXPECT_NEAR(static_cast<double>(frames[0].time.count()) - 1e12, all["rows"][0]["time_ns"].get<double>(), 1000.0);
  }
  EXPECT_EQ(ask(Method::get, "rs/capture?format=candump").status, 400U);
}

TEST_F(TrafficTest, CapturesOfACanBusAreReadAgain) {
  record("can0");
  send(sdo(0x601, {0x40, 0x41, 0x60, 0, 0, 0, 0, 0}));
  const std::uint64_t frames = get("can0/traffic")["frames"];
  for (const char* format : {"pcap", "candump"}) {
    const Response capture = ask(Method::get, std::string("can0/capture?format=") + format);
    std::FILE* file = std::tmpfile();
    std::fwrite(capture.body.data(), 1, capture.body.size(), file);
    std::rewind(file);
    master::CaptureFile reader(file, "capture");
    std::uint64_t read = 0;
    bool found = false;
    while (auto frame = reader.next()) {
      ++read;
      found = found || std::get<canopen::Frame>(frame->content) == sdo(0x601, {0x40, 0x41, 0x60, 0, 0, 0, 0, 0});
    }
    std::fclose(file);
    EXPECT_EQ(read, frames) << format;
    EXPECT_TRUE(found) << format;
  }
}

// More than the ring buffer holds: lost frames are reported, and the parts of an answer stay small.
TEST_F(TrafficTest, OverloadIsTold) {
  record("can0");
  send(sdo(0x601, {0x40, 0x41, 0x60, 0, 0, 0, 0, 0}));
  const std::uint64_t since = get("can0/traffic")["next"];
  ASSERT_GT(since, 0U);
  const std::size_t enough = TrafficView::ring_bytes / 32 + 1000;
  for (std::size_t i = 0; i < enough; ++i) {
    port.send(sdo(0x501, {}), line.now());
    if (i % 64 == 0) line.run_until(line.now() + 20ms);
  }
  line.run_until(line.now() + 100ms);
  pieces = longest_piece = 0;
  const json answer = get("can0/traffic?newest=true&limit=100&since=" + std::to_string(since));
  EXPECT_EQ(answer["rows"].size(), 100U);
  EXPECT_GT(answer["missed"], 500);
  EXPECT_GT(answer["lost"], 0);
  EXPECT_EQ(answer["left_out"].get<std::uint64_t>() + 100, TrafficView::most_rows);
  EXPECT_GT(pieces, 1000U);
  EXPECT_LT(longest_piece, 64U * 1024);
}

TEST_F(TrafficTest, WrongRequestsAreRefusedAndChangeNothing) {
  EXPECT_EQ(ask(Method::get, "nobody/traffic").status, 404U);
  EXPECT_EQ(ask(Method::get, "can0/traffic?since=x").status, 400U);
  EXPECT_EQ(ask(Method::get, "can0/traffic?limit=100000").status, 422U);
  EXPECT_EQ(ask(Method::get, "can0/traffic?kind=nothing").status, 400U);
  EXPECT_EQ(ask(Method::get, "can0/traffic?node=%zz").status, 400U);
  EXPECT_EQ(ask(Method::get, "can0/capture?format=zip").status, 400U);
  EXPECT_EQ(ask(Method::put, "can0/traffic", "{}").status, 400U);
  EXPECT_EQ(ask(Method::put, "can0/traffic", R"({"record": 1})").status, 400U);
  EXPECT_EQ(ask(Method::put, "can0/traffic", R"({"record": true, "x": 1})").status, 400U);
  EXPECT_EQ(get("can0/traffic")["recording"], false);
}

}  // namespace
}  // namespace traffic_test
}  // namespace servodrome::studio
