#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/entry.hpp"

// Samples values of an axis in every tick. No part of the drive is involved.
namespace servodrome::line {

class Axis;

// A number of an axis, as it is after a tick. It is not-a-number while there is no value (an object of an axis without
// power).
struct Channel {
  using Read = double (*)(Axis& axis, const Channel& channel);

  Axis* axis = nullptr;
  Read read = nullptr;
  const dictionary::Entry* object = nullptr;  // if the channel is an object
  unsigned wire = 0;                          // if the channel is an input or an output

  double value() const { return read(*axis, *this); }
  friend bool operator==(const Channel&, const Channel&) = default;
};

// A true value of the plant, or a state of the drive that has no object.
struct Signal {
  std::string_view name;
  std::string_view unit;
  Channel::Read read;
};
std::span<const Signal> signals();

// The channel of a signal, an input ("DI0"), an output ("DO0"), or an object that is a number. `read` of the result is
// nullptr if the name does not exist, or if the object is no number or cannot be read.
Channel signal_channel(Axis& axis, std::string_view name);
Channel object_channel(Axis& axis, const dictionary::Entry& object);

// A ring buffer of the values at all ticks that are multiples of a stride. It stores a row of columns for each such
// tick, because all values of a row are written at the same time. It keeps the latest `kept` rows; the reader must
// fetch them before they are overwritten.
class SampleRows {
 public:
  static constexpr std::size_t kept = 512;

  // `stride` in ticks, at least 1. `first` is the tick of the first row, a multiple of `stride`.
  SampleRows(std::int64_t stride, std::int64_t first, std::size_t columns)
      : stride_(stride), due_(first), columns_(columns), values_(kept * columns) {}

  std::int64_t stride() const { return stride_; }
  std::int64_t due() const { return due_; }  // tick of the next row
  // The value at a tick before `due`. The tick must be a multiple of the stride and in one of the `kept` latest rows.
  double at(std::int64_t tick, std::size_t column) const { return values_[place(tick) + column]; }

  // Returns the row of tick `due`, to be written, and moves `due` on to the next row.
  std::span<double> put() {
    const std::span<double> row = std::span(values_).subspan(place(due_), columns_);
    due_ += stride_;
    return row;
  }

 private:
  std::size_t place(std::int64_t tick) const { return static_cast<std::size_t>(tick / stride_) % kept * columns_; }

  std::int64_t stride_;
  std::int64_t due_;
  std::size_t columns_;
  std::vector<double> values_;
};

// One column of SampleRows, for a reader of its values.
class Samples {
 public:
  // `rows` must outlive it.
  explicit Samples(const SampleRows& rows, std::size_t column = 0) : rows_(&rows), column_(column) {}

  std::int64_t stride() const { return rows_->stride(); }
  std::int64_t due() const { return rows_->due(); }
  double at(std::int64_t tick) const { return rows_->at(tick, column_); }

 private:
  const SampleRows* rows_;
  std::size_t column_;
};

// Samples channels of one axis from construction on. Nothing is allocated while it runs.
class Tap final {
 public:
  // `channels` has at least one element, all of the same axis; `stride` is in ticks.
  Tap(std::vector<Channel> channels, std::int64_t stride);
  ~Tap();
  Tap(const Tap&) = delete;
  Tap& operator=(const Tap&) = delete;

  std::span<const Channel> channels() const { return channels_; }
  std::span<Samples> samples() { return samples_; }  // one for each channel
  std::int64_t stride() const { return rows_.stride(); }
  std::int64_t due() const { return rows_.due(); }  // tick of the next values
  // Called by the axis at tick `due`.
  void take() {
    double* value = rows_.put().data();
    for (const Channel& channel : channels_) *value++ = channel.value();
  }

 private:
  std::vector<Channel> channels_;
  SampleRows rows_;
  std::vector<Samples> samples_;
};

}  // namespace servodrome::line
