#pragma once

#include <chrono>

namespace servodrome::line {

// Whether a master's next frame is worth staying awake for. To be woken costs more than a frame that passes a segment,
// so it is while a master sends each frame soon after it got the one before (a scan, SDOs, files, a fast cycle); one
// that cycles once in a millisecond is awaited asleep.
class Vigil {
 public:
  using Moment = std::chrono::steady_clock::time_point;

  static constexpr auto longest = std::chrono::microseconds(100);  // from an answer to the next frame
  static constexpr int proof = 8;                                  // frames in a row that came so soon
  // Lent to others for longer, the processor is one that something computes on without end.
  static constexpr auto longest_loan = std::chrono::milliseconds(1);
  // Frames to pass then before another try: who sleeps gets such a processor back sooner than who lends it.
  static constexpr int respite = 10'000;

  // Frames came, and have been answered at `present`.
  void served(Moment present) {
    const bool soon = present - answered_ <= longest;
    answered_ = present;
    if (soon) {
      if (score_ < proof) ++score_;
    } else if (score_ > 0) {
      score_ = 0;
    }
  }
  // The same while awake: how long that took says nothing about when they came.
  void answered(Moment present) { answered_ = present; }
  bool worthwhile() const { return score_ >= proof; }
  // Nothing came for as long as `longest`.
  bool over(Moment present) const { return present - answered_ > longest; }
  void in_vain() {
    if (score_ > 0) score_ = 0;  // a respite goes on
  }
  // The processor was lent to others, and they kept it for `span`.
  void lent(Moment::duration span) {
    if (span > longest_loan) score_ = -respite;
  }

 private:
  Moment answered_{};
  int score_ = 0;
};

}  // namespace servodrome::line
