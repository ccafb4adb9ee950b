#include "scope/recorder.hpp"

#include <utility>

namespace servodrome::scope {

Recorder::Recorder(std::vector<Channel> channels, std::vector<std::size_t> groups, std::size_t group_count,
                   const RecorderOptions& options)
    : options_(options), channels_(std::move(channels)), groups_(std::move(groups)), group_count_(group_count) {}

void Recorder::take(const Sample& sample) {
  if (done_) return;
  // The first group's time decides for the whole row.
  const Time now = sample.times.front();
  if (zero_ && options_.duration && now - *zero_ >= *options_.duration) {
    done_ = true;
    return;
  }
  times_.insert(times_.end(), sample.times.begin(), sample.times.end());
  values_.insert(values_.end(), sample.values.begin(), sample.values.end());
  missed_.push_back(sample.missed);
  if (waits_for_trigger()) {
    const double value = sample.values[options_.trigger_channel];
    triggered_ = options_.trigger.fires(before_, value);
    before_ = options_.trigger.next_before(before_, value);
    if (triggered_) zero_ = now;
    forget_before(now - options_.pre);
  } else if (!zero_) {
    zero_ = now;
  }
  full_ = done_ = values_.size() + channels_.size() > options_.most_values;
}

void Recorder::forget_before(Time time) {
  while (!times_.empty() && times_.front() < time) {
    times_.erase(times_.begin(), times_.begin() + static_cast<std::ptrdiff_t>(group_count_));
    values_.erase(values_.begin(), values_.begin() + static_cast<std::ptrdiff_t>(channels_.size()));
    missed_.pop_front();
  }
}

Recording Recorder::recording() const {
  return {.channels = channels_,
          .groups = groups_,
          .group_count = group_count_,
          .times = {times_.begin(), times_.end()},
          .values = {values_.begin(), values_.end()},
          .zero = zero_.value_or(times_.empty() ? Time{} : times_.front()),
          .triggered = triggered_,
          .missed = missed_.empty() ? 0 : missed_.back() - missed_.front()};
}

}  // namespace servodrome::scope
