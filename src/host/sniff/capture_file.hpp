#pragma once

#include <cstdint>
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "canopen/frame.hpp"
#include "links/serial/sender.hpp"
#include "links/time.hpp"

namespace servodrome::host {

// An error message of SocketCAN: something went wrong on the wire.
struct CanErrorFrame {
  std::uint32_t error_class = 0;
};

using EthernetBytes = std::vector<std::uint8_t>;

// What went over a serial line, in pieces of any size; or a frame of Modbus TCP that went past it.
struct SerialBytes {
  links::SerialSender sender = links::SerialSender::unknown;
  bool is_tcp = false;
  std::vector<std::uint8_t> bytes{};
};

struct CapturedFrame {
  links::Time time{};  // since the epoch, as the capture has it
  std::variant<canopen::Frame, CanErrorFrame, EthernetBytes, SerialBytes> content;
};

// Reads captures: candump logs (`candump -L`, `up --log trace.log`) and serial logs of that form, pcap and pcapng with
// CAN (SocketCAN), Ethernet, IP or serial (RTAC serial, user link types) packets, in micro- or nanoseconds, of either
// byte order. Frames of other link types are skipped and counted. Nothing is sought: a pipe will do.
//
// A line of a serial log is "(1436509052.249713) NAME > 01 03 32 00 00 02 CA B3": time, name of the line, who sent
// (> the master, < a drive, tcp> and tcp< the same of Modbus TCP), the bytes. All but the bytes may be missing.
class CaptureFile {
 public:
  // `name` stands in messages. The file stays the caller's.
  CaptureFile(std::FILE* file, std::string name);

  // The next frame; nothing at the end. Throws HostError that says at which byte or line the file is no capture.
  std::optional<CapturedFrame> next();
  std::uint64_t skipped() const { return skipped_; }  // packets that are none of a fieldbus

 private:
  enum class Format : std::uint8_t { candump, pcap, pcapng };
  struct Interface {
    unsigned link_type = 0;
    std::uint64_t ticks_per_second = 1'000'000;
  };

  std::optional<CapturedFrame> next_line();
  std::optional<CapturedFrame> next_packet();
  std::optional<CapturedFrame> next_block();
  void read_section(const std::uint8_t* length);
  std::optional<CapturedFrame> content_of(unsigned link_type, links::Time time, std::vector<std::uint8_t> bytes);
  bool read(std::uint8_t* into, std::size_t size, const char* what, bool may_end);
  std::uint16_t u16(const std::uint8_t* at) const;
  std::uint32_t u32(const std::uint8_t* at) const;
  [[noreturn]] void refuse(const std::string& problem) const;

  std::FILE* file_;
  std::string name_;
  Format format_ = Format::candump;
  std::string head_;  // what was read to tell the format
  std::uint64_t offset_ = 0;
  unsigned line_ = 0;
  links::Time last_line_{};
  bool swapped_ = false;
  std::vector<Interface> interfaces_;
  std::uint64_t skipped_ = 0;
};

}  // namespace servodrome::host
