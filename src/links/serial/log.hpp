#pragma once

#include <cstdio>
#include <memory>
#include <string>

#include "links/serial/messages.hpp"

namespace servodrome::links {

// Returns "(1436509052.249713) rs485 > 01 03 32 00 00 02 CA B3", without line end. The sender is > for the master and <
// for a drive; tcp> and tcp< are the same for Modbus TCP.
std::string serial_log_line(const SerialMessage& message, Time timestamp, std::string_view name);

// A pcapng file. Traffic on a serial line becomes RTAC serial packets (link type 250; "transmit" is from the master,
// "receive" from the drives). Modbus TCP becomes Ethernet frames of one invented connection. Write header() and then
// each packet() to the same file.
class SerialPcapng {
 public:
  static std::string header();
  std::string packet(const SerialMessage& message, Time timestamp);

 private:
  std::uint32_t sent_ = 1;      // TCP sequence number of the master's next byte
  std::uint32_t received_ = 1;  // the same of the drives' next byte
};

// Writes the traffic on a line to a file: a line of text for each message, or pcapng. Buffering and errors are as in
// CanLog.
class SerialLog final {
 public:
  enum class Format { text, pcapng };

  // Creates or truncates the file; throws LinkError. `epoch`: wall-clock time of the line's time 0.
  SerialLog(const std::string& path, Format format, std::string name, SerialLine& line, Time epoch);
  ~SerialLog();
  SerialLog(const SerialLog&) = delete;
  SerialLog& operator=(const SerialLog&) = delete;

  // For a log that was opened before the line's time 0 is known.
  void set_epoch(Time epoch) { epoch_ = epoch; }
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
