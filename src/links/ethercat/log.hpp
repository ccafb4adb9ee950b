#pragma once

#include <array>
#include <cstdio>
#include <memory>
#include <string>

#include "links/ethercat/bus.hpp"

namespace servodrome::links {

// Writes the frames of a bus to a pcap file (link type 1, Ethernet, nanoseconds): each frame as it came from the master
// and, if it came back, as it came back. Contents of UDP packets get an invented Ethernet header, with the source
// addresses that a master and a slave controller would use. Up to 64 KiB are buffered; flush() and the destructor write
// them. A write error (disk full) stops the log and sets failed().
class EthercatLog final : public EthercatObserver {
 public:
  using EthernetHeader = std::array<std::uint8_t, 14>;
  // The invented Ethernet header of a frame that was in a UDP packet.
  static const EthernetHeader& made_up_header(Direction direction);

  // Creates or truncates the file; throws LinkError. `epoch`: wall-clock time of the line's time 0.
  EthercatLog(const std::string& path, Time epoch);
  EthercatLog(const EthercatLog&) = delete;
  EthercatLog& operator=(const EthercatLog&) = delete;

  void on_frame(std::span<const std::uint8_t> bytes, ethercat::Segment::Encapsulation encapsulation,
                Direction direction, Time at) override;
  // For a log that was opened before the line's time 0 is known.
  void set_epoch(Time epoch) { epoch_ = epoch; }
  void flush();
  bool failed() const { return failed_; }

 private:
  void write(const void* bytes, std::size_t size);

  Time epoch_;
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  bool failed_ = false;
};

}  // namespace servodrome::links
