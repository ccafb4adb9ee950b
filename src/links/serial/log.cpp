#include "links/serial/log.hpp"

#include <cerrno>
#include <fmt/format.h>

#include "links/descriptor_advice.hpp"
#include "links/link_error.hpp"
#include "links/log_file.hpp"
#include "links/pcap.hpp"

namespace servodrome::links {
namespace {

// pcapng: https://www.ietf.org/archive/id/draft-ietf-opsawg-pcapng-02.html; little endian.
constexpr std::uint32_t section_header = 0x0A0D0D0A;
constexpr std::uint32_t byte_order = 0x1A2B3C4D;
constexpr std::uint32_t interface_description = 1;
constexpr std::uint32_t enhanced_packet = 6;

// https://www.tcpdump.org/linktypes/LINKTYPE_RTAC_SERIAL.html
constexpr std::uint8_t rtac_transmit_start = 1;
constexpr std::uint8_t rtac_receive_start = 2;

constexpr std::uint16_t modbus_tcp_port = 502;
constexpr std::uint16_t client_port = 40000;

void add_little(std::string& text, std::uint64_t value, unsigned bytes) {
  for (unsigned i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i));
}

void add_big(std::string& text, std::uint64_t value, unsigned bytes) {
  for (unsigned i = bytes; i-- > 0;) text += static_cast<char>(value >> (8 * i));
}

std::string block(std::uint32_t type, std::string body) {
  body.resize((body.size() + 3) / 4 * 4);
  const std::size_t length = body.size() + 12;
  std::string text;
  add_little(text, type, 4);
  add_little(text, length, 4);
  text += body;
  add_little(text, length, 4);
  return text;
}

std::string interface_block(PcapLink link) {
  constexpr unsigned if_tsresol = 9;
  std::string body;
  add_little(body, static_cast<std::uint32_t>(link), 2);
  add_little(body, 0, 2);
  add_little(body, 0, 4);  // unlimited packet length
  add_little(body, if_tsresol, 2);
  add_little(body, 1, 2);
  add_little(body, 9, 4);  // 10^-9 s
  add_little(body, 0, 4);  // end of options
  return block(interface_description, body);
}

// The checksum of an IPv4 header (RFC 791).
std::uint16_t internet_checksum(std::string_view bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    sum +=
        static_cast<std::uint32_t>(static_cast<std::uint8_t>(bytes[i]) << 8 | static_cast<std::uint8_t>(bytes[i + 1]));
  }
  while (sum > 0xFFFF) sum = (sum & 0xFFFF) + (sum >> 16);
  return static_cast<std::uint16_t>(~sum);
}

std::string tcp_frame(bool from_master, std::uint32_t sequence, std::uint32_t acknowledge,
                      std::span<const std::uint8_t> data) {
  constexpr std::uint32_t master_address = 0x7F000001;
  constexpr std::uint32_t drive_address = 0x7F000002;
  std::string ip;
  add_big(ip, 0x4500, 2);
  add_big(ip, 40 + data.size(), 2);
  add_big(ip, 0x00004000, 4);  // don't fragment
  add_big(ip, 0x4006, 2);      // TCP
  add_big(ip, 0, 2);
  add_big(ip, from_master ? master_address : drive_address, 4);
  add_big(ip, from_master ? drive_address : master_address, 4);
  const std::uint16_t sum = internet_checksum(ip);
  ip[10] = static_cast<char>(sum >> 8);
  ip[11] = static_cast<char>(sum);
  std::string frame(12, '\0');
  add_big(frame, 0x0800, 2);
  frame += ip;
  add_big(frame, from_master ? client_port : modbus_tcp_port, 2);
  add_big(frame, from_master ? modbus_tcp_port : client_port, 2);
  add_big(frame, sequence, 4);
  add_big(frame, acknowledge, 4);
  add_big(frame, 0x5018, 2);  // PSH, ACK
  add_big(frame, 0xFFFF, 2);
  add_big(frame, 0, 4);  // no checksum, as if the network card adds it
  frame.append(reinterpret_cast<const char*>(data.data()), data.size());
  return frame;
}

}  // namespace

std::string serial_log_line(const SerialMessage& message, Time timestamp, std::string_view name) {
  const auto microseconds = timestamp.count() / 1000;
  const char* sender = message.side == SerialSender::master ? ">" : message.side == SerialSender::drive ? "<" : "";
  std::string line = fmt::format("({:010d}.{:06d}) {} {}{}", microseconds / 1'000'000, microseconds % 1'000'000, name,
                                 message.is_tcp ? "tcp" : "", sender);
  for (const std::uint8_t byte : message.bytes) line += fmt::format(" {:02X}", byte);
  return line;
}

std::string SerialPcapng::header() {
  std::string section;
  add_little(section, byte_order, 4);
  add_little(section, 1, 2);
  add_little(section, 0, 2);
  add_little(section, ~std::uint64_t{0}, 8);  // unknown length
  return block(section_header, section) + interface_block(PcapLink::rtac_serial) + interface_block(PcapLink::ethernet);
}

std::string SerialPcapng::packet(const SerialMessage& message, Time timestamp) {
  const bool from_master = message.side == SerialSender::master;
  std::string data;
  if (message.is_tcp) {
    std::uint32_t& sequence = from_master ? sent_ : received_;
    data = tcp_frame(from_master, sequence, from_master ? received_ : sent_, message.bytes);
    sequence += static_cast<std::uint32_t>(message.bytes.size());
  } else {
    add_big(data, static_cast<std::uint64_t>(timestamp.count() / 1'000'000'000), 4);
    add_big(data, static_cast<std::uint64_t>(timestamp.count() % 1'000'000'000 / 1000), 4);
    data += static_cast<char>(from_master ? rtac_transmit_start : rtac_receive_start);
    data.append(3, '\0');
    data.append(reinterpret_cast<const char*>(message.bytes.data()), message.bytes.size());
  }
  std::string body;
  const auto nanoseconds = static_cast<std::uint64_t>(timestamp.count());
  add_little(body, message.is_tcp ? 1 : 0, 4);
  add_little(body, nanoseconds >> 32, 4);
  add_little(body, nanoseconds & 0xFFFFFFFF, 4);
  add_little(body, data.size(), 4);
  add_little(body, data.size(), 4);
  return block(enhanced_packet, body + data);
}

SerialLog::SerialLog(const std::string& path, Format format, std::string name, SerialLine& line, Time epoch)
    : format_(format),
      name_(std::move(name)),
      epoch_(epoch),
      file_(open_log_file(path), &std::fclose),
      messages_(line, [this](const SerialMessage& message) {
        const Time at = message.at + epoch_;
        write(format_ == Format::text ? serial_log_line(message, at, name_) + "\n" : pcapng_.packet(message, at));
      }) {
  if (!file_) {
    const std::error_code code(errno, std::generic_category());
    throw LinkError(code, fmt::format("cannot create the serial log \"{}\": {}; {}", path, code.message(),
                                      advice_for(code.value(), "choose a folder that exists and may be written to")));
  }
  std::setvbuf(file_.get(), nullptr, _IOFBF, log_buffer_bytes);
  if (format_ == Format::pcapng) write(SerialPcapng::header());
}

SerialLog::~SerialLog() { messages_.end(); }

void SerialLog::flush() {
  messages_.flush();
  if (std::fflush(file_.get()) != 0) failed_ = true;
}

void SerialLog::write(const std::string& text) {
  if (failed_) return;
  if (std::fwrite(text.data(), 1, text.size(), file_.get()) != text.size()) failed_ = true;
}

}  // namespace servodrome::links
