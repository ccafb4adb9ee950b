#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "api/scope/samples.hpp"

namespace servodrome::api {

using WallTime = std::chrono::steady_clock::time_point;

// The channels of which a client receives frames. If the client is too slow, every second sample is left out, then
// three of four, and so on. When the client keeps up again, the samples come back.
class Subscription {
 public:
  static constexpr std::size_t step = 512 * 1024;  // additional waiting bytes that halve the resolution
  static constexpr std::size_t easy = 64 * 1024;   // waiting bytes at which the resolution may rise again
  static constexpr auto recovery_time = std::chrono::seconds(1);
  static constexpr std::int64_t longest_stride = 16000;  // ticks: one sample per second

  // All taps must have the same stride.
  Subscription(std::uint32_t id, std::vector<std::shared_ptr<Samples>> taps);

  std::uint32_t id() const { return id_; }
  std::int64_t first_tick() const { return next_tick_; }
  std::int64_t stride() const { return taps_.front()->stride() * factor_; }

  // Returns a frame of the samples since the last call, before tick `end`; nothing if there are none.
  std::optional<std::string> take(std::int64_t end);
  // Leaves out the samples before tick `end`.
  void skip(std::int64_t end);
  // Adapts the resolution to the number of bytes that wait for the client.
  void adapt(std::size_t queued, WallTime now);

 private:
  std::uint32_t id_;
  std::vector<std::shared_ptr<Samples>> taps_;
  std::int64_t next_tick_;
  std::int64_t factor_ = 1;
  std::size_t halved_at_ = 0;  // waiting bytes when the resolution was last halved
  WallTime busy_{};            // when more than `easy` bytes were last waiting
};

}  // namespace servodrome::api
