#pragma once

#include <algorithm>
#include <span>

#include "canopen/frame.hpp"
#include "canopen/time.hpp"

namespace servodrome::canopen {

// State shared by the services of a node: the present time, the queue of frames to send, and the time of the next poll.
// The time of the next poll may be too early, because a cancelled deadline still counts: such a poll finds nothing due,
// and calculates the next time.
class Link {
 public:
  // Place of a waiting frame in the queue. A sent frame never gets its place back.
  using Place = std::uint64_t;
  static constexpr Place no_place = ~Place{0};
  // Time until a service tries again whose frame found no place in the full queue.
  static constexpr Time retry_time = std::chrono::milliseconds(1);

  // `ring` is the ring buffer for waiting frames; its size is a power of two.
  explicit Link(std::span<WaitingFrame> ring) : ring_(ring), mask_(ring.size() - 1) {}

  Time now() const { return now_; }
  void set_now(Time now) { now_ = now; }

  // Appends a frame to the queue. Returns false if the ring is full; the frame is lost then.
  bool transmit(const Frame& frame) {
    if (full()) {
      overrun_ = true;
      return false;
    }
    ring_[head_++ & mask_] = {frame, now_};
    return true;
  }
  // For a service for which only the newest frame counts. If the frame at `place` still waits, returns it to be
  // overwritten; otherwise appends a new frame. Returns nullptr if the ring is full; the caller must retry.
  Frame* newest(Place& place) {
    if (!waits(place)) {
      if (full()) return nullptr;
      place = head_++;
      ring_[place & mask_].since = now_;
    }
    return &ring_[place & mask_].frame;
  }
  bool transmit_newest(const Frame& frame, Place& place) {
    Frame* to = newest(place);
    if (to != nullptr) *to = frame;
    return to != nullptr;
  }
  // Removes the frame at `place` from the queue. Returns true if it still waited.
  bool withdraw(Place& place) {
    const bool waited = waits(place);
    if (waited) ring_[place & mask_].frame.length = withdrawn;
    while (head_ != tail_ && ring_[(head_ - 1) & mask_].frame.length == withdrawn) --head_;
    place = no_place;
    return waited;
  }
  bool waits(Place place) const { return place - tail_ < head_ - tail_; }

  // The frame to send next; nullptr: none. It stays in the queue until sent(), and may be changed or withdrawn until
  // then.
  const WaitingFrame* next() {
    while (head_ != tail_ && ring_[tail_ & mask_].frame.length == withdrawn) ++tail_;
    return head_ == tail_ || muted() ? nullptr : &ring_[tail_ & mask_];
  }
  // `frame` was sent. If the frame at the front has changed during the transmission, it stays in the queue.
  void sent(const Frame& frame) {
    const WaitingFrame* front = next();
    if (front == nullptr || front->frame.id != frame.id || front->frame.length != frame.length) return;
    const auto data = front->frame.data.begin();
    if (std::equal(data, data + frame.length, frame.data.begin())) pop();
  }
  // Removes the frame that next() returned.
  void pop() { ++tail_; }
  void discard() { tail_ = head_; }

  // Sends nothing before `time` (while the bit rate is switched).
  void mute_until(Time time) {
    muted_until_ = time;
    wake_at(time);
  }
  bool muted() const { return now_ < muted_until_; }
  Time muted_until() const { return muted_until_; }

  // Returns true once after frames were lost.
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
  bool full() const { return head_ - tail_ > mask_; }

  static constexpr std::uint8_t withdrawn = 0xFF;  // value of a frame's length

  Time now_{0};
  Time wake_ = never;
  Time muted_until_{0};
  std::span<WaitingFrame> ring_;
  std::uint64_t mask_;
  std::uint64_t head_ = 0;
  std::uint64_t tail_ = 0;
  bool overrun_ = false;
};

}  // namespace servodrome::canopen
