#pragma once

#include <utility>

#include "modbus/server.hpp"

namespace servodrome::modbus {

// The header of Modbus TCP: transaction, protocol (0), length of the following bytes including the unit, unit (Modbus
// Messaging on TCP/IP V1.0b, 3.1.3).
struct Mbap {
  static constexpr std::size_t size = 7;

  std::uint16_t transaction = 0;
  std::uint16_t protocol = 0;
  std::uint16_t length = 0;
  std::uint8_t unit = 0;

  static constexpr Mbap read(const std::uint8_t* bytes) {
    return {read_u16(bytes), read_u16(bytes + 2), read_u16(bytes + 4), bytes[6]};
  }
  constexpr void write(std::uint8_t* bytes) const {
    write_u16(bytes, transaction);
    write_u16(bytes + 2, protocol);
    write_u16(bytes + 4, length);
    bytes[6] = unit;
  }
  // A PDU of 1 to 253 bytes follows.
  constexpr bool is_valid() const { return protocol == 0 && length >= 2 && length <= 1 + longest_pdu; }
};

inline constexpr std::size_t longest_tcp_frame = Mbap::size + longest_pdu;

// Unit identifiers for the only device behind an address (Modbus Messaging on TCP/IP V1.0b, 4.4.2.1).
inline constexpr std::uint8_t no_unit = 0;
inline constexpr std::uint8_t unspecified_unit = 255;

// The devices behind one TCP address.
class Units {
 public:
  // Returns the server for a unit identifier, or nullptr if it is unused. The only device behind an address also
  // answers to no_unit and unspecified_unit.
  virtual Server* find(std::uint8_t unit) = 0;

 protected:
  ~Units() = default;
};

// One client connection: accepts its bytes in pieces of any size and returns the responses. Requests are answered one
// after the other in their order; a client may send the next one before it has the response.
class TcpConnection {
 public:
  explicit TcpConnection(Units& units) : units_(units) {}

  // Takes bytes up to the end of a request; returns the number of bytes taken. Call it again with the rest after
  // take().
  std::size_t receive(std::span<const std::uint8_t> bytes);
  // The response, empty if there is none; its bytes are valid until the next receive().
  std::span<const std::uint8_t> take() { return std::span(frame_).first(std::exchange(to_send_, 0)); }
  // The client does not send valid Modbus TCP, so the start of its next request is unknown. Close the connection.
  bool is_broken() const { return is_broken_; }

 private:
  void answer();

  Units& units_;
  bool is_broken_ = false;
  std::size_t received_ = 0;
  std::size_t to_send_ = 0;
  std::array<std::uint8_t, longest_tcp_frame> frame_{};
};

}  // namespace servodrome::modbus
