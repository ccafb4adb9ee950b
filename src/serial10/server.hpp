#pragma once

#include <chrono>
#include <span>
#include <utility>

#include "dictionary/dictionary.hpp"
#include "serial10/frame.hpp"

namespace servodrome::serial10 {

// A point on the caller's monotonic clock, or a span of it. The stack never asks for the time; it is told.
using Time = std::chrono::nanoseconds;

inline constexpr Time never = Time::max();

// One drive on a serial line that speaks the 10-byte protocol: every character of the line goes in with the time its
// stop bit ended, frames come out. A frame that is for another id or whose checksum is wrong is not answered (iSMK
// manual, ch. 8.4.1); part of a frame is forgotten after `partial_frame_timeout` without a character (the manual gives
// none). Drives on one line are all handed all characters, but not their own.
//
// Answers (iSMK manual, ch. 8.4.2): a write is confirmed with the request's data; a value that is read is lengthened to
// four bytes by its topmost bit, whatever its type; an error carries the CiA 301 abort code.
class Server {
 public:
  static constexpr Time partial_frame_timeout = std::chrono::milliseconds(50);

  // `id` 1..127. The dictionary outlives this.
  Server(dictionary::Dictionary& dictionary, std::uint8_t id) : dictionary_(dictionary), id_(id) {}

  void receive(std::uint8_t character, Time at);
  // A character with a framing error, or one that two drives sent at once: the frame is spoilt.
  void receive_garbled(Time at);
  // There is nothing to do between characters; for symmetry with other stations of a line.
  void poll(Time /*now*/) {}
  Time next_deadline() const { return never; }
  // The answer, empty if there is none; its bytes are valid until the next receive().
  std::span<const std::uint8_t> take() { return std::span(answer_.bytes).first(std::exchange(to_send_, 0)); }

  std::uint8_t id() const { return id_; }
  void set_id(std::uint8_t id) { id_ = id; }
  // Forgets what has been received and what was to be sent, as a serial port does that is set up anew.
  void reset();

  // The answer to an intact request for this drive.
  Frame answer(const Frame& request);

 private:
  Frame read(const Frame& request);
  Frame write(const Frame& request);
  Frame refuse(const Frame& request, dictionary::AbortCode abort) const;

  dictionary::Dictionary& dictionary_;
  std::uint8_t id_;
  bool is_spoilt_ = false;
  std::size_t received_ = 0;
  std::size_t to_send_ = 0;
  Time last_{};  // end of the last character
  Frame request_;
  Frame answer_;
};

}  // namespace servodrome::serial10
