#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "links/time.hpp"

namespace servodrome::links {

// How much of the last second a wire was busy, kept as 100 slices of 10 ms.
class LoadWindow {
 public:
  void add_busy(Time from, Time to);
  // Percent of the 100 slices that end with the one before `now`'s.
  double percent(Time now) const;

 private:
  static constexpr Time slice = std::chrono::milliseconds(10);
  static constexpr std::size_t slices = 100;

  struct Slice {
    std::int64_t number = -1;
    Time busy{};
  };
  // One slice more than the window: the one being filled.
  std::array<Slice, slices + 28> ring_{};
};

}  // namespace servodrome::links
