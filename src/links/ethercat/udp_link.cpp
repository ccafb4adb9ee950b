#include "links/ethercat/udp_link.hpp"

#include <boost/asio/steady_timer.hpp>
#include <cerrno>

#include "links/ethercat/system_links.hpp"
#include "links/ethercat/udp_socket.hpp"

namespace servodrome::links {
namespace {

using boost::system::error_code;

// Limit of frames that a disturbance or an interposer delays; further ones are lost.
constexpr std::size_t most_delayed_packets = 256;

}  // namespace

EthercatUdpLink::EthercatUdpLink(const EthercatUdpName& name, EthercatBus& bus, boost::asio::io_context& io,
                                 LineHost& host)
    : name_(name), bus_(bus), io_(io), host_(host), socket_(io) {
  FileDescriptor socket = udp_listen({name.host, name.port}, to_string(name));
  name_.port = local_port(socket);
  socket_.assign(socket.release());
  for (std::size_t i = 0; i < most_at_once; ++i) {
    Packet& packet = packets_[i];
    packet.memory = {packet.bytes.data(), packet.bytes.size()};
    msghdr& message = incoming_[i].msg_hdr;
    message.msg_name = &packet.sender;
    message.msg_iov = &packet.memory;
    message.msg_iovlen = 1;
  }
  if (!name.busy) wait_for_frames();
}

EthercatUdpLink::~EthercatUdpLink() { *alive_ = false; }

void EthercatUdpLink::wait_for_frames() {
  socket_.async_wait(boost::asio::posix::stream_descriptor::wait_read, [this, alive = alive_](error_code code) {
    if (!*alive || code) return;
    serve();
    wait_for_frames();
  });
}

// Returns the number of frames served.
std::size_t EthercatUdpLink::serve() {
  for (std::size_t i = 0; i < most_at_once; ++i) {
    packets_[i].memory.iov_len = packets_[i].bytes.size();
    incoming_[i].msg_hdr.msg_namelen = sizeof(sockaddr_storage);
  }
  const int received = ::recvmmsg(socket_.native_handle(), incoming_.data(), most_at_once, MSG_DONTWAIT, nullptr);
  if (received <= 0) return 0;
  const auto count = static_cast<std::size_t>(received);

  const Time at = host_.frame_time();
  std::size_t answers = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0) bus_.settle(at);
    const std::size_t size = incoming_[i].msg_len;
    const msghdr& message = incoming_[i].msg_hdr;
    const auto passage =
        bus_.pass(std::span(packets_[i].bytes).first(size), at, EthercatBus::Port::primary,
                  EthercatBus::Encapsulation::payload, EthercatSender::at(this, message.msg_name, message.msg_namelen));
    if (passage.kind != ethercat::FrameKind::ethercat) ++counters_.malformed;
    packets_[i].memory.iov_len = passage.length;
    for (const auto& extra : passage.behind) send_later(incoming_[i], extra, passage.delay);
    if (passage.exit == EthercatBus::Exit::lost) continue;
    if (passage.delay > Time{}) {
      send_later(incoming_[i], std::span(packets_[i].bytes).first(passage.length), passage.delay);
    } else {
      outgoing_[answers++] = incoming_[i];
    }
  }
  send(std::span(outgoing_).first(answers));
  bus_.settle(at);
  counters_.to_bus += count;
  return count;
}

void EthercatUdpLink::send(std::span<mmsghdr> answers) {
  // sendmmsg stops at a packet that cannot be sent, for example because its sender has closed its port. Skip that
  // packet and send the rest.
  while (!answers.empty()) {
    const int sent =
        answers.size() == 1
            ? (::sendmsg(socket_.native_handle(), &answers[0].msg_hdr, MSG_DONTWAIT) >= 0 ? 1 : 0)
            : ::sendmmsg(socket_.native_handle(), answers.data(), static_cast<unsigned>(answers.size()), MSG_DONTWAIT);
    const std::size_t done = sent > 0 ? static_cast<std::size_t>(sent) : 0;
    counters_.from_bus += done;
    if (done == 0) ++counters_.dropped;
    answers = answers.subspan(std::max<std::size_t>(done, 1));
  }
}

void EthercatUdpLink::send_later(const mmsghdr& answer, std::span<const std::uint8_t> content, Time delay) {
  if (waiting_ == most_delayed_packets) {
    ++counters_.dropped;
    return;
  }
  ++waiting_;
  const auto* sender = static_cast<const sockaddr_storage*>(answer.msg_hdr.msg_name);
  const auto timer = std::make_shared<boost::asio::steady_timer>(io_, delay);
  timer->async_wait([this, timer, alive = alive_, to = *sender, to_size = answer.msg_hdr.msg_namelen,
                     bytes = std::vector<std::uint8_t>(content.begin(), content.end())](error_code code) mutable {
    if (!*alive || code) return;
    --waiting_;
    iovec memory{bytes.data(), bytes.size()};
    mmsghdr message{};
    message.msg_hdr.msg_name = &to;
    message.msg_hdr.msg_namelen = to_size;
    message.msg_hdr.msg_iov = &memory;
    message.msg_hdr.msg_iovlen = 1;
    send(std::span(&message, 1));
  });
}

std::unique_ptr<EthercatLink> open_udp_link(const EthercatUdpName& name, EthercatBus& bus, boost::asio::io_context& io,
                                            LineHost& host) {
  return std::make_unique<EthercatUdpLink>(name, bus, io, host);
}

}  // namespace servodrome::links
