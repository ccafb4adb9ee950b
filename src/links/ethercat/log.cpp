#include "links/ethercat/log.hpp"

#include <array>
#include <cerrno>
#include <fmt/format.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"
#include "links/log_file.hpp"
#include "links/pcap.hpp"

namespace servodrome::links {
namespace {

using EthernetHeader = EthercatLog::EthernetHeader;
constexpr EthernetHeader from_master{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x10,
                                     0x10, 0x10, 0x10, 0x10, 0x10, 0x88, 0xA4};
constexpr EthernetHeader from_slaves{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x12,
                                     0x10, 0x10, 0x10, 0x10, 0x10, 0x88, 0xA4};

}  // namespace

EthercatLog::EthercatLog(const std::string& path, Time epoch)
    : epoch_(epoch), file_(open_log_file(path), &std::fclose) {
  if (!file_) {
    const std::error_code code(errno, std::generic_category());
    throw LinkError(code, fmt::format("cannot create the EtherCAT log \"{}\": {}; {}", path, code.message(),
                                      advice_for(code.value(), "choose a folder that exists and may be written to")));
  }
  std::setvbuf(file_.get(), nullptr, _IOFBF, log_buffer_bytes);
  const PcapFileHeader header{.link_type = PcapLink::ethernet};
  write(&header, sizeof header);
}

void EthercatLog::on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation encapsulation,
                           Direction direction, Time at) {
  const bool payload = encapsulation == ethercat::Segment::Encapsulation::payload;
  const PcapPacketHeader packet =
      PcapPacketHeader::of(at + epoch_, bytes.size() + (payload ? sizeof(EthernetHeader) : 0));
  write(&packet, sizeof packet);
  if (payload) write(made_up_header(direction).data(), sizeof(EthernetHeader));
  write(bytes.data(), bytes.size());
}

const EthercatLog::EthernetHeader& EthercatLog::made_up_header(Direction direction) {
  return direction == Direction::in ? from_master : from_slaves;
}

void EthercatLog::flush() {
  if (std::fflush(file_.get()) != 0) failed_ = true;
}

void EthercatLog::write(const void* bytes, std::size_t size) {
  if (failed_) return;
  if (std::fwrite(bytes, 1, size, file_.get()) != size) failed_ = true;
}

}  // namespace servodrome::links
