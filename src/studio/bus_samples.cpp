#include "studio/bus_samples.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "drive/hardware.hpp"

namespace servodrome::studio {
namespace {

constexpr double not_sampled = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t longest_wait = drive::ticks_per_second;  // until the server fetches the values

}  // namespace

BusSamples::BusSamples(std::size_t drive, master::ObjectAddress object, Decode decode, Sampling sampling,
                       std::int64_t stride, std::int64_t first)
    : Samples(rows_),
      rows_(stride, first, 2),
      drive_(drive),
      object_(object),
      decode_(std::move(decode)),
      sampling_(std::move(sampling)),
      next_(first),
      values_(static_cast<std::size_t>(longest_wait / stride) + 16),
      held_{first - std::max(sampling_.period, stride), not_sampled} {}

// A late cycle must not take the row of the next cycle. So consecutive values get consecutive rows, as long as the row
// is at most three quarters of a stride away from the value; otherwise the value gets the nearest row.
std::int64_t BusSamples::row_of(std::int64_t tick) const {
  const std::int64_t nearest = (tick + stride() / 2) / stride() * stride();
  if (!last_tick_ || sampling_.by == Sampling::By::reading || sampling_.period < stride()) return nearest;
  const std::int64_t rows = std::max<std::int64_t>(1, (tick - *last_tick_ + stride() / 2) / stride());
  const std::int64_t next = last_row_ + rows * stride();
  return std::abs(tick - next) <= 3 * stride() / 4 ? next : nearest;
}

void BusSamples::note(std::int64_t tick, std::span<const std::byte> bytes) {
  const double value = decode_(bytes);
  const std::int64_t row = row_of(tick);
  if (sampling_.by == Sampling::By::reading) {
    const std::int64_t period = sampling_.period;
    next_ = std::max((tick + period / 2) / period * period, tick) / period * period + period;
  }
  if (last_tick_ && row <= last_row_) {
    // Several values for one row: the nearest one counts.
    if (row < last_row_ || std::abs(tick - row) >= std::abs(*last_tick_ - row)) return;
    const std::lock_guard lock(mutex_);
    last_tick_ = tick;
    if (count_ > 0) values_[(begin_ + count_ - 1) % values_.size()].value = value;
    return;
  }
  last_tick_ = tick;
  last_row_ = row;
  const std::lock_guard lock(mutex_);
  if (count_ == values_.size()) {  // the server has not fetched the oldest one
    begin_ = (begin_ + 1) % values_.size();
    --count_;
  }
  values_[(begin_ + count_++) % values_.size()] = {row, value};
}

void BusSamples::skip(std::int64_t tick) { next_ = (tick / sampling_.period + 1) * sampling_.period; }

void BusSamples::fetch(std::int64_t end) {
  const std::lock_guard lock(mutex_);
  for (; count_ > 0 && values_[begin_].row < end; --count_) {
    fetched_.push_back(values_[begin_]);
    begin_ = (begin_ + 1) % values_.size();
  }
}

void BusSamples::fill(std::int64_t end, bool answers) {
  while (due() < end) put(due(), answers);
}

void BusSamples::put(std::int64_t row, bool answers) {
  for (; !fetched_.empty() && fetched_.front().row <= row; fetched_.pop_front()) held_ = fetched_.front();
  const std::int64_t age = row - held_.row;
  auto taken = api::Taken::held;
  double value = answers ? held_.value : not_sampled;
  if (age == 0) {
    taken = api::Taken::sampled;
    value = held_.value;
  } else {
    // Values that come less often than rows may be late by half a period.
    const std::int64_t period = std::max(sampling_.period, stride());
    const bool is_due = sampling_.period > 0;
    const std::int64_t late = age - (period > stride() ? period / 2 : 0);
    if (is_due && late >= period) value = not_sampled;
    if (is_due && late >= period && late / period > (late - stride()) / period) taken = api::Taken::missed;
  }
  const std::span<double> columns = rows_.put();
  columns[0] = value;
  columns[1] = static_cast<double>(taken);
}

api::Taken BusSamples::taken(std::int64_t tick) const { return static_cast<api::Taken>(rows_.at(tick, 1)); }

}  // namespace servodrome::studio
