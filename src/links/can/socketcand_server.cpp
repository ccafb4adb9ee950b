#include "links/can/socketcand_server.hpp"

#include <algorithm>
#include <array>
#include <boost/asio/post.hpp>
#include <boost/asio/write.hpp>
#include <deque>
#include <fmt/format.h>
#include <utility>

#include "links/can/socketcand_protocol.hpp"
#include "links/guarded.hpp"
#include "links/listen.hpp"
#include "links/socket_options.hpp"

namespace servodrome::links {
namespace {

using boost::asio::ip::tcp;
using boost::system::error_code;

// python-can expects the `< ok >` that answers `< rawmode >` in a read of its own, and fails if a frame follows in the
// same read. So frames are held back until the client's next command shows that it has read the answer, or for this
// time.
constexpr auto rawmode_quiet_time = std::chrono::milliseconds(50);
// Limits the system's buffer, so that a slow reader receives recent frames.
constexpr int socket_send_buffer_bytes = 64 * 1024;
// Limit for each client, beside the frame in the controller.
constexpr std::size_t most_queued = link_queue_depth - 1;

}  // namespace

// The frames that a client has sent and that are not on the wire yet. The queue outlives the client, because a program
// may send a frame and exit.
struct SocketcandServer::Queue {
  struct Waiting {
    canopen::Frame frame;
    Time since{};
  };
  explicit Queue(std::uint32_t its_client) : client(its_client) {}
  std::uint32_t client;  // number of the client
  bool is_open = true;   // the client is connected
  std::deque<Waiting> frames;
};

class SocketcandServer::Client : public std::enable_shared_from_this<Client> {
 public:
  Client(SocketcandServer& server, tcp::socket socket, std::shared_ptr<Queue> queue)
      : server_(&server), socket_(std::move(socket)), quiet_(socket_.get_executor()), queue_(std::move(queue)) {}

  std::uint32_t number() const { return queue_->client; }
  // When the client last sent something.
  Moment silent_since() const { return silent_since_; }
  // Returns true if the client receives frames of the bus (its quiet time is over), and the server has read everything
  // that the client wrote or reads nothing now.
  bool settled() const {
    error_code ignored;
    return !is_quiet_ && !(reading_ && socket_.available(ignored) > 0);
  }

  void start() {
    reply("hi");
    read();
  }

  void show(const std::string& text) {
    if (mode_ != Mode::raw) return;
    if (held_.size() + waiting_.size() + writing_.size() + text.size() > most_waiting_bytes) {
      ++server_->counters_.dropped;
      return;
    }
    ++server_->counters_.from_bus;
    (is_quiet_ ? held_ : waiting_) += text;
    write();
  }

  // Called when the client's queue may have room again or the controller's error state has changed.
  void resume() {
    if (!paused_ || must_wait()) return;
    paused_ = false;
    boost::asio::post(socket_.get_executor(), guarded(shared_from_this(), [this] { work(); }));
  }

  bool is_open() const { return server_ != nullptr; }
  void fail(const std::exception& error) {
    server_->host_.report(
        fmt::format("CAN link \"{}\": an exception ended a connection: {}", server_->name(), error.what()));
    close();
  }

  // The client must not use the server after this.
  void disconnect() {
    server_ = nullptr;
    queue_->is_open = false;
    error_code ignored;
    socket_.close(ignored);
    quiet_.cancel();
  }

 private:
  enum class Mode : std::uint8_t { no_bus, bcm, raw };

  void read() {
    if (reading_) return;
    reading_ = true;
    socket_.async_read_some(boost::asio::buffer(input_),
                            guarded(shared_from_this(), [this](error_code code, std::size_t size) {
                              reading_ = false;
                              if (code) {
                                close();
                                return;
                              }
                              acknowledge_at_once(socket_);
                              silent_since_ = std::chrono::steady_clock::now();
                              unread_ = std::string_view(input_.data(), size);
                              work();
                            }));
  }

  // Processes the bytes that have been read. It reads more when all are processed, and neither the bus queue nor the
  // client's output is full.
  void work() {
    while (server_ != nullptr && !paused_ && !unread_.empty()) {
      if (waiting_.size() > most_waiting_bytes) return;  // the client does not read; the end of the write calls work()
      if (must_wait()) {
        paused_ = true;
        return;
      }
      unread_.remove_prefix(reader_.feed(unread_));
      if (reader_.oversized() != oversized_) {
        oversized_ = reader_.oversized();
        refuse("an element is longer than 256 characters");
      }
      if (reader_.ready()) execute(socketcand::Words(reader_.element()));
    }
    if (server_ != nullptr && unread_.empty() && !closing_) read();
  }

  bool must_wait() const {
    return queue_->frames.size() >= most_queued && server_->bus_.error_state(server_->port_) == ErrorState::active;
  }

  void execute(const socketcand::Words& words) {
    if (closing_ || words.count == 0) return;
    end_quiet_time();
    if (words.is("echo")) {
      reply("echo");
    } else if (mode_ == Mode::no_bus) {
      open(words);
    } else if (words.is("rawmode")) {
      mode_ = Mode::raw;
      reply("ok");
      begin_quiet_time();
    } else if (words.is("bcmmode")) {
      mode_ = Mode::bcm;
      reply("ok");
    } else if (words.is("send") || words.is("sendrtr")) {
      send(words);
    } else {
      refuse(
          fmt::format("command \"{}\" is not supported, use rawmode, send and sendrtr", words.word[0].substr(0, 20)));
    }
  }

  void open(const socketcand::Words& words) {
    const std::string& bus = server_->name_.bus;
    if (words.is("open") && words.count == 2 && words.word[1] == bus) {
      mode_ = Mode::bcm;
      reply("ok");
    } else if (words.is("open")) {
      refuse(fmt::format("could not open bus, the one here is {}", bus));
      closing_ = true;  // the protocol requires it; the answer is written first
    } else {
      refuse(fmt::format("no bus is open, begin with: open {}", bus));
    }
  }

  void send(const socketcand::Words& words) {
    const auto frame = socketcand::parse_send(words);
    if (!frame) {
      refuse("send takes an identifier of 3 or 8 hexadecimal digits, a length from 0 to 8 and as many bytes");
      return;
    }
    server_->queue(*queue_, *frame);
  }

  void reply(std::string_view words) {
    waiting_ += fmt::format("< {} >", words);
    write();
  }

  void refuse(std::string_view reason) {
    ++server_->counters_.malformed;
    reply(fmt::format("error {}", reason));
  }

  void begin_quiet_time() {
    is_quiet_ = true;
    quiet_.expires_after(rawmode_quiet_time);
    quiet_.async_wait(guarded(shared_from_this(), [this](error_code code) {
      if (!code) end_quiet_time();
    }));
  }

  void end_quiet_time() {
    if (!is_quiet_) return;
    is_quiet_ = false;
    quiet_.cancel();
    waiting_ += std::exchange(held_, {});
    write();
  }

  void write() {
    if (!writing_.empty()) return;
    if (waiting_.empty()) {
      if (closing_) close();
      return;
    }
    std::swap(writing_, waiting_);
    boost::asio::async_write(socket_, boost::asio::buffer(writing_),
                             guarded(shared_from_this(), [this](error_code code, std::size_t) {
                               if (code) {
                                 close();
                                 return;
                               }
                               writing_.clear();
                               write();
                               work();
                             }));
    acknowledge_at_once(socket_);  // sending has switched the immediate acknowledge off
  }

  void close() {
    if (server_ != nullptr) server_->remove(*this);
  }

  SocketcandServer* server_;
  tcp::socket socket_;
  boost::asio::steady_timer quiet_;
  std::shared_ptr<Queue> queue_;
  Moment silent_since_ = std::chrono::steady_clock::now();
  Mode mode_ = Mode::no_bus;
  bool reading_ = false;
  bool paused_ = false;
  bool closing_ = false;
  bool is_quiet_ = false;
  std::array<char, 4096> input_{};
  std::string_view unread_;
  socketcand::ElementReader reader_;
  std::uint64_t oversized_ = 0;
  std::string writing_;
  std::string waiting_;
  std::string held_;  // frames held back during the quiet time
};

SocketcandServer::SocketcandServer(const SocketcandName& name, CanBus& bus, boost::asio::io_context& io, LineHost& host)
    : name_(name),
      bus_(bus),
      host_(host),
      accept_loop_(listen_at(io, {name.host, name.port}, to_string(name)), accept_retry_time),
      port_(bus.attach(*this)) {
  name_.port = accept_loop_.port();
  accept_loop_.start([this](tcp::socket&& socket) { accept(std::move(socket)); });
}

SocketcandServer::~SocketcandServer() {
  for (const auto& client : clients_) client->disconnect();
  bus_.detach(port_);
}

void SocketcandServer::accept(tcp::socket&& socket) {
  error_code ignored;
  serve_promptly(socket);
  socket.set_option(boost::asio::socket_base::send_buffer_size(socket_send_buffer_bytes), ignored);
  if (clients_.size() == most_clients && !make_room()) {
    socket.non_blocking(true, ignored);
    socket.write_some(boost::asio::buffer(std::string_view("< error too many clients >")), ignored);
    return;  // the caller closes the socket
  }
  if (++last_client_number_ == 0) ++last_client_number_;
  queues_.push_back(std::make_shared<Queue>(last_client_number_));
  clients_.push_back(std::make_shared<Client>(*this, std::move(socket), queues_.back()));
  counters_.clients = static_cast<std::uint32_t>(clients_.size());
  clients_.back()->start();
  host_.wake();  // drives' frames now have a receiver, so the line sleeps less
}

bool SocketcandServer::make_room() {
  const std::shared_ptr<Client> client = find_silent(clients_);
  if (client) remove(*client);
  return client != nullptr;
}

void SocketcandServer::remove(Client& client) {
  client.disconnect();
  const auto is_it = [&client](const std::shared_ptr<Client>& other) { return other.get() == &client; };
  clients_.erase(std::remove_if(clients_.begin(), clients_.end(), is_it), clients_.end());
  feed();
  counters_.clients = static_cast<std::uint32_t>(clients_.size());
}

void SocketcandServer::on_frame(const canopen::Frame& frame, Time at) { show(frame, at, 0); }

void SocketcandServer::on_sent(const canopen::Frame& frame, std::uint32_t tag, Time at) {
  show(frame, at, tag);
  feed();
  resume();
}

// At bus-off the frames that wait behind the controller are lost, like the one in it.
void SocketcandServer::on_error_state(ErrorState state, Time /*at*/) {
  if (state == ErrorState::bus_off) {
    for (const auto& queue : queues_) counters_.refused += std::exchange(queue->frames, {}).size();
  }
  resume();
}

void SocketcandServer::resume() {
  for (const auto& client : clients_) client->resume();
}

bool SocketcandServer::settled() {
  return std::all_of(clients_.begin(), clients_.end(), [](const auto& client) { return client->settled(); });
}

void SocketcandServer::queue(Queue& queue, const canopen::Frame& frame) {
  if (queue.frames.size() >= most_queued || bus_.error_state(port_) == ErrorState::bus_off) {
    ++counters_.refused;
    return;
  }
  ++counters_.to_bus;
  queue.frames.push_back({frame, host_.now()});
  feed();
  host_.wake();
}

// Passes frames to the controller one at a time, in turn from each client's queue (round robin).
void SocketcandServer::feed() {
  for (std::size_t looked = 0; looked < queues_.size() && bus_.pending(port_) == 0;) {
    turn_ = (turn_ + 1) % queues_.size();
    Queue& next = *queues_[turn_];
    if (next.frames.empty()) {
      ++looked;
      continue;
    }
    const Queue::Waiting waiting = next.frames.front();
    next.frames.pop_front();
    if (!bus_.transmit(port_, waiting.frame, waiting.since, next.client)) ++counters_.refused;
    looked = 0;
  }
  std::erase_if(queues_, [](const auto& queue) { return !queue->is_open && queue->frames.empty(); });
}

void SocketcandServer::show(const canopen::Frame& frame, Time at, std::uint32_t except) {
  if (clients_.empty()) return;
  const std::string text = socketcand::format_frame(frame, at + host_.epoch());
  for (const auto& client : clients_) {
    if (client->number() != except) client->show(text);
  }
}

}  // namespace servodrome::links
