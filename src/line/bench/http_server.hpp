#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "line/bench/access.hpp"
#include "line/bench/http.hpp"

namespace servodrome::line::bench {

class HttpConnection;
struct Upgrade;

// What a server does with what it reads.
struct HttpHandlers {
  using Reply = std::function<void(Response&&)>;

  // Calls `reply` once, in the thread of `io`, at once or later.
  std::function<void(Request&& request, Reply reply)> answer;
  // The one address where a WebSocket may begin, for clients that may write.
  std::string upgrade_address{};
  std::function<std::optional<Response>()> refuse_upgrade{};
  std::function<void(Upgrade&&)> upgrade{};
  // Shows a message to the operator of the server.
  std::function<void(const std::string& message)> report{};
};

// HTTP/1.1 on a TCP port, with keep-alive. Requests of at most 8 KiB of header and 256 KiB of body; at most 64
// connections, of which the one that was silent longest makes room for a new one (none that is being answered does);
// one that is silent for a minute is closed. More than 2000 requests per second, of all clients together, wait for
// their turn, and fewer of those that take longer: what they ask for is done between the ticks of drives. All in the
// thread of `io`.
class HttpServer {
 public:
  // Listens at once. Throws links::LinkError when it cannot.
  HttpServer(boost::asio::io_context& io, const std::string& address, std::uint16_t port, Access access,
             HttpHandlers handlers);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  // The port, also if 0 was asked for.
  std::uint16_t port() const;
  // An exception has ended a connection, or a WebSocket that was one. Reports the 1st, 2nd, 4th, 8th ...: a client that
  // does it again and again fills no log.
  void count_failure(const std::exception& error);
  // How many those were.
  std::uint64_t failures() const { return failures_; }

 private:
  friend class HttpConnection;
  static constexpr std::size_t most_connections = 64;
  static constexpr auto turn = std::chrono::microseconds(500);
  static constexpr auto burst = 200 * turn;  // that need not wait after a pause

  void accept();
  void accept_later(const boost::system::error_code& why);
  // False: all clients are being answered.
  bool make_room();
  // How long a request that is there now has to wait.
  std::chrono::steady_clock::duration take_turn();
  // A request has taken so much of the thread's time: what is more than its turn is paid by those that come after it,
  // so that requests have half of the time at most.
  void charge(std::chrono::steady_clock::duration spent);

  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer retry_;
  Access access_;
  HttpHandlers handlers_;
  std::set<std::shared_ptr<HttpConnection>> connections_;
  std::chrono::steady_clock::time_point next_turn_{};
  std::uint64_t failures_ = 0;
};

}  // namespace servodrome::line::bench
