#include "api/scope/subscription.hpp"

#include <algorithm>

#include "api/scope/frame.hpp"

namespace servodrome::api {

// Taps that were opened earlier have older values, which are not for this client. A tap of an axis that has run ahead
// begins later.
Subscription::Subscription(std::uint32_t id, std::vector<std::shared_ptr<Samples>> taps)
    : id_(id), taps_(std::move(taps)), next_tick_(taps_.front()->due()) {
  for (const auto& tap : taps_) next_tick_ = std::max(next_tick_, tap->due());
}

std::optional<std::string> Subscription::take(std::int64_t end) {
  const std::int64_t stride = this->stride();
  const std::int64_t first = (next_tick_ + stride - 1) / stride * stride;
  if (first >= end) return std::nullopt;
  const std::int64_t samples = (end - first + stride - 1) / stride;
  double* values = nullptr;
  std::string frame = make_frame({.id = id_,
                                  .stride = static_cast<std::uint32_t>(stride),
                                  .first_tick = static_cast<std::uint64_t>(first),
                                  .samples = static_cast<std::uint32_t>(samples),
                                  .channels = static_cast<std::uint32_t>(taps_.size())},
                                 values);
  for (const auto& tap : taps_) {
    for (std::int64_t n = 0; n < samples; ++n) *values++ = tap->at(first + n * stride);
  }
  next_tick_ = first + samples * stride;
  return frame;
}

void Subscription::skip(std::int64_t end) { next_tick_ = std::max(next_tick_, end); }

void Subscription::adapt(std::size_t queued, WallTime now) {
  if (queued > easy) busy_ = now;
  if (queued > halved_at_ + step && stride() * 2 <= longest_stride) {
    factor_ *= 2;
    halved_at_ = queued;
  } else if (factor_ > 1 && queued <= easy && now - busy_ > recovery_time) {
    factor_ /= 2;
    halved_at_ = 0;
    busy_ = now;
  }
}

}  // namespace servodrome::api
