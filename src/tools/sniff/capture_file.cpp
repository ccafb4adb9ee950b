#include "tools/sniff/capture_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <fmt/format.h>
#include <string_view>

#include "links/number_text.hpp"
#include "master/error.hpp"

namespace servodrome::master {
namespace {

constexpr std::uint32_t pcap_microseconds = 0xA1B2C3D4;
constexpr std::uint32_t pcap_nanoseconds = 0xA1B23C4D;
constexpr std::uint32_t pcapng_section = 0x0A0D0D0A;
constexpr std::uint32_t pcapng_byte_order = 0x1A2B3C4D;
constexpr std::uint32_t pcapng_interface = 1;
constexpr std::uint32_t pcapng_packet = 6;
constexpr std::size_t most_packet = 256 * 1024;
constexpr std::size_t longest_line = 4096;

// https://www.tcpdump.org/linktypes.html
constexpr unsigned linktype_ethernet = 1;
constexpr unsigned linktype_raw_ip = 101;
constexpr unsigned linktype_sll = 113;
constexpr unsigned linktype_user_first = 147;
constexpr unsigned linktype_user_last = 162;
constexpr unsigned linktype_can = 227;
constexpr unsigned linktype_rtac_serial = 250;
constexpr unsigned linktype_sll2 = 276;
constexpr unsigned protocol_can = 0x000C;  // protocol type in linktype_sll
constexpr std::size_t sll_header = 16;
constexpr std::size_t sll2_header = 20;
constexpr std::size_t ethernet_addresses = 12;

// https://www.tcpdump.org/linktypes/LINKTYPE_RTAC_SERIAL.html: time (8 bytes), event, control lines, footer (2), data.
constexpr std::size_t rtac_header = 12;
constexpr std::size_t rtac_event = 8;
constexpr std::uint8_t rtac_status_change = 0;
constexpr std::uint8_t rtac_transmit_start = 1;
constexpr std::uint8_t rtac_receive_start = 2;
constexpr std::uint8_t rtac_transmit_end = 3;
constexpr std::uint8_t rtac_receive_end = 4;

// Bits of a SocketCAN identifier (linux/can.h).
constexpr std::uint32_t extended_flag = 0x80000000;
constexpr std::uint32_t remote_flag = 0x40000000;
constexpr std::uint32_t error_flag = 0x20000000;

std::variant<canopen::Frame, CanErrorFrame> frame_of(std::uint32_t id, std::uint8_t length,
                                                     std::span<const std::uint8_t> data) {
  if ((id & error_flag) != 0) return CanErrorFrame{id & 0x1FFFFFFF};
  canopen::Frame frame;
  frame.extended = (id & extended_flag) != 0;
  frame.remote = (id & remote_flag) != 0;
  frame.id = id & (frame.extended ? 0x1FFFFFFFU : 0x7FFU);
  frame.length = length;
  std::copy_n(data.begin(), std::min(data.size(), frame.data.size()), frame.data.begin());
  return frame;
}

template <typename T>
bool number(std::string_view text, T& value, int base) {
  const auto read = links::number_of_text<T>(text, base);
  if (read) value = *read;
  return read.has_value();
}

// A candump line such as "(1436509052.249713) can0 123#1122"; nullopt for any other line.
std::optional<CapturedFrame> parse_candump(std::string_view line) {
  if (!line.starts_with('(')) return std::nullopt;
  const std::size_t dot = line.find('.');
  const std::size_t close = line.find(')');
  const std::size_t hash = line.find('#');
  const std::size_t gap = hash == std::string_view::npos ? hash : line.rfind(' ', hash);
  if (dot == std::string_view::npos || close == std::string_view::npos || dot > close) return std::nullopt;
  if (gap == std::string_view::npos || gap < close) return std::nullopt;
  std::int64_t seconds = 0;
  std::int64_t fraction = 0;
  std::string digits(line.substr(dot + 1, close - dot - 1));
  if (digits.size() > 9) return std::nullopt;
  digits.resize(9, '0');
  if (!number(line.substr(1, dot - 1), seconds, 10) || !number(digits, fraction, 10)) return std::nullopt;
  if (seconds < 0 || seconds > 9'000'000'000 || fraction < 0) return std::nullopt;
  const std::string_view id_text = line.substr(gap + 1, hash - gap - 1);
  std::string_view rest = line.substr(hash + 1);
  rest = rest.substr(0, rest.find(' '));  // candump may append a direction
  std::uint32_t id = 0;
  if ((id_text.size() != 3 && id_text.size() != 8) || !number(id_text, id, 16)) return std::nullopt;
  if (id_text.size() == 8) id |= (id & error_flag) != 0 ? 0 : extended_flag;
  CapturedFrame captured{links::Time(seconds * 1'000'000'000 + fraction), {}};
  if (rest.starts_with('R')) {
    std::uint8_t length = 0;
    if (rest.size() > 1 && !number(rest.substr(1), length, 10)) return std::nullopt;
    std::visit([&](auto one) { captured.content = one; }, frame_of(id | remote_flag, length, {}));
    return captured;
  }
  std::vector<std::uint8_t> data;
  if (rest.size() % 2 != 0 || rest.size() > 16) return std::nullopt;
  for (std::size_t i = 0; i < rest.size(); i += 2) {
    std::uint8_t byte = 0;
    if (!number(rest.substr(i, 2), byte, 16)) return std::nullopt;
    data.push_back(byte);
  }
  std::visit([&](auto one) { captured.content = one; }, frame_of(id, static_cast<std::uint8_t>(data.size()), data));
  return captured;
}

// Removes the next word from the line and returns it.
std::string_view next_word(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(' '), line.size()));
  const std::string_view word = line.substr(0, line.find(' '));
  line.remove_prefix(word.size());
  return word;
}

// A time in seconds such as "1436509052.249713", with or without parentheses.
std::optional<links::Time> parse_seconds(std::string_view word) {
  if (word.starts_with('(') && word.ends_with(')')) word = word.substr(1, word.size() - 2);
  const std::size_t dot = word.find('.');
  if (dot == std::string_view::npos) return std::nullopt;
  std::string digits(word.substr(dot + 1));
  if (digits.size() > 9) return std::nullopt;
  digits.resize(9, '0');
  std::int64_t seconds = 0;
  std::int64_t fraction = 0;
  if (!number(word.substr(0, dot), seconds, 10) || !number(std::string_view(digits), fraction, 10)) return std::nullopt;
  if (seconds < 0 || seconds > 9'000'000'000 || fraction < 0) return std::nullopt;
  return links::Time(seconds * 1'000'000'000 + fraction);
}

// A line of a serial log (format: capture_file.hpp); nullopt for any other line. A line without a time gets the time of
// the line before.
std::optional<CapturedFrame> parse_serial_line(std::string_view line, links::Time before) {
  using links::SerialSender;
  struct Arrow {
    std::string_view word;
    SerialSender sender;
    bool is_tcp;
  };
  constexpr std::array arrows{Arrow{">", SerialSender::master, false}, Arrow{"<", SerialSender::drive, false},
                              Arrow{"tcp>", SerialSender::master, true}, Arrow{"tcp<", SerialSender::drive, true}};
  CapturedFrame captured{before, {}};
  SerialBytes content;
  bool named = false;
  bool directed = false;
  std::string_view word = next_word(line);
  if (const auto time = parse_seconds(word)) {
    captured.time = *time;
    word = next_word(line);
  }
  for (; !word.empty(); word = next_word(line)) {
    const auto* arrow = std::find_if(arrows.begin(), arrows.end(), [&](const Arrow& one) { return one.word == word; });
    std::uint8_t byte = 0;
    if (arrow != arrows.end()) {
      // A name such as "ba" is also a hexadecimal byte. The sender after it shows that the first word is the name.
      const bool is_name = !named && content.bytes.size() == 1;
      if (directed || (!content.bytes.empty() && !is_name)) return std::nullopt;
      content.bytes.clear();
      directed = true;
      content.sender = arrow->sender;
      content.is_tcp = arrow->is_tcp;
    } else if (word.size() == 2 && number(word, byte, 16)) {
      content.bytes.push_back(byte);
    } else if (content.bytes.empty() && !named && !directed && word.find('#') == std::string_view::npos) {
      named = true;
    } else {
      return std::nullopt;
    }
  }
  if (content.bytes.empty()) return std::nullopt;
  captured.content = std::move(content);
  return captured;
}

}  // namespace

CaptureFile::CaptureFile(std::FILE* file, std::string name) : file_(file), name_(std::move(name)) {
  std::array<std::uint8_t, 24> head{};
  const std::size_t got = std::fread(head.data(), 1, 4, file_);
  head_.assign(reinterpret_cast<const char*>(head.data()), got);
  if (got < 4) return;  // an empty file has no frames; next() rejects a file that is too short
  std::uint32_t magic = 0;
  std::memcpy(&magic, head.data(), sizeof magic);
  const std::uint32_t other = __builtin_bswap32(magic);
  offset_ = 4;
  if (magic == pcapng_section) {
    format_ = Format::pcapng;
    std::array<std::uint8_t, 4> length{};
    read(length.data(), length.size(), "the section header", false);
    read_section(length.data());
    return;
  }
  const auto is_pcap = [](std::uint32_t word) { return word == pcap_microseconds || word == pcap_nanoseconds; };
  if (!is_pcap(magic) && !is_pcap(other)) return;
  format_ = Format::pcap;
  swapped_ = is_pcap(other);
  read(head.data() + 4, 20, "the file header", false);
  const bool nanoseconds = (swapped_ ? other : magic) == pcap_nanoseconds;
  interfaces_ = {{u32(&head[20]) & 0x0FFFFFFF, nanoseconds ? 1'000'000'000U : 1'000'000U}};
}

void CaptureFile::refuse(const std::string& problem) const {
  const std::string where = format_ == Format::candump && line_ != 0 ? fmt::format("{}:{}", name_, line_)
                                                                     : fmt::format("{}, byte {}", name_, offset_);
  throw MasterError(problem, where,
                    "give a candump log (candump -L), a serial log (time and bytes), or a pcap or pcapng file");
}

std::uint16_t CaptureFile::u16(const std::uint8_t* at) const {
  std::uint16_t value = 0;
  std::memcpy(&value, at, sizeof value);
  return swapped_ ? __builtin_bswap16(value) : value;
}

std::uint32_t CaptureFile::u32(const std::uint8_t* at) const {
  std::uint32_t value = 0;
  std::memcpy(&value, at, sizeof value);
  return swapped_ ? __builtin_bswap32(value) : value;
}

bool CaptureFile::read(std::uint8_t* into, std::size_t size, const char* what, bool may_end) {
  const std::size_t got = std::fread(into, 1, size, file_);
  if (got == 0 && may_end) return false;
  if (got < size) {
    offset_ += got;
    refuse(fmt::format("the file ends within {}", what));
  }
  offset_ += size;
  return true;
}

std::optional<CapturedFrame> CaptureFile::next() {
  for (;;) {
    const std::uint64_t before = skipped_;
    auto frame = format_ == Format::candump ? next_line() : format_ == Format::pcap ? next_packet() : next_block();
    if (frame || skipped_ == before) return frame;
  }
}

std::optional<CapturedFrame> CaptureFile::next_line() {
  for (;;) {
    ++line_;
    std::string line = std::move(head_);
    head_.clear();
    // The head may contain the end of a line.
    if (const std::size_t end = line.find('\n'); end != std::string::npos) {
      head_ = line.substr(end + 1);
      line.resize(end);
    } else {
      int character = EOF;
      while ((character = std::getc(file_)) != EOF && character != '\n') {
        if (line.size() == longest_line || character == 0)
          refuse("this is not a line of a candump log or a serial log");
        line += static_cast<char>(character);
      }
      if (character == EOF && line.empty()) return std::nullopt;
    }
    if (line.ends_with('\r')) line.pop_back();
    if (line.empty()) continue;
    if (auto frame = parse_candump(line)) return frame;
    if (auto frame = parse_serial_line(line, last_line_)) {
      last_line_ = frame->time;
      return frame;
    }
    std::string shown = line.substr(0, 40);
    std::replace_if(
        shown.begin(), shown.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
    refuse(fmt::format("\"{}\" is not a line of a candump log or a serial log", shown));
  }
}

std::optional<CapturedFrame> CaptureFile::next_packet() {
  std::array<std::uint8_t, 16> header{};
  if (!read(header.data(), header.size(), "a packet header", true)) return std::nullopt;
  const std::uint32_t length = u32(&header[8]);
  if (length > most_packet) refuse(fmt::format("a packet length of {} bytes is not possible", length));
  const std::uint64_t nanoseconds = u32(&header[4]) * (1'000'000'000 / interfaces_[0].ticks_per_second);
  const links::Time time(static_cast<std::int64_t>(u32(header.data()) * 1'000'000'000ULL + nanoseconds));
  std::vector<std::uint8_t> bytes(length);
  if (length > 0) read(bytes.data(), length, "a packet", false);
  return content_of(interfaces_[0].link_type, time, std::move(bytes));
}

void CaptureFile::read_section(const std::uint8_t* length) {
  std::array<std::uint8_t, 4> order{};
  read(order.data(), order.size(), "the section header", false);
  swapped_ = false;
  if (u32(order.data()) != pcapng_byte_order) swapped_ = true;
  if (u32(order.data()) != pcapng_byte_order) refuse("the section header has no byte order");
  const std::uint32_t bytes = u32(length);
  if (bytes < 28 || bytes > most_packet)
    refuse(fmt::format("a section header length of {} bytes is not possible", bytes));
  std::vector<std::uint8_t> rest(bytes - 12);
  read(rest.data(), rest.size(), "the section header", false);
  interfaces_.clear();
}

// Reads one block; blocks without a frame count in skipped_.
std::optional<CapturedFrame> CaptureFile::next_block() {
  std::array<std::uint8_t, 8> header{};
  if (!read(header.data(), header.size(), "a block header", true)) return std::nullopt;
  const std::uint32_t type = u32(header.data());
  if (type == pcapng_section) {
    read_section(&header[4]);
    ++skipped_;
    return std::nullopt;
  }
  const std::uint32_t length = u32(&header[4]);
  if (length < 12 || length % 4 != 0 || length > most_packet)
    refuse(fmt::format("a block length of {} bytes is not possible", length));
  std::vector<std::uint8_t> block(length - 8);
  read(block.data(), block.size(), "a block", false);
  const std::size_t size = block.size() - 4;  // a block ends with its length again
  if (type == pcapng_interface && size >= 8) {
    Interface made{u16(block.data()), 1'000'000};
    constexpr unsigned time_resolution = 9;
    for (std::size_t at = 8; at + 4 <= size;) {
      const unsigned option = u16(&block[at]);
      const std::size_t option_length = u16(&block[at + 2]);
      if (option == 0 || at + 4 + option_length > size) break;
      if (option == time_resolution && option_length == 1) {
        const unsigned exponent = block[at + 4] & 0x7FU;
        const bool binary = (block[at + 4] & 0x80) != 0;
        if (exponent > (binary ? 30U : 9U)) refuse("an interface's clock is finer than nanoseconds");
        made.ticks_per_second = 1;
        for (unsigned i = 0; i < exponent; ++i) made.ticks_per_second *= binary ? 2 : 10;
      }
      at += 4 + (option_length + 3) / 4 * 4;
    }
    interfaces_.push_back(made);
  } else if (type == pcapng_packet && size >= 20) {
    const std::uint32_t interface = u32(block.data());
    const std::uint32_t captured = u32(&block[12]);
    if (interface >= interfaces_.size()) refuse(fmt::format("there is no interface {}", interface));
    if (captured > size - 20) refuse(fmt::format("a packet of {} bytes does not fit into its block", captured));
    const std::uint64_t ticks = std::uint64_t{u32(&block[4])} << 32 | u32(&block[8]);
    const std::uint64_t rate = interfaces_[interface].ticks_per_second;
    const links::Time time(
        static_cast<std::int64_t>(ticks / rate * 1'000'000'000 + ticks % rate * 1'000'000'000 / rate));
    return content_of(interfaces_[interface].link_type, time,
                      {block.begin() + 20, block.begin() + 20 + static_cast<std::ptrdiff_t>(captured)});
  }
  ++skipped_;
  return std::nullopt;
}

std::optional<CapturedFrame> CaptureFile::content_of(unsigned link_type, links::Time time,
                                                     std::vector<std::uint8_t> bytes) {
  // Fields of these headers are in network byte order.
  const auto network = [&bytes](std::size_t at, unsigned count) {
    std::uint32_t value = 0;
    for (unsigned i = 0; i < count; ++i) value = value << 8 | bytes[at + i];
    return value;
  };
  if (link_type == linktype_sll && bytes.size() >= sll_header && network(14, 2) == protocol_can) {
    bytes.erase(bytes.begin(), bytes.begin() + sll_header);
    link_type = linktype_can;
  }
  // Replaces the link layer header by an Ethernet header, so that the rest is handled like Ethernet.
  const auto as_ethernet = [&bytes, &link_type](std::size_t header, unsigned type) {
    std::vector<std::uint8_t> frame(ethernet_addresses + 2 + bytes.size() - header);
    frame[ethernet_addresses] = static_cast<std::uint8_t>(type >> 8);
    frame[ethernet_addresses + 1] = static_cast<std::uint8_t>(type);
    std::copy(bytes.begin() + static_cast<std::ptrdiff_t>(header), bytes.end(), frame.begin() + ethernet_addresses + 2);
    bytes = std::move(frame);
    link_type = linktype_ethernet;
  };
  if (link_type == linktype_sll && bytes.size() >= sll_header) as_ethernet(sll_header, network(14, 2));
  if (link_type == linktype_sll2 && bytes.size() >= sll2_header) as_ethernet(sll2_header, network(0, 2));
  if (link_type == linktype_raw_ip && !bytes.empty()) as_ethernet(0, bytes[0] >> 4 == 6 ? 0x86DD : 0x0800);
  CapturedFrame captured{time, {}};
  if (link_type == linktype_rtac_serial && bytes.size() > rtac_header && bytes[rtac_event] != rtac_status_change) {
    const std::uint8_t event = bytes[rtac_event];
    SerialBytes serial;
    if (event == rtac_transmit_start || event == rtac_transmit_end) serial.sender = links::SerialSender::master;
    if (event == rtac_receive_start || event == rtac_receive_end) serial.sender = links::SerialSender::drive;
    serial.bytes.assign(bytes.begin() + rtac_header, bytes.end());
    captured.content = std::move(serial);
    return captured;
  }
  if (link_type >= linktype_user_first && link_type <= linktype_user_last && !bytes.empty()) {
    captured.content = SerialBytes{.bytes = std::move(bytes)};
    return captured;
  }
  if (link_type == linktype_can && bytes.size() >= 8) {
    const std::span<const std::uint8_t> data = std::span(bytes).subspan(8);
    const auto length = static_cast<std::uint8_t>(std::min<std::size_t>(bytes[4], 64));
    std::visit([&](auto one) { captured.content = one; },
               frame_of(network(0, 4), length, data.first(std::min<std::size_t>(data.size(), 8))));
    return captured;
  }
  if (link_type == linktype_ethernet) {
    captured.content = std::move(bytes);
    return captured;
  }
  ++skipped_;
  return std::nullopt;
}

}  // namespace servodrome::master
