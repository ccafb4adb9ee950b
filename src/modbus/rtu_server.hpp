#pragma once

#include <utility>

#include "modbus/character_format.hpp"
#include "modbus/crc16.hpp"
#include "modbus/server.hpp"

namespace servodrome::modbus {

inline constexpr std::uint8_t broadcast_station = 0;
inline constexpr std::uint8_t highest_station = 247;
inline constexpr std::size_t longest_rtu_frame = 256;

// One station of a serial line in RTU mode (Modbus over Serial Line V1.02, 2.5.1). The caller passes every character of
// the line with the time at which its stop bit ended, and takes frames out. A frame ends with silence. An invalid
// frame, one with a wrong CRC and one for another station are not answered. Each station receives all characters except
// its own.
//
// Usage: receive() for each character, poll() no later than next_deadline(), and after each of these calls take() the
// frame to send. Times must not decrease.
class RtuServer {
 public:
  // `station` 1..247. The server must outlive this object.
  RtuServer(Server& server, std::uint8_t station, const RtuTiming& timing)
      : server_(server), timing_(timing), station_(station) {}

  void receive(std::uint8_t character, Time at);
  // A character with a parity or framing error, or one that two stations sent at once: makes the frame invalid.
  void receive_garbled(Time at);
  void poll(Time now) {
    if (now >= next_deadline()) end_frame();
  }
  // Time at which the silence ends the frame. `never`: no frame is being received.
  Time next_deadline() const { return is_receiving_ ? last_ + timing_.silence : never; }
  // The frame to send, empty if there is none; its bytes are valid until the next call of receive() or poll().
  std::span<const std::uint8_t> take() { return std::span(frame_).first(std::exchange(to_send_, 0)); }

  std::uint8_t station() const { return station_; }
  void set_station(std::uint8_t station) { station_ = station; }
  // Discards received characters and the frame to send, as a serial port does when it is reconfigured.
  void reset(const RtuTiming& timing);

 private:
  void start_character(Time at);
  void end_frame();

  Server& server_;
  RtuTiming timing_;
  std::uint8_t station_;
  bool is_receiving_ = false;
  bool is_spoilt_ = false;
  Time last_{};  // end of the last character
  std::size_t received_ = 0;
  std::size_t to_send_ = 0;
  std::array<std::uint8_t, longest_rtu_frame> frame_{};
};

// Appends the CRC to `size` bytes of `frame`; returns the total length.
constexpr std::size_t seal_rtu_frame(std::span<std::uint8_t> frame, std::size_t size) {
  const std::uint16_t crc = crc16(frame.first(size));
  frame[size] = static_cast<std::uint8_t>(crc);
  frame[size + 1] = static_cast<std::uint8_t>(crc >> 8);
  return size + 2;
}

// At least station, function and CRC, with a correct CRC. (The CRC over a frame including its CRC is 0.)
constexpr bool is_rtu_frame(std::span<const std::uint8_t> frame) { return frame.size() >= 4 && crc16(frame) == 0; }

}  // namespace servodrome::modbus
