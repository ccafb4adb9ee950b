#pragma once

#include <algorithm>
#include <array>
#include <span>

#include "ethercat/bytes.hpp"

// Layout of mailbox messages (ETG.1000.4 clause 5.6, ETG.1000.6 clause 5.6).
namespace servodrome::ethercat {

// Length 2 (without the header), address 2, channel and priority 1, type 4 bits and counter 3 bits.
inline constexpr std::size_t mailbox_header_size = 6;

enum class MailboxType : std::uint8_t { error = 0, aoe = 1, eoe = 2, coe = 3, foe = 4, soe = 5, voe = 15 };

// ETG.1000.4 table 30.
enum class MailboxError : std::uint16_t {
  syntax = 0x01,
  unsupported_protocol = 0x02,
  invalid_channel = 0x03,
  service_not_supported = 0x04,
  invalid_header = 0x05,
  size_too_short = 0x06,
  no_more_memory = 0x07,
  invalid_size = 0x08,
};

// A message under construction in a mailbox; `room` is the space behind the mailbox header.
struct Message {
  std::span<std::uint8_t> room;
  std::size_t length = 0;  // 0: no message
  MailboxType type = MailboxType::coe;

  std::size_t left() const { return room.size() - length; }
  std::uint8_t* add(std::size_t bytes) {
    std::uint8_t* place = room.data() + length;
    length += bytes;
    return place;
  }
  void u8(unsigned value) { *add(1) = static_cast<std::uint8_t>(value); }
  void u16(unsigned value) { store_u16(add(2), value); }
  void u32(std::uint32_t value) { store_u32(add(4), value); }
  template <typename Byte>
  void bytes(std::span<Byte> content) {
    if (!content.empty()) std::memcpy(add(content.size()), content.data(), content.size());
  }
};

// CoE header: number 9 bits, 3 reserved, service 4 bits (ETG.1000.6 table 27).
inline constexpr std::size_t coe_header_size = 2;
enum class CoeService : std::uint8_t {
  emergency = 1,
  sdo_request = 2,
  sdo_response = 3,
  tx_pdo = 4,
  rx_pdo = 5,
  tx_pdo_remote = 6,
  rx_pdo_remote = 7,
  sdo_information = 8,
};

inline void begin_coe(Message& message, CoeService service) {
  message.type = MailboxType::coe;
  message.length = 0;
  message.u16(static_cast<unsigned>(service) << 12);
}

}  // namespace servodrome::ethercat
