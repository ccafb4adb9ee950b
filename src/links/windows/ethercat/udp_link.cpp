#include <array>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <fmt/format.h>
#include <mswsock.h>
#include <vector>

#include "ethercat/frame/datagram.hpp"
#include "links/ethercat/system_links.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

using boost::asio::ip::udp;
using boost::system::error_code;

// Limit of frames that a disturbance or an interposer delays; further ones are lost.
constexpr std::size_t most_delayed_packets = 256;
// Limit of packets that are served before other links are.
constexpr std::size_t most_at_once = 32;

udp::socket listen_at(const EthercatUdpName& name, boost::asio::io_context& io) {
  const std::string link = to_string(EthercatLinkName(name));
  error_code code;
  udp::resolver resolver(io);
  const auto found = resolver.resolve(name.host, std::to_string(name.port), udp::resolver::passive, code);
  if (code || found.empty()) {
    throw LinkError(code, fmt::format("cannot open \"{}\": host \"{}\" is unknown ({}); write an address, such as "
                                      "127.0.0.1",
                                      link, name.host, code.message()));
  }
  const udp::endpoint address = found.begin()->endpoint();
  udp::socket socket(io);
  socket.open(address.protocol(), code);
  if (!code) socket.bind(address, code);
  if (!code) socket.non_blocking(true, code);
  if (!code) {
    // Otherwise the answer to a master that has closed its port makes the next read fail.
    BOOL off = FALSE;
    DWORD unused = 0;
    ::WSAIoctl(socket.native_handle(), SIO_UDP_CONNRESET, &off, sizeof off, nullptr, 0, &unused, nullptr, nullptr);
    return socket;
  }
  const bool in_use = code == boost::asio::error::address_in_use || code == boost::asio::error::access_denied;
  throw LinkError(code, fmt::format("cannot open \"{}\": {}; {}", link, code.message(),
                                    in_use ? fmt::format("another program has UDP port {}; stop it or choose another "
                                                         "port",
                                                         name.port)
                                           : "the host must be an address of this computer, such as 127.0.0.1"));
}

// `udp:HOST:PORT`, like the class of the same name for Linux, but with one system call for each packet, because Windows
// has no call for several packets.
class EthercatUdpLink final : public EthercatLink {
 public:
  EthercatUdpLink(const EthercatUdpName& name, EthercatBus& bus, boost::asio::io_context& io, LineHost& host)
      : name_(name), bus_(bus), io_(io), host_(host), socket_(listen_at(name, io)) {
    error_code ignored;
    name_.port = socket_.local_endpoint(ignored).port();
    if (!name.busy) wait_for_frame();
  }
  ~EthercatUdpLink() override { *alive_ = false; }
  EthercatUdpLink(const EthercatUdpLink&) = delete;
  EthercatUdpLink& operator=(const EthercatUdpLink&) = delete;

  std::string name() const override { return to_string(name_); }
  const LinkCounters& counters() const override { return counters_; }
  bool busy() const override { return name_.busy; }
  bool poll() override { return serve_waiting() > 0; }

 private:
  void wait_for_frame() {
    socket_.async_receive_from(boost::asio::buffer(bytes_), sender_,
                               [this, alive = alive_](error_code code, std::size_t size) {
                                 if (!*alive || code == boost::asio::error::operation_aborted) return;
                                 if (received(code, size)) {
                                   serve(size);
                                   serve_waiting();
                                 }
                                 wait_for_frame();
                               });
  }

  // Windows reports a packet that is longer than the buffer as an error.
  bool received(error_code code, std::size_t& size) const {
    if (code == boost::asio::error::message_size) size = bytes_.size();
    return !code || code == boost::asio::error::message_size;
  }

  // Returns the number of frames served.
  std::size_t serve_waiting() {
    for (std::size_t count = 0; count < most_at_once; ++count) {
      error_code code;
      std::size_t size = socket_.receive_from(boost::asio::buffer(bytes_), sender_, 0, code);
      if (!received(code, size)) return count;
      serve(size);
    }
    return most_at_once;
  }

  // Passes the frame in `bytes_` and answers `sender_`; then the stations do their work.
  void serve(std::size_t size) {
    const Time at = host_.frame_time();
    const std::span<std::uint8_t> frame = std::span(bytes_).first(size);
    const auto passage = bus_.pass(frame, at, EthercatBus::Port::primary, EthercatBus::Encapsulation::payload,
                                   EthercatSender::at(this, sender_.data(), sender_.size()));
    if (passage.kind != ethercat::FrameKind::ethercat) ++counters_.malformed;
    if (passage.exit != EthercatBus::Exit::lost) {
      if (passage.delay > Time{}) {
        send_later(frame.first(passage.length), passage.delay);
      } else {
        send(frame.first(passage.length), sender_);
      }
    }
    for (const auto& extra : passage.behind) send_later(extra, passage.delay);
    bus_.settle(at);
    ++counters_.to_bus;
  }

  void send(std::span<const std::uint8_t> answer, const udp::endpoint& to) {
    error_code code;
    socket_.send_to(boost::asio::buffer(answer.data(), answer.size()), to, 0, code);
    ++(code ? counters_.dropped : counters_.from_bus);
  }

  void send_later(std::span<const std::uint8_t> answer, Time delay) {
    if (waiting_ == most_delayed_packets) {
      ++counters_.dropped;
      return;
    }
    ++waiting_;
    const auto timer = std::make_shared<boost::asio::steady_timer>(io_, delay);
    timer->async_wait([this, timer, alive = alive_, to = sender_,
                       bytes = std::vector<std::uint8_t>(answer.begin(), answer.end())](error_code code) {
      if (!*alive || code) return;
      --waiting_;
      send(bytes, to);
    });
  }

  EthercatUdpName name_;
  EthercatBus& bus_;
  boost::asio::io_context& io_;
  LineHost& host_;
  udp::socket socket_;
  std::array<std::uint8_t, ethercat::max_payload + 1> bytes_{};  // one more, to detect packets that are too long
  udp::endpoint sender_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  std::size_t waiting_ = 0;  // frames that send_later() holds
  LinkCounters counters_;
};

}  // namespace

std::unique_ptr<EthercatLink> open_udp_link(const EthercatUdpName& name, EthercatBus& bus, boost::asio::io_context& io,
                                            LineHost& host) {
  return std::make_unique<EthercatUdpLink>(name, bus, io, host);
}

}  // namespace servodrome::links
