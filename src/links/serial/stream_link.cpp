#include "links/serial/stream_link.hpp"

#include <algorithm>
#include <boost/asio/write.hpp>

#include "links/file_descriptor.hpp"
#include "links/serial/tty.hpp"

namespace servodrome::links {
namespace {

using boost::system::error_code;

constexpr auto input_poll_time = std::chrono::milliseconds(2);
// Retry interval while the port's queue on the line is full.
constexpr auto full_line_wait = std::chrono::milliseconds(5);

}  // namespace

StreamLink::StreamLink(Descriptor descriptor, SerialLine& line, boost::asio::io_context& io, LineHost& host)
    : line_(line),
      host_(host),
      port_(line.attach(*this)),
      stream_(serial_stream(io, descriptor)),
      timer_(io),
      watch_(io) {}

StreamLink::~StreamLink() {
  *alive_ = false;
  line_.detach(port_);
}

// A client that has just opened the pty may already have written to it.
bool StreamLink::settled() {
  if (!is_open()) look_for_client();
  return !is_open() || !is_reading_ || !is_readable(descriptor_of(stream_));
}

void StreamLink::open() {
  counters_.clients = 1;
  read();
  if (stream_may_miss_input) watch_input();
}

// Polls the descriptor periodically during a read, because Asio may miss its input (stream_may_miss_input). Does
// nothing during a write, which cancel() would end as well.
void StreamLink::watch_input() {
  watch_.expires_after(input_poll_time);
  watch_.async_wait([this, alive = alive_](error_code code) {
    if (!*alive || code || !is_open()) return;
    if (is_reading_ && !is_writing_ && has_arrived(descriptor_of(stream_))) {
      error_code ignored;
      stream_.cancel(ignored);  // the read starts again and finds the bytes
    }
    watch_input();
  });
}

void StreamLink::read() {
  const std::size_t pending = line_.pending(port_);
  if (pending >= most_pending) {
    timer_.expires_after(full_line_wait);
    timer_.async_wait([this, alive = alive_](error_code code) {
      if (*alive && !code) read();
    });
    return;
  }
  is_reading_ = true;
  stream_.async_read_some(boost::asio::buffer(input_.data(), most_pending - pending),
                          [this, alive = alive_](error_code code, std::size_t size) {
                            if (!*alive) return;
                            is_reading_ = false;
                            if (code == boost::asio::error::operation_aborted) {
                              read();
                              return;
                            }
                            if (code) {  // EIO: the other end is closed
                              counters_.clients = 0;
                              waiting_.clear();
                              error_code ignored;
                              stream_.cancel(ignored);
                              lost();
                              return;
                            }
                            counters_.to_bus += size;
                            line_.transmit(port_, std::span(input_).first(size), host_.now());
                            host_.wake();
                            read();
                          });
}

void StreamLink::receive(std::uint8_t character, bool /*intact*/, Time /*at*/) {
  if (!is_open()) return;
  if (waiting_.size() + writing_.size() >= most_waiting_bytes) {
    ++counters_.dropped;
    return;
  }
  ++counters_.from_bus;
  waiting_.push_back(character);
  write();
}

void StreamLink::write() {
  if (is_writing_ || waiting_.empty()) return;
  is_writing_ = true;
  std::swap(writing_, waiting_);
  boost::asio::async_write(stream_, boost::asio::buffer(writing_),
                           [this, alive = alive_](error_code code, std::size_t) {
                             if (!*alive) return;
                             is_writing_ = false;
                             writing_.clear();
                             if (!code) write();  // otherwise the pending read fails as well and handles it
                           });
}

TtyLink::TtyLink(const TtyName& name, SerialLine& line, boost::asio::io_context& io, LineHost& host)
    : StreamLink(open_tty(name.device, line.format()).release(), line, io, host), name_(name) {
  open();
}

}  // namespace servodrome::links
