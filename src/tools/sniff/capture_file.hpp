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

namespace servodrome::master {

// An error frame of SocketCAN, which reports an error on the wire.
struct CanErrorFrame {
  std::uint32_t error_class = 0;
};

using EthernetBytes = std::vector<std::uint8_t>;

// Bytes from a serial line, in pieces of any size; or a frame of Modbus TCP (`is_tcp`).
struct SerialBytes {
  links::SerialSender sender = links::SerialSender::unknown;
  bool is_tcp = false;
  std::vector<std::uint8_t> bytes{};
};

struct CapturedFrame {
  links::Time time{};  // since the epoch, as stored in the capture
  std::variant<canopen::Frame, CanErrorFrame, EthernetBytes, SerialBytes> content;
};

// Reads captures: candump logs (`candump -L`, `up --log trace.log`), serial logs in the same style, and pcap or pcapng
// files with CAN (SocketCAN), Ethernet, IP or serial packets (RTAC serial, user link types), with times in micro- or
// nanoseconds and either byte order. Frames of other link types are skipped and counted. Does not seek, so a pipe
// works.
//
// A line of a serial log is "(1436509052.249713) NAME > 01 03 32 00 00 02 CA B3": time, name of the line, sender (> the
// master, < a drive, tcp> and tcp< the same for Modbus TCP), bytes. All parts except the bytes are optional.
class CaptureFile {
 public:
  // `name` appears in error messages. The caller keeps the ownership of the file.
  CaptureFile(std::FILE* file, std::string name);

  // Returns the next frame; nullopt at the end. Throws MasterError with the byte or line at which the file is not a
  // valid capture.
  std::optional<CapturedFrame> next();
  std::uint64_t skipped() const { return skipped_; }  // packets without fieldbus frames

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
  std::string head_;  // bytes read to detect the format
  std::uint64_t offset_ = 0;
  unsigned line_ = 0;
  links::Time last_line_{};
  bool swapped_ = false;
  std::vector<Interface> interfaces_;
  std::uint64_t skipped_ = 0;
};

}  // namespace servodrome::master
