#include "links/can/client_socketcand.hpp"

#include <cerrno>
#include <fmt/format.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"
#include "links/socket_addresses.hpp"

namespace servodrome::links {

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
  const SocketAddresses addresses = resolve({name_.host, name_.port}, Transport::tcp);
  if (addresses.unknown != nullptr) {
    throw LinkError(std::make_error_code(std::errc::address_not_available),
                    fmt::format("cannot connect to \"{}\": host \"{}\" is unknown ({}); check the link name",
                                to_string(name_), name_.host, addresses.unknown));
  }
  int reason = 0;
  socket_ = connect_tcp(addresses, deadline, reason);
  if (socket_.is_open()) return;
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
  const Deadline deadline = std::chrono::steady_clock::now() + send_timeout;
  while (!text.empty()) {
    const std::ptrdiff_t sent = send_some(socket_.get(), text.data(), text.size());
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
    const std::ptrdiff_t size = read_some(socket_.get(), input_.data(), input_.size());
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
