#pragma once

#include <span>

#include "canopen/frame.hpp"
#include "canopen/time.hpp"

namespace servodrome::canopen {

// What the services of a node share: the time they were last told, the frames waiting to be sent, and the moment the
// node wants to be polled. A deadline may be announced and then lapse; the poll that finds nothing due works out the
// next one.
class Link {
 public:
  // `ring` holds the frames that wait; its size is a power of two.
  explicit Link(std::span<Frame> ring) : ring_(ring), mask_(static_cast<std::uint32_t>(ring.size() - 1)) {}

  Time now() const { return now_; }
  void set_now(Time now) { now_ = now; }

  // False if the ring is full; the frame is lost then.
  bool transmit(const Frame& frame) {
    if (head_ - tail_ > mask_) {
      overrun_ = true;
      return false;
    }
    ring_[head_++ & mask_] = frame;
    return true;
  }
  bool take(Frame& frame) {
    if (head_ == tail_ || muted()) return false;
    frame = ring_[tail_++ & mask_];
    return true;
  }
  void discard() { tail_ = head_; }

  // Nothing is sent before `time` (a bit rate is being switched).
  void mute_until(Time time) {
    muted_until_ = time;
    wake_at(time);
  }
  bool muted() const { return now_ < muted_until_; }
  Time muted_until() const { return muted_until_; }

  // True once after frames were lost.
  bool take_overrun() {
    const bool overrun = overrun_;
    overrun_ = false;
    return overrun;
  }

  Time wake() const { return wake_; }
  void wake_at(Time deadline) {
    if (deadline < wake_) wake_ = deadline;
  }
  void clear_wake() { wake_ = never; }

 private:
  Time now_{0};
  Time wake_ = never;
  Time muted_until_{0};
  std::span<Frame> ring_;
  std::uint32_t mask_;
  std::uint32_t head_ = 0;
  std::uint32_t tail_ = 0;
  bool overrun_ = false;
};

}  // namespace servodrome::canopen
