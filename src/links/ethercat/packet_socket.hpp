#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <sys/uio.h>

#include "links/file_descriptor.hpp"

namespace servodrome::links {

// A packet socket (AF_PACKET) on an Ethernet interface, nonblocking, that receives EtherCAT frames of others: of type
// 88A4h, in IPv4 UDP to port 88A4h, each with or without a VLAN tag, whatever address they are sent to.
//
// Received frames lie in memory shared with the kernel, where they may be changed and sent from: nothing is copied and
// no system call made to receive. Sending is one system call for any number of frames.
class PacketSocket {
 public:
  static constexpr std::size_t most_frames = 32;  // in one send()

  // Throws LinkError: no permission, no such interface, not Ethernet, down, or an MTU below 1500. `link` is the name to
  // complain under.
  PacketSocket(const std::string& interface, const std::string& link);
  ~PacketSocket();
  PacketSocket(const PacketSocket&) = delete;
  PacketSocket& operator=(const PacketSocket&) = delete;

  // Readable when there is a frame, or an error.
  int descriptor() const { return socket_.get(); }

  // The received frame that is `ahead` behind the oldest, as it was on the wire without FCS; empty: there is none. It
  // may be changed, and stays until it is released. To be asked for once.
  std::span<std::uint8_t> frame(std::size_t ahead);
  // The oldest `count` go.
  void release(std::size_t count);

  // Returns how many of at most `most_frames` went out, from the first on; errno says why the next did not.
  std::size_t send(std::span<const iovec> frames);

  // What is wrong with the interface since the last call (ENETDOWN); 0: nothing.
  int take_error();
  // Frames that were lost since the last call because others were not released; a system call only if there were any.
  std::uint32_t take_overruns();

 private:
  std::uint8_t* slot(std::size_t ahead) const;

  FileDescriptor socket_;
  std::uint8_t* ring_ = nullptr;
  std::size_t first_ = 0;  // slot of the oldest frame
  bool losing_ = false;    // a received frame says that others were lost
};

}  // namespace servodrome::links
