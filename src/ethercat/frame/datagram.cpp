#include "ethercat/frame/datagram.hpp"

namespace servodrome::ethercat {

namespace {

constexpr std::size_t addresses_size = 12;  // destination and source
constexpr std::size_t ipv4_header_size = 20;
constexpr std::size_t udp_header_size = 8;
constexpr unsigned type_ethercat = 0x88A4;
constexpr unsigned type_vlan = 0x8100;
constexpr unsigned type_ipv4 = 0x0800;
constexpr unsigned ipv4_without_options = 0x45;  // version and header length: all that slave controllers take
constexpr unsigned protocol_udp = 17;
constexpr unsigned datagram_type = 1;  // of the EtherCAT header

unsigned network_u16(const std::uint8_t* place) { return static_cast<unsigned>(place[0]) << 8 | place[1]; }

}  // namespace

FrameKind parse_payload(std::span<std::uint8_t> bytes, Frame& frame) {
  frame.count_ = 0;
  if (bytes.size() < 2 || bytes.size() > max_payload) return FrameKind::malformed;
  if (bytes[1] >> 4 != datagram_type) return FrameKind::foreign;
  std::size_t at = 2;
  for (bool more = true; more;) {
    if (bytes.size() - at < datagram_overhead) return FrameKind::malformed;
    std::uint8_t* header = bytes.data() + at;
    const std::uint16_t flags = load_u16(header + 6);
    const std::uint16_t length = flags & length_mask;
    if (bytes.size() - at < datagram_overhead + length) return FrameKind::malformed;
    frame.store_[frame.count_++] = {header, header + datagram_header_size, length, static_cast<Command>(header[0])};
    at += datagram_overhead + length;
    more = (flags & more_bit) != 0;
  }
  return FrameKind::ethercat;
}

FrameKind parse_ethernet(std::span<std::uint8_t> bytes, Frame& frame) {
  frame.count_ = 0;
  frame.source_address = nullptr;
  frame.udp_checksum = nullptr;
  std::size_t at = addresses_size;
  if (bytes.size() < at + 2) return FrameKind::malformed;
  frame.source_address = bytes.data() + 6;
  unsigned type = network_u16(bytes.data() + at);
  at += 2;
  if (type == type_vlan) {
    if (bytes.size() < at + 4) return FrameKind::malformed;
    type = network_u16(bytes.data() + at + 2);
    at += 4;
  }
  if (type == type_ipv4) {
    if (bytes.size() < at + ipv4_header_size + udp_header_size) return FrameKind::foreign;
    const std::uint8_t* ip = bytes.data() + at;
    if (ip[0] != ipv4_without_options || ip[9] != protocol_udp) return FrameKind::foreign;
    std::uint8_t* udp = bytes.data() + at + ipv4_header_size;
    if (network_u16(udp + 2) != type_ethercat) return FrameKind::foreign;
    at += ipv4_header_size + udp_header_size;
    const FrameKind kind = parse_payload(bytes.subspan(at), frame);
    if (kind != FrameKind::foreign) frame.udp_checksum = udp + 6;
    return kind;
  }
  if (type != type_ethercat) return FrameKind::foreign;
  return parse_payload(bytes.subspan(at), frame);
}

}  // namespace servodrome::ethercat
