#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "canopen/frame.hpp"
#include "links/time.hpp"

// The text protocol of socketcand (github.com/linux-can/socketcand, doc/protocol.md), the part that raw mode needs: a
// stream of elements `< word word ... >`. Comments note where python-can's `socketcand` interface differs.
namespace servodrome::links::socketcand {

inline constexpr std::size_t longest_element = 256;  // between the angle brackets; longer elements are discarded

// Splits a byte stream into elements. Text outside angle brackets is skipped.
class ElementReader {
 public:
  // Reads bytes up to the end of an element and returns how many. ready() then returns true if an element is complete.
  std::size_t feed(std::string_view bytes);
  bool ready() const { return ready_; }
  // The text between the brackets; valid until the next feed().
  std::string_view element() const { return {text_.data(), size_}; }
  // The number of elements discarded because they were too long.
  std::uint64_t oversized() const { return oversized_; }

 private:
  enum class State : std::uint8_t { outside, inside, discarding };
  std::array<char, longest_element> text_{};
  std::size_t size_ = 0;
  std::uint64_t oversized_ = 0;
  State state_ = State::outside;
  bool ready_ = false;
};

// The words of an element. If there are too many, the rest is dropped and `overflow` is set.
struct Words {
  std::array<std::string_view, 12> word{};
  std::size_t count = 0;
  bool overflow = false;

  explicit Words(std::string_view element);
  bool is(std::string_view command) const { return count > 0 && word[0] == command; }
};

// `send ID DLC [byte ...]` and `sendrtr ID DLC`. The identifier is hexadecimal, and extended if it has 8 digits; bytes
// have one or two digits. A `send` with a length above 0 but no bytes is a remote frame: python-can writes remote
// frames in this form, although socketcand rejects it. With length 0 it is a data frame, since the two cannot be
// distinguished.
std::optional<canopen::Frame> parse_send(const Words& words);
std::string format_send(const canopen::Frame& frame);

// `frame ID seconds.useconds HEX` and `rtr ID seconds.useconds DLC`. parse_frame() also accepts spaces between the
// bytes, which socketcand writes in BCM mode. python-can does not know `rtr` and skips it with a warning.
std::optional<canopen::Frame> parse_frame(const Words& words);
std::string format_frame(const canopen::Frame& frame, Time timestamp);

}  // namespace servodrome::links::socketcand
