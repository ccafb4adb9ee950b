#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "links/time.hpp"

namespace servodrome::links {

// Measures how much of the last second a wire was busy, in slices of 10 ms.
class LoadWindow {
 public:
  // `from` and `to` must be at most 200 ms later than the times passed to percent().
  void add_busy(Time from, Time to);
  // The percentage of busy time in the 100 complete slices before the one that contains `now`.
  double percent(Time now) const;

 private:
  static constexpr Time slice_length = std::chrono::milliseconds(10);
  static constexpr std::int64_t window_slices = 100;
  // The window, the slice that is being filled, and room for a frame that extends beyond it.
  static constexpr std::size_t ring_slices = 128;

  struct Slice {
    std::int64_t number = -1;
    Time busy{};
  };
  std::array<Slice, ring_slices> ring_{};
};

}  // namespace servodrome::links
