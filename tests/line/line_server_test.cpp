#include <filesystem>
#include <fstream>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <thread>
#include <unistd.h>
#include <vector>

#include "links/can/client.hpp"
#include "links/link_error.hpp"
#include "links/serial/client.hpp"
#include "running_server.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace line_server_test {
namespace {

using namespace test;
using testing::HasSubstr;

// A path in the folder for temporary files that no other process uses.
std::string own_path(const char* name) {
  return testing::TempDir() + "servodrome_line_server_test_" + std::to_string(::getpid()) + name;
}

constexpr std::string_view open_line = R"(
clock = "virtual"
[api]
address = "127.0.0.1:0"
[[bus]]
name = "can0"
links = ["socketcand:127.0.0.1:0/can0"]
[[axis]]
name = "x"
product = "ismc"
)";

TEST(LineServer, ServesTheBenchApi) {
  Running running(settings_of(open_line));
  Client client(running.server().api_port());
  const auto version = client.ask(http::verb::get, "/version");
  EXPECT_EQ(version.result_int(), 200U);
  EXPECT_EQ(version[http::field::content_type], "application/json");
  EXPECT_EQ(json_of(version)["name"], "servodrome");
  // The second request uses the same connection; another connection works at once too.
  EXPECT_EQ(json_of(client.ask(http::verb::post, "/clock/advance", R"({"ms": 20})"))["time_ns"], 20'000'000);
  Client other(running.server().api_port());
  EXPECT_EQ(json_of(other.ask(http::verb::get, "/clock"))["time_ns"], 20'000'000);
  EXPECT_EQ(client.ask(http::verb::put, "/axes/x/objects/6081/0", R"({"value": 77})").result_int(), 204U);
  EXPECT_EQ(json_of(other.ask(http::verb::get, "/axes/x/objects/6081/0"))["value"], 77);
  EXPECT_EQ(client.ask(http::verb::get, "/nowhere").result_int(), 404U);
  const auto refused = client.ask(http::verb::patch, "/clock");
  EXPECT_EQ(refused.result_int(), 405U);
  EXPECT_EQ(refused[http::field::allow], "GET, PUT");
}

TEST(LineServer, KeepsStrangersOut) {
  Running running(settings_of(open_line));
  Client client(running.server().api_port());
  const std::string body = R"({"ms": 1})";
  EXPECT_EQ(client.ask(http::verb::post, "/clock/advance", body, {{http::field::origin, "https://x.org"}}).result_int(),
            403U);
  EXPECT_EQ(client.ask(http::verb::get, "/clock", "", {{http::field::host, "x.org"}}).result_int(), 403U);
  EXPECT_EQ(client.ask(http::verb::get, "/clock", "", {{http::field::authorization, "Bearer no"}}).result_int(), 401U);
  EXPECT_EQ(client
                .ask(http::verb::post, "/clock/advance", body,
                     {{http::field::origin, "https://x.org"},
                      {http::field::authorization, "Bearer " + running.server().token()}})
                .result_int(),
            200U);
  const auto clock = client.ask(http::verb::get, "/clock");
  EXPECT_EQ(json_of(clock)["time_ns"], 1'000'000);
  EXPECT_EQ(clock.find(http::field::access_control_allow_origin), clock.end());
}

TEST(LineServer, BoundsWhatItReads) {
  Running running(settings_of(open_line));
  const std::uint16_t port = running.server().api_port();
  {
    Client client(port);
    client.write("POST /api/v1/clock/advance HTTP/1.1\r\nHost: localhost\r\nContent-Length: 300000\r\n\r\n");
    EXPECT_EQ(client.read().result_int(), 413U);
    EXPECT_TRUE(client.closed_by_peer());
  }
  {
    Client client(port);
    client.write("GET / HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(9000, 'x'));
    EXPECT_EQ(client.read().result_int(), 431U);
  }
  {
    Client client(port);
    EXPECT_EQ(client.ask(http::verb::get, std::string(3000, 'x')).result_int(), 414U);
  }
  {
    Client client(port);
    client.write("how are you?\r\n\r\n");
    const auto response = client.read();
    EXPECT_EQ(response.result_int(), 400U);
    EXPECT_THAT(json_of(response)["error"]["what"].get<std::string>(), HasSubstr("not HTTP"));
  }
  std::vector<std::unique_ptr<Client>> crowd;
  for (int i = 0; i < 64; ++i) {
    crowd.push_back(std::make_unique<Client>(port));
    EXPECT_EQ(crowd.back()->ask(http::verb::get, "/version").result_int(), 200U);
  }
  EXPECT_EQ(Client(port).ask(http::verb::get, "/version").result_int(), 200U);
  EXPECT_TRUE(crowd.front()->closed_by_peer()) << "the one that was silent longest made room";
}

TEST(LineServer, ABusyPortLeavesNothingOpen) {
  LineServer first(settings_of(open_line));
  const std::string pty = own_path("pty");
  LineSettings settings = settings_of(open_line);
  settings.buses[0].links = {"slcan:" + pty};
  settings.api.port = first.api_port();
  try {
    LineServer second(settings);
    FAIL() << "two servers on one port";
  } catch (const links::LinkError& error) {
    EXPECT_THAT(error.what(), HasSubstr("another program has this port"));
    EXPECT_EQ(error.code(), std::errc::address_in_use);
  }
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(pty)));
  settings.api.port = 0;
  {
    LineServer third(settings);
    EXPECT_TRUE(std::filesystem::is_symlink(std::filesystem::symlink_status(pty)));
  }
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(pty)));
}

TEST(LineServer, AnAddressThatIsNotOursIsRefused) {
  LineSettings settings = settings_of(open_line);
  settings.api.address = "192.0.2.1";
  EXPECT_THROW(LineServer{settings}, links::LinkError);
  settings.api.address = "nonsense";
  EXPECT_THROW(LineServer{settings}, links::LinkError);
  settings.api.enabled = false;
  EXPECT_EQ(LineServer(settings).api_port(), 0);
}

std::optional<canopen::Frame> receive_id(links::CanClient& client, std::uint32_t id) {
  while (const auto frame = client.receive(60s)) {
    if (frame->id == id) return frame;
  }
  return std::nullopt;
}

TEST(LineServer, ClientsThatSendHalfARequestDoNotKeepOthersOut) {
  Running running(settings_of(open_line));
  const std::uint16_t port = running.server().api_port();
  std::vector<std::unique_ptr<Client>> halves;
  for (int i = 0; i < 200; ++i) {
    halves.push_back(std::make_unique<Client>(port));
    halves.back()->write("GET /api/v1/clock HT");
    if (i % 20 != 0) continue;
    Client whole(port);
    ASSERT_EQ(whole.ask(http::verb::get, "/clock").result_int(), 200U) << i;
  }
}

// For example a page on a computer that went to standby during a download.
TEST(LineServer, ClientsThatDoNotReadTheirAnswersDoNotKeepOthersOut) {
  Running running(settings_of(open_line));
  const std::uint16_t port = running.server().api_port();
  {
    Client client(port);
    const std::string asked = R"({"channels": [{"axis": "x", "signal": "supply_v"}, {"axis": "x", "object": "6064:00"},
      {"axis": "x", "signal": "temperature_c"}, {"axis": "x", "signal": "position_counts"},
      {"axis": "x", "signal": "velocity_rpm"}, {"axis": "x", "signal": "torque_nm"}], "duration_ms": 8000})";
    ASSERT_EQ(client.ask(http::verb::post, "/recordings", asked).result_int(), 201U);
    ASSERT_EQ(client.ask(http::verb::post, "/clock/advance", R"({"ms": 9000})").result_int(), 200U);
  }
  std::vector<std::unique_ptr<Client>> greedy;
  for (int i = 0; i < 64; ++i) {
    greedy.push_back(std::make_unique<Client>(port, 4096));
    greedy.back()->write("GET /api/v1/recordings/1/data HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
  // Earlier than the idle timeout that would end them in any case.
  const auto patience = std::chrono::steady_clock::now() + 50s;
  bool served = false;
  while (!served && std::chrono::steady_clock::now() < patience) {
    try {
      served = Client(port).ask(http::verb::get, "/version").result_int() == 200U;
    } catch (const boost::system::system_error&) {  // no room yet
      std::this_thread::sleep_for(50ms);
    }
  }
  EXPECT_TRUE(served);
}

// A client need not sleep before it requests an advance: its earlier frames are on the bus at the instant before.
TEST(LineServer, WhatWasWrittenBeforeAnAdvanceIsTakenBeforeTimePasses) {
  constexpr int many = 200;
  Running running(settings_of(open_line));
  const auto master = links::open_can_client(running.link());
  Client client(running.server().api_port());
  for (int round = 0; round < 20; ++round) {
    for (int i = 0; i < many; ++i) master->send(sdo_read(9, 0x1000, 0));  // to a node that does not exist
    const auto answer = json_of(client.ask(http::verb::post, "/clock/advance", R"({"ms": 40})"));
    EXPECT_EQ(answer["time_ms"], (round + 1) * 40.0);
    // An SDO request has 108 bits plus stuff bits: all of them pass in 40 ms if they wait from the start.
    const auto bus = json_of(client.ask(http::verb::get, "/buses/can0"));
    EXPECT_GE(bus["frames"].get<int>(), (round + 1) * many) << "in round " << round;
  }
}

// After rawmode the server holds frames back for 50 ms, as python-can requires. Virtual time does not advance
// meanwhile. When the advance is answered, the frames are in the client's socket, with the line's time.
TEST(LineServer, NothingIsLostAfterRawmodeAndTimestampsAreLineTime) {
  Running running(settings_of(open_line));
  const std::string link = running.link();
  Client client(running.server().api_port());
  client.ask(http::verb::post, "/axes/x/power", R"({"action": "off"})");
  boost::asio::io_context io;
  tcp::socket socket(io);
  const auto colon = link.find(':', link.find(':') + 1);
  const auto port = static_cast<std::uint16_t>(std::stoi(link.substr(colon + 1)));
  socket.connect(tcp::endpoint(boost::asio::ip::make_address("127.0.0.1"), port));
  boost::asio::write(socket, boost::asio::buffer(std::string_view("< open can0 >< rawmode >")));
  std::string text(std::string_view("< hi >< ok >< ok >").size(), ' ');
  boost::asio::read(socket, boost::asio::buffer(text));
  EXPECT_EQ(text, "< hi >< ok >< ok >");
  client.ask(http::verb::post, "/axes/x/power", R"({"action": "on"})");
  client.ask(http::verb::post, "/clock/advance", R"({"ms": 2000})");
  std::string frames(4096, ' ');
  ASSERT_GT(socket.available(), 0U) << "it is there at once";
  frames.resize(socket.read_some(boost::asio::buffer(frames)));
  EXPECT_THAT(frames, testing::StartsWith("< frame 701 "));
  const double at = std::stod(frames.substr(12));
  EXPECT_GT(at, 0.0);
  EXPECT_LT(at, 2.0);
}

TEST(LineServer, AnswersAMasterInRealTime) {
  LineSettings settings = settings_of(open_line);
  settings.clock = ClockMode::real;
  Running running(settings);
  const auto master = links::open_can_client(running.link());
  for (int i = 0; i < 50; ++i) {
    master->send(sdo_write(1, 0x6081, 0, static_cast<std::uint32_t>(i), 4));
    ASSERT_TRUE(receive_id(*master, 0x581));
    master->send(sdo_read(1, 0x6081, 0));
    const auto answer = receive_id(*master, 0x581);
    ASSERT_TRUE(answer);
    EXPECT_EQ(number_in(*answer), static_cast<std::uint32_t>(i));
  }
  // Time advances by itself, and is never ahead of the clock.
  Client client(running.server().api_port());
  const auto time = [&client] { return json_of(client.ask(http::verb::get, "/clock"))["time_ns"].get<std::int64_t>(); };
  const auto start = std::chrono::steady_clock::now();
  const std::int64_t first = time();
  while (time() < first + 20'000'000) std::this_thread::sleep_for(1ms);
  EXPECT_GE(std::chrono::steady_clock::now() - start, 20ms);
}

// A client of a bus has to wait while the server does something else. That counts as lag even if the line catches up.
TEST(LineServer, LatenessOfServiceIsLag) {
  LineSettings settings = settings_of(open_line);
  settings.clock = ClockMode::real;
  Running running(settings);
  const auto master = links::open_can_client(running.link());  // so that the line wakes up each millisecond
  Client client(running.server().api_port());
  const auto lag = [&client] { return json_of(client.ask(http::verb::get, "/clock"))["lag_ms"].get<double>(); };
  const double before = lag();
  for (int i = 0; i < 10; ++i) {
    boost::asio::post(running.server().io(), [] { std::this_thread::sleep_for(12ms); });
    std::this_thread::sleep_for(30ms);
  }
  EXPECT_GE(lag() - before, 5 * 8.0);
}

// Sends `bytes` to a link and returns as many bytes as the answer has.
std::vector<std::uint8_t> ask_link(links::ByteClient& client, const std::vector<std::uint8_t>& bytes,
                                   std::size_t expected) {
  client.send(bytes);
  std::vector<std::uint8_t> answer;
  while (answer.size() < expected && client.receive(answer, 60s)) {
  }
  return answer;
}

// Modbus TCP is answered immediately, so a client can use a line in virtual time even while its time stands still.
TEST(LineServer, ServesModbusTcpInBothTimes) {
  for (const ClockMode clock : {ClockMode::virtual_time, ClockMode::real}) {
    LineSettings settings = settings_of(serial_line);
    settings.clock = clock;
    Running running(settings);
    const std::string link = running.server().line().serial_buses()[0]->links[0]->name();
    const auto client = links::open_byte_client(links::parse_serial_link(link), {});
    const auto other = links::open_byte_client(links::parse_serial_link(link), {});
    // One client writes mode 1 and the other reads it; unit 255 is the only drive.
    const std::vector<std::uint8_t> write{0, 7, 0, 0, 0, 6, 255, 6, 0, 1, 0, 1};
    EXPECT_EQ(ask_link(*client, write, write.size()), write);
    EXPECT_EQ(ask_link(*other, {0, 8, 0, 0, 0, 6, 2, 3, 0, 1, 0, 1}, 11),
              (std::vector<std::uint8_t>{0, 8, 0, 0, 0, 5, 2, 3, 2, 0, 1}));
    EXPECT_EQ(ask_link(*other, {0, 9, 0, 0, 0, 6, 3, 3, 0, 1, 0, 1}, 9),
              (std::vector<std::uint8_t>{0, 9, 0, 0, 0, 3, 3, 0x83, 0x0B}))
        << "no unit 3";
  }
}

TEST(LineServer, ServesAPtyInRealTime) {
  const std::string path = own_path("rs485");
  LineSettings settings = settings_of(serial_line);
  settings.clock = ClockMode::real;
  settings.serial_buses[0].links = {"pty:" + path};
  {
    Running running(settings);
    const auto client =
        links::open_byte_client(links::parse_serial_link("pty:" + path), settings.serial_buses[0].format);
    std::vector<std::uint8_t> request{2, 3, 1, 0, 0, 1, 0, 0};
    modbus::seal_rtu_frame(request, 6);
    for (int i = 0; i < 20; ++i) {
      const std::vector<std::uint8_t> answer = ask_link(*client, request, 7);
      EXPECT_TRUE(answer.size() == 7 && modbus::is_rtu_frame(answer));
    }
  }
  EXPECT_FALSE(std::filesystem::exists(std::filesystem::symlink_status(path)));
  settings.serial_buses[0].links = {"serial:/nonexistent/tty"};
  EXPECT_THROW(LineServer{settings}, links::LinkError);
}

TEST(LineServer, ALogHasEveryFrame) {
  const std::string path = own_path("log");
  LineSettings settings = settings_of(open_line);
  {
    LineServer server(settings);
    server.log(*server.line().buses()[0], path);
    server.line().run_until(20ms);
  }
  std::ifstream file(path);
  std::string line;
  ASSERT_TRUE(std::getline(file, line));
  EXPECT_THAT(line, testing::MatchesRegex(R"(\([0-9]+\.[0-9]+\) can0 701#00)"));
  std::filesystem::remove(path);
  LineServer server(settings);
  EXPECT_THROW(server.log(*server.line().buses()[0], "/nonexistent/x.log"), links::LinkError);
}

// Real time begins with run(), and with it the times of links, recordings and logs.
TEST(LineServer, ALogHasTheTimesOfTheLinks) {
  struct FirstFrame final : links::BusObserver {
    void on_bus_event(const links::BusEvent& event) override { at = at.value_or(event.end); }
    std::optional<Time> at;
  } first;
  const std::string path = own_path("log");
  LineSettings settings = settings_of(open_line);
  settings.clock = ClockMode::real;
  Time expected{};
  {
    LineServer server(settings);
    server.log(*server.line().buses()[0], path);
    server.line().buses()[0]->bus.add_observer(first);
    std::this_thread::sleep_for(20ms);
    boost::asio::steady_timer enough(server.io(), 200ms);
    enough.async_wait([&server](const boost::system::error_code&) { server.stop(); });
    server.run();
    ASSERT_TRUE(first.at);
    expected = server.wall_epoch() + *first.at;
    server.line().buses()[0]->bus.remove_observer(first);
  }
  std::ifstream file(path);
  std::string line;
  ASSERT_TRUE(std::getline(file, line));
  const auto us = expected.count() / 1000;
  EXPECT_EQ(line.substr(0, line.find(' ')), fmt::format("({:010d}.{:06d})", us / 1'000'000, us % 1'000'000));
  std::filesystem::remove(path);
}

TEST(LineServer, SaysOnceThatALogCannotBeWritten) {
  int failures = 0;
  LineSettings settings = settings_of(open_line);
  settings.clock = ClockMode::real;
  LineServer server(settings);
  server.log(*server.line().buses()[0], "/dev/full", [&failures] { ++failures; });
  boost::asio::steady_timer enough(server.io(), 1s);  // several flushes
  enough.async_wait([&server](const boost::system::error_code&) { server.stop(); });
  server.run();
  EXPECT_EQ(failures, 1);
}

}  // namespace
}  // namespace line_server_test
}  // namespace servodrome::line
