#pragma once

#include <algorithm>

#include "ethercat/frame/datagram.hpp"

namespace servodrome::ethercat {

// Composes a frame of a master: optional Ethernet header, EtherCAT header, datagrams (ETG.1000.4 clause 5.3).
class FrameWriter {
 public:
  static constexpr std::array<std::uint8_t, 6> default_source{0x10, 0x10, 0x10, 0x10, 0x10, 0x10};

  // EtherCAT in an Ethernet frame: type 88A4h, broadcast.
  static FrameWriter ethernet(std::span<std::uint8_t> memory, std::array<std::uint8_t, 6> source = default_source) {
    std::fill_n(memory.begin(), 6, std::uint8_t{0xFF});
    std::copy(source.begin(), source.end(), memory.begin() + 6);
    memory[12] = 0x88;
    memory[13] = 0xA4;
    return {memory, 14};
  }
  // The content of a UDP packet.
  static FrameWriter payload(std::span<std::uint8_t> memory) { return {memory, 0}; }

  // Number of data bytes that another datagram may have; negative if not even an empty datagram fits.
  int room() const {
    const std::size_t limit = std::min(memory_.size(), start_ + max_payload);
    return static_cast<int>(limit) - static_cast<int>(end_) - static_cast<int>(datagram_overhead);
  }

  // Appends a datagram. Returns its data, all zero, for the caller to fill; empty if it does not fit. `address` is ADP
  // | ADO << 16, or the logical address.
  std::span<std::uint8_t> add(Command command, std::uint8_t index, std::uint32_t address, std::size_t length) {
    if (room() < static_cast<int>(length)) return {};
    if (last_ != 0) store_u16(&memory_[last_ + 6], load_u16(&memory_[last_ + 6]) | more_bit);
    std::uint8_t* header = &memory_[end_];
    std::fill_n(header, datagram_overhead + length, std::uint8_t{0});
    header[0] = static_cast<std::uint8_t>(command);
    header[1] = index;
    store_u32(header + 2, address);
    store_u16(header + 6, static_cast<unsigned>(length));
    last_ = end_;
    end_ += datagram_overhead + length;
    store_u16(&memory_[start_], static_cast<unsigned>(end_ - start_ - 2) | 0x1000U);
    return {header + datagram_header_size, length};
  }

  // The frame so far, without FCS and without padding to the minimum Ethernet length.
  std::span<std::uint8_t> bytes() const { return memory_.first(end_); }

 private:
  FrameWriter(std::span<std::uint8_t> memory, std::size_t start) : memory_(memory), start_(start), end_(start + 2) {
    store_u16(&memory_[start_], 0x1000U);
  }

  std::span<std::uint8_t> memory_;
  std::size_t start_;     // position of the EtherCAT header
  std::size_t end_;       // end of the written bytes
  std::size_t last_ = 0;  // position of the last datagram's header; 0: none yet
};

// Combines ADP and ADO of a datagram into one address.
constexpr std::uint32_t address_of(std::uint16_t adp, std::uint16_t ado) {
  return adp | static_cast<std::uint32_t>(ado) << 16;
}

}  // namespace servodrome::ethercat
