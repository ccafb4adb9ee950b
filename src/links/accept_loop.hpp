#pragma once

#include <algorithm>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <vector>

namespace servodrome::links {

// Accepts the connections of a listening socket, one after the other, in the thread of the socket's executor. Accepting
// fails usually because the process has no file descriptors left; the loop then waits for `retry_time` and accepts
// again, instead of retrying without end. The destructor ends the loop.
class AcceptLoop {
 public:
  using Accepted = std::function<void(boost::asio::ip::tcp::socket&& socket)>;
  using Failed = std::function<void(const boost::system::error_code& why)>;

  AcceptLoop(boost::asio::ip::tcp::acceptor acceptor, std::chrono::milliseconds retry_time);
  ~AcceptLoop();
  AcceptLoop(const AcceptLoop&) = delete;
  AcceptLoop& operator=(const AcceptLoop&) = delete;

  // `accepted` receives each connection; a socket that it does not keep is closed. `failed` is called before the loop
  // waits.
  void start(Accepted accepted, Failed failed = {});
  // The actual port, also if the requested port was 0.
  std::uint16_t port() const;

 private:
  void accept();

  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer retry_;
  std::chrono::milliseconds retry_time_;
  Accepted accepted_;
  Failed failed_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

// Time between attempts to accept a client of a link.
inline constexpr auto accept_retry_time = std::chrono::milliseconds(200);
// When all places are in use, a new client replaces one that has been silent for at least this time.
inline constexpr auto client_patience = std::chrono::seconds(2);

// Returns the client that has been silent for longest, by its silent_since(), if that is at least client_patience; else
// nullptr. `clients` must not be empty.
template <typename Client>
std::shared_ptr<Client> find_silent(const std::vector<std::shared_ptr<Client>>& clients) {
  const auto silent_longer = [](const auto& a, const auto& b) { return a->silent_since() < b->silent_since(); };
  const auto client = std::min_element(clients.begin(), clients.end(), silent_longer);
  if (std::chrono::steady_clock::now() - (*client)->silent_since() < client_patience) return nullptr;
  return *client;
}

}  // namespace servodrome::links
