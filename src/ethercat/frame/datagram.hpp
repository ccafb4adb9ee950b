#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "ethercat/bytes.hpp"

// EtherCAT frames and their datagrams in memory (ETG.1000.4 clause 5.3).
namespace servodrome::ethercat {

// ETG.1000.4 table 10. A: addressed by position, F: by station address, B: broadcast, L: by logical address. M in the
// last two: the addressed slave writes into the frame, all others read.
enum class Command : std::uint8_t {
  nop = 0,
  aprd = 1,
  apwr = 2,
  aprw = 3,
  fprd = 4,
  fpwr = 5,
  fprw = 6,
  brd = 7,
  bwr = 8,
  brw = 9,
  lrd = 10,
  lwr = 11,
  lrw = 12,
  armw = 13,
  frmw = 14,
};

// Layout: command 1, index 1, address 4 (ADP 2, ADO 2, or logical), length 11 bits + 3 reserved + circulating + more,
// interrupt 2, data, working counter 2.
inline constexpr std::size_t datagram_header_size = 10;
inline constexpr std::size_t datagram_overhead = datagram_header_size + 2;
inline constexpr std::size_t max_payload = 1500;  // bytes: EtherCAT header and datagrams
inline constexpr std::size_t max_datagram_data = max_payload - 2 - datagram_overhead;
inline constexpr std::size_t max_datagrams = (max_payload - 2) / datagram_overhead;
inline constexpr std::size_t max_frame = 14 + 4 + max_payload;  // bytes without FCS, one VLAN tag

inline constexpr std::uint16_t length_mask = 0x07FF;
inline constexpr std::uint16_t circulating_bit = 0x4000;
inline constexpr std::uint16_t more_bit = 0x8000;

// Increment of the working counter (ETG.1000.4 table 11).
constexpr unsigned gain(bool read, bool written, bool both_wanted) {
  return (read ? 1U : 0U) + (written ? both_wanted ? 2U : 1U : 0U);
}

// Points into the bytes of a frame; the setters change the frame. `command` and `length` are copies.
struct Datagram {
  std::uint8_t* header;
  std::uint16_t length;  // bytes of data
  Command command;

  std::uint8_t* data() const { return header + datagram_header_size; }
  std::span<std::uint8_t> content() const { return {data(), length}; }
  std::uint8_t index() const { return header[1]; }                 // a number of the master's choice
  std::uint16_t position() const { return load_u16(header + 2); }  // ADP
  void set_position(unsigned value) { store_u16(header + 2, value); }
  std::uint16_t offset() const { return load_u16(header + 4); }  // ADO
  std::uint32_t logical() const { return load_u32(header + 2); }
  bool circulating() const { return (load_u16(header + 6) & circulating_bit) != 0; }
  void set_circulating() { store_u16(header + 6, load_u16(header + 6) | circulating_bit); }
  std::uint16_t interrupt() const { return load_u16(header + 8); }
  void raise_interrupt(unsigned events) { store_u16(header + 8, interrupt() | events); }
  std::uint16_t working_counter() const { return load_u16(data() + length); }
  void count(unsigned step) { set_working_counter(working_counter() + step); }
  void set_working_counter(unsigned value) { store_u16(data() + length, value); }  // the low 16 bits of `value`
};

enum class FrameKind : std::uint8_t {
  ethercat,   // datagrams for slave controllers
  foreign,    // another protocol, or an EtherCAT type that slave controllers pass on (ETG.1000.4 table 8)
  malformed,  // EtherCAT, but the datagrams exceed the frame
};

// A parsed frame. Its pointers refer to the bytes that were parsed.
struct Frame {
  std::span<Datagram> datagrams() { return std::span(store_.data(), count_); }

  std::uint8_t* source_address;  // of the Ethernet header; nullptr without one
  std::uint8_t* udp_checksum;    // nullptr if it is not EtherCAT over UDP

  std::array<Datagram, max_datagrams> store_;  // only the first `count_` are valid
  std::size_t count_ = 0;
};

// Parses an Ethernet frame without FCS: type 88A4h, or IPv4 UDP to port 88A4h, each with or without a VLAN tag. Ignores
// the length in the EtherCAT header, as slave controllers do: the chain of datagrams gives the length.
FrameKind parse_ethernet(std::span<std::uint8_t> bytes, Frame& frame);

// The same for the content of a UDP packet: the EtherCAT header and what follows it.
FrameKind parse_payload(std::span<std::uint8_t> bytes, Frame& frame);

}  // namespace servodrome::ethercat
