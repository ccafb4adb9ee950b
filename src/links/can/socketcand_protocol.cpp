#include "links/can/socketcand_protocol.hpp"

#include <fmt/format.h>

#include "links/number_text.hpp"

namespace servodrome::links::socketcand {
namespace {

std::optional<std::uint32_t> hex_number(std::string_view digits, std::size_t most_digits) {
  if (digits.size() > most_digits) return std::nullopt;
  return number_of_text<std::uint32_t>(digits, 16);
}

bool read_identifier(std::string_view digits, canopen::Frame& frame) {
  const auto id = hex_number(digits, 8);
  frame.extended = digits.size() == 8;
  if (!id || *id > (frame.extended ? 0x1FFFFFFFU : 0x7FFU)) return false;
  frame.id = *id;
  return true;
}

bool read_length(std::string_view digit, canopen::Frame& frame) {
  if (digit.size() != 1 || digit[0] < '0' || digit[0] > '8') return false;
  frame.length = static_cast<std::uint8_t>(digit[0] - '0');
  return true;
}

std::string identifier_text(const canopen::Frame& frame) {
  return frame.extended ? fmt::format("{:08X}", frame.id) : fmt::format("{:03X}", frame.id);
}

}  // namespace

std::size_t ElementReader::feed(std::string_view bytes) {
  if (ready_) {
    ready_ = false;
    size_ = 0;
    state_ = State::outside;
  }
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const char c = bytes[i];
    if (c == '<') {
      // An element that is still incomplete is dropped, and the stream is synchronised again.
      state_ = State::inside;
      size_ = 0;
    } else if (state_ == State::inside && c == '>') {
      ready_ = true;
      return i + 1;
    } else if (state_ == State::inside && size_ == text_.size()) {
      state_ = State::discarding;
      ++oversized_;
    } else if (state_ == State::inside) {
      text_[size_++] = c;
    }
  }
  return bytes.size();
}

Words::Words(std::string_view element) {
  constexpr std::string_view blanks = " \t\r\n";
  for (;;) {
    const auto begin = element.find_first_not_of(blanks);
    if (begin == std::string_view::npos) return;
    element.remove_prefix(begin);
    const auto end = std::min(element.find_first_of(blanks), element.size());
    if (count == word.size()) {
      overflow = true;
      return;
    }
    word[count++] = element.substr(0, end);
    element.remove_prefix(end);
  }
}

std::optional<canopen::Frame> parse_send(const Words& words) {
  canopen::Frame frame;
  if (words.overflow || words.count < 3) return std::nullopt;
  if (!read_identifier(words.word[1], frame) || !read_length(words.word[2], frame)) return std::nullopt;
  const std::size_t bytes = words.count - 3;
  frame.remote = words.is("sendrtr") || (frame.length > 0 && bytes == 0);
  if (bytes != (frame.remote ? 0U : frame.length)) return std::nullopt;
  for (std::size_t i = 0; i < bytes; ++i) {
    const auto byte = hex_number(words.word[3 + i], 2);
    if (!byte) return std::nullopt;
    frame.data[i] = static_cast<std::uint8_t>(*byte);
  }
  return frame;
}

std::string format_send(const canopen::Frame& frame) {
  std::string text =
      fmt::format("< {} {} {} ", frame.remote ? "sendrtr" : "send", identifier_text(frame), frame.length);
  for (unsigned i = 0; !frame.remote && i < frame.length; ++i) text += fmt::format("{:02X} ", frame.data[i]);
  return text + ">";
}

std::optional<canopen::Frame> parse_frame(const Words& words) {
  canopen::Frame frame;
  if (words.overflow || words.count < 3 || !read_identifier(words.word[1], frame)) return std::nullopt;
  if (words.is("rtr")) {
    frame.remote = true;
    if (words.count != 4 || !read_length(words.word[3], frame)) return std::nullopt;
    return frame;
  }
  for (std::size_t i = 3; i < words.count; ++i) {
    for (std::string_view digits = words.word[i]; !digits.empty(); digits.remove_prefix(2)) {
      const auto byte = digits.size() < 2 ? std::nullopt : hex_number(digits.substr(0, 2), 2);
      if (!byte || frame.length == 8) return std::nullopt;
      frame.data[frame.length++] = static_cast<std::uint8_t>(*byte);
    }
  }
  return frame;
}

std::string format_frame(const canopen::Frame& frame, Time timestamp) {
  const auto microseconds = timestamp.count() / 1000;
  std::string text = fmt::format("< {} {} {}.{:06} ", frame.remote ? "rtr" : "frame", identifier_text(frame),
                                 microseconds / 1'000'000, microseconds % 1'000'000);
  if (frame.remote) {
    text += fmt::format("{}", frame.length);
  } else {
    for (unsigned i = 0; i < frame.length; ++i) text += fmt::format("{:02X}", frame.data[i]);
  }
  return text + " >";
}

}  // namespace servodrome::links::socketcand
