#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <functional>
#include <memory>
#include <set>
#include <string>

#include "line/bench/access.hpp"
#include "line/bench/http.hpp"

namespace servodrome::line::bench {

// HTTP/1.1 on a TCP port, with keep-alive, for a handler that answers at once. Requests of at most 8 KiB of header and
// 256 KiB of body; at most 64 connections, of which the one that was silent longest makes room for a new one; one that
// is silent for a minute is closed. All in the thread of `io`.
class HttpServer {
 public:
  using Handler = std::function<Response(const Request&)>;

  // Listens at once. Throws links::LinkError when it cannot.
  HttpServer(boost::asio::io_context& io, const std::string& address, std::uint16_t port, Access access,
             Handler handler);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  // The port, also if 0 was asked for.
  std::uint16_t port() const;

 private:
  class Connection;
  static constexpr std::size_t most_connections = 64;

  void accept();

  boost::asio::ip::tcp::acceptor acceptor_;
  Access access_;
  Handler handler_;
  std::set<std::shared_ptr<Connection>> connections_;
};

}  // namespace servodrome::line::bench
