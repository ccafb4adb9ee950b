#include "links/serial/messages.hpp"

#include <utility>

namespace servodrome::links {

SerialMessages::SerialMessages(SerialLine& line, Take take)
    : line_(line), take_(std::move(take)), silence_(modbus::standard_timing(line.format()).silence) {
  line_.add_observer(*this);
}

void SerialMessages::end() {
  if (size_ == 0) return;
  message_.bytes = std::span(characters_).first(std::exchange(size_, 0));
  take_(message_);
}

void SerialMessages::on_character(SerialSender side, SerialPortId port, std::uint8_t character, Time at) {
  if (size_ != 0 && (port != message_.port || at - message_.at > silence_ || size_ == longest)) end();
  message_ = {side, port, false, {}, at};
  characters_[size_++] = character;
}

void SerialMessages::on_tcp_message(SerialSender side, std::span<const std::uint8_t> message, Time at) {
  end();
  take_({side, {}, true, message, at});
}

}  // namespace servodrome::links
