#include "line/bench/scope/tap_table.hpp"

#include <algorithm>

#include "api/error.hpp"
#include "line/bench/api_names.hpp"

namespace servodrome::line::bench {

std::shared_ptr<api::Samples> TapTable::open(const Channel& channel, std::int64_t stride) {
  for (const auto& weak : taps_) {
    const auto tap = weak.lock();
    if (!tap || tap->stride() != stride) continue;
    const auto channels = tap->channels();
    const auto found = std::find(channels.begin(), channels.end(), channel);
    if (found != channels.end()) return {tap, &tap->samples()[static_cast<std::size_t>(found - channels.begin())]};
  }
  return open(std::vector{channel}, stride).front();
}

std::vector<std::shared_ptr<api::Samples>> TapTable::open(std::vector<Channel> channels, std::int64_t stride) {
  std::erase_if(taps_, [](const auto& tap) { return tap.expired(); });
  if (load() + static_cast<double>(channels.size()) / static_cast<double>(stride) > most_values_per_tick) {
    throw ApiError{409, "the line cannot be sampled more", "channels",
                   "choose fewer channels or a lower rate, or end another stream or recording"};
  }
  const auto tap = std::make_shared<Tap>(std::move(channels), stride);
  taps_.push_back(tap);
  std::vector<std::shared_ptr<api::Samples>> samples;
  for (api::Samples& column : tap->samples()) samples.emplace_back(tap, &column);
  return samples;
}

double TapTable::load() const {
  double load = 0;
  for (const auto& weak : taps_) {
    const auto tap = weak.lock();
    if (tap) load += static_cast<double>(tap->channels().size()) / static_cast<double>(tap->stride());
  }
  return load;
}

}  // namespace servodrome::line::bench
