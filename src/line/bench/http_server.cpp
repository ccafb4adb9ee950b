#include "line/bench/http_server.hpp"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <fmt/format.h>
#include <optional>

#include "line/bench/error.hpp"
#include "links/link_error.hpp"

namespace servodrome::line::bench {
namespace {

namespace beast = boost::beast;
namespace http = boost::beast::http;
using boost::asio::ip::tcp;
using boost::system::error_code;

constexpr std::uint32_t largest_header = 8 * 1024;
constexpr std::uint64_t largest_body = 256 * 1024;
constexpr std::size_t longest_target = 2048;
constexpr auto idle_time = std::chrono::seconds(60);

Method method_of(http::verb verb) {
  switch (verb) {
    case http::verb::get: return Method::get;
    case http::verb::put: return Method::put;
    case http::verb::post: return Method::post;
    case http::verb::delete_: return Method::delete_;
    default: return Method::other;
  }
}

std::string text_of(beast::string_view text) { return {text.data(), text.size()}; }

Request request_of(http::request<http::string_body>&& message, bool from_loopback) {
  Request request;
  request.method = method_of(message.method());
  request.target = text_of(message.target());
  request.host = text_of(message[http::field::host]);
  request.origin = text_of(message[http::field::origin]);
  request.has_origin = message.find(http::field::origin) != message.end();
  request.authorization = text_of(message[http::field::authorization]);
  request.from_loopback = from_loopback;
  request.body = std::move(message.body());
  return request;
}

http::response<http::string_body> message_of(Response&& response, unsigned version, bool keep_alive) {
  http::response<http::string_body> message(static_cast<http::status>(response.status), version);
  message.set(http::field::server, "servodrome");
  message.set(http::field::cache_control, "no-store");
  message.set("X-Content-Type-Options", "nosniff");
  if (!response.allow.empty()) message.set(http::field::allow, response.allow);
  if (!response.body.empty()) message.set(http::field::content_type, response.content_type);
  message.body() = std::move(response.body);
  message.keep_alive(keep_alive);
  if (response.status != 204) message.prepare_payload();
  return message;
}

Response refusal_of(const error_code& code) {
  if (code == http::error::body_limit) {
    return error_response({413, "the body is too long", "body", fmt::format("send at most {} bytes", largest_body)});
  }
  if (code == http::error::header_limit) {
    return error_response(
        {431, "the header is too long", "header", fmt::format("send at most {} bytes", largest_header)});
  }
  return error_response({400, fmt::format("this is not HTTP: {}", code.message()), "header", "send HTTP/1.1"});
}

[[noreturn]] void cannot_listen(const std::string& address, std::uint16_t port, const error_code& code) {
  std::string advice = "the address must be one of this computer, such as 127.0.0.1";
  if (code == boost::asio::error::address_in_use) {
    advice = "another program has this port; stop it or choose another with --api ADDRESS:PORT";
  } else if (code == boost::asio::error::access_denied) {
    advice = "choose a port above 1023";
  }
  throw links::LinkError(
      std::error_code(code.value(), std::system_category()),
      fmt::format("bench API: cannot listen on {}:{}: {}; {}", address, port, code.message(), advice));
}

}  // namespace

class HttpServer::Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(HttpServer& server, tcp::socket socket) : server_(&server), stream_(std::move(socket)) {
    error_code ignored;
    const auto peer = stream_.socket().remote_endpoint(ignored).address();
    from_loopback_ = peer.is_loopback() ||
                     (peer.is_v6() && peer.to_v6().is_v4_mapped() &&
                      boost::asio::ip::make_address_v4(boost::asio::ip::v4_mapped, peer.to_v6()).is_loopback());
    stream_.socket().set_option(tcp::no_delay(true), ignored);
  }

  void read() {
    reading_since_ = std::chrono::steady_clock::now();
    parser_.emplace();
    parser_->header_limit(largest_header);
    parser_->body_limit(largest_body);
    stream_.expires_after(idle_time);
    http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](error_code code, std::size_t) {
      if (self->server_ == nullptr) return;
      if (code == http::error::end_of_stream || code == boost::asio::error::eof ||
          code == boost::asio::error::connection_reset || code == beast::error::timeout ||
          code == http::error::partial_message) {
        self->close();
      } else if (code) {
        self->answer(refusal_of(code), 11, false);
      } else {
        self->serve();
      }
    });
  }

  // When it began to wait for the request that is not there yet.
  std::chrono::steady_clock::time_point reading_since() const { return reading_since_; }

  // No call of the server after this.
  void disconnect() {
    server_ = nullptr;
    error_code ignored;
    stream_.socket().close(ignored);
  }

 private:
  void serve() {
    auto message = parser_->release();
    const unsigned version = message.version();
    const bool keep_alive = message.keep_alive();
    if (message.target().size() > longest_target) {
      answer(error_response({414, "the address is too long", "address", "docs/bench-api.md lists the addresses"}),
             version, false);
      return;
    }
    const Request request = request_of(std::move(message), from_loopback_);
    auto refusal = refuse(server_->access_, request);
    answer(refusal ? std::move(*refusal) : server_->handler_(request), version, keep_alive);
  }

  void answer(Response&& response, unsigned version, bool keep_alive) {
    message_ = message_of(std::move(response), version, keep_alive);
    stream_.expires_after(idle_time);
    http::async_write(stream_, message_, [self = shared_from_this()](error_code code, std::size_t) {
      if (self->server_ == nullptr) return;
      if (code || !self->message_.keep_alive()) {
        self->close();
      } else {
        self->read();
      }
    });
  }

  void close() {
    error_code ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    stream_.socket().close(ignored);
    server_->connections_.erase(shared_from_this());
  }

  HttpServer* server_;
  std::chrono::steady_clock::time_point reading_since_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{largest_header + largest_body};
  std::optional<http::request_parser<http::string_body>> parser_;
  http::response<http::string_body> message_;
  bool from_loopback_ = false;
};

HttpServer::HttpServer(boost::asio::io_context& io, const std::string& address, std::uint16_t port, Access access,
                       Handler handler)
    : acceptor_(io), access_(std::move(access)), handler_(std::move(handler)) {
  error_code code;
  const auto host = boost::asio::ip::make_address(address == "localhost" ? "127.0.0.1" : address, code);
  if (code) cannot_listen(address, port, code);
  const tcp::endpoint endpoint(host, port);
  acceptor_.open(endpoint.protocol(), code);
  if (!code) acceptor_.set_option(tcp::acceptor::reuse_address(true), code);
  if (!code) acceptor_.bind(endpoint, code);
  if (!code) acceptor_.listen(boost::asio::socket_base::max_listen_connections, code);
  if (code) cannot_listen(address, port, code);
  accept();
}

HttpServer::~HttpServer() {
  error_code ignored;
  acceptor_.close(ignored);
  for (const auto& connection : connections_) connection->disconnect();
}

std::uint16_t HttpServer::port() const {
  error_code ignored;
  return acceptor_.local_endpoint(ignored).port();
}

void HttpServer::accept() {
  acceptor_.async_accept([this](error_code code, tcp::socket socket) {
    if (code == boost::asio::error::operation_aborted) return;
    if (!code) {
      // Connections that send nothing do not keep others out.
      if (connections_.size() == most_connections) {
        const auto longest =
            std::min_element(connections_.begin(), connections_.end(),
                             [](const auto& a, const auto& b) { return a->reading_since() < b->reading_since(); });
        (*longest)->disconnect();
        connections_.erase(longest);
      }
      const auto connection = std::make_shared<Connection>(*this, std::move(socket));
      connections_.insert(connection);
      connection->read();
    }
    accept();
  });
}

}  // namespace servodrome::line::bench
