#pragma once

#include <boost/asio/posix/stream_descriptor.hpp>
#include <memory>
#include <sys/socket.h>
#include <vector>

#include "ethercat/frame/datagram.hpp"
#include "links/ethercat/link.hpp"
#include "links/file_descriptor.hpp"

namespace servodrome::links {

// `udp:HOST:PORT`: contents of frames in UDP packets (ETG.1000.4 clause 5.3.2), answered to their sender. All waiting
// packets are read with one system call and answered with another.
class EthercatUdpLink final : public EthercatLink {
 public:
  EthercatUdpLink(const EthercatUdpName& name, EthercatBus& bus, boost::asio::io_context& io, LineHost& host);
  ~EthercatUdpLink() override;
  EthercatUdpLink(const EthercatUdpLink&) = delete;
  EthercatUdpLink& operator=(const EthercatUdpLink&) = delete;

  std::string name() const override { return to_string(name_); }
  const LinkCounters& counters() const override { return counters_; }
  bool busy() const override { return name_.busy; }
  bool poll() override { return serve() > 0; }

 private:
  static constexpr std::size_t most_at_once = 32;

  // A packet and the address of its sender.
  struct Packet {
    std::array<std::uint8_t, ethercat::max_payload + 1> bytes;  // one more, to detect packets that are too long
    sockaddr_storage sender;
    iovec memory;
  };

  void wait_for_frames();
  std::size_t serve();
  void send(std::span<mmsghdr> answers);
  void send_later(const mmsghdr& answer, std::span<const std::uint8_t> content, Time delay);

  EthercatUdpName name_;
  EthercatBus& bus_;
  boost::asio::io_context& io_;
  LineHost& host_;
  boost::asio::posix::stream_descriptor socket_;
  std::vector<Packet> packets_{most_at_once};
  std::array<mmsghdr, most_at_once> incoming_{};
  std::array<mmsghdr, most_at_once> outgoing_{};
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::size_t waiting_ = 0;  // frames that send_later() holds
  LinkCounters counters_;
};

}  // namespace servodrome::links
