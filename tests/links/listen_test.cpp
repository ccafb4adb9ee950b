// The options of clients' TCP sockets, and the error messages when there is no file descriptor left.
#include "links/listen.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <netinet/tcp.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "links/can/client.hpp"
#include "links/can/log.hpp"
#include "links/descriptor_advice.hpp"
#include "links/ethercat/client.hpp"
#include "links/ethercat/log.hpp"
#include "links/ethercat/udp_socket.hpp"
#include "links/file_descriptor.hpp"
#include "links/file_medium.hpp"
#include "links/link_error.hpp"
#include "links/pty.hpp"
#include "links/serial/client.hpp"
#include "links/serial/tty.hpp"
#include "links/socket_options.hpp"

namespace servodrome::links {
namespace listen_test {
namespace {

using boost::asio::ip::tcp;
using testing::HasSubstr;

// Both ends of a TCP connection.
struct TcpPair {
  TcpPair() {
    tcp::acceptor acceptor(io, tcp::endpoint(boost::asio::ip::make_address("127.0.0.1"), 0));
    near.connect(acceptor.local_endpoint());
    far = acceptor.accept();
  }
  int option(int level, int name) {
    int value = -1;
    socklen_t size = sizeof value;
    EXPECT_EQ(::getsockopt(far.native_handle(), level, name, &value, &size), 0);
    return value;
  }
  boost::asio::io_context io;
  tcp::socket near{io};
  tcp::socket far{io};
};

TEST(ClientSockets, AreServedPromptlyAndWatched) {
  TcpPair pair;
  EXPECT_EQ(pair.option(IPPROTO_TCP, TCP_NODELAY), 0);
  EXPECT_EQ(pair.option(SOL_SOCKET, SO_KEEPALIVE), 0);
  const int off = 0;
  ::setsockopt(pair.far.native_handle(), IPPROTO_TCP, TCP_QUICKACK, &off, sizeof off);
  serve_promptly(pair.far);
  EXPECT_EQ(pair.option(IPPROTO_TCP, TCP_NODELAY), 1);
  EXPECT_EQ(pair.option(IPPROTO_TCP, TCP_QUICKACK), 1);
  // Ends within a minute, whether the peer is silent or does not acknowledge data.
  EXPECT_EQ(pair.option(SOL_SOCKET, SO_KEEPALIVE), 1);
  const int idle_s = pair.option(IPPROTO_TCP, TCP_KEEPIDLE);
  const int probes_s = pair.option(IPPROTO_TCP, TCP_KEEPINTVL) * pair.option(IPPROTO_TCP, TCP_KEEPCNT);
  EXPECT_GT(idle_s, 0);
  EXPECT_GT(probes_s, 0);
  EXPECT_LE(idle_s + probes_s, 60);
  EXPECT_EQ(pair.option(IPPROTO_TCP, TCP_USER_TIMEOUT), 60'000);
}

TEST(ClientSockets, AreAcknowledgedAtOnceAsOftenAsThatIsAsked) {
  TcpPair pair;
  for (int i = 0; i < 3; ++i) {
    const int off = 0;
    ::setsockopt(pair.far.native_handle(), IPPROTO_TCP, TCP_QUICKACK, &off, sizeof off);
    EXPECT_EQ(pair.option(IPPROTO_TCP, TCP_QUICKACK), 0);
    acknowledge_at_once(pair.far);
    EXPECT_EQ(pair.option(IPPROTO_TCP, TCP_QUICKACK), 1);
  }
}

// While it exists, the process cannot open a file descriptor.
class NoDescriptors {
 public:
  NoDescriptors() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const FileDescriptor lowest_free(::dup(0));
    rlimit none = before_;
    none.rlim_cur = static_cast<rlim_t>(lowest_free.get());
    EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  }
  ~NoDescriptors() { ::setrlimit(RLIMIT_NOFILE, &before_); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_{};
};

TEST(DescriptorAdvice, IsOfTheLimitAndOfNothingElse) {
  for (const int reason : {EMFILE, ENFILE}) {
    EXPECT_STREQ(advice_for(reason, "check the path"),
                 "too many files are open; end other programs, or raise the limit (ulimit -n)");
  }
  for (const int reason : {0, ENOENT, EACCES, EADDRINUSE, ENOMEM}) {
    EXPECT_STREQ(advice_for(reason, "check the path"), "check the path");
  }
}

// Covers all places where a link or its client opens something.
TEST(DescriptorAdvice, IsGivenByWhateverIsOpened) {
  boost::asio::io_context io;
  const tcp::acceptor asio_has_its_own(io);
  const std::string path = testing::TempDir() + "servodrome_listen_test_pty" + std::to_string(::getpid());
  const Pty pty(path);
  const std::pair<const char*, std::function<void()>> calls[] = {
      {"TCP",
       [&] {
         listen_at(io, {"127.0.0.1", 0}, "tcp:127.0.0.1:0");
       }},
      {"UDP",
       [&] {
         udp_listen({"127.0.0.1", 0}, "udp:127.0.0.1:0");
       }},
      {"raw", [&] { open_ethercat_client("raw:lo"); }},
      {"store", [&] { FileMedium(path + ".store", 16384); }},
      {"CAN log", [&] { CanLog(path + ".log", CanLog::Format::candump, "can0", {}); }},
      {"EtherCAT log", [&] { EthercatLog(path + ".pcap", {}); }},
      {"pty", [&] { Pty(path + "2"); }},
      {"tty", [&] { open_tty(path, {}); }},
      {"socketcand client", [&] { open_can_client("socketcand:127.0.0.1:1/can0"); }},
      {"slcan client", [&] { open_can_client("slcan:" + path); }},
      {"socketcan client", [&] { open_can_client("socketcan:can0"); }},
      {"Modbus TCP client", [&] { open_byte_client(parse_serial_link("tcp:127.0.0.1:1"), {}); }},
      {"serial client", [&] { open_byte_client(parse_serial_link("pty:" + path), {}); }},
  };
  const bool has_can = FileDescriptor(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, 1)).is_open();  // in this kernel
  for (const auto& [name, call] : calls) {
    if (std::string_view(name) == "socketcan client" && !has_can) continue;
    std::string what;
    {
      const NoDescriptors none;
      try {
        call();
      } catch (const std::runtime_error& error) {
        what = error.what();
      }
    }
    EXPECT_THAT(what, HasSubstr("too many files are open")) << name;
    EXPECT_THAT(what, HasSubstr("ulimit -n")) << name;
  }
}

}  // namespace
}  // namespace listen_test
}  // namespace servodrome::links
