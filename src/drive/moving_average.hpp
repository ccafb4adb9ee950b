#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace servodrome::drive {

// Moving average of an integer signal, exact however long it runs. It stores the steps between consecutive values and
// the sum of the distances to the newest value, so no stored number grows with the signal.
class MovingAverage {
 public:
  static constexpr std::size_t longest = 512;

  // Starts a mean over `length` values, 1 .. longest, all past values being `value`.
  void begin(std::int64_t value, std::size_t length) {
    length_ = length;
    steps_.fill(0);
    next_ = 0;
    newest_ = value;
    span_ = distances_ = 0;
  }
  std::size_t length() const { return length_; }  // 0: not begun

  // The mean with `value` as the newest, rounded towards the newest.
  std::int64_t update(std::int64_t value) {
    const std::int64_t step = value - newest_;
    const auto others = static_cast<std::int64_t>(length_) - 1;
    newest_ = value;
    if (others == 0) return value;
    // The oldest value drops out: it was `span_` below the newest. The distances of the remaining ones grow by one
    // step.
    distances_ += span_ - others * step;
    span_ += step - steps_[next_];
    steps_[next_] = step;
    if (++next_ == static_cast<std::size_t>(others)) next_ = 0;
    return value + distances_ / static_cast<std::int64_t>(length_);
  }

 private:
  std::array<std::int64_t, longest> steps_{};  // the last length - 1, `next_` is the oldest
  std::size_t length_ = 0;
  std::size_t next_ = 0;
  std::int64_t newest_ = 0;
  std::int64_t span_ = 0;       // the newest minus the oldest
  std::int64_t distances_ = 0;  // sum of (value - newest) over all
};

}  // namespace servodrome::drive
