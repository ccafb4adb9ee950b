#pragma once

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "api/access.hpp"
#include "api/http.hpp"
#include "links/accept_loop.hpp"

namespace servodrome::api {

class HttpConnection;
struct Upgrade;

// The callbacks of a server.
struct HttpHandlers {
  using Reply = std::function<void(Response&&)>;

  // Must call `reply` once, in the thread of `io`, immediately or later. A request with `only_if_urgent` that is
  // postponed comes again.
  std::function<void(Request&& request, Reply reply)> answer;
  // The only address at which a client that may write can open a WebSocket.
  std::string upgrade_address{};
  std::function<std::optional<Response>()> refuse_upgrade{};
  std::function<void(Upgrade&&)> upgrade{};
  // Shows a message to the operator of the server.
  std::function<void(const std::string& message)> report{};
};

// The turns of a rate limit: the earliest times of requests.
class Turns {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr auto length = std::chrono::microseconds(500);
  static constexpr auto burst = 200 * length;  // requests that need not wait after a pause

  // The turn of a request that comes at `now`; it may be in the past.
  Clock::time_point next(Clock::time_point now) const { return std::max(last_, now - burst) + length; }
  Clock::time_point take(Clock::time_point now) { return last_ = next(now); }
  // Charges the thread's time of a request: time beyond its turn delays later requests, so that requests use at most
  // half of the thread's time.
  void charge(Clock::time_point now, Clock::duration spent) {
    constexpr int share = 2;
    if (share * spent > length) last_ = std::max(last_, now - burst) + (share * spent - length);
  }

 private:
  Clock::time_point last_{};
};

// HTTP/1.1 on a TCP port, with keep-alive. A request has at most 8 KiB of header and 256 KiB of body. There are at most
// 64 connections: a new one replaces the one that has been silent longest, but none whose request is being carried out.
// A connection is closed after a minute of silence. A rate limit delays requests beyond 2000 per second of all clients
// together. The limit is lower if requests take long, because they are carried out between the ticks of drives. Urgent
// requests (Route::is_urgent) with a short body have a second rate limit of their own: other requests do not delay
// them, but they count in the common limit and delay other requests. Everything happens in the thread of `io`.
class HttpServer {
 public:
  // Begins to listen. Throws links::LinkError if that fails.
  HttpServer(boost::asio::io_context& io, const std::string& address, std::uint16_t port, Access access,
             HttpHandlers handlers);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  // The actual port, also if the requested port was 0.
  std::uint16_t port() const { return accept_loop_.port(); }
  // Counts a connection, or a WebSocket, that an exception has ended. Reports the 1st, 2nd, 4th, 8th ... of them, so
  // that a client that causes them repeatedly does not fill the log.
  void count_failure(const std::exception& error);
  // The number of such connections.
  std::uint64_t failures() const { return failures_; }

 private:
  friend class HttpConnection;
  static constexpr std::size_t most_connections = 64;

  void accept(boost::asio::ip::tcp::socket&& socket);
  // Returns false if no connection may be ended now (HttpConnection::dispensable_from).
  bool make_room();

  links::AcceptLoop accept_loop_;
  Access access_;
  HttpHandlers handlers_;
  std::set<std::shared_ptr<HttpConnection>> connections_;
  Turns turns_;              // of all requests
  Turns urgent_turns_;       // of urgent requests that come before their turn
  std::uint64_t halts_ = 0;  // number of requests that have halted axes
  std::uint64_t failures_ = 0;
};

}  // namespace servodrome::api
