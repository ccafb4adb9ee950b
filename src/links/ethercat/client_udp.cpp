#include "links/ethercat/client_udp.hpp"

#include <cerrno>
#include <fmt/format.h>
#include <thread>

#include "links/ethercat/udp_socket.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

constexpr auto udp_send_timeout = std::chrono::seconds(1);

}  // namespace

UdpEthercatClient::UdpEthercatClient(const EthercatUdpName& name)
    : name_(name), socket_(udp_connect({name.host, name.port}, to_string(EthercatLinkName(name)))) {}

void UdpEthercatClient::send(std::span<const std::uint8_t> content) {
  check_content_size(content.size(), name());
  const Deadline deadline = std::chrono::steady_clock::now() + udp_send_timeout;
  while (send_some(socket_.get(), content.data(), content.size()) < 0) {
    if (errno == EINTR) continue;
    if (errno != EAGAIN || !wait_writable(socket_.get(), deadline)) lost(errno);
  }
}

std::size_t UdpEthercatClient::receive(std::span<std::uint8_t> into, Time timeout) {
  const Deadline deadline = std::chrono::steady_clock::now() + timeout;
  for (bool late = false;;) {
    const std::ptrdiff_t size = read_some(socket_.get(), into.data(), into.size());
    if (size > 0) return static_cast<std::size_t>(size);
    if (size == 0) continue;  // a packet without content
    if (errno == EINTR) continue;
    if (errno != EAGAIN) lost(errno);
    if (late) return 0;
    late = name_.busy ? std::chrono::steady_clock::now() > deadline : !wait_readable(socket_.get(), deadline);
  }
}

Time UdpEthercatClient::now() const { return steady_now(); }

void UdpEthercatClient::wait(Time span) { std::this_thread::sleep_for(span); }

void UdpEthercatClient::lost(int reason) const {
  const std::error_code code(reason, std::generic_category());
  const char* advice =
      reason == ECONNREFUSED ? "no server listens there; is \"servodrome up\" running?" : "see \"ip route\"";
  throw LinkError(code, fmt::format("lost \"{}\": {}; {}", name(), code.message(), advice));
}

}  // namespace servodrome::links
