#include "links/serial_stream.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cerrno>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"
#include "links/pty.hpp"

namespace servodrome::links {
namespace {

using boost::system::error_code;

// A pty gives no event when a program opens it again, so it is polled at this interval.
constexpr int client_poll_ms = 10;
// Retry interval while the other end does not take the bytes.
constexpr auto full_port_wait = std::chrono::milliseconds(2);

// The two threads exchange packets over a pair of sockets. They share no lock: if the reading thread lost the processor
// while it holds the lock, the other thread would wait for it.
//
// A packet to the reading thread is an order: how many bytes to read, or `look` for the next program that opens the
// pty. A packet back is a report: one of the letters below, then the bytes that were read. The reading thread answers
// each order with one report, `opened`, `bytes_read` or `lost`. In addition it sends `reset` as soon as it gets the
// order `look`, and `gone` without an order.
using Order = std::uint32_t;
constexpr Order look = 0;
constexpr char opened = 'o';
constexpr char bytes_read = 'b';
constexpr char gone = 'g';   // the program has closed the port; what it has written can still be read
constexpr char lost = 'l';   // the program has closed the port, and everything is read
constexpr char reset = 'r';  // the bytes that the last program has not read are discarded

struct SocketPair {
  SocketPair() {
    std::array<int, 2> ends{};
    if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
      const std::error_code code(errno, std::generic_category());
      throw LinkError(code, fmt::format("cannot connect the thread that reads a serial port: {}; {}", code.message(),
                                        advice_for(code.value(), "end other programs")));
    }
    first.reset(ends[0]);
    second.reset(ends[1]);
  }

  FileDescriptor first;
  FileDescriptor second;
};

// The thread that reads. It ends when its socket, or the other end, is closed.
class Reader {
 public:
  // `pty`: null if `descriptor` is a tty.
  Reader(int descriptor, Pty* pty, FileDescriptor socket)
      : descriptor_(descriptor), pty_(pty), socket_(std::move(socket)), has_program_(pty == nullptr), thread_([this] {
          run();
        }) {}
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;
  ~Reader() {
    ::shutdown(socket_.get(), SHUT_RDWR);
    thread_.join();
  }

  // True from the moment before the thread takes bytes from the port until they are in the socket.
  bool moves_bytes() const { return moves_bytes_; }

 private:
  void run();
  bool take_order();
  void look_for_program();
  void read_bytes();
  void read_all();
  void end_session();
  void report(char what, std::string_view bytes = {}) {
    packet_[0] = what;
    std::copy(bytes.begin(), bytes.end(), packet_.begin() + 1);
    ::send(socket_.get(), packet_.data(), 1 + bytes.size(), MSG_NOSIGNAL);
  }

  int descriptor_;
  Pty* pty_;
  FileDescriptor socket_;
  Order order_ = look;
  bool is_busy_ = false;      // the order is not executed yet
  bool has_program_ = false;  // a program has the pty open, or the tty exists
  std::string backlog_;       // what a program wrote before it closed the port
  std::array<char, SerialStream::most_at_once> bytes_{};
  std::array<char, 1 + SerialStream::most_at_once> packet_{};
  std::atomic<bool> moves_bytes_ = false;
  std::thread thread_;
};

void Reader::run() {
  for (;;) {
    const bool looks = is_busy_ && order_ == look;
    const bool reads = is_busy_ && order_ != look;
    // Without POLLIN, poll() reports only that the other end is closed.
    std::array<pollfd, 2> entries{
        {{socket_.get(), POLLIN, 0}, {descriptor_, static_cast<short>(reads ? POLLIN : 0), 0}}};
    ::poll(entries.data(), has_program_ ? 2 : 1, looks ? client_poll_ms : -1);
    if (entries[0].revents != 0 && !take_order()) return;
    if (has_program_ && entries[1].revents != 0) {
      if (reads) {
        read_bytes();
      } else {
        read_all();
      }
    }
    if (is_busy_ && order_ == look) look_for_program();
    if (is_busy_ && order_ != look && (!has_program_ || !backlog_.empty())) {
      const std::string bytes = backlog_.substr(0, order_);
      backlog_.erase(0, bytes.size());
      is_busy_ = false;
      report(bytes.empty() ? lost : bytes_read, bytes);
      moves_bytes_ = !backlog_.empty();
    }
  }
}

bool Reader::take_order() {
  if (::recv(socket_.get(), &order_, sizeof order_, 0) != sizeof order_) return false;
  is_busy_ = true;
  if (order_ == look) {
    pty_->discard_unread();  // the owner may have written before it got the report `gone`
    report(reset);
  }
  return true;
}

void Reader::look_for_program() {
  if (!pty_->has_client()) return;
  has_program_ = true;
  is_busy_ = false;
  report(opened);
}

void Reader::read_bytes() {
  moves_bytes_ = true;
  const ssize_t size = ::read(descriptor_, bytes_.data(), order_);
  if (size > 0) {
    is_busy_ = false;
    report(bytes_read, {bytes_.data(), static_cast<std::size_t>(size)});
  } else if (size == 0 || (errno != EAGAIN && errno != EINTR)) {  // EIO: the other end is closed
    end_session();
  }
  moves_bytes_ = false;
}

// The program has closed the port while no order to read is pending. Reads the rest now, because otherwise the bytes of
// the next program would be taken for those of this one.
void Reader::read_all() {
  moves_bytes_ = true;
  for (;;) {
    const ssize_t size = ::read(descriptor_, bytes_.data(), bytes_.size());
    if (size > 0) {
      backlog_.append(bytes_.data(), static_cast<std::size_t>(size));
    } else if (size == 0 || (errno != EAGAIN && errno != EINTR)) {
      break;
    } else if (errno == EAGAIN) {
      moves_bytes_ = !backlog_.empty();
      return;  // another program has opened it already, and continues the session
    }
  }
  end_session();
  report(gone);
  moves_bytes_ = !backlog_.empty();
}

void Reader::end_session() {
  has_program_ = false;
  if (pty_ != nullptr) pty_->reset();
}

class TtyStream final : public SerialStream {
 public:
  // Exactly one of `tty` and `pty` is given.
  TtyStream(FileDescriptor tty, std::unique_ptr<Pty> pty, boost::asio::io_context& io, Owner& owner,
            SocketPair sockets = {})
      : pty_(std::move(pty)),
        tty_(std::move(tty)),
        descriptor_(pty_ ? pty_->master() : tty_.get()),
        owner_(owner),
        io_(io),
        retry_(io),
        reader_(descriptor_, pty_.get(), std::move(sockets.second)),
        socket_(io, sockets.first.release()),
        is_open_(!pty_) {
    if (pty_) give(look);
    wait_for_report();
  }
  TtyStream(const TtyStream&) = delete;
  TtyStream& operator=(const TtyStream&) = delete;
  ~TtyStream() override { *alive_ = false; }

  bool is_open() const override { return is_open_; }
  void read(std::size_t most) override {
    is_reading_ = true;
    give(static_cast<Order>(most));
  }
  void write(std::string_view bytes) override {
    if (!is_open_ || is_gone_) return;
    unwritten_ += bytes;
    if (!is_flush_due_) flush();
  }
  std::size_t unwritten() const override { return unwritten_.size(); }
  bool settled() override;

 private:
  void give(Order order) { ::send(socket_.native_handle(), &order, sizeof order, MSG_NOSIGNAL); }
  void wait_for_report();
  void handle_report(std::size_t size);
  void flush();

  std::unique_ptr<Pty> pty_;
  FileDescriptor tty_;
  int descriptor_;
  Owner& owner_;
  boost::asio::io_context& io_;
  boost::asio::steady_timer retry_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  Reader reader_;
  boost::asio::posix::stream_descriptor socket_;
  std::array<char, 1 + most_at_once> report_{};
  std::string unwritten_;
  bool is_open_;
  bool is_gone_ = false;  // the program has closed the port; the stream is open until everything is read
  bool had_program_ = false;
  bool is_reading_ = false;
  bool is_flush_due_ = false;
};

bool TtyStream::settled() {
  if (!is_open_) return !pty_ || !pty_->has_client();
  if (!is_reading_) return true;
  if (is_gone_) return false;  // on_bytes() or on_close() follows
  // Checks the places in the order in which bytes pass through them, so that no byte is missed.
  return !is_readable(descriptor_) && !reader_.moves_bytes() && !is_readable(socket_.native_handle());
}

void TtyStream::wait_for_report() {
  socket_.async_read_some(boost::asio::buffer(report_), [this, alive = alive_](error_code code, std::size_t size) {
    if (!*alive || code) return;
    handle_report(size);
    wait_for_report();
  });
}

void TtyStream::handle_report(std::size_t size) {
  switch (report_[0]) {
    case opened:
      is_open_ = had_program_ = true;
      is_gone_ = false;
      owner_.on_open();
      return;
    case bytes_read:
      is_reading_ = false;
      owner_.on_bytes({report_.data() + 1, size - 1});
      return;
    case gone:
      is_gone_ = true;
      unwritten_.clear();
      owner_.on_written();
      return;
    case lost:
      is_open_ = is_reading_ = false;
      unwritten_.clear();
      if (!pty_) return owner_.on_close();
      give(look);
      return;
    default:  // `reset`: no byte for the last program can reach the next one; also sent before the first program
      if (std::exchange(had_program_, false)) owner_.on_close();
  }
}

// Bytes that follow before the io_context has run other handlers are written together.
void TtyStream::flush() {
  while (!unwritten_.empty()) {
    const ssize_t written = ::write(descriptor_, unwritten_.data(), unwritten_.size());
    if (written > 0) {
      unwritten_.erase(0, static_cast<std::size_t>(written));
    } else if (written == 0 || errno == EAGAIN) {
      break;
    } else if (errno != EINTR) {
      unwritten_.clear();
    }
  }
  is_flush_due_ = true;
  const auto again = [this, alive = alive_] {
    if (!*alive) return;
    is_flush_due_ = false;
    if (!unwritten_.empty()) {
      flush();
    } else if (is_open_) {
      owner_.on_written();
    }
  };
  if (unwritten_.empty()) {
    boost::asio::post(io_, again);
    return;
  }
  retry_.expires_after(full_port_wait);
  retry_.async_wait([again](error_code /*code*/) { again(); });
}

}  // namespace

std::unique_ptr<SerialStream> open_tty_stream(FileDescriptor tty, boost::asio::io_context& io,
                                              SerialStream::Owner& owner) {
  return std::make_unique<TtyStream>(std::move(tty), nullptr, io, owner);
}

std::unique_ptr<SerialStream> open_adapter_stream(const std::string& path, boost::asio::io_context& io,
                                                  SerialStream::Owner& owner) {
  return std::make_unique<TtyStream>(FileDescriptor(), std::make_unique<Pty>(path), io, owner);
}

}  // namespace servodrome::links
