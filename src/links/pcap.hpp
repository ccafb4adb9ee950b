#pragma once

#include <cstdint>

#include "links/time.hpp"

// pcap files: https://www.ietf.org/archive/id/draft-ietf-opsawg-pcap-03.html. They are in host byte order; readers
// detect it by the magic number.
namespace servodrome::links {

// https://www.tcpdump.org/linktypes.html
enum class PcapLink : std::uint32_t { ethernet = 1, can_socketcan = 227, rtac_serial = 250 };

struct PcapFileHeader {
  std::uint32_t magic = 0xA1B23C4DU;  // times in nanoseconds
  std::uint16_t version_major = 2;
  std::uint16_t version_minor = 4;
  std::uint32_t reserved1 = 0;
  std::uint32_t reserved2 = 0;
  std::uint32_t snap_length = 65535;
  PcapLink link_type{};
};
static_assert(sizeof(PcapFileHeader) == 24);

struct PcapPacketHeader {
  std::uint32_t seconds = 0;
  std::uint32_t nanoseconds = 0;
  std::uint32_t captured_length = 0;
  std::uint32_t original_length = 0;

  static PcapPacketHeader of(Time time, std::size_t length) {
    const auto bytes = static_cast<std::uint32_t>(length);
    return {static_cast<std::uint32_t>(time.count() / 1'000'000'000),
            static_cast<std::uint32_t>(time.count() % 1'000'000'000), bytes, bytes};
  }
};
static_assert(sizeof(PcapPacketHeader) == 16);

}  // namespace servodrome::links
