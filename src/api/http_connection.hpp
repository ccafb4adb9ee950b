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

#include "api/http_server.hpp"

namespace servodrome::api {

// A client's connection to the server: reads requests and sends responses, until it becomes a WebSocket or ends.
class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  HttpConnection(HttpServer& server, boost::asio::ip::tcp::socket socket);

  void read();
  // When the connection may be ended to make room for another one: immediately while it waits for a request, or after
  // `patience` if its client does not receive a part of the response. Nothing while a request is being carried out.
  std::optional<std::chrono::steady_clock::time_point> dispensable_from() const { return dispensable_from_; }
  // The connection must not use the server after this.
  void disconnect();

 private:
  static constexpr std::uint32_t largest_header = 8 * 1024;
  static constexpr std::uint64_t largest_body = 256 * 1024;
  static constexpr std::uint64_t largest_urgent_body = 1024;
  static constexpr auto patience = std::chrono::seconds(5);

  using Message = boost::beast::http::request<boost::beast::http::string_body>;

  // Wraps a callback: if `handler` throws, only this connection ends.
  template <typename Handler>
  auto guarded(Handler handler);
  void receive();
  void parse();
  void invite_body();
  void has_read(const boost::system::error_code& code);
  void take_turn();
  bool may_be_urgent() const;
  // Calls serve_if_urgent or serve at that time.
  void serve_at(Turns::Clock::time_point when);
  void serve_if_urgent();
  void serve();
  // Request::obsolete.
  std::string_view obsolete();
  std::optional<Response> refusal_of_address(const Message& message) const;
  void upgrade(Message&& message);
  void begin_to_send();
  void answer(Response&& response, unsigned version, bool keep_alive);
  void written(const boost::system::error_code& code);
  void charge();
  void close();

  HttpServer* server_;
  std::optional<std::chrono::steady_clock::time_point> dispensable_from_;
  boost::beast::tcp_stream stream_;
  boost::asio::steady_timer turn_;
  boost::beast::flat_buffer buffer_{largest_header + largest_body};
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  boost::beast::http::response<boost::beast::http::string_body> message_;
  std::optional<boost::beast::http::response_serializer<boost::beast::http::string_body>> head_;  // of a long response
  More more_;                                    // generates its next part
  std::string part_;                             // that is being sent
  std::chrono::steady_clock::duration spent_{};  // time of the thread for the current request
  Turns::Clock::time_point due_{};               // turn of the current request
  std::uint64_t halts_ = 0;                      // HttpServer::halts_ when the current request began to arrive
  bool was_urgent_ = false;                      // it was served before its turn
  bool from_loopback_ = false;
  bool wants_head_ = false;  // the request is a HEAD: the response has no body
};

}  // namespace servodrome::api
