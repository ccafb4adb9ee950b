#include "api/http_connection.hpp"

#include <algorithm>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <fmt/format.h>

#include "api/error.hpp"
#include "api/query.hpp"
#include "api/routes.hpp"
#include "api/upgrade.hpp"
#include "links/socket_options.hpp"

namespace servodrome::api {
namespace {

namespace beast = boost::beast;
namespace http = boost::beast::http;
using boost::asio::ip::tcp;
using boost::system::error_code;

constexpr std::size_t longest_target = 2048;
constexpr auto idle_time = std::chrono::seconds(60);

Method method_of(http::verb verb) {
  switch (verb) {
    case http::verb::get:
    case http::verb::head: return Method::get;  // HEAD is GET without the body (RFC 9110 9.3.2)
    case http::verb::put: return Method::put;
    case http::verb::post: return Method::post;
    case http::verb::delete_: return Method::delete_;
    default: return Method::other;
  }
}

std::string text_of(beast::string_view text) { return {text.data(), text.size()}; }

// Browsers cannot add header fields to a WebSocket handshake, but they can name subprotocols. A page from another
// machine names "servodrome" and "token." followed by the token, percent-escaped.
std::string token_of_subprotocols(beast::string_view list) {
  constexpr std::string_view mark = "token.";
  for (const auto& each : http::token_list(list)) {
    const std::string protocol = text_of(each);
    if (protocol.starts_with(mark)) return unescaped(std::string_view(protocol).substr(mark.size()));
  }
  return {};
}

// A browser sends Origin with each request that changes something.
std::string client_of(const Request& request, std::string_view user_agent) {
  if (request.has_origin) return "page";
  constexpr std::size_t longest = 24;
  const std::size_t end = std::min({user_agent.find_first_of("/ "), user_agent.size(), longest});
  std::string name(user_agent.substr(0, end));
  std::erase_if(name, [](char each) { return each < '!' || each > '~'; });
  return name;
}

Request request_of(http::request<http::string_body>&& message, bool from_loopback) {
  Request request;
  request.method = method_of(message.method());
  request.target = text_of(message.target());
  request.host = text_of(message[http::field::host]);
  // The target may be a whole address, as sent to proxies (RFC 9112 3.2.2). It then overrides the Host field.
  if (constexpr beast::string_view scheme = "http://";
      beast::iequals(request.target.substr(0, scheme.size()), scheme)) {
    const std::string address = request.target.substr(scheme.size());
    const std::size_t end = std::min(address.find_first_of("/?"), address.size());
    request.host = address.substr(0, end);
    request.target = address.substr(end);
    if (!request.target.starts_with('/')) request.target.insert(0, "/");
  }
  request.origin = text_of(message[http::field::origin]);
  request.has_origin = message.find(http::field::origin) != message.end();
  request.authorization = text_of(message[http::field::authorization]);
  request.if_none_match = text_of(message[http::field::if_none_match]);
  request.client = client_of(request, text_of(message[http::field::user_agent]));
  request.from_loopback = from_loopback;
  request.body = std::move(message.body());
  return request;
}

http::response<http::string_body> message_of(Response&& response, unsigned version, bool keep_alive, bool chunked) {
  http::response<http::string_body> message(static_cast<http::status>(response.status), version);
  message.set(http::field::server, "servodrome");
  message.set(http::field::cache_control, "no-store");
  message.set("X-Content-Type-Options", "nosniff");
  for (const auto& [name, value] : response.fields) message.set(name, value);
  if (!response.allow.empty()) message.set(http::field::allow, response.allow);
  if (chunked || !response.body.empty()) message.set(http::field::content_type, response.content_type);
  message.body() = std::move(response.body);
  message.keep_alive(keep_alive);
  if (chunked) {
    message.chunked(true);
  } else if (response.status != 204 && response.status != 304) {
    message.prepare_payload();
  }
  return message;
}

Response refusal_of(const error_code& code, std::uint64_t largest_header, std::uint64_t largest_body) {
  if (code == http::error::body_limit) {
    return error_response({413, "the body is too long", "body", fmt::format("send at most {} bytes", largest_body)});
  }
  if (code == http::error::header_limit) {
    return error_response(
        {431, "the header is too long", "header", fmt::format("send at most {} bytes", largest_header)});
  }
  return error_response({400, fmt::format("this is not HTTP: {}", code.message()), "header", "send HTTP/1.1"});
}

}  // namespace

HttpConnection::HttpConnection(HttpServer& server, tcp::socket socket)
    : server_(&server), stream_(std::move(socket)), turn_(stream_.get_executor()) {
  error_code ignored;
  const auto peer = stream_.socket().remote_endpoint(ignored).address();
  from_loopback_ =
      peer.is_loopback() || (peer.is_v6() && peer.to_v6().is_v4_mapped() &&
                             boost::asio::ip::make_address_v4(boost::asio::ip::v4_mapped, peer.to_v6()).is_loopback());
  links::serve_promptly(stream_.socket());
  stream_.socket().non_blocking(true, ignored);  // so that obsolete() does not wait for bytes
}

template <typename Handler>
auto HttpConnection::guarded(Handler handler) {
  return [self = shared_from_this(), handler = std::move(handler)](auto&&... results) {
    HttpServer* const server = self->server_;
    if (server == nullptr) return;
    const auto began = std::chrono::steady_clock::now();
    try {
      handler(std::forward<decltype(results)>(results)...);
      self->spent_ += std::chrono::steady_clock::now() - began;
    } catch (const std::exception& error) {
      server->count_failure(error);
      if (self->server_ != nullptr) self->close();
    }
  };
}

void HttpConnection::read() {
  dispensable_from_ = std::chrono::steady_clock::now();
  parser_.emplace();
  parser_->header_limit(largest_header);
  parser_->body_limit(largest_body);
  halts_ = server_->halts_;  // for a request that has already arrived in the buffer
  stream_.expires_after(idle_time);
  parse();
}

// Beast's own read function would parse inside Beast, where this class cannot catch exceptions. So this function only
// reads bytes, and parse() parses them.
void HttpConnection::receive() {
  constexpr std::size_t most_at_once = 16 * 1024;
  const std::size_t room = std::min(most_at_once, buffer_.max_size() - buffer_.size());
  if (room == 0) {
    has_read(http::error::header_limit);
    return;
  }
  stream_.async_read_some(buffer_.prepare(room), guarded([this](error_code code, std::size_t size) {
                            links::acknowledge_at_once(stream_.socket());
                            buffer_.commit(size);
                            // A request begins with its first byte: its rest may come after a halt.
                            if (!parser_->got_some()) halts_ = server_->halts_;
                            if (code == boost::asio::error::eof) {
                              code = parser_->got_some() ? http::error::partial_message : http::error::end_of_stream;
                            }
                            if (code) {
                              has_read(code);
                            } else {
                              parse();
                            }
                          }));
}

// Parses the header first, so that the body is not read before the client is invited to send it.
void HttpConnection::parse() {
  while (!parser_->is_done()) {
    const bool had_header = parser_->is_header_done();
    error_code code = http::error::need_more;
    if (buffer_.size() != 0) {
      try {
        buffer_.consume(parser_->put(buffer_.data(), code));
      } catch (const std::length_error&) {  // a trailer field with more than 64 KiB
        code = http::error::header_limit;
      }
    }
    if (code == http::error::need_more) {
      receive();
      return;
    }
    if (code) {
      has_read(code);
      return;
    }
    if (had_header || !parser_->is_header_done() || parser_->is_done()) continue;
    parser_->eager(true);
    if (beast::iequals(parser_->get()[http::field::expect], "100-continue")) {
      invite_body();
      return;
    }
  }
  has_read({});
}

// Answers a client that asks before it sends its body (Expect: 100-continue, RFC 9110 10.1.1). A body that is too long
// has already been refused, when the header was read.
void HttpConnection::invite_body() {
  constexpr std::string_view go_on = "HTTP/1.1 100 Continue\r\n\r\n";
  boost::asio::async_write(stream_, boost::asio::buffer(go_on), guarded([this](error_code code, std::size_t) {
                             if (code) {
                               has_read(code);
                             } else {
                               parse();
                             }
                           }));
}

void HttpConnection::has_read(const error_code& code) {
  dispensable_from_.reset();
  wants_head_ = false;
  if (code == http::error::end_of_stream || code == boost::asio::error::eof ||
      code == boost::asio::error::connection_reset || code == beast::error::timeout ||
      code == http::error::partial_message) {
    close();
  } else if (code) {
    answer(refusal_of(code, largest_header, largest_body), 11, false);
  } else {
    take_turn();
  }
}

void HttpConnection::take_turn() {
  const auto now = Turns::Clock::now();
  due_ = server_->turns_.take(now);
  serve_at(may_be_urgent() ? std::min(due_, server_->urgent_turns_.next(now)) : due_);
}

// Only the server's handler knows whether the route is urgent, so each request of this form is first offered to the
// handler as urgent.
bool HttpConnection::may_be_urgent() const {
  const Message& message = parser_->get();
  return (message.method() == http::verb::post || message.method() == http::verb::delete_) &&
         text_of(message.target()).starts_with("/api/") && message.body().size() < largest_urgent_body;
}

void HttpConnection::serve_at(Turns::Clock::time_point when) {
  if (when <= Turns::Clock::now()) {
    if (due_ <= Turns::Clock::now()) {
      serve();
    } else {
      serve_if_urgent();
    }
    return;
  }
  turn_.expires_at(when);
  turn_.async_wait(guarded([this, when](const error_code& code) {
    if (!code) serve_at(when);
  }));
}

// Serves an urgent request before its turn. All other requests, and those that are refused, wait for their turn.
void HttpConnection::serve_if_urgent() {
  const Message& message = parser_->get();
  Request request = request_of(Message(message), from_loopback_);
  if (refusal_of_address(message) || refuse(server_->access_, request)) {
    serve_at(due_);
    return;
  }
  request.only_if_urgent = true;
  request.obsolete = obsolete();
  server_->handlers_.answer(std::move(request), guarded([this, version = message.version(),
                                                         keep_alive = message.keep_alive()](Response&& response) {
                              if (response.postponed) {
                                serve_at(due_);
                                return;
                              }
                              was_urgent_ = true;
                              server_->urgent_turns_.take(Turns::Clock::now());
                              answer(std::move(response), version, keep_alive);
                            }));
}

// Returns why the present request is no longer valid (Request::obsolete). A client that abandons a request closes its
// connection; meanwhile the request may have waited in the socket, for example while this process was stopped.
std::string_view HttpConnection::obsolete() {
  char next = 0;
  error_code code;
  stream_.socket().receive(boost::asio::buffer(&next, 1), tcp::socket::message_peek, code);
  if (code && code != boost::asio::error::would_block && code != boost::asio::error::try_again) {
    return "the client has closed its connection";
  }
  return halts_ != server_->halts_ ? "a halt or a stop came while this request waited" : "";
}

void HttpConnection::disconnect() {
  server_ = nullptr;
  turn_.cancel();
  error_code ignored;
  stream_.socket().close(ignored);
}

// Refuses requests that are ambiguous, such as one with two Host fields (RFC 9112 3.2).
std::optional<Response> HttpConnection::refusal_of_address(const Message& message) const {
  if (message.target().size() > longest_target) {
    return error_response({414, "the address is too long", "address", "docs/bench-api.md lists the addresses"});
  }
  // With any other transfer coding the end of the body is unknown (RFC 9112 6.1).
  if (const auto coding = message[http::field::transfer_encoding];
      message.count(http::field::transfer_encoding) > 1 || (!coding.empty() && !beast::iequals(coding, "chunked"))) {
    return error_response({501,
                           fmt::format("the transfer coding \"{}\" is not supported", text_of(coding).substr(0, 40)),
                           "Transfer-Encoding", "send Content-Length, or Transfer-Encoding: chunked"});
  }
  for (const http::field field : {http::field::host, http::field::origin, http::field::authorization}) {
    if (message.count(field) > 1) {
      const std::string name = text_of(http::to_string(field));
      return error_response({400, fmt::format("the field {} is present more than once", name), name, "send it once"});
    }
  }
  return std::nullopt;
}

void HttpConnection::serve() {
  auto message = parser_->release();
  const unsigned version = message.version();
  const bool keep_alive = message.keep_alive();
  wants_head_ = message.method() == http::verb::head;
  if (auto refusal = refusal_of_address(message)) {
    answer(std::move(*refusal), version, false);
    return;
  }
  if (beast::websocket::is_upgrade(message)) {
    upgrade(std::move(message));
    return;
  }
  Request request = request_of(std::move(message), from_loopback_);
  if (auto refusal = refuse(server_->access_, request)) {
    answer(std::move(*refusal), version, keep_alive);
    return;
  }
  request.obsolete = obsolete();
  server_->handlers_.answer(std::move(request), guarded([this, version, keep_alive](Response&& response) {
                              answer(std::move(response), version, keep_alive);
                            }));
}

// Browsers allow any page to open a WebSocket to any address, so this requires the right to write.
void HttpConnection::upgrade(Message&& message) {
  const HttpHandlers& handlers = server_->handlers_;
  Request request = request_of(Message(message), from_loopback_);
  const std::string target = request.target;
  request.method = Method::post;
  if (request.authorization.empty()) {
    const auto token = token_of_subprotocols(message[http::field::sec_websocket_protocol]);
    if (!token.empty()) request.authorization = "Bearer " + token;
  }
  auto refusal = refuse(server_->access_, request);
  if (!refusal && (!handlers.upgrade || target.substr(0, target.find('?')) != handlers.upgrade_address)) {
    refusal = error_response({404, "there is no WebSocket at this address", target.substr(0, 200),
                              "the stream is at " + handlers.upgrade_address});
  }
  // Refuses frames before the answer to the handshake (RFC 6455 4.1 forbids them).
  if (!refusal && buffer_.size() != 0) {
    refusal =
        error_response({400, "data follow the handshake request", "body", "wait for the answer to the handshake"});
  }
  if (!refusal && handlers.refuse_upgrade) refusal = handlers.refuse_upgrade();
  if (refusal) {
    answer(std::move(*refusal), message.version(), false);
    return;
  }
  HttpServer& server = *server_;
  server_ = nullptr;
  Upgrade upgrade{std::move(stream_), std::move(message)};
  server.connections_.erase(shared_from_this());
  server.handlers_.upgrade(std::move(upgrade));
}

void HttpConnection::begin_to_send() {
  dispensable_from_ = std::chrono::steady_clock::now() + patience;
  stream_.expires_after(idle_time);
}

void HttpConnection::answer(Response&& response, unsigned version, bool keep_alive) {
  if (response.halts) ++server_->halts_;
  constexpr unsigned chunks_since = 11;  // HTTP 1.1
  if (response.more && version < chunks_since) {
    for (std::string part = response.more(); !part.empty(); part = response.more()) response.body += part;
    response.more = {};
  }
  more_ = std::move(response.more);
  part_ = more_ ? std::exchange(response.body, {}) : std::string();
  message_ = message_of(std::move(response), version, keep_alive, more_ != nullptr);
  const bool head_only = std::exchange(wants_head_, false);
  if (head_only) more_ = {};
  begin_to_send();
  const auto written = guarded([this](error_code code, std::size_t) { this->written(code); });
  if (more_ || head_only) {
    head_.emplace(message_);
    http::async_write_header(stream_, *head_, written);
  } else {
    http::async_write(stream_, message_, written);
  }
}

// Sends the body part by part. Each part is generated after the previous one was sent, so that other events are handled
// in between.
void HttpConnection::written(const error_code& code) {
  if (code) {
    close();
  } else if (more_) {
    if (part_.empty()) part_ = more_();
    const auto next = guarded([this](error_code its_code, std::size_t) {
      part_.clear();
      written(its_code);
    });
    begin_to_send();
    if (part_.empty()) {
      more_ = {};
      boost::asio::async_write(stream_, http::make_chunk_last(), next);
    } else {
      boost::asio::async_write(stream_, http::make_chunk(boost::asio::buffer(part_)), next);
    }
  } else if (message_.keep_alive()) {
    charge();
    message_ = {};  // frees up to 16 MiB
    read();
  } else {
    close();
  }
}

void HttpConnection::charge() {
  const auto now = Turns::Clock::now();
  const auto spent = std::exchange(spent_, {});
  server_->turns_.charge(now, spent);
  if (std::exchange(was_urgent_, false)) server_->urgent_turns_.charge(now, spent);
}

void HttpConnection::close() {
  charge();
  error_code ignored;
  stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  stream_.socket().close(ignored);
  server_->connections_.erase(shared_from_this());
}

}  // namespace servodrome::api
