#include "links/can/socketcan.hpp"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

constexpr int receive_buffer_bytes = 1 << 20;  // about 1300 frames: 100 ms of a full bus of 1 Mbit/s, and some room

[[noreturn]] void fail(const std::string& interface_name, std::string_view reason, std::string_view advice) {
  const std::error_code code(errno, std::generic_category());
  throw LinkError(code, fmt::format("cannot open \"socketcan:{}\": {} ({}); {}", interface_name, reason, code.message(),
                                    advice_for(code.value(), advice)));
}

}  // namespace

FileDescriptor open_socketcan(const std::string& interface_name) {
  FileDescriptor socket(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  if (!socket.is_open()) {
    fail(interface_name, "this kernel does not support CAN sockets",
         "load its modules (modprobe -a can can_raw) or use socketcand:127.0.0.1:29536/can0, which needs no kernel "
         "support");
  }
  const unsigned index = ::if_nametoindex(interface_name.c_str());
  if (index == 0) {
    fail(interface_name, "there is no such interface",
         fmt::format("\"ip link\" lists the interfaces; a virtual one: ip link add {0} type vcan && ip link set {0} up",
                     interface_name));
  }
  const int off = 0;
  ::setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS, &off, sizeof off);
  // The default buffer holds about 270 frames. After a pause of 100 ms, more frames may wait for a line or a master.
  // SO_RCVBUF is for a process without the privilege to exceed the system's limit.
  for (const int option : {SO_RCVBUFFORCE, SO_RCVBUF}) {
    if (::setsockopt(socket.get(), SOL_SOCKET, option, &receive_buffer_bytes, sizeof receive_buffer_bytes) == 0) break;
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(index);
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    fail(interface_name, "the interface cannot be used", "it must be a CAN interface: see \"ip -details link\"");
  }
  return socket;
}

bool from_socketcan(const can_frame& wire, canopen::Frame& frame) {
  if ((wire.can_id & CAN_ERR_FLAG) != 0) return false;
  frame = {};
  frame.extended = (wire.can_id & CAN_EFF_FLAG) != 0;
  frame.remote = (wire.can_id & CAN_RTR_FLAG) != 0;
  frame.id = wire.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
  frame.length = std::min<std::uint8_t>(wire.can_dlc, 8);
  if (!frame.remote) std::copy_n(wire.data, frame.length, frame.data.begin());
  return true;
}

can_frame to_socketcan(const canopen::Frame& frame) {
  can_frame wire{};
  wire.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) | (frame.remote ? CAN_RTR_FLAG : 0U);
  wire.can_dlc = std::min<std::uint8_t>(frame.length, 8);
  if (!frame.remote) std::copy_n(frame.data.begin(), wire.can_dlc, wire.data);
  return wire;
}

}  // namespace servodrome::links
