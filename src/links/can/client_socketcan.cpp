#include "links/can/client_socketcan.hpp"

#include <cerrno>
#include <fmt/format.h>
#include <linux/can.h>
#include <poll.h>
#include <unistd.h>

#include "links/can/socketcan.hpp"
#include "links/can/system_links.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {

SocketcanClient::SocketcanClient(const SocketcanName& name) : name_(name), socket_(open_socketcan(name.interface)) {}

void SocketcanClient::lost(int reason) const {
  const std::error_code code(reason, std::generic_category());
  throw LinkError(code, fmt::format("\"socketcan:{0}\" fails: {1}; is the interface up (ip link set {0} up)?",
                                    name_.interface, code.message()));
}

void SocketcanClient::send(const canopen::Frame& frame) {
  const Deadline deadline = std::chrono::steady_clock::now() + send_timeout;
  const can_frame wire = to_socketcan(frame);
  while (::write(socket_.get(), &wire, sizeof wire) < 0) {
    const int reason = errno;
    if (reason == EINTR) continue;
    if (reason != EAGAIN && reason != ENOBUFS) lost(reason);
    if (std::chrono::steady_clock::now() >= deadline) lost(ETIMEDOUT);
    // No event shows that the interface's full queue (ENOBUFS) has room again, so retry after 1 ms.
    ::poll(nullptr, 0, 1);
  }
}

std::optional<canopen::Frame> SocketcanClient::receive(Time timeout) {
  const Deadline deadline = std::chrono::steady_clock::now() + timeout;
  for (;;) {
    can_frame wire{};
    const ssize_t size = ::read(socket_.get(), &wire, sizeof wire);
    canopen::Frame frame;
    if (size == sizeof wire && from_socketcan(wire, frame)) return frame;
    if (size >= 0 || errno == EINTR) continue;
    if (errno != EAGAIN) lost(errno);
    if (!wait_readable(socket_.get(), deadline)) return std::nullopt;
  }
}

std::unique_ptr<CanClient> open_socketcan_client(const SocketcanName& name) {
  return std::make_unique<SocketcanClient>(name);
}

}  // namespace servodrome::links
