#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "line/tap.hpp"

namespace servodrome::line::bench {

using WallTime = std::chrono::steady_clock::time_point;

// Channels that a client gets frames of. When the client does not keep up, every other sample is left out, then three
// of four, and so on; when it does again the samples come back.
class Subscription {
 public:
  static constexpr std::size_t step = 512 * 1024;  // bytes that wait more: half the resolution
  static constexpr std::size_t easy = 64 * 1024;   // bytes that may wait while the resolution comes back
  static constexpr auto recovery_time = std::chrono::seconds(1);
  static constexpr std::int64_t longest_stride =
      16000;  // ticks; a client that is too slow for a sample a second is gone

  // All of one stride.
  Subscription(std::uint32_t id, std::vector<std::shared_ptr<Samples>> taps);

  std::uint32_t id() const { return id_; }
  std::int64_t first_tick() const { return next_tick_; }
  std::int64_t stride() const { return taps_.front()->stride() * factor_; }

  // The samples since the last time, before tick `end`; nothing if there are none.
  std::optional<std::string> take(std::int64_t end);
  // Leaves them out.
  void skip(std::int64_t end);
  // How much waits for the client now.
  void adapt(std::size_t queued, WallTime now);

 private:
  std::uint32_t id_;
  std::vector<std::shared_ptr<Samples>> taps_;
  std::int64_t next_tick_;
  std::int64_t factor_ = 1;
  std::size_t halved_at_ = 0;  // bytes that waited when the resolution was last halved
  WallTime busy_{};            // when more than `easy` waited last
};

}  // namespace servodrome::line::bench
