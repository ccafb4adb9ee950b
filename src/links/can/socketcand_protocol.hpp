#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "canopen/frame.hpp"
#include "links/time.hpp"

// The text protocol of socketcand (github.com/linux-can/socketcand, doc/protocol.md), as far as raw mode needs it: a
// stream of elements `< word word ... >`. What python-can's `socketcand` interface sends and expects is noted where it
// differs.
namespace servodrome::links::socketcand {

inline constexpr std::size_t longest_element = 256;  // between the angle brackets; longer ones are discarded

// Cuts a byte stream into elements. What stands outside of angle brackets is skipped.
class ElementReader {
 public:
  // Takes bytes up to and including the one that completes an element and returns how many; ready() then says whether
  // there is an element.
  std::size_t feed(std::string_view bytes);
  bool ready() const { return ready_; }
  // The words' text between the brackets; valid until the next feed().
  std::string_view element() const { return {text_.data(), size_}; }
  // Elements discarded because they were too long.
  std::uint64_t oversized() const { return oversized_; }

 private:
  enum class State : std::uint8_t { outside, inside, discarding };
  std::array<char, longest_element> text_{};
  std::size_t size_ = 0;
  std::uint64_t oversized_ = 0;
  State state_ = State::outside;
  bool ready_ = false;
};

// The words of an element; more than fit are dropped and `overflow` says so.
struct Words {
  std::array<std::string_view, 12> word{};
  std::size_t count = 0;
  bool overflow = false;

  explicit Words(std::string_view element);
  bool is(std::string_view command) const { return count > 0 && word[0] == command; }
};

// `send ID DLC [byte ...]` and `sendrtr ID DLC`. The identifier is hexadecimal, extended if it has 8 digits; bytes have
// one or two. A `send` with a length above 0 and no bytes is a remote frame: that is what python-can makes of one (and
// what socketcand refuses); with length 0 the two cannot be told apart, and it is a data frame.
std::optional<canopen::Frame> parse_send(const Words& words);
std::string format_send(const canopen::Frame& frame);

// `frame ID seconds.useconds HEX` and `rtr ID seconds.useconds DLC`; socketcand in BCM mode puts spaces between the
// bytes, which parse_frame() accepts as well. python-can knows no `rtr` and skips it with a warning.
std::optional<canopen::Frame> parse_frame(const Words& words);
std::string format_frame(const canopen::Frame& frame, Time timestamp);

}  // namespace servodrome::links::socketcand
