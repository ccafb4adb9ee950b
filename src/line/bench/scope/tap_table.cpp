#include "line/bench/scope/tap_table.hpp"

#include "line/bench/error.hpp"

namespace servodrome::line::bench {

std::shared_ptr<Tap> TapTable::open(const Channel& channel, std::int64_t stride) {
  std::erase_if(taps_, [](const auto& tap) { return tap.expired(); });
  double load = 1.0 / static_cast<double>(stride);
  for (const auto& weak : taps_) {
    const auto tap = weak.lock();
    if (tap->stride() == stride && tap->channel() == channel) return tap;
    load += 1.0 / static_cast<double>(tap->stride());
  }
  if (load > most_values_per_tick) {
    throw ApiError{409, "the line is looked at as much as it may be", "channels",
                   "choose fewer channels or a lower rate, or end another stream or recording"};
  }
  auto tap = std::make_shared<Tap>(channel, stride);
  taps_.push_back(tap);
  return tap;
}

}  // namespace servodrome::line::bench
