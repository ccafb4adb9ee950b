#pragma once

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <linux/if_packet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <stdexcept>
#include <string>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

namespace servodrome::bench {

// Records when EtherCAT frames arrive at an Ethernet interface, by the kernel's receive time stamp. The time does not
// depend on when this program reads the frame, or on other readers of the interface.
class FrameWitness {
 public:
  using Time = std::chrono::nanoseconds;  // of CLOCK_REALTIME
  struct Arrival {
    std::uint8_t index;  // of the first datagram
    Time at;
  };

  explicit FrameWitness(const std::string& interface) : socket_(::socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK, 0)) {
    const int on = 1;
    const int room = 4 << 20;
    sockaddr_ll address{};
    address.sll_family = AF_PACKET;
    address.sll_protocol = htons(0x88A4);
    address.sll_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    if (socket_ < 0 || address.sll_ifindex == 0 ||
        ::setsockopt(socket_, SOL_PACKET, PACKET_IGNORE_OUTGOING, &on, sizeof on) != 0 ||
        ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room) != 0 ||
        ::setsockopt(socket_, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) != 0 ||
        ::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("cannot watch \"" + interface + "\": " + std::strerror(errno));
    }
  }
  ~FrameWitness() { ::close(socket_); }
  FrameWitness(const FrameWitness&) = delete;
  FrameWitness& operator=(const FrameWitness&) = delete;

  // Reads the next frame; false: there is none.
  bool next(Arrival& arrival) {
    constexpr std::size_t index_at = 14 + 2 + 1;  // behind the Ethernet and EtherCAT headers, and the command
    std::array<std::uint8_t, index_at + 1> bytes{};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(timespec))> control{};
    iovec into{bytes.data(), bytes.size()};
    msghdr message{};
    message.msg_iov = &into;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    if (::recvmsg(socket_, &message, 0) < static_cast<ssize_t>(bytes.size())) return false;
    arrival.index = bytes[index_at];
    for (const cmsghdr* one = CMSG_FIRSTHDR(&message); one != nullptr;
         one = CMSG_NXTHDR(&message, const_cast<cmsghdr*>(one))) {
      if (one->cmsg_level != SOL_SOCKET || one->cmsg_type != SCM_TIMESTAMPNS) continue;
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(one), sizeof stamp);
      arrival.at = std::chrono::seconds(stamp.tv_sec) + Time(stamp.tv_nsec);
    }
    return true;
  }

 private:
  int socket_;
};

}  // namespace servodrome::bench
