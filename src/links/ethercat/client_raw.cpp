#include "links/ethercat/client_raw.hpp"

#include <algorithm>
#include <cerrno>
#include <fmt/format.h>
#include <random>
#include <thread>

#include "links/ethercat/system_links.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

constexpr std::size_t addresses_size = 12;
constexpr std::size_t header_size = addresses_size + 2;
// The shortest Ethernet frame, without FCS. Interfaces without hardware do not pad frames themselves.
constexpr std::size_t shortest_frame = 60;
constexpr std::uint8_t locally_administered = 0x02;  // the bit that slave controllers set in the source address
constexpr auto raw_send_timeout = std::chrono::seconds(1);

const RawName& of_one_interface(const RawName& name) {
  if (!name.secondary) return name;
  throw LinkError(std::make_error_code(std::errc::invalid_argument),
                  fmt::format("EtherCAT link \"{}\": this master uses one interface; name one of the two",
                              to_string(EthercatLinkName(name))));
}

std::array<std::uint8_t, 6> draw_source() {
  std::random_device random;
  std::array<std::uint8_t, 6> source{0x10};
  std::generate(source.begin() + 1, source.end(), [&] { return static_cast<std::uint8_t>(random()); });
  return source;
}

}  // namespace

RawEthercatClient::RawEthercatClient(const RawName& name)
    : name_(of_one_interface(name)),
      socket_(name.interface, to_string(EthercatLinkName(name))),
      source_(draw_source()) {
  std::fill_n(outgoing_.begin(), 6, std::uint8_t{0xFF});
  std::copy(source_.begin(), source_.end(), outgoing_.begin() + 6);
  outgoing_[addresses_size] = 0x88;
  outgoing_[addresses_size + 1] = 0xA4;
}

void RawEthercatClient::send(std::span<const std::uint8_t> content) {
  check_content_size(content.size(), name());
  std::copy(content.begin(), content.end(), outgoing_.begin() + header_size);
  std::size_t size = header_size + content.size();
  for (; size < shortest_frame; ++size) outgoing_[size] = 0;
  const iovec frame{outgoing_.data(), size};
  const Deadline deadline = std::chrono::steady_clock::now() + raw_send_timeout;
  while (socket_.send(std::span(&frame, 1)) == 0) {
    if (errno == EINTR) continue;
    const bool full = errno == EAGAIN || errno == ENOBUFS;
    if (!full || std::chrono::steady_clock::now() > deadline) lost(errno);
    std::this_thread::yield();
  }
}

// Copies the oldest received frame that answers this master to `into` and returns its size; 0: there is none.
std::size_t RawEthercatClient::take(std::span<std::uint8_t> into) {
  for (std::span<std::uint8_t> frame = socket_.frame(0); !frame.empty(); frame = socket_.frame(0)) {
    std::size_t size = 0;
    if (frame.size() > header_size && frame[addresses_size] == 0x88 && frame[addresses_size + 1] == 0xA4) {
      frame[6] &= static_cast<std::uint8_t>(~locally_administered);
      if (std::equal(source_.begin(), source_.end(), frame.begin() + 6)) {
        size = std::min(into.size(), frame.size() - header_size);
        std::copy_n(frame.begin() + header_size, size, into.begin());
      }
    }
    socket_.release(1);
    if (size > 0) return size;
  }
  return 0;
}

std::size_t RawEthercatClient::receive(std::span<std::uint8_t> into, Time timeout) {
  std::size_t size = take(into);
  if (size > 0) return size;
  const Deadline deadline = std::chrono::steady_clock::now() + timeout;
  for (;;) {
    const bool late =
        name_.busy ? std::chrono::steady_clock::now() > deadline : !wait_readable(socket_.descriptor(), deadline);
    size = take(into);
    if (size > 0) return size;
    if (const int reason = name_.busy && !late ? 0 : socket_.take_error(); reason != 0) lost(reason);
    if (late) return 0;
  }
}

Time RawEthercatClient::now() const { return steady_now(); }

void RawEthercatClient::wait(Time span) { std::this_thread::sleep_for(span); }

void RawEthercatClient::lost(int reason) const {
  const std::error_code code(reason, std::generic_category());
  throw LinkError(code,
                  fmt::format("lost \"{}\": {}; see \"ip link show {}\"", name(), code.message(), name_.interface));
}

std::unique_ptr<EthercatClient> open_raw_client(const RawName& name) {
  return std::make_unique<RawEthercatClient>(name);
}

int monitor_interface(const RawName& name, const std::function<bool()>& over,
                      const std::function<void(std::span<const std::uint8_t> frame)>& take) {
  constexpr auto look_time = std::chrono::milliseconds(50);
  PacketSocket socket(name.interface, to_string(EthercatLinkName(name)));
  while (!over()) {
    wait_readable(socket.descriptor(), std::chrono::steady_clock::now() + look_time);
    for (auto frame = socket.frame(0); !frame.empty(); frame = socket.frame(0)) {
      take(frame);
      socket.release(1);
    }
    if (const int reason = socket.take_error(); reason != 0) return reason;
  }
  return 0;
}

}  // namespace servodrome::links
