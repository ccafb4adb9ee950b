#include "ethercat/frame/datagram.hpp"

namespace servodrome::ethercat {

namespace {

constexpr std::size_t addresses_size = 12;  // destination and source
constexpr std::size_t ipv4_header_size = 20;
constexpr std::size_t udp_header_size = 8;
constexpr unsigned type_ethercat = 0x88A4;
constexpr unsigned type_vlan = 0x8100;
constexpr unsigned type_ipv4 = 0x0800;
constexpr unsigned ipv4_without_options = 0x45;  // version and header length; slave controllers accept no other
constexpr unsigned protocol_udp = 17;
constexpr unsigned datagram_type = 1;  // of the EtherCAT header

unsigned network_u16(const std::uint8_t* place) { return static_cast<unsigned>(place[0]) << 8 | place[1]; }

}  // namespace

[[gnu::always_inline]] inline FrameKind parse(std::uint8_t* bytes, std::size_t size, Frame& frame) {
  Datagram* datagram = frame.store_.data();
  const auto ended = [&](FrameKind kind) {
    frame.count_ = static_cast<std::size_t>(datagram - frame.store_.data());
    return kind;
  };
  if (size < 2 || size > max_payload) return ended(FrameKind::malformed);
  if (bytes[1] >> 4 != datagram_type) return ended(FrameKind::foreign);
  for (std::size_t at = 2;;) {
    std::uint8_t* const header = bytes + at;
    if (at + datagram_overhead > size) return ended(FrameKind::malformed);
    const unsigned flags = load_u16(header + 6);
    at += datagram_overhead + (flags & length_mask);
    if (at > size) return ended(FrameKind::malformed);
    *datagram++ = {header, static_cast<std::uint16_t>(flags & length_mask), static_cast<Command>(header[0])};
    if ((flags & more_bit) == 0) return ended(FrameKind::ethercat);
  }
}

FrameKind parse_payload(std::span<std::uint8_t> bytes, Frame& frame) {
  frame.source_address = nullptr;
  frame.udp_checksum = nullptr;
  return parse(bytes.data(), bytes.size(), frame);
}

namespace {

// Parses EtherCAT within a VLAN tag, within UDP, or within both.
FrameKind parse_wrapped(std::span<std::uint8_t> bytes, Frame& frame) {
  frame.count_ = 0;
  std::size_t at = addresses_size + 2;
  unsigned type = network_u16(bytes.data() + addresses_size);
  if (type == type_vlan) {
    if (bytes.size() < at + 4) return FrameKind::malformed;
    type = network_u16(bytes.data() + at + 2);
    at += 4;
  }
  if (type == type_ethercat) return parse(bytes.data() + at, bytes.size() - at, frame);
  if (type != type_ipv4 || bytes.size() < at + ipv4_header_size + udp_header_size) return FrameKind::foreign;
  const std::uint8_t* ip = bytes.data() + at;
  if (ip[0] != ipv4_without_options || ip[9] != protocol_udp) return FrameKind::foreign;
  std::uint8_t* udp = bytes.data() + at + ipv4_header_size;
  if (network_u16(udp + 2) != type_ethercat) return FrameKind::foreign;
  at += ipv4_header_size + udp_header_size;
  const FrameKind kind = parse(bytes.data() + at, bytes.size() - at, frame);
  if (kind != FrameKind::foreign) frame.udp_checksum = udp + 6;
  return kind;
}

}  // namespace

FrameKind parse_ethernet(std::span<std::uint8_t> bytes, Frame& frame) {
  constexpr std::size_t header = addresses_size + 2;
  if (bytes.size() < header) {
    frame.source_address = frame.udp_checksum = nullptr;
    frame.count_ = 0;
    return FrameKind::malformed;
  }
  frame.source_address = bytes.data() + 6;
  frame.udp_checksum = nullptr;
  if (network_u16(bytes.data() + addresses_size) != type_ethercat) [[unlikely]]
    return parse_wrapped(bytes, frame);
  return parse(bytes.data() + header, bytes.size() - header, frame);
}

}  // namespace servodrome::ethercat
