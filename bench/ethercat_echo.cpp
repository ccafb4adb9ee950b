// The simplest possible answer to a master on an Ethernet interface: receives each EtherCAT frame, adds 3 for each of
// SLAVES slaves (a slave that is read and written) to the working counter of every datagram, changes the source
// address, and sends the frame back. It is the baseline for the round trips of the line.
// Usage: ethercat_echo INTERFACE SLAVES [busy]
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <linux/if_packet.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "ethercat/frame/datagram.hpp"

int main(int argc, char** argv) {
  using namespace servodrome::ethercat;
  if (argc < 3) {
    std::fprintf(stderr, "usage: ethercat_echo INTERFACE SLAVES [busy]\n");
    return 2;
  }
  const unsigned slaves = static_cast<unsigned>(std::atoi(argv[2]));
  const int flags = argc > 3 && std::strcmp(argv[3], "busy") == 0 ? MSG_DONTWAIT : 0;
  const int socket = ::socket(AF_PACKET, SOCK_RAW, 0);
  const int on = 1;
  ::setsockopt(socket, SOL_PACKET, PACKET_IGNORE_OUTGOING, &on, sizeof on);
  ::setsockopt(socket, SOL_PACKET, PACKET_QDISC_BYPASS, &on, sizeof on);
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_protocol = htons(0x88A4);
  address.sll_ifindex = static_cast<int>(::if_nametoindex(argv[1]));
  packet_mreq everything{};
  everything.mr_ifindex = address.sll_ifindex;
  everything.mr_type = PACKET_MR_PROMISC;
  ::setsockopt(socket, SOL_PACKET, PACKET_ADD_MEMBERSHIP, &everything, sizeof everything);
  if (::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    std::perror("ethercat_echo");
    return 1;
  }
  std::array<std::uint8_t, max_frame> memory;
  for (;;) {
    const ssize_t size = ::recv(socket, memory.data(), memory.size(), flags);
    if (size <= 0) continue;
    const auto bytes = std::span(memory).first(static_cast<std::size_t>(size));
    Frame frame;
    if (parse_ethernet(bytes, frame) != FrameKind::ethercat) continue;
    for (Datagram& datagram : frame.datagrams()) datagram.count(3 * slaves);
    *frame.source_address |= 0x02;
    ::send(socket, bytes.data(), bytes.size(), 0);
  }
}
