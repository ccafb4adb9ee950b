#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <sys/uio.h>

#include "links/file_descriptor.hpp"

namespace servodrome::links {

// A nonblocking packet socket (AF_PACKET) on an Ethernet interface. It receives the EtherCAT frames of others, to any
// address: EtherType 88A4h, or IPv4 UDP to port 88A4h, each with or without a VLAN tag.
//
// Received frames are in memory shared with the kernel. They can be changed and sent from there, so receiving needs no
// copy and no system call. Sending needs one system call for any number of frames.
class PacketSocket {
 public:
  static constexpr std::size_t most_frames = 32;  // in one send()

  // Throws LinkError: no permission, no such interface, not Ethernet, down, or an MTU below 1500. `link` is the name in
  // messages.
  PacketSocket(const std::string& interface, const std::string& link);
  ~PacketSocket();
  PacketSocket(const PacketSocket&) = delete;
  PacketSocket& operator=(const PacketSocket&) = delete;

  // Readable when there is a frame or an error.
  int descriptor() const { return socket_.get(); }

  // Returns the received frame at position `ahead` behind the oldest, as it was on the wire without FCS; empty: there
  // is none. The frame may be changed and stays valid until release(). Must be called only once per frame, because it
  // puts the VLAN tag back in place.
  std::span<std::uint8_t> frame(std::size_t ahead);
  // Gives the oldest `count` frames back to the kernel.
  void release(std::size_t count);

  // Returns how many of at most `most_frames` frames were sent, from the first on. errno is the reason why the next was
  // not.
  std::size_t send(std::span<const iovec> frames);

  // Returns and clears the socket's error, such as ENETDOWN; 0: none.
  int take_error();
  // Returns how many frames were lost since the last call because the ring was full. Needs a system call only if there
  // were any.
  std::uint32_t take_overruns();

 private:
  std::uint8_t* slot(std::size_t ahead) const;

  FileDescriptor socket_;
  std::uint8_t* ring_ = nullptr;
  std::size_t first_ = 0;  // slot of the oldest frame
  bool losing_ = false;    // the kernel has marked a frame: others were lost
};

}  // namespace servodrome::links
