#include "links/ethercat/packet_socket.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <linux/filter.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <net/if_arp.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <utility>

#include "links/descriptor_advice.hpp"
#include "links/ethercat/link_name.hpp"
#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

// The receive ring has one frame per slot: the kernel's header, space for a VLAN tag, and the frame.
constexpr std::size_t slot_size = 2048;
constexpr std::size_t slots = 512;
constexpr std::size_t block_size = 64 * 1024;
constexpr unsigned vlan_tag_size = 4;
constexpr int smallest_mtu = 1500;

[[noreturn]] void fail_raw(const std::string& link, std::string_view reason, std::string_view advice) {
  const std::error_code code(errno, std::generic_category());
  throw LinkError(code, fmt::format("cannot open \"{}\": {} ({}); {}", link, reason, code.message(),
                                    advice_for(code.value(), advice)));
}

// Requests a property of the interface (netdevice(7)).
ifreq ask(int socket, unsigned long request, const std::string& interface, const std::string& link) {
  ifreq question{};
  std::strncpy(question.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  if (::ioctl(socket, request, &question) != 0) {
    fail_raw(link, fmt::format("interface \"{}\" does not answer", interface), "see \"ip link\"");
  }
  return question;
}

void check_interface(int socket, const std::string& interface, const std::string& link) {
  if (::if_nametoindex(interface.c_str()) == 0) {
    fail_raw(link, fmt::format("there is no interface \"{}\"", interface),
             fmt::format("\"ip link\" lists the interfaces; a pair of virtual ones: ip link add {0} type veth peer "
                         "name {0}-master && ip link set {0} up && ip link set {0}-master up",
                         interface));
  }
  if (ask(socket, SIOCGIFHWADDR, interface, link).ifr_hwaddr.sa_family != ARPHRD_ETHER) {
    errno = EINVAL;
    fail_raw(link, fmt::format("\"{}\" is not an Ethernet interface", interface),
             "name an Ethernet interface; programs on this computer reach the line with udp:127.0.0.1:34980");
  }
  if ((ask(socket, SIOCGIFFLAGS, interface, link).ifr_flags & IFF_UP) == 0) {
    errno = ENETDOWN;
    fail_raw(link, fmt::format("interface \"{}\" is down", interface), fmt::format("ip link set {} up", interface));
  }
  if (const int mtu = ask(socket, SIOCGIFMTU, interface, link).ifr_mtu; mtu < smallest_mtu) {
    errno = EMSGSIZE;
    fail_raw(link,
             fmt::format("the MTU of interface \"{}\" is {}, EtherCAT frames have up to {} bytes", interface, mtu,
                         smallest_mtu),
             fmt::format("ip link set {} mtu {}", interface, smallest_mtu));
  }
}

// The kernel discards frames that are not EtherCAT. It usually keeps a VLAN tag beside the frame, not in it.
void attach_filter(int socket) {
  constexpr std::uint32_t all = 0x40000;
  std::array<sock_filter, 13> program{{
      BPF_STMT(BPF_LD | BPF_H | BPF_ABS, 12),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, 0x88A4, 9, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ETH_P_IP, 3, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ETH_P_8021Q, 0, 8),
      BPF_STMT(BPF_LD | BPF_H | BPF_ABS, 16),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, 0x88A4, 5, 6),
      BPF_STMT(BPF_LD | BPF_B | BPF_ABS, 23),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, IPPROTO_UDP, 0, 4),
      BPF_STMT(BPF_LDX | BPF_B | BPF_MSH, 14),
      BPF_STMT(BPF_LD | BPF_H | BPF_IND, 16),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, ethercat_udp_port, 0, 1),
      BPF_STMT(BPF_RET | BPF_K, all),
      BPF_STMT(BPF_RET | BPF_K, 0),
  }};
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  ::setsockopt(socket, SOL_SOCKET, SO_ATTACH_FILTER, &filter, sizeof filter);
}

bool set_packet_option(int socket, int option, int value) {
  return ::setsockopt(socket, SOL_PACKET, option, &value, sizeof value) == 0;
}

tpacket2_hdr& header_of(std::uint8_t* slot) { return *reinterpret_cast<tpacket2_hdr*>(slot); }

std::uint32_t status_of(std::uint8_t* slot) { return __atomic_load_n(&header_of(slot).tp_status, __ATOMIC_ACQUIRE); }

// The kernel has removed the VLAN tag from the frame. This puts it back, in the space in front of the frame.
std::span<std::uint8_t> with_vlan_tag(std::span<std::uint8_t> bytes, const tpacket2_hdr& header) {
  constexpr std::size_t address_bytes = 2 * ETH_ALEN;
  std::uint8_t* start = bytes.data() - vlan_tag_size;
  std::memmove(start, bytes.data(), address_bytes);
  const bool has_type = (header.tp_status & TP_STATUS_VLAN_TPID_VALID) != 0;
  const std::uint16_t tag[] = {htons(has_type ? header.tp_vlan_tpid : std::uint16_t{ETH_P_8021Q}),
                               htons(header.tp_vlan_tci)};
  std::memcpy(start + address_bytes, tag, vlan_tag_size);
  return {start, bytes.size() + vlan_tag_size};
}

}  // namespace

PacketSocket::PacketSocket(const std::string& interface, const std::string& link)
    // With protocol 0 the socket receives nothing until bind().
    : socket_(::socket(AF_PACKET, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
  if (!socket_.is_open()) {
    fail_raw(link, "raw Ethernet is not permitted",
             "run as root (sudo), or give the program the capability (sudo setcap cap_net_raw+ep PROGRAM), or use "
             "udp:127.0.0.1:34980, which needs none");
  }
  const int socket = socket_.get();
  check_interface(socket, interface, link);
  attach_filter(socket);
  tpacket_req ring{};
  ring.tp_block_size = block_size;
  ring.tp_block_nr = slots * slot_size / block_size;
  ring.tp_frame_size = slot_size;
  ring.tp_frame_nr = slots;
  // The order matters: the version and the reserved space determine the layout of the ring. Without a queueing
  // discipline the kernel passes outgoing frames directly to the driver.
  if (!set_packet_option(socket, PACKET_VERSION, TPACKET_V2) ||
      !set_packet_option(socket, PACKET_RESERVE, vlan_tag_size) ||
      !set_packet_option(socket, PACKET_IGNORE_OUTGOING, 1) || !set_packet_option(socket, PACKET_QDISC_BYPASS, 1) ||
      ::setsockopt(socket, SOL_PACKET, PACKET_RX_RING, &ring, sizeof ring) != 0) {
    fail_raw(link, "this kernel has no packet rings", "Linux 4.20 or later is needed");
  }
  void* memory = ::mmap(nullptr, slots * slot_size, PROT_READ | PROT_WRITE, MAP_SHARED, socket, 0);
  if (memory == MAP_FAILED) fail_raw(link, "there is no memory for received frames", "see \"ulimit -v\"");
  ring_ = static_cast<std::uint8_t*>(memory);

  packet_mreq everything{};
  everything.mr_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  everything.mr_type = PACKET_MR_PROMISC;
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_protocol = htons(ETH_P_ALL);
  address.sll_ifindex = everything.mr_ifindex;
  if (::setsockopt(socket, SOL_PACKET, PACKET_ADD_MEMBERSHIP, &everything, sizeof everything) != 0 ||
      ::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int reason = errno;
    ::munmap(ring_, slots * slot_size);
    errno = reason;
    fail_raw(link, fmt::format("interface \"{}\" cannot be used", interface), "see \"ip -details link\"");
  }
}

PacketSocket::~PacketSocket() { ::munmap(ring_, slots * slot_size); }

std::uint8_t* PacketSocket::slot(std::size_t ahead) const { return ring_ + (first_ + ahead) % slots * slot_size; }

std::span<std::uint8_t> PacketSocket::frame(std::size_t ahead) {
  if (ahead == slots) return {};
  std::uint8_t* place = slot(ahead);
  const std::uint32_t status = status_of(place);
  if ((status & TP_STATUS_USER) == 0) return {};
  losing_ = losing_ || (status & TP_STATUS_LOSING) != 0;
  const tpacket2_hdr& header = header_of(place);
  const std::span<std::uint8_t> bytes(place + header.tp_mac, header.tp_snaplen);
  return (status & TP_STATUS_VLAN_VALID) != 0 ? with_vlan_tag(bytes, header) : bytes;
}

void PacketSocket::release(std::size_t count) {
  for (; count > 0; --count) {
    __atomic_store_n(&header_of(slot(0)).tp_status, std::uint32_t{TP_STATUS_KERNEL}, __ATOMIC_RELEASE);
    first_ = (first_ + 1) % slots;
  }
}

std::size_t PacketSocket::send(std::span<const iovec> frames) {
  if (frames.size() == 1) return ::send(socket_.get(), frames[0].iov_base, frames[0].iov_len, 0) >= 0 ? 1 : 0;
  std::array<mmsghdr, most_frames> messages{};
  const std::size_t count = std::min(frames.size(), most_frames);
  for (std::size_t i = 0; i < count; ++i) {
    messages[i].msg_hdr.msg_iov = const_cast<iovec*>(&frames[i]);
    messages[i].msg_hdr.msg_iovlen = 1;
  }
  const int sent = ::sendmmsg(socket_.get(), messages.data(), static_cast<unsigned>(count), 0);
  return sent < 0 ? 0 : static_cast<std::size_t>(sent);
}

int PacketSocket::take_error() {
  int error = 0;
  socklen_t size = sizeof error;
  ::getsockopt(socket_.get(), SOL_SOCKET, SO_ERROR, &error, &size);
  return error;
}

std::uint32_t PacketSocket::take_overruns() {
  if (!std::exchange(losing_, false)) return 0;
  tpacket_stats statistics{};
  socklen_t size = sizeof statistics;
  ::getsockopt(socket_.get(), SOL_PACKET, PACKET_STATISTICS, &statistics, &size);
  return statistics.tp_drops;
}

}  // namespace servodrome::links
