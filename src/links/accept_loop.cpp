#include "links/accept_loop.hpp"

#include <utility>

namespace servodrome::links {

using boost::asio::ip::tcp;
using boost::system::error_code;

AcceptLoop::AcceptLoop(tcp::acceptor acceptor, std::chrono::milliseconds retry_time)
    : acceptor_(std::move(acceptor)), retry_(acceptor_.get_executor()), retry_time_(retry_time) {}

AcceptLoop::~AcceptLoop() { *alive_ = false; }

void AcceptLoop::start(Accepted accepted, Failed failed) {
  accepted_ = std::move(accepted);
  failed_ = std::move(failed);
  accept();
}

std::uint16_t AcceptLoop::port() const {
  error_code ignored;
  return acceptor_.local_endpoint(ignored).port();
}

void AcceptLoop::accept() {
  acceptor_.async_accept([this, alive = alive_](error_code code, tcp::socket socket) {
    if (!*alive || code == boost::asio::error::operation_aborted) return;
    if (!code) {
      accepted_(std::move(socket));
      accept();
      return;
    }
    if (failed_) failed_(code);
    retry_.expires_after(retry_time_);
    retry_.async_wait([this, alive](error_code cancelled) {
      if (*alive && !cancelled) accept();
    });
  });
}

}  // namespace servodrome::links
