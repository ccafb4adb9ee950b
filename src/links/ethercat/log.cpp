#include "links/ethercat/log.hpp"

#include <array>
#include <cerrno>
#include <fmt/format.h>

#include "links/link_error.hpp"

namespace servodrome::links {
namespace {

constexpr std::size_t buffer_bytes = 64 * 1024;

// pcap file format: https://www.ietf.org/archive/id/draft-ietf-opsawg-pcap-03.html; host byte order, which readers
// recognise by the magic number.
struct FileHeader {
  std::uint32_t magic = 0xA1B23C4D;  // times in nanoseconds
  std::uint16_t version_major = 2;
  std::uint16_t version_minor = 4;
  std::uint32_t reserved1 = 0;
  std::uint32_t reserved2 = 0;
  std::uint32_t snap_length = 65535;
  std::uint32_t link_type = 1;  // LINKTYPE_ETHERNET
};
static_assert(sizeof(FileHeader) == 24);

struct PacketHeader {
  std::uint32_t seconds = 0;
  std::uint32_t nanoseconds = 0;
  std::uint32_t captured_length = 0;
  std::uint32_t original_length = 0;
};
static_assert(sizeof(PacketHeader) == 16);

using EthernetHeader = std::array<std::uint8_t, 14>;
constexpr EthernetHeader from_master{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x10,
                                     0x10, 0x10, 0x10, 0x10, 0x10, 0x88, 0xA4};
constexpr EthernetHeader from_slaves{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x12,
                                     0x10, 0x10, 0x10, 0x10, 0x10, 0x88, 0xA4};

}  // namespace

EthercatLog::EthercatLog(const std::string& path, Time epoch)
    : epoch_(epoch), file_(std::fopen(path.c_str(), "wb"), &std::fclose) {
  if (!file_) {
    const std::error_code code(errno, std::generic_category());
    throw LinkError(code,
                    fmt::format("cannot create the EtherCAT log \"{}\": {}; choose a folder that exists and may be "
                                "written to",
                                path, code.message()));
  }
  std::setvbuf(file_.get(), nullptr, _IOFBF, buffer_bytes);
  const FileHeader header;
  write(&header, sizeof header);
}

void EthercatLog::on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation encapsulation,
                           Direction direction, Time at) {
  const bool payload = encapsulation == ethercat::Segment::Encapsulation::payload;
  const auto nanoseconds = (at + epoch_).count();
  PacketHeader packet;
  packet.seconds = static_cast<std::uint32_t>(nanoseconds / 1'000'000'000);
  packet.nanoseconds = static_cast<std::uint32_t>(nanoseconds % 1'000'000'000);
  packet.captured_length = static_cast<std::uint32_t>(bytes.size() + (payload ? sizeof(EthernetHeader) : 0));
  packet.original_length = packet.captured_length;
  write(&packet, sizeof packet);
  const EthernetHeader& header = direction == Direction::in ? from_master : from_slaves;
  if (payload) write(header.data(), header.size());
  write(bytes.data(), bytes.size());
}

void EthercatLog::flush() {
  if (std::fflush(file_.get()) != 0) failed_ = true;
}

void EthercatLog::write(const void* bytes, std::size_t size) {
  if (failed_) return;
  if (std::fwrite(bytes, 1, size, file_.get()) != size) failed_ = true;
}

}  // namespace servodrome::links
