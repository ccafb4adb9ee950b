#include "scenario/shaft_log.hpp"

#include "drive/drive.hpp"
#include "scenario/watch.hpp"

namespace servodrome::scenario {

ShaftLog::ShaftLog(line::Line& line, links::Time most) : line_(line), end_(line.now() + most), next_(line.now()) {
  line.add_follower(*this);
}

void ShaftLog::reached(links::Time now) {
  next_ = now + period < end_ ? now + period : links::never;
  times_.push_back(now);
  for (const auto& axis : line_.axes()) {
    samples_.push_back({revolutions(*axis), axis->plant().velocity_rpm(),
                        axis->powered() ? static_cast<int>(axis->device().drive().state()) : -1});
  }
}

}  // namespace servodrome::scenario
