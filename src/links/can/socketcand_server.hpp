#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <memory>
#include <string>
#include <vector>

#include "links/accept_loop.hpp"
#include "links/can/link.hpp"

namespace servodrome::links {

// `socketcand:HOST:PORT/BUS`: serves the bus to up to 32 TCP clients in socketcand's raw mode. All clients share one
// port of the bus, like programs that share a computer's CAN interface. When a client's frame has been sent, the other
// clients receive it. The server sends no UDP beacon: clients must know its address.
//
// The port takes part in the bus and acknowledges frames even if no client is connected.
//
// Each client has its own queue. The queues take turns frame by frame, so a client that sends without pause delays each
// frame of another client by only one frame.
//
// A client that does not read loses frames when more than 256 KiB wait for it; the line never waits for it. When all
// places are in use, a new client replaces the one that has sent nothing for longest, if that is at least 2 s
// (client_patience).
class SocketcandServer final : public CanLink, private Receiver {
 public:
  static constexpr std::size_t most_clients = 32;
  static constexpr std::size_t most_waiting_bytes = 256 * 1024;

  SocketcandServer(const SocketcandName& name, CanBus& bus, boost::asio::io_context& io, LineHost& host);
  ~SocketcandServer() override;
  SocketcandServer(const SocketcandServer&) = delete;
  SocketcandServer& operator=(const SocketcandServer&) = delete;

  PortId port() const override { return port_; }
  std::string name() const override { return to_string(name_); }
  const LinkCounters& counters() const override { return counters_; }
  bool settled() override;

 private:
  class Client;
  struct Queue;
  using Moment = std::chrono::steady_clock::time_point;

  void on_frame(const canopen::Frame& frame, Time at) override;
  void on_sent(const canopen::Frame& frame, std::uint32_t tag, Time at) override;
  void on_error_state(ErrorState state, Time at) override;
  void resume();
  void queue(Queue& queue, const canopen::Frame& frame);
  void feed();
  void show(const canopen::Frame& frame, Time at, std::uint32_t except);
  void accept(boost::asio::ip::tcp::socket&& socket);
  bool make_room();
  void remove(Client& client);

  SocketcandName name_;
  CanBus& bus_;
  LineHost& host_;
  AcceptLoop accept_loop_;
  PortId port_;
  std::vector<std::shared_ptr<Client>> clients_;
  std::vector<std::shared_ptr<Queue>> queues_;
  std::size_t turn_ = 0;                  // index of the queue that sent last
  std::uint32_t last_client_number_ = 0;  // 0 is never a client's number
  LinkCounters counters_;
};

}  // namespace servodrome::links
