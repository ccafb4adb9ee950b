#include "links/can/load_window.hpp"

#include <algorithm>

namespace servodrome::links {

void LoadWindow::add_busy(Time from, Time to) {
  while (from < to) {
    const std::int64_t number = from / slice_length;
    const Time end = std::min(to, (number + 1) * slice_length);
    Slice& slice = ring_[static_cast<std::size_t>(number) % ring_slices];
    if (slice.number != number) slice = {number, Time{}};
    slice.busy += end - from;
    from = end;
  }
}

double LoadWindow::percent(Time now) const {
  const std::int64_t current = now / slice_length;
  Time busy{};
  for (const Slice& slice : ring_) {
    if (slice.number >= current - window_slices && slice.number < current) busy += slice.busy;
  }
  return 100.0 * static_cast<double>(busy.count()) / static_cast<double>((window_slices * slice_length).count());
}

}  // namespace servodrome::links
