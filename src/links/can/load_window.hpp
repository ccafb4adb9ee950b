#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "links/time.hpp"

namespace servodrome::links {

// How much of the last second a wire was busy, kept in slices of 10 ms.
class LoadWindow {
 public:
  // `from` and `to` must not lie more than 200 ms ahead of the times percent() is asked for.
  void add_busy(Time from, Time to);
  // Percent busy in the 100 full slices before the one that holds `now`.
  double percent(Time now) const;

 private:
  static constexpr Time slice_length = std::chrono::milliseconds(10);
  static constexpr std::int64_t window_slices = 100;
  // The window, the slice being filled, and room for a frame that reaches beyond it.
  static constexpr std::size_t ring_slices = 128;

  struct Slice {
    std::int64_t number = -1;
    Time busy{};
  };
  std::array<Slice, ring_slices> ring_{};
};

}  // namespace servodrome::links
