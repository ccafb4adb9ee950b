#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <memory>
#include <vector>

#include "links/accept_loop.hpp"
#include "links/serial/link.hpp"

namespace servodrome::links {

// `tcp:HOST:PORT`: Modbus TCP for up to 32 clients. Each client's requests are answered in order. If a client does not
// read its responses, the listener stops serving it until it does (backpressure). Bytes that are not Modbus TCP end the
// connection. When all places are in use, a new client replaces the one that has sent nothing for longest, if that is
// at least 2 s (client_patience).
class ModbusTcpListener final : public SerialLink {
 public:
  static constexpr std::size_t most_clients = 32;
  static constexpr std::size_t most_waiting_bytes = 16 * 1024;

  // Observers of `line` receive the messages.
  ModbusTcpListener(const ModbusTcpName& name, SerialLine& line, modbus::Units& units, boost::asio::io_context& io,
                    LineHost& host);
  ~ModbusTcpListener() override;
  ModbusTcpListener(const ModbusTcpListener&) = delete;
  ModbusTcpListener& operator=(const ModbusTcpListener&) = delete;

  std::string name() const override { return to_string(name_); }
  std::uint16_t port() const { return name_.endpoint.port; }
  const LinkCounters& counters() const override { return counters_; }
  bool settled() override;
  void end_connections() override;

 private:
  class Client;
  using Moment = std::chrono::steady_clock::time_point;

  void accept(boost::asio::ip::tcp::socket&& socket);
  bool make_room();
  void remove(const Client& client);

  ModbusTcpName name_;
  SerialLine& line_;
  modbus::Units& units_;
  LineHost& host_;
  AcceptLoop accept_loop_;
  std::vector<std::shared_ptr<Client>> clients_;
  LinkCounters counters_;
};

}  // namespace servodrome::links
