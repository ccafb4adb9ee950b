#pragma once

#include <cstdio>
#include <memory>
#include <string>

#include "links/can/bus.hpp"

namespace servodrome::links {

// Returns a frame in the format of `candump -L`, without line end: `(1436509052.249713) can0 123#1122`, `123#R` or
// `123#R4` for a remote frame, eight digits for an extended identifier.
std::string candump_line(const canopen::Frame& frame, Time timestamp, std::string_view interface_name);

// The same for an event on a bus. An error frame becomes a SocketCAN error message (class bus error, 20000080).
std::string candump_line(const BusEvent& event, Time timestamp, std::string_view interface_name);

// The header of a pcap file of link type 227 (LINKTYPE_CAN_SOCKETCAN, nanoseconds), and the packet for an event.
std::string can_pcap_header();
std::string can_pcap_packet(const BusEvent& event, Time timestamp);

// Writes the events on a bus to a file. Up to 64 KiB are buffered; flush() and the destructor write them. A write error
// (disk full) stops the log and sets failed(). The log contains frames that a disturbance withheld from the receivers,
// because they were on the wire. Error frames become SocketCAN error messages (class bus error, 20000080).
class CanLog final : public BusObserver {
 public:
  enum class Format { candump, pcap };  // pcap: link type 227, LINKTYPE_CAN_SOCKETCAN, nanoseconds

  // Creates or truncates the file; throws LinkError. `epoch`: wall-clock time of the line's time 0.
  CanLog(const std::string& path, Format format, std::string interface_name, Time epoch);
  ~CanLog() override;
  CanLog(const CanLog&) = delete;
  CanLog& operator=(const CanLog&) = delete;

  void on_bus_event(const BusEvent& event) override;
  // For a log that was opened before the line's time 0 is known.
  void set_epoch(Time epoch) { epoch_ = epoch; }
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
