#pragma once

#include <array>
#include <functional>
#include <span>

#include "links/serial/line.hpp"

namespace servodrome::links {

// A piece of what went over a serial line or past it.
struct SerialMessage {
  SerialSender side = SerialSender::unknown;
  SerialPortId port{};
  bool is_tcp = false;  // a message of Modbus TCP
  std::span<const std::uint8_t> bytes;
  Time at{};  // end of its last character
};

// Joins the characters of a line to messages: what one station sends without a pause that ends a frame (Modbus over
// Serial Line V1.02, 2.5.1.1). Nothing is allocated while it listens.
class SerialMessages final : public SerialObserver {
 public:
  static constexpr std::size_t longest = 512;  // of RTU: 256
  using Take = std::function<void(const SerialMessage&)>;

  SerialMessages(SerialLine& line, Take take);
  ~SerialMessages() override { line_.remove_observer(*this); }
  SerialMessages(const SerialMessages&) = delete;
  SerialMessages& operator=(const SerialMessages&) = delete;

  // Hands over what has been followed by a pause until now.
  void flush() {
    if (line_.now() - message_.at >= silence_) end();
  }
  // Hands over what there is.
  void end();

 private:
  void on_character(SerialSender side, SerialPortId port, std::uint8_t character, Time at) override;
  void on_tcp_message(SerialSender side, std::span<const std::uint8_t> message, Time at) override;

  SerialLine& line_;
  Take take_;
  Time silence_;
  SerialMessage message_{};
  std::size_t size_ = 0;
  std::array<std::uint8_t, longest> characters_{};
};

}  // namespace servodrome::links
