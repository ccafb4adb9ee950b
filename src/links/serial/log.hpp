#pragma once

#include <cstdio>
#include <memory>
#include <string>

#include "links/serial/messages.hpp"

namespace servodrome::links {

// "(1436509052.249713) rs485 > 01 03 32 00 00 02 CA B3", without line end: who sent is > for the master, < for a drive,
// tcp> and tcp< the same of Modbus TCP.
std::string serial_log_line(const SerialMessage& message, Time timestamp, std::string_view name);

// A pcapng file with what goes over a serial line as RTAC serial packets (link type 250; sent is the master's, received
// the drives'), and Modbus TCP as Ethernet frames of one made-up connection. Both parts are to be written one after the
// other to the same file.
class SerialPcapng {
 public:
  static std::string header();
  std::string packet(const SerialMessage& message, Time timestamp);

 private:
  std::uint32_t sent_ = 1;      // bytes of TCP from the master, for sequence numbers
  std::uint32_t received_ = 1;  // and to it
};

// Writes what goes over a line to a file: a line of text for each message, or pcapng. As CanLog in all else.
class SerialLog final {
 public:
  enum class Format { text, pcapng };

  // Creates or truncates the file; throws LinkError. `epoch`: wall-clock time of the line's time 0.
  SerialLog(const std::string& path, Format format, std::string name, SerialLine& line, Time epoch);
  ~SerialLog();
  SerialLog(const SerialLog&) = delete;
  SerialLog& operator=(const SerialLog&) = delete;

  void flush();
  bool failed() const { return failed_; }

 private:
  void write(const std::string& text);

  Format format_;
  std::string name_;
  Time epoch_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  SerialPcapng pcapng_;
  bool failed_ = false;
  SerialMessages messages_;
};

}  // namespace servodrome::links
