// The sockets that socketcand, Modbus TCP and the bench API accept: they send immediately, they acknowledge immediately
// after each receive, and they detect a client that has vanished. Client and server are in one process here, so that
// the test can read the options of the server's socket.
#include <array>
#include <atomic>
#include <filesystem>
#include <gtest/gtest.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "links/can/link_name.hpp"
#include "links/link_text.hpp"
#include "links/serial/link_name.hpp"
#include "running_server.hpp"
#include "support.hpp"

namespace {

// How often TCP_QUICKACK was switched on, by descriptor. The kernel switches the option off and on by itself, so
// reading its present value proves nothing.
std::array<std::atomic<int>, 1024> quick_acknowledges{};

}  // namespace

// Replaces the library's function in this whole program.
extern "C" int setsockopt(int descriptor, int level, int name, const void* value, socklen_t size) noexcept {
  const bool on = size >= sizeof(int) && *static_cast<const int*>(value) != 0;
  if (level == IPPROTO_TCP && name == TCP_QUICKACK && on) ++quick_acknowledges.at(static_cast<std::size_t>(descriptor));
  return static_cast<int>(::syscall(SYS_setsockopt, descriptor, level, name, value, size));
}

namespace servodrome::line {
namespace {

using namespace test;

constexpr std::string_view line_file = R"(
clock = "virtual"
[api]
address = "127.0.0.1:0"
[[bus]]
name = "can0"
links = ["socketcand:127.0.0.1:0/can0"]
[[bus]]
name = "rs"
type = "rs485"
links = ["tcp:127.0.0.1:0"]
[[axis]]
name = "x"
product = "generic402"
bus = "can0"
serial = "rs"
)";

struct Service {
  const char* name;
  const char* greeting;  // sent first; the server answers it
  const char* half;      // sent next; the server does not answer it
};
// A frame for a drive that does not exist; half a request; half a header.
const Service services[] = {{"socketcand", "< open can0 >< rawmode >", "< send 123 1 00 >"},
                            {"modbus", nullptr, "half"},
                            {"api", nullptr, "GET /api/v1/clock HT"}};

class AcceptedSockets : public testing::TestWithParam<Service> {
 protected:
  AcceptedSockets() {
    socket.connect(tcp::endpoint(boost::asio::ip::make_address("127.0.0.1"), port()));
    accepted = find_accepted();
    EXPECT_GE(accepted, 0);
  }
  std::uint16_t port() {
    const std::string name = GetParam().name;
    const Line& line = running.server().line();
    if (name == "api") return running.server().api_port();
    if (name == "modbus")
      return std::get<links::ModbusTcpName>(links::parse_serial_link(line.serial_buses()[0]->links[0]->name()))
          .endpoint.port;
    return std::get<links::SocketcandName>(links::parse_can_link(line.buses()[0]->links[0]->name())).port;
  }
  // The descriptor in this process that is connected to our socket.
  int find_accepted() {
    const tcp::endpoint ours = socket.local_endpoint();
    const auto found = [&]() -> int {
      for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
        const int descriptor = std::stoi(entry.path().filename().string());
        sockaddr_in peer{};
        socklen_t size = sizeof peer;
        if (::getpeername(descriptor, reinterpret_cast<sockaddr*>(&peer), &size) != 0 || peer.sin_family != AF_INET)
          continue;
        if (ntohs(peer.sin_port) == ours.port() && option_of(descriptor, IPPROTO_TCP, TCP_NODELAY) != 0)
          return descriptor;
      }
      return -1;
    };
    int descriptor = -1;
    until([&] { return (descriptor = found()) >= 0; });
    return descriptor;
  }
  static int option_of(int descriptor, int level, int name) {
    int value = -1;
    socklen_t size = sizeof value;
    ::getsockopt(descriptor, level, name, &value, &size);
    return value;
  }
  int option(int level, int name) const { return option_of(accepted, level, name); }
  // Returns false after some seconds: the test has failed.
  static bool until(const std::function<bool()>& condition) {
    for (int i = 0; i < 2000; ++i) {
      if (condition()) return true;
      std::this_thread::sleep_for(1ms);
    }
    return false;
  }
  int acknowledged() const { return quick_acknowledges.at(static_cast<std::size_t>(accepted)); }
  void write(std::string_view text) { boost::asio::write(socket, boost::asio::buffer(text)); }

  Running running{settings_of(line_file)};
  boost::asio::io_context io;
  tcp::socket socket{io};
  int accepted = -1;
};
INSTANTIATE_TEST_SUITE_P(Of, AcceptedSockets, testing::ValuesIn(services),
                         [](const auto& row) { return std::string(row.param.name); });

TEST_P(AcceptedSockets, AreServedPromptlyAndWatched) {
  EXPECT_EQ(option(IPPROTO_TCP, TCP_NODELAY), 1);
  EXPECT_EQ(option(SOL_SOCKET, SO_KEEPALIVE), 1);
  EXPECT_EQ(option(IPPROTO_TCP, TCP_USER_TIMEOUT), 60'000);
  EXPECT_LE(option(IPPROTO_TCP, TCP_KEEPIDLE) + option(IPPROTO_TCP, TCP_KEEPINTVL) * option(IPPROTO_TCP, TCP_KEEPCNT),
            60);
}

// The bytes that are read get no answer, so only the receive can have switched the option on.
TEST_P(AcceptedSockets, AcknowledgeAtOnceAfterEachReceive) {
  if (GetParam().greeting != nullptr) {
    write(GetParam().greeting);
    std::string text(std::string_view("< hi >< ok >< ok >").size(), ' ');
    boost::asio::read(socket, boost::asio::buffer(text));
  }
  for (int i = 0; i < 3; ++i) {
    const int before = acknowledged();
    write(i == 0 || GetParam().greeting != nullptr ? GetParam().half : "x");
    EXPECT_TRUE(until([&] { return acknowledged() > before; })) << i;
  }
  EXPECT_EQ(socket.available(), 0U);
}

}  // namespace
}  // namespace servodrome::line
