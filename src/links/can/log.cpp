#include "links/can/log.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <fmt/format.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"
#include "links/log_file.hpp"
#include "links/pcap.hpp"

namespace servodrome::links {
namespace {

// Bits of a SocketCAN identifier (linux/can.h).
constexpr std::uint32_t extended_flag = 0x80000000U;
constexpr std::uint32_t remote_flag = 0x40000000U;
constexpr std::uint32_t error_flag = 0x20000000U;
constexpr std::uint32_t error_class_bus = 0x00000080U;

// The packet of LINKTYPE_CAN_SOCKETCAN: identifier and flags in network byte order, length, padding, data.
struct SocketcanPacket {
  PcapPacketHeader header{};
  std::array<std::uint8_t, 4> id{};
  std::uint8_t length = 0;
  std::array<std::uint8_t, 3> reserved{};
  std::array<std::uint8_t, 8> data{};
};
static_assert(sizeof(SocketcanPacket) == 32);

// A SocketCAN error message always has eight data bytes. Only its class (bus error) is known here.
constexpr std::uint8_t error_message_length = 8;

std::string timestamp_text(Time timestamp) {
  const auto microseconds = timestamp.count() / 1000;
  return fmt::format("({:010d}.{:06d})", microseconds / 1'000'000, microseconds % 1'000'000);
}

}  // namespace

std::string candump_line(const canopen::Frame& frame, Time timestamp, std::string_view interface_name) {
  std::string line = fmt::format("{} {} ", timestamp_text(timestamp), interface_name);
  line += frame.extended ? fmt::format("{:08X}#", frame.id) : fmt::format("{:03X}#", frame.id);
  if (frame.remote) {
    line += 'R';
    if (frame.length > 0) line += fmt::format("{}", frame.length);
  } else {
    for (unsigned i = 0; i < frame.length && i < frame.data.size(); ++i) line += fmt::format("{:02X}", frame.data[i]);
  }
  return line;
}

std::string candump_line(const BusEvent& event, Time timestamp, std::string_view interface_name) {
  if (event.kind != BusEvent::Kind::error) return candump_line(event.frame, timestamp, interface_name);
  return fmt::format("{} {} {:08X}#{:016X}", timestamp_text(timestamp), interface_name, error_flag | error_class_bus,
                     0);
}

std::string can_pcap_header() {
  const PcapFileHeader header{.link_type = PcapLink::can_socketcan};
  return {reinterpret_cast<const char*>(&header), sizeof header};
}

std::string can_pcap_packet(const BusEvent& event, Time timestamp) {
  SocketcanPacket packet;
  packet.header = PcapPacketHeader::of(timestamp, sizeof packet - sizeof packet.header);
  std::uint32_t id = 0;
  if (event.kind == BusEvent::Kind::error) {
    id = error_flag | error_class_bus;
    packet.length = error_message_length;
  } else {
    id = event.frame.id | (event.frame.extended ? extended_flag : 0U) | (event.frame.remote ? remote_flag : 0U);
    packet.length = event.frame.length;
    if (!event.frame.remote) packet.data = event.frame.data;
  }
  for (unsigned i = 0; i < 4; ++i) packet.id[i] = static_cast<std::uint8_t>(id >> (24U - 8U * i));
  return {reinterpret_cast<const char*>(&packet), sizeof packet};
}

CanLog::CanLog(const std::string& path, Format format, std::string interface_name, Time epoch)
    : format_(format),
      interface_name_(std::move(interface_name)),
      epoch_(epoch),
      file_(open_log_file(path), &std::fclose) {
  if (!file_) {
    const std::error_code code(errno, std::generic_category());
    throw LinkError(code, fmt::format("cannot create the CAN log \"{}\": {}; {}", path, code.message(),
                                      advice_for(code.value(), "choose a folder that exists and may be written to")));
  }
  std::setvbuf(file_.get(), nullptr, _IOFBF, log_buffer_bytes);
  if (format_ == Format::pcap) {
    const std::string header = can_pcap_header();
    write(header.data(), header.size());
  }
}

CanLog::~CanLog() = default;

void CanLog::on_bus_event(const BusEvent& event) {
  if (format_ == Format::candump) {
    write_candump(event);
  } else {
    write_pcap(event);
  }
}

void CanLog::flush() {
  if (std::fflush(file_.get()) != 0) failed_ = true;
}

void CanLog::write(const void* bytes, std::size_t size) {
  if (failed_) return;
  if (std::fwrite(bytes, 1, size, file_.get()) != size) failed_ = true;
}

void CanLog::write_candump(const BusEvent& event) {
  const std::string line = candump_line(event, event.end + epoch_, interface_name_) + '\n';
  write(line.data(), line.size());
}

void CanLog::write_pcap(const BusEvent& event) {
  const std::string packet = can_pcap_packet(event, event.end + epoch_);
  write(packet.data(), packet.size());
}

}  // namespace servodrome::links
