// Data that a client wrote to a link of any kind before it requested clock/advance act before time advances
// (docs/bench-api.md, Clock). The client need not sleep first. The test for socketcand is in line_server_test.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include "ethercat/frame/frame_writer.hpp"
#include "links/can/client.hpp"
#include "links/ethercat/client.hpp"
#include "links/serial/client.hpp"
#include "modbus/rtu_server.hpp"
#include "running_server.hpp"
#include "support.hpp"

namespace servodrome::line {
namespace written_before_advance_test {
namespace {

using namespace test;

constexpr int rounds = 20;

std::string path_of(const char* name) {
  return testing::TempDir() + "servodrome_before_advance_" + std::to_string(::getpid()) + name;
}

constexpr std::string_view can_line = R"(
clock = "virtual"
[api]
address = "127.0.0.1:0"
[[bus]]
name = "can0"
links = ["mem:"]
[[axis]]
name = "x"
product = "ismc"
)";

constexpr std::string_view ethercat_line = R"(
clock = "virtual"
[api]
address = "127.0.0.1:0"
[[bus]]
name = "ecat"
type = "ethercat"
links = ["udp:127.0.0.1:0"]
[[axis]]
name = "x"
product = "generic402-ec"
)";

void advance(Client& client, int ms) {
  EXPECT_EQ(client.ask(http::verb::post, "/clock/advance", fmt::format(R"({{"ms": {}}})", ms)).result_int(), 200U);
}
int frames(Client& client) { return json_of(client.ask(http::verb::get, "/buses/can0"))["frames"]; }
int value(Client& client, const char* object) {
  return json_of(client.ask(http::verb::get, fmt::format("/axes/x/objects/{}", object)))["value"];
}

// An SDO request to a node that does not exist has 108 bits plus stuff bits: 200 of them pass in 40 ms if they wait
// from the start.
constexpr int many = 200;

TEST(WrittenBeforeAnAdvance, ToSlcan) {
  LineSettings settings = settings_of(can_line);
  const std::string link = "slcan:" + path_of("slcan");
  settings.buses[0].links = {link};
  Running running(settings);
  const auto master = links::open_can_client(link, {.bit_rate = 1'000'000});
  Client client(running.server().api_port());
  for (int round = 1; round <= rounds; ++round) {
    for (int i = 0; i < many; ++i) master->send(sdo_read(9, 0x1000, 0));
    advance(client, 40);
    EXPECT_GE(frames(client), round * many) << "in round " << round;
  }
}

struct Terminal {
  explicit Terminal(const std::string& path) : descriptor(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK)) {
    EXPECT_GE(descriptor, 0) << path;
  }
  ~Terminal() { ::close(descriptor); }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;
  void write(std::string_view bytes) {
    EXPECT_EQ(::write(descriptor, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  int descriptor;
};

// This includes the very first bytes of a client.
TEST(WrittenBeforeAnAdvance, ToSlcanByAClientThatHasJustOpenedIt) {
  for (int round = 0; round < rounds; ++round) {
    LineSettings settings = settings_of(can_line);
    const std::string path = path_of("slcan");
    settings.buses[0].links = {"slcan:" + path};
    Running running(settings);
    Client client(running.server().api_port());
    Terminal terminal(path);
    std::string text = "S8\rO\r";
    for (int i = 0; i < many; ++i) text += "t60984000100000000000\r";
    terminal.write(text);
    advance(client, 40);
    EXPECT_GE(frames(client), many) << "in round " << round;
  }
}

// A request of 8 characters takes 5 ms on the line, and the pause behind it 2 ms. Register 1 is 6060h.
std::vector<std::uint8_t> mode_request(int mode) {
  std::vector<std::uint8_t> request{2, 6, 0, 1, 0, static_cast<std::uint8_t>(mode), 0, 0};
  modbus::seal_rtu_frame(request, 6);
  return request;
}

TEST(WrittenBeforeAnAdvance, ToASerialPty) {
  LineSettings settings = settings_of(serial_line);
  const std::string link = "pty:" + path_of("pty");
  settings.serial_buses[0].links = {link};
  Running running(settings);
  const auto master = links::open_byte_client(links::parse_serial_link(link), settings.serial_buses[0].format);
  Client client(running.server().api_port());
  advance(client, 100);
  for (int round = 0; round < rounds; ++round) {
    const int mode = round % 2 == 0 ? 3 : 1;
    master->send(mode_request(mode));
    advance(client, 20);
    ASSERT_EQ(value(client, "6060/0"), mode) << "in round " << round;
    std::vector<std::uint8_t> answer;
    while (answer.size() < 8 && master->receive(answer, 60s)) {
    }
    EXPECT_EQ(answer, mode_request(mode)) << "what came back meanwhile";
  }
}

TEST(WrittenBeforeAnAdvance, ToASerialPtyByAClientThatHasJustOpenedIt) {
  for (int round = 0; round < rounds; ++round) {
    LineSettings settings = settings_of(serial_line);
    const std::string path = path_of("pty");
    settings.serial_buses[0].links = {"pty:" + path};
    Running running(settings);
    Client client(running.server().api_port());
    advance(client, 100);
    Terminal terminal(path);
    const std::vector<std::uint8_t> request = mode_request(3);
    terminal.write({reinterpret_cast<const char*>(request.data()), request.size()});
    advance(client, 20);
    EXPECT_EQ(value(client, "6060/0"), 3) << "in round " << round;
  }
}

// Requests are answered immediately, so the test checks their effect: 6060h acts in the cycle after it was written.
// There are more requests than one read returns, and the last one counts.
TEST(WrittenBeforeAnAdvance, ToModbusTcp) {
  Running running(settings_of(serial_line));
  const std::string link = running.server().line().serial_buses()[0]->links[0]->name();
  const auto master = links::open_byte_client(links::parse_serial_link(link), {});
  Client client(running.server().api_port());
  advance(client, 100);
  for (int round = 0; round < rounds; ++round) {
    const int mode = round % 2 == 0 ? 3 : 1;
    std::vector<std::uint8_t> requests;
    for (int i = 1; i <= 4000; ++i) {
      const auto wanted = static_cast<std::uint8_t>(i < 4000 ? 6 : mode);
      requests.insert(requests.end(), {0, static_cast<std::uint8_t>(i), 0, 0, 0, 6, 255, 6, 0, 1, 0, wanted});
    }
    master->send(requests);
    advance(client, 2);
    EXPECT_EQ(value(client, "6061/0"), mode) << "in round " << round;
    std::vector<std::uint8_t> answers;
    while (answers.size() < requests.size() && master->receive(answers, 60s)) {
    }
    EXPECT_EQ(answers, requests);
  }
}

// A frame that reads the slave's system time returns the instant at which it passed. There are more frames than one
// call serves.
TEST(WrittenBeforeAnAdvance, ToEthercatOverUdp) {
  Running running(settings_of(ethercat_line));
  const std::string link = running.server().line().ethercat_buses()[0]->links[0]->name();
  const auto master = links::open_ethercat_client(link);
  Client client(running.server().api_port());
  advance(client, 100);
  const auto ask = [&] {
    std::array<std::uint8_t, ethercat::max_frame> memory{};
    ethercat::FrameWriter writer = ethercat::FrameWriter::payload(memory);
    writer.add(ethercat::Command::aprd, 0x55, ethercat::address_of(0, ethercat::reg::system_time), 8);
    master->send(writer.bytes());
  };
  const auto answer = [&] {
    std::array<std::uint8_t, ethercat::max_frame> memory{};
    EXPECT_GT(master->receive(memory, 60s), 20U);
    return ethercat::load<std::uint64_t>(memory.data() + 12);
  };
  ask();
  const std::uint64_t start = answer();  // virtual time stands still
  for (int round = 0; round < rounds; ++round) {
    for (int i = 0; i < many; ++i) ask();
    advance(client, 40);
    for (int i = 0; i < many; ++i) {
      ASSERT_EQ(answer() - start, static_cast<std::uint64_t>(round) * 40'000'000) << i << " in round " << round;
    }
  }
}

}  // namespace
}  // namespace written_before_advance_test
}  // namespace servodrome::line
