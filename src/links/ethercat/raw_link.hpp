#pragma once

#include <boost/asio/steady_timer.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "links/descriptor_watch.hpp"
#include "links/ethercat/link.hpp"
#include "links/ethercat/packet_socket.hpp"

namespace servodrome::links {

// `raw:INTERFACE` and `raw:INTERFACE+INTERFACE`: connects the segment to an Ethernet interface, or a ring to two.
// Frames are changed in the memory in which they were received, and all frames of a batch are sent back together. When
// an interface goes down or disappears, the link retries once a second until it is back. The host receives a report of
// both events.
class RawLink final : public EthercatLink {
 public:
  RawLink(const RawName& name, EthercatBus& bus, boost::asio::io_context& io, DescriptorWatch& watch, LineHost& host);
  ~RawLink() override;
  RawLink(const RawLink&) = delete;
  RawLink& operator=(const RawLink&) = delete;

  std::string name() const override { return to_string(name_); }
  const LinkCounters& counters() const override { return counters_; }
  bool busy() const override { return name_.busy; }
  bool poll() override;
  void check() override;

 private:
  static constexpr std::size_t most_at_once = PacketSocket::most_frames;

  // One interface and the master's port that it leads to.
  struct Side {
    Side(std::string its_interface, EthercatBus::Port its_port, boost::asio::io_context& io)
        : interface(std::move(its_interface)), port(its_port), retry(io) {}

    std::string interface;
    EthercatBus::Port port;
    std::optional<PacketSocket> socket;  // none while the interface is lost
    boost::asio::steady_timer retry;
    std::array<iovec, most_at_once> outgoing{};  // frames that leave through this interface
    std::size_t outgoing_count = 0;
  };

  void open(Side& side);
  void check(Side& side);
  void close(Side& side);
  std::size_t serve(Side& side);
  Side& side_of(EthercatBus::Exit exit);
  void send(Side& side);
  void send_later(Side& side, std::span<const std::uint8_t> frame, Time delay);
  void lose(Side& side, int reason);
  void try_again(Side& side);

  RawName name_;
  EthercatBus& bus_;
  boost::asio::io_context& io_;
  DescriptorWatch& watch_;
  LineHost& host_;
  std::vector<std::unique_ptr<Side>> sides_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::size_t waiting_ = 0;  // frames that send_later() holds
  LinkCounters counters_;    // `clients` is 1 while at least one side has a socket, else 0
};

}  // namespace servodrome::links
