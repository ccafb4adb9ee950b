#pragma once

#include <array>
#include <functional>
#include <span>

#include "links/serial/line.hpp"

namespace servodrome::links {

// A message on a serial line, or one of Modbus TCP.
struct SerialMessage {
  SerialSender side = SerialSender::unknown;
  SerialPortId port{};
  bool is_tcp = false;  // a message of Modbus TCP
  std::span<const std::uint8_t> bytes;
  Time at{};  // end of the last character
};

// Joins the characters of a line to messages. A message is what one station sends without the pause that ends a frame
// (Modbus over Serial Line V1.02, 2.5.1.1). Nothing is allocated while it listens.
class SerialMessages final : public SerialObserver {
 public:
  static constexpr std::size_t longest = 512;  // an RTU frame has at most 256
  using Take = std::function<void(const SerialMessage&)>;

  SerialMessages(SerialLine& line, Take take);
  ~SerialMessages() override { line_.remove_observer(*this); }
  SerialMessages(const SerialMessages&) = delete;
  SerialMessages& operator=(const SerialMessages&) = delete;

  // Passes on the current message if the pause after it has ended the frame.
  void flush() {
    if (line_.now() - message_.at >= silence_) end();
  }
  // Passes on the current message, even if it is incomplete.
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
