#pragma once

#include <cstdint>
#include <optional>

#include "links/time.hpp"

namespace servodrome::master {

// 60C2h, interpolation time period: sub 1 times ten to the power of sub 2, in seconds (CiA 402-2 clause 16).
struct InterpolationTime {
  std::uint8_t value = 0;
  std::int8_t index = 0;
};

// Uses the greatest unit that represents the period exactly, at most milliseconds; nullopt if no unit does.
constexpr std::optional<InterpolationTime> interpolation_time_of(links::Time period) {
  links::Time unit = std::chrono::milliseconds(1);
  for (std::int8_t index = -3; index >= -6; --index, unit /= 10) {
    if (period % unit == links::Time{0} && period / unit >= 1 && period / unit <= 255) {
      return InterpolationTime{static_cast<std::uint8_t>(period / unit), index};
    }
  }
  return std::nullopt;
}
inline constexpr const char* periods_that_can_be_written =
    "give whole milliseconds up to 255, or a period of at most 255 times 100, 10 or 1 us";

}  // namespace servodrome::master
