#include "line/pacing/real_pace.hpp"

#include <algorithm>

namespace servodrome::line {

Time RealPace::due(Moment present, Time line_now, Time nap) {
  const Time behind = present - start_ - line_now;
  given_up_ = behind > most_behind + nap ? behind / step * step : Time{};
  start_ += given_up_;
  return std::max<Time>(line_now, present - start_);
}

}  // namespace servodrome::line
