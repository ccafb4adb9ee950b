#pragma once

#include <chrono>

namespace servodrome::line {

// Adaptive polling: decides when to busy-wait for a master's next frame instead of sleeping until it comes. A wake-up
// costs more than a frame on a segment. Busy-waiting is therefore worthwhile while a master sends each frame soon after
// it received the previous one (a scan, SDOs, files, a fast cycle). For a master with a cycle of 1 ms it is not.
class Vigil {
 public:
  using Moment = std::chrono::steady_clock::time_point;

  static constexpr auto longest = std::chrono::microseconds(100);  // maximum time from an answer to the next frame
  static constexpr int proof = 8;  // number of such frames in a row that starts busy-waiting
  // If a yield takes longer than this, another program computes on this processor without a pause.
  static constexpr auto longest_loan = std::chrono::milliseconds(1);
  // After such a yield, this number of frames that come within `longest` must pass before frames count towards `proof`
  // again. On a processor that another program uses without a pause, a thread that sleeps gets the processor back
  // sooner than one that yields.
  static constexpr int respite = 10'000;

  // Must be called after a wait that returned frames; `present` is the moment at which they had been answered.
  void served(Moment present) {
    const bool soon = present - answered_ <= longest;
    answered_ = present;
    if (soon) {
      if (score_ < proof) ++score_;
    } else if (score_ > 0) {
      score_ = 0;
    }
  }
  // The same while busy-waiting. It does not count the frames: the time between two answers does not show when they
  // came.
  void answered(Moment present) { answered_ = present; }
  bool worthwhile() const { return score_ >= proof; }
  // Returns true if no frame came for `longest`: busy-waiting must end.
  bool over(Moment present) const { return present - answered_ > longest; }
  void in_vain() {
    if (score_ > 0) score_ = 0;  // a negative score stays: it counts the frames until the next attempt
  }
  // A yield took `span`.
  void lent(Moment::duration span) {
    if (span > longest_loan) score_ = -respite;
  }

 private:
  Moment answered_{};
  int score_ = 0;
};

}  // namespace servodrome::line
