#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <string>
#include <vector>

#include "links/can/link.hpp"

namespace servodrome::links {

// `socketcand:HOST:PORT/BUS`: serves the bus to any number of TCP clients (at most 32) in socketcand's raw mode. All of
// them share one port, as programs on one computer share its CAN interface; a client's frame is shown to the others
// once it has been sent. There is no UDP beacon: clients know the address of the bus.
//
// The port takes part in the bus, and acknowledges, also while no client is connected.
//
// Each client has a queue of its own, and they take turns frame by frame: what one sends without pause holds up the
// frames of the others by one frame each.
//
// A client that does not read loses frames (256 KiB may wait for it), never the line its time. When all places are
// taken, the client that has sent nothing for longest makes room, if that is some seconds.
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
  void accept();
  bool make_room();
  void remove(Client& client);

  SocketcandName name_;
  CanBus& bus_;
  LineHost& host_;
  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer accept_retry_;
  PortId port_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::vector<std::shared_ptr<Client>> clients_;
  std::vector<std::shared_ptr<Queue>> queues_;
  std::size_t turn_ = 0;                  // of the queue that has sent last
  std::uint32_t last_client_number_ = 0;  // 0: no client's
  LinkCounters counters_;
};

}  // namespace servodrome::links
