#pragma once

#include <cstdio>
#include <memory>
#include <string>

#include "links/can/bus.hpp"

namespace servodrome::links {

// A frame as `candump -L` writes it, without line end: `(1436509052.249713) can0 123#1122`, `123#R` or `123#R4` for a
// remote frame, eight digits for an extended identifier.
std::string candump_line(const canopen::Frame& frame, Time timestamp, std::string_view interface_name);

// The same of what happened on a bus; an error frame is an error message of SocketCAN (class bus error, 20000080).
std::string candump_line(const BusEvent& event, Time timestamp, std::string_view interface_name);

// A pcap file of link type 227 (LINKTYPE_CAN_SOCKETCAN, nanoseconds): its header, then a packet for each event.
std::string can_pcap_header();
std::string can_pcap_packet(const BusEvent& event, Time timestamp);

// Writes what happens on a bus to a file. At most 64 KiB wait in memory; then, and on flush() and destruction, they are
// written. A write that fails (disk full) stops the log; failed() says so. Frames withheld by a disturbance are
// written: they were on the wire. Error frames are written as SocketCAN error messages (class bus error, 20000080).
class CanLog final : public BusObserver {
 public:
  enum class Format { candump, pcap };  // pcap: link type 227, LINKTYPE_CAN_SOCKETCAN, nanoseconds

  // Creates or truncates the file; throws LinkError. `epoch`: wall-clock time of the line's time 0.
  CanLog(const std::string& path, Format format, std::string interface_name, Time epoch);
  ~CanLog() override;
  CanLog(const CanLog&) = delete;
  CanLog& operator=(const CanLog&) = delete;

  void on_bus_event(const BusEvent& event) override;
  void flush();
  bool failed() const { return failed_; }

 private:
  void write(const void* bytes, std::size_t size);
  void write_candump(const BusEvent& event);
  void write_pcap(const BusEvent& event);

  Format format_;
  std::string interface_name_;
  Time epoch_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  bool failed_ = false;
};

}  // namespace servodrome::links
