#pragma once

#include <memory>
#include <vector>

#include "line/tap.hpp"

namespace servodrome::line::bench {

// Taps that several look at are there once: ten pages that show the same cost a line no more than one.
class TapTable {
 public:
  // Values per tick that all taps together may take: some microseconds of the 62.5.
  static constexpr double most_values_per_tick = 512;

  // The samples of a channel. Throws ApiError 409 when the line is looked at as much as it may be.
  std::shared_ptr<Samples> open(const Channel& channel, std::int64_t stride);
  // Of several channels of one axis by a tap of their own, which costs less than as many taps.
  std::vector<std::shared_ptr<Samples>> open(std::vector<Channel> channels, std::int64_t stride);

 private:
  double load() const;  // values per tick

  std::vector<std::weak_ptr<Tap>> taps_;
};

}  // namespace servodrome::line::bench
