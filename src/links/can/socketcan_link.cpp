#include "links/can/socketcan_link.hpp"

#include <boost/asio/post.hpp>
#include <cerrno>
#include <linux/can.h>
#include <unistd.h>

#include "links/can/socketcan.hpp"
#include "links/can/system_links.hpp"
#include "links/file_descriptor.hpp"

namespace servodrome::links {
namespace {

using boost::system::error_code;

// No event shows that the interface's full transmit queue (ENOBUFS) has room again, so the link retries after this
// time.
constexpr auto write_retry_time = std::chrono::milliseconds(1);
// The link reads again after this time when the interface is down (ENETDOWN).
constexpr auto read_retry_time = std::chrono::milliseconds(200);

}  // namespace

SocketcanLink::SocketcanLink(const SocketcanName& name, CanBus& bus, boost::asio::io_context& io, LineHost& host)
    : name_(name),
      bus_(bus),
      host_(host),
      socket_(io, open_socketcan(name.interface).release()),
      port_(bus.attach(*this, link_queue_depth)),
      read_retry_(io),
      write_retry_(io) {
  counters_.clients = 1;
  wait_for_frames();
}

SocketcanLink::~SocketcanLink() {
  *alive_ = false;
  bus_.detach(port_);
}

bool SocketcanLink::settled() { return paused_ || !is_readable(socket_.native_handle()); }

void SocketcanLink::wait_for_frames() {
  socket_.async_wait(boost::asio::posix::stream_descriptor::wait_read, [this, alive = alive_](error_code code) {
    if (*alive && !code) read();
  });
}

void SocketcanLink::read() {
  for (;;) {
    if (bus_.queue_space(port_) == 0 && bus_.error_state(port_) == ErrorState::active) {
      paused_ = true;
      return;
    }
    can_frame wire{};
    const ssize_t size = ::read(socket_.native_handle(), &wire, sizeof wire);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0 && errno == EAGAIN) break;
    if (size < 0) {
      read_retry_.expires_after(read_retry_time);
      read_retry_.async_wait([this, alive = alive_](error_code code) {
        if (*alive && !code) wait_for_frames();
      });
      return;
    }
    canopen::Frame frame;
    if (size != sizeof wire || !from_socketcan(wire, frame)) continue;
    if (bus_.transmit(port_, frame, host_.now())) {
      ++counters_.to_bus;
      host_.wake();
    } else {
      ++counters_.refused;
    }
  }
  wait_for_frames();
}

void SocketcanLink::resume() {
  if (!paused_) return;
  paused_ = false;
  boost::asio::post(socket_.get_executor(), [this, alive = alive_] {
    if (*alive) read();
  });
}

void SocketcanLink::on_frame(const canopen::Frame& frame, Time /*at*/) {
  if (waiting_.size() == most_waiting_frames) {
    ++counters_.dropped;
    return;
  }
  waiting_.push_back(frame);
  if (!write_is_due_) write();
}

void SocketcanLink::on_sent(const canopen::Frame& /*frame*/, std::uint32_t /*tag*/, Time /*at*/) {
  if (bus_.queue_space(port_) >= link_queue_depth / 2) resume();
}

void SocketcanLink::on_error_state(ErrorState /*state*/, Time /*at*/) { resume(); }

void SocketcanLink::write() {
  while (!waiting_.empty()) {
    const can_frame wire = to_socketcan(waiting_.front());
    const ssize_t size = ::write(socket_.native_handle(), &wire, sizeof wire);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0 && (errno == EAGAIN || errno == ENOBUFS)) {
      write_is_due_ = true;
      write_retry_.expires_after(write_retry_time);
      write_retry_.async_wait([this, alive = alive_](error_code code) {
        if (!*alive || code) return;
        write_is_due_ = false;
        write();
      });
      return;
    }
    ++(size < 0 ? counters_.dropped : counters_.from_bus);
    waiting_.pop_front();
  }
}

std::unique_ptr<CanLink> open_socketcan_link(const SocketcanName& name, CanBus& bus, boost::asio::io_context& io,
                                             LineHost& host) {
  return std::make_unique<SocketcanLink>(name, bus, io, host);
}

}  // namespace servodrome::links
