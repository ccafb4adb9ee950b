#pragma once

#include <utility>

#include "modbus/server.hpp"

namespace servodrome::modbus {

// The header of Modbus TCP: transaction, protocol (0), length of what follows including the unit, unit (Modbus
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

// Unit identifiers for a device that is alone behind its address (Modbus Messaging on TCP/IP V1.0b, 4.4.2.1).
inline constexpr std::uint8_t no_unit = 0;
inline constexpr std::uint8_t unspecified_unit = 255;

// The devices behind one TCP address.
class Units {
 public:
  // The server for a unit identifier, or nullptr: it is unused. A device that is alone behind its address answers to
  // no_unit and unspecified_unit as well.
  virtual Server* find(std::uint8_t unit) = 0;

 protected:
  ~Units() = default;
};

// What one client sends, in whatever pieces, and what it is answered. Requests are answered one after the other in
// their order; a client may send the next before it has the answer.
class TcpConnection {
 public:
  explicit TcpConnection(Units& units) : units_(units) {}

  // Takes bytes up to the end of a request; returns how many it took. Call again with the rest after take().
  std::size_t receive(std::span<const std::uint8_t> bytes);
  // The response, empty if there is none; its bytes are valid until the next receive().
  std::span<const std::uint8_t> take() { return std::span(frame_).first(std::exchange(to_send_, 0)); }
  // The client does not speak Modbus TCP: where its requests begin is not known any more. Close the connection.
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
