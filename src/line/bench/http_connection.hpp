#pragma once

#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/serializer.hpp>
#include <boost/beast/http/string_body.hpp>
#include <chrono>
#include <memory>
#include <optional>

#include "line/bench/http_server.hpp"

namespace servodrome::line::bench {

// One connection of a client of the server: requests in, responses out, until it becomes a WebSocket or ends.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  HttpConnection(HttpServer& server, boost::asio::ip::tcp::socket socket);

  void read();
  // From when on it has to make room for another: at once while it waits for a request, and when its client needs
  // longer than `patience` for a part of the answer. Nothing: a request is being carried out.
  std::optional<std::chrono::steady_clock::time_point> dispensable_from() const { return dispensable_from_; }
  // No call of the server after this.
  void disconnect();

 private:
  static constexpr std::uint32_t largest_header = 8 * 1024;
  static constexpr std::uint64_t largest_body = 256 * 1024;
  static constexpr auto patience = std::chrono::seconds(5);

  using Message = boost::beast::http::request<boost::beast::http::string_body>;

  // Of every wait of this connection: an exception that leaves `handler` ends the connection, and no other.
  template <typename Handler>
  auto guarded(Handler handler);
  void receive();
  void parse();
  void invite_body();
  void has_read(const boost::system::error_code& code);
  void serve_in_turn();
  void serve();
  std::optional<Response> refusal_of_address(const Message& message) const;
  void upgrade(Message&& message);
  void begin_to_send();
  void answer(Response&& response, unsigned version, bool keep_alive);
  void written(const boost::system::error_code& code);
  void close();

  HttpServer* server_;
  std::optional<std::chrono::steady_clock::time_point> dispensable_from_;
  boost::beast::tcp_stream stream_;
  boost::asio::steady_timer turn_;
  boost::beast::flat_buffer buffer_{largest_header + largest_body};
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  boost::beast::http::response<boost::beast::http::string_body> message_;
  std::optional<boost::beast::http::response_serializer<boost::beast::http::string_body>> head_;  // of a long response
  More more_;                                                                                     // of it, what follows
  std::string part_;                                                                              // that is being sent
  std::chrono::steady_clock::duration spent_{};  // of the thread's time on the request at hand
  bool from_loopback_ = false;
  bool wants_head_ = false;  // the request is a HEAD: an answer without its body
};

}  // namespace servodrome::line::bench
