#pragma once

#include <memory>
#include <vector>

#include "line/tap.hpp"

namespace servodrome::line::bench {

// Shares taps: if several clients sample the same channel, there is only one tap for it, so ten open pages take no
// more time than one.
class TapTable {
 public:
  // Limit for the values per tick of all taps. To sample so many values takes some microseconds of a tick of 62.5 us.
  static constexpr double most_values_per_tick = 512;

  // Returns the samples of a channel. Throws ApiError 409 if that would exceed most_values_per_tick.
  std::shared_ptr<api::Samples> open(const Channel& channel, std::int64_t stride);
  // Returns the samples of several channels of one axis. They share a new tap, which costs less than one tap each.
  std::vector<std::shared_ptr<api::Samples>> open(std::vector<Channel> channels, std::int64_t stride);

 private:
  double load() const;  // values per tick

  std::vector<std::weak_ptr<Tap>> taps_;
};

}  // namespace servodrome::line::bench
