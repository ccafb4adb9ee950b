#include "links/serial/modbus_tcp_listener.hpp"

#include <algorithm>
#include <array>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/write.hpp>
#include <fmt/format.h>

#include "links/guarded.hpp"
#include "links/listen.hpp"
#include "links/socket_options.hpp"

namespace servodrome::links {

using boost::asio::ip::tcp;
using boost::system::error_code;

class ModbusTcpListener::Client : public std::enable_shared_from_this<Client> {
 public:
  Client(ModbusTcpListener& listener, tcp::socket socket)
      : listener_(&listener), socket_(std::move(socket)), connection_(listener.units_), late_(socket_.get_executor()) {}

  void read() {
    is_reading_ = true;
    socket_.async_read_some(boost::asio::buffer(input_),
                            guarded(shared_from_this(), [this](error_code code, std::size_t size) {
                              is_reading_ = false;
                              if (code) {
                                close();
                                return;
                              }
                              acknowledge_at_once(socket_);
                              silent_since_ = std::chrono::steady_clock::now();
                              unread_ = std::span<const std::uint8_t>(input_).first(size);
                              work();
                            }));
  }

  // When the client last sent something.
  Moment silent_since() const { return silent_since_; }
  // Returns true if the server has read everything that the client wrote, or reads nothing now because answers wait.
  bool settled() const {
    error_code ignored;
    return !is_reading_ || socket_.available(ignored) == 0;
  }

  bool is_open() const { return listener_ != nullptr; }
  void fail(const std::exception& error) {
    listener_->host_.report(
        fmt::format("serial link \"{}\": an exception ended a connection: {}", listener_->name(), error.what()));
    close();
  }

  // Ends the connection, but not at once, because this object may be processing a request.
  void end_soon() {
    boost::asio::post(socket_.get_executor(), guarded(shared_from_this(), [this] { close(); }));
  }

  // The client must not use the listener after this.
  void disconnect() {
    listener_ = nullptr;
    late_.cancel();
    error_code ignored;
    socket_.close(ignored);
  }

 private:
  // Processes the bytes that have been read. It pauses while the client does not read its responses, and reads more
  // when all bytes are processed.
  void work() {
    if (is_late_) return;
    LinkCounters& counters = listener_->counters_;
    while (!unread_.empty() && waiting_.size() < most_waiting_bytes && !connection_.is_broken() && !is_closing_) {
      const std::size_t taken = connection_.receive(unread_);
      ModbusTcpInterposer* const interposer = listener_->line_.tcp_interposer();
      const bool is_observed = listener_->line_.is_observed();
      if (is_observed || interposer != nullptr)
        request_.insert(request_.end(), unread_.begin(), unread_.begin() + static_cast<std::ptrdiff_t>(taken));
      unread_ = unread_.subspan(taken);
      const auto response = connection_.take();
      if (response.empty()) continue;
      if (is_observed) listener_->line_.passed_by(SerialSender::master, request_);
      ++counters.to_bus;
      listener_->host_.wake();
      if (interposer != nullptr) {
        reply_ = interposer->answers(std::exchange(request_, {}), response, listener_->line_.now());
        if (reply_.delay > Time{}) {
          reply_later();
          return;
        }
        give_reply();
        if (is_late_) return;
      } else {
        request_.clear();
        give(response);
      }
    }
    if (connection_.is_broken() && !is_closing_) {
      ++counters.malformed;
      is_closing_ = true;
    }
    const bool is_done = unread_.empty() && !is_closing_;
    write();
    if (is_done && listener_ != nullptr) read();
  }

  void give(std::span<const std::uint8_t> response) {
    if (response.empty()) return;
    if (listener_->line_.is_observed()) listener_->line_.passed_by(SerialSender::drive, response);
    ++listener_->counters_.from_bus;
    waiting_.insert(waiting_.end(), response.begin(), response.end());
  }
  void give_reply() {
    give(reply_.bytes);
    if (reply_.then.empty()) {
      is_closing_ = is_closing_ || reply_.closes;
      return;
    }
    reply_.bytes = std::move(reply_.then.front().characters);
    reply_.delay = reply_.then.front().pause;
    reply_.then.erase(reply_.then.begin());
    reply_later();
  }
  // Until the reply is due, no request of the client is processed and nothing is read.
  void reply_later() {
    is_late_ = true;
    write();
    late_.expires_after(reply_.delay);
    late_.async_wait(guarded(shared_from_this(), [this](error_code code) {
      if (code) return;
      is_late_ = false;
      give_reply();
      work();
    }));
  }

  void write() {
    if (is_writing_) return;
    if (waiting_.empty()) {
      if (is_closing_) close();
      return;
    }
    is_writing_ = true;
    std::swap(writing_, waiting_);
    boost::asio::async_write(socket_, boost::asio::buffer(writing_),
                             guarded(shared_from_this(), [this](error_code code, std::size_t) {
                               is_writing_ = false;
                               writing_.clear();
                               if (code) {
                                 close();
                               } else if (unread_.empty() || is_closing_) {
                                 write();
                               } else {
                                 work();
                               }
                             }));
    acknowledge_at_once(socket_);  // sending has switched the immediate acknowledge off
  }

  void close() {
    if (listener_ != nullptr) listener_->remove(*this);
  }

  ModbusTcpListener* listener_;
  tcp::socket socket_;
  modbus::TcpConnection connection_;
  std::array<std::uint8_t, 4096> input_{};
  std::span<const std::uint8_t> unread_;
  std::vector<std::uint8_t> request_;  // the request received so far, for observers and the interposer
  TcpReply reply_;                     // of the interposer
  boost::asio::steady_timer late_;     // until `reply_` is due
  std::vector<std::uint8_t> writing_;
  std::vector<std::uint8_t> waiting_;
  Moment silent_since_ = std::chrono::steady_clock::now();
  bool is_reading_ = false;
  bool is_writing_ = false;
  bool is_closing_ = false;
  bool is_late_ = false;
};

ModbusTcpListener::ModbusTcpListener(const ModbusTcpName& name, SerialLine& line, modbus::Units& units,
                                     boost::asio::io_context& io, LineHost& host)
    : name_(name),
      line_(line),
      units_(units),
      host_(host),
      accept_loop_(listen_at(io, name.endpoint, to_string(name)), accept_retry_time) {
  name_.endpoint.port = accept_loop_.port();
  accept_loop_.start([this](tcp::socket&& socket) { accept(std::move(socket)); });
}

ModbusTcpListener::~ModbusTcpListener() {
  for (const auto& client : clients_) client->disconnect();
}

void ModbusTcpListener::accept(tcp::socket&& socket) {
  if (clients_.size() == most_clients && !make_room()) return;  // the caller closes the socket
  using Admission = ModbusTcpInterposer::Admission;
  ModbusTcpInterposer* const interposer = line_.tcp_interposer();
  const Admission admission = interposer != nullptr ? interposer->connects() : Admission::serve;
  if (admission == Admission::reset) {
    error_code ignored;
    socket.set_option(boost::asio::socket_base::linger(true, 0), ignored);
    socket.close(ignored);  // resets the connection; the destructor would not
  }
  if (admission == Admission::close || admission == Admission::reset) return;
  serve_promptly(socket);
  clients_.push_back(std::make_shared<Client>(*this, std::move(socket)));
  counters_.clients = static_cast<std::uint32_t>(clients_.size());
  if (admission == Admission::serve) clients_.back()->read();
}

bool ModbusTcpListener::make_room() {
  const std::shared_ptr<Client> client = find_silent(clients_);
  if (client) remove(*client);
  return client != nullptr;
}

bool ModbusTcpListener::settled() {
  return std::all_of(clients_.begin(), clients_.end(), [](const auto& client) { return client->settled(); });
}

void ModbusTcpListener::end_connections() {
  for (const auto& client : clients_) client->end_soon();
}

void ModbusTcpListener::remove(const Client& client) {
  const auto place = std::find_if(clients_.begin(), clients_.end(),
                                  [&client](const std::shared_ptr<Client>& other) { return other.get() == &client; });
  if (place == clients_.end()) return;
  const std::shared_ptr<Client> kept = *place;
  clients_.erase(place);
  counters_.clients = static_cast<std::uint32_t>(clients_.size());
  kept->disconnect();
}

}  // namespace servodrome::links
