#include "api/scope/web_sockets.hpp"

#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/rfc7230.hpp>
#include <boost/beast/websocket.hpp>
#include <deque>
#include <fmt/format.h>

#include "api/error.hpp"
#include "api/scope/scope.hpp"
#include "api/upgrade.hpp"

namespace servodrome::api {
namespace {

namespace beast = boost::beast;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

constexpr const char* subprotocol = "servodrome";
constexpr auto handshake_time = std::chrono::seconds(10);
constexpr auto closing_time = std::chrono::seconds(5);   // for a client to answer the close frame
constexpr auto silence_time = std::chrono::seconds(30);  // a ping is sent after half of it

}  // namespace

class WebSockets::Connection final : public std::enable_shared_from_this<Connection>, public Outbox {
 public:
  Connection(WebSockets& sockets, Upgrade&& upgrade)
      : sockets_(&sockets),
        socket_(std::move(upgrade.stream)),
        closing_timer_(socket_.get_executor()),
        request_(std::move(upgrade.request)) {
    websocket::stream_base::timeout timeout{};
    timeout.handshake_timeout = handshake_time;
    timeout.idle_timeout = silence_time;
    timeout.keep_alive_pings = true;
    beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has its own timeouts
    socket_.set_option(timeout);
    // A client that names subprotocols disconnects if the server chooses none of them (RFC 6455 4.1).
    beast::http::token_list offered(request_[beast::http::field::sec_websocket_protocol]);
    socket_.set_option(websocket::stream_base::decorator(
        [speaks_ours = offered.exists(subprotocol)](websocket::response_type& response) {
          response.set(beast::http::field::server, "servodrome");
          if (speaks_ours) response.set(beast::http::field::sec_websocket_protocol, subprotocol);
        }));
    socket_.read_message_max(StreamSession::largest_message);
    socket_.auto_fragment(false);
  }

 private:
  // If `handler` throws, only this connection ends.
  template <typename Handler>
  auto guarded(Handler handler) {
    return [self = shared_from_this(), handler = std::move(handler)](const auto&... results) {
      WebSockets* const sockets = self->sockets_;
      if (sockets == nullptr) return;
      try {
        handler(results...);
      } catch (const std::exception& error) {
        if (sockets->on_failure_) sockets->on_failure_(error);
        if (self->sockets_ != nullptr) self->end();
      }
    };
  }

 public:
  void accept() {
    socket_.async_accept(request_, guarded([this](error_code code) {
                           if (code) {
                             end();
                             return;
                           }
                           session_ = std::make_unique<StreamSession>(sockets_->scope_, *this);
                           read();
                         }));
  }

  // The connection must not use the owner after this.
  void disconnect() {
    sockets_ = nullptr;
    closing_timer_.cancel();
    session_.reset();
    error_code ignored;
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

 private:
  void read() {
    socket_.async_read(buffer_, guarded([this](error_code code, std::size_t) {
                         if (code) {
                           end();
                           return;
                         }
                         if (socket_.got_text()) {
                           session_->receive(beast::buffers_to_string(buffer_.data()),
                                             std::chrono::steady_clock::now());
                         } else {
                           close("messages must be text");
                         }
                         buffer_.consume(buffer_.size());
                         read();
                       }));
  }

  // --- Outbox
  void text(std::string message) override { send({std::move(message), true}); }
  void binary(std::string message) override { send({std::move(message), false}); }
  std::size_t queued() const override { return queued_; }
  void close(const std::string& reason) override {
    if (closing_) return;
    closing_ = true;
    reason_ = reason;
    // Drops the queue, because a client that does not read would never receive it. The message that is being sent must
    // be completed.
    if (messages_.size() > 1) messages_.erase(messages_.begin() + 1, messages_.end());
    if (messages_.empty()) write_close();
    // The client may keep sending without ever reading, so that no other timeout ends the connection.
    closing_timer_.expires_after(closing_time);
    closing_timer_.async_wait(guarded([this](error_code code) {
      if (!code) end();
    }));
  }

  struct Message {
    std::string bytes;
    bool is_text;
  };

  void send(Message message) {
    if (closing_) return;
    queued_ += message.bytes.size();
    messages_.push_back(std::move(message));
    if (messages_.size() == 1) write();
  }

  void write() {
    socket_.text(messages_.front().is_text);
    socket_.async_write(boost::asio::buffer(messages_.front().bytes), guarded([this](error_code code, std::size_t) {
                          if (code) {
                            end();
                            return;
                          }
                          queued_ -= messages_.front().bytes.size();
                          messages_.pop_front();
                          if (!messages_.empty()) {
                            write();
                          } else if (closing_) {
                            write_close();
                          }
                        }));
  }

  void write_close() {
    const websocket::close_reason reason(websocket::close_code::policy_error, reason_);
    socket_.async_close(reason, guarded([this](error_code) { end(); }));
  }

  void end() {
    WebSockets& sockets = *sockets_;
    disconnect();
    sockets.connections_.erase(shared_from_this());
  }

  WebSockets* sockets_;
  websocket::stream<beast::tcp_stream> socket_;
  boost::asio::steady_timer closing_timer_;
  beast::http::request<beast::http::string_body> request_;
  beast::flat_buffer buffer_;
  std::unique_ptr<StreamSession> session_;
  std::deque<Message> messages_;  // the first is being written
  std::size_t queued_ = 0;        // total bytes of `messages_`
  bool closing_ = false;
  std::string reason_;
};

WebSockets::WebSockets(Scope& scope, std::function<void(const std::exception&)> on_failure)
    : scope_(scope), on_failure_(std::move(on_failure)) {}

WebSockets::~WebSockets() {
  for (const auto& connection : connections_) connection->disconnect();
}

std::optional<Response> WebSockets::refuse() const {
  if (connections_.size() < most_clients) return std::nullopt;
  return error_response({503,
                         fmt::format("no further stream is possible: {} clients are connected", connections_.size()),
                         address, "close one of them"});
}

void WebSockets::accept(Upgrade&& upgrade) {
  const auto connection = std::make_shared<Connection>(*this, std::move(upgrade));
  connections_.insert(connection);
  connection->accept();
}

}  // namespace servodrome::api
