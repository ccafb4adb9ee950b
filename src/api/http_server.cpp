#include "api/http_server.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <fmt/format.h>

#include "api/http_connection.hpp"
#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"

namespace servodrome::api {
namespace {

using boost::asio::ip::tcp;
using boost::system::error_code;

// When accepting fails, usually no file descriptors are left: the server frees one and accepts again after this time.
constexpr auto retry_time = std::chrono::milliseconds(100);

[[noreturn]] void cannot_listen(const std::string& address, std::uint16_t port, const error_code& code) {
  std::string advice = "the address must be one of this computer, such as 127.0.0.1";
  if (code == boost::asio::error::address_in_use) {
    advice = "another program has this port; stop it or choose another with --api ADDRESS:PORT";
  } else if (code == boost::asio::error::access_denied) {
    advice = "choose a port above 1023";
  }
  throw links::LinkError(std::error_code(code.value(), std::system_category()),
                         fmt::format("bench API: cannot listen on {}:{}: {}; {}", address, port, code.message(),
                                     links::advice_for(code.value(), advice)));
}

tcp::acceptor listen_at(boost::asio::io_context& io, const std::string& address, std::uint16_t port) {
  error_code code;
  const auto host = boost::asio::ip::make_address(address == "localhost" ? "127.0.0.1" : address, code);
  if (code) cannot_listen(address, port, code);
  const tcp::endpoint endpoint(host, port);
  tcp::acceptor acceptor(io);
  acceptor.open(endpoint.protocol(), code);
  if (!code) acceptor.set_option(tcp::acceptor::reuse_address(true), code);
  if (!code) acceptor.bind(endpoint, code);
  if (!code) acceptor.listen(tcp::acceptor::max_listen_connections, code);
  if (code) cannot_listen(address, port, code);
  return acceptor;
}

}  // namespace

HttpServer::HttpServer(boost::asio::io_context& io, const std::string& address, std::uint16_t port, Access access,
                       HttpHandlers handlers)
    : accept_loop_(listen_at(io, address, port), retry_time),
      access_(std::move(access)),
      handlers_(std::move(handlers)) {
  accept_loop_.start([this](tcp::socket&& socket) { accept(std::move(socket)); },
                     [this](const error_code& why) {
                       if (why == boost::asio::error::no_descriptors) make_room();
                     });
}

HttpServer::~HttpServer() {
  for (const auto& connection : connections_) connection->disconnect();
}

// Makes room for a new connection by ending one whose client sends nothing or does not receive its response. A download
// that makes progress is not ended.
bool HttpServer::make_room() {
  const auto waits_longer = [](const auto& a, const auto& b) {
    if (!a->dispensable_from() || !b->dispensable_from()) return a->dispensable_from().has_value();
    return *a->dispensable_from() < *b->dispensable_from();
  };
  const auto longest = std::min_element(connections_.begin(), connections_.end(), waits_longer);
  if (longest == connections_.end()) return false;
  const auto from = (*longest)->dispensable_from();
  if (!from || *from > std::chrono::steady_clock::now()) return false;
  (*longest)->disconnect();
  connections_.erase(longest);
  return true;
}

void HttpServer::count_failure(const std::exception& error) {
  ++failures_;
  if (!std::has_single_bit(failures_) || !handlers_.report) return;
  handlers_.report(fmt::format(
      "bench API: an exception ended a connection ({} so far): {}; please report it with the request that caused it",
      failures_, error.what()));
}

void HttpServer::accept(tcp::socket&& socket) {
  if (connections_.size() == most_connections && !make_room()) return;  // the caller closes the socket
  const auto connection = std::make_shared<HttpConnection>(*this, std::move(socket));
  connections_.insert(connection);
  connection->read();
}

}  // namespace servodrome::api
