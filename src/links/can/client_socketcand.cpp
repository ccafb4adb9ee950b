#include "links/can/client_socketcand.hpp"

#include <cerrno>
#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

struct AddressDeleter {
  void operator()(addrinfo* list) const { ::freeaddrinfo(list); }
};

// Returns 0, or the error that prevented the connection.
int connect_one(const addrinfo& address, FileDescriptor& socket, Deadline deadline) {
  socket.reset(::socket(address.ai_family, address.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, address.ai_protocol));
  if (!socket.is_open()) return errno;
  if (::connect(socket.get(), address.ai_addr, address.ai_addrlen) == 0) return 0;
  if (errno != EINPROGRESS) return errno;
  if (!wait_writable(socket.get(), deadline)) return ETIMEDOUT;
  int reason = 0;
  socklen_t size = sizeof reason;
  ::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &reason, &size);
  return reason;
}

}  // namespace

SocketcandClient::SocketcandClient(const SocketcandName& name, std::chrono::milliseconds timeout) : name_(name) {
  const Deadline deadline = std::chrono::steady_clock::now() + timeout;
  connect(deadline);
  expect("hi", "a greeting", deadline);
  write(fmt::format("< open {} >", name_.bus));
  expect("ok", fmt::format("an answer to the opening of bus \"{}\"", name_.bus), deadline);
  write("< rawmode >");
  expect("ok", "an answer to the raw mode request", deadline);
}

void SocketcandClient::connect(Deadline deadline) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* list = nullptr;
  const int failure = ::getaddrinfo(name_.host.c_str(), std::to_string(name_.port).c_str(), &hints, &list);
  const std::unique_ptr<addrinfo, AddressDeleter> addresses(list);
  if (failure != 0) {
    throw LinkError(std::make_error_code(std::errc::address_not_available),
                    fmt::format("cannot connect to \"{}\": host \"{}\" is unknown ({}); check the link name",
                                to_string(name_), name_.host, ::gai_strerror(failure)));
  }
  int reason = 0;
  for (const addrinfo* address = list; address != nullptr; address = address->ai_next) {
    reason = connect_one(*address, socket_, deadline);
    if (reason == 0) {
      const int on = 1;
      ::setsockopt(socket_.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
      return;
    }
  }
  const std::error_code code(reason, std::generic_category());
  throw LinkError(code, fmt::format("cannot connect to \"{}\": {}; {}", to_string(name_), code.message(),
                                    advice_for(reason, "is the line up (servodrome up) and the port right?")));
}

void SocketcandClient::lost(int reason) const {
  const std::error_code code(reason, std::generic_category());
  throw LinkError(code, fmt::format("the connection to \"{}\" is lost: {}; check that the line still runs",
                                    to_string(name_), code.message()));
}

void SocketcandClient::write(std::string_view text) {
  // MSG_NOSIGNAL: if the peer is gone, the result must be an error and not a SIGPIPE.
  const Deadline deadline = std::chrono::steady_clock::now() + send_timeout;
  while (!text.empty()) {
    const ssize_t sent = ::send(socket_.get(), text.data(), text.size(), MSG_NOSIGNAL);
    if (sent > 0) {
      text.remove_prefix(static_cast<std::size_t>(sent));
    } else if (errno != EAGAIN && errno != EINTR) {
      lost(errno);
    } else if (!wait_writable(socket_.get(), deadline)) {
      lost(ETIMEDOUT);
    }
  }
}

// Reads up to the end of the next element. Returns false if the deadline has passed.
bool SocketcandClient::next_element(Deadline deadline) {
  for (;;) {
    while (!unread_.empty()) {
      unread_.remove_prefix(reader_.feed(unread_));
      if (reader_.ready()) return true;
    }
    const ssize_t size = ::recv(socket_.get(), input_.data(), input_.size(), 0);
    if (size > 0) {
      unread_ = std::string_view(input_.data(), static_cast<std::size_t>(size));
    } else if (size == 0) {
      lost(ECONNRESET);
    } else if (errno != EAGAIN && errno != EINTR) {
      lost(errno);
    } else if (!wait_readable(socket_.get(), deadline)) {
      return false;
    }
  }
}

void SocketcandClient::expect(std::string_view word, std::string_view step, Deadline deadline) {
  if (!next_element(deadline)) {
    throw LinkError(std::make_error_code(std::errc::timed_out),
                    fmt::format("\"{}\" did not send {} in time; is there a socketcand server at this port?",
                                to_string(name_), step));
  }
  if (!socketcand::Words(reader_.element()).is(word)) {
    throw LinkError(std::make_error_code(std::errc::protocol_error),
                    fmt::format("\"{}\" did not send {} but answered \"{}\"; check host, port and bus",
                                to_string(name_), step, reader_.element()));
  }
}

void SocketcandClient::send(const canopen::Frame& frame) { write(socketcand::format_send(frame)); }

std::optional<canopen::Frame> SocketcandClient::receive(Time timeout) {
  const Deadline deadline = std::chrono::steady_clock::now() + timeout;
  while (next_element(deadline)) {
    const socketcand::Words words(reader_.element());
    if (!words.is("frame") && !words.is("rtr")) continue;
    if (const auto frame = socketcand::parse_frame(words)) return frame;
  }
  return std::nullopt;
}

}  // namespace servodrome::links
