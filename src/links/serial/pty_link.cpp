#include "links/serial/pty_link.hpp"

#include <unistd.h>

#include "links/serial/system_links.hpp"

namespace servodrome::links {
namespace {

using boost::system::error_code;

// A pty gives no event when a client opens it again, so it is polled at this interval.
constexpr auto client_poll_time = std::chrono::milliseconds(10);

}  // namespace

PtyLink::PtyLink(const PtyName& name, SerialLine& line, boost::asio::io_context& io, LineHost& host)
    : PtyLink(name, std::make_unique<Pty>(name.path), line, io, host) {}

PtyLink::PtyLink(const PtyName& name, std::unique_ptr<Pty> pty, SerialLine& line, boost::asio::io_context& io,
                 LineHost& host)
    : StreamLink(::dup(pty->master()), line, io, host), name_(name), pty_(std::move(pty)) {
  wait_for_client();
}

void PtyLink::look_for_client() {
  if (pty_->has_client()) wait_for_client();
}

void PtyLink::wait_for_client() {
  if (is_open()) return;  // settled() has already found the client
  if (pty_->has_client()) {
    open();
    return;
  }
  timer().expires_after(client_poll_time);
  timer().async_wait([this, alive = alive()](error_code code) {
    if (*alive && !code) wait_for_client();
  });
}

void PtyLink::lost() {
  pty_->reset();
  wait_for_client();
}

std::unique_ptr<SerialLink> open_pty_link(const PtyName& name, SerialLine& line, boost::asio::io_context& io,
                                          LineHost& host) {
  return std::make_unique<PtyLink>(name, line, io, host);
}

}  // namespace servodrome::links
