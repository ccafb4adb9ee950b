#pragma once

#include <chrono>
#include <span>
#include <utility>

#include "dictionary/dictionary.hpp"
#include "serial10/frame.hpp"

namespace servodrome::serial10 {

// A point in time on the caller's monotonic clock, or a duration. The stack never reads a clock: the caller passes the
// time.
using Time = std::chrono::nanoseconds;

inline constexpr Time never = Time::max();

// One drive on a serial line with the 10-byte protocol. The caller passes every character of the line with the time at
// which its stop bit ended, and takes frames out. A frame for another id or with a wrong checksum is not answered (iSMK
// manual, ch. 8.4.1). An incomplete frame is discarded after `partial_frame_timeout` without a character (the manual
// gives no value). Each drive receives all characters except its own.
//
// Answers (iSMK manual, ch. 8.4.2): a write is confirmed with the data of the request; a value that is read is extended
// to four bytes by its topmost bit, for every type; an error contains the CiA 301 abort code.
class Server {
 public:
  static constexpr Time partial_frame_timeout = std::chrono::milliseconds(50);

  // `id` 1..127. The dictionary must outlive this object.
  Server(dictionary::Dictionary& dictionary, std::uint8_t id) : dictionary_(dictionary), id_(id) {}

  void receive(std::uint8_t character, Time at);
  // A character with a framing error, or one that two drives sent at once: makes the frame invalid.
  void receive_garbled(Time at);
  // Nothing is to be done between characters; these functions exist because other stations of a line have them.
  void poll(Time /*now*/) {}
  Time next_deadline() const { return never; }
  // The answer, empty if there is none; its bytes are valid until the next receive().
  std::span<const std::uint8_t> take() { return std::span(answer_.bytes).first(std::exchange(to_send_, 0)); }

  std::uint8_t id() const { return id_; }
  void set_id(std::uint8_t id) { id_ = id; }
  // Discards received characters and the answer to send, as a serial port does when it is reconfigured.
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
