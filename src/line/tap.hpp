#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/entry.hpp"

// Values of an axis tick by tick, without a part of the drive knowing that they are read.
namespace servodrome::line {

class Axis;

// A number of an axis. Its value is that after a tick; not a number while it has none (an object of an axis without
// power).
struct Channel {
  using Read = double (*)(Axis& axis, const Channel& channel);

  Axis* axis = nullptr;
  Read read = nullptr;
  const dictionary::Entry* object = nullptr;  // of a channel that is an object
  unsigned wire = 0;                          // of a channel that is an input or an output

  double value() const { return read(*axis, *this); }
  friend bool operator==(const Channel&, const Channel&) = default;
};

// A true value of the plant or a state of the drive that is no object.
struct Signal {
  std::string_view name;
  std::string_view unit;
  Channel::Read read;
};
std::span<const Signal> signals();

// The channel of a signal, of an input ("DI0"), of an output ("DO0") or of an object that is a number. Without `read`
// if there is none of the name or the object is no number that can be read.
Channel signal_channel(Axis& axis, std::string_view name);
Channel object_channel(Axis& axis, const dictionary::Entry& object);

// Values at all ticks that are multiples of a stride: a row of columns for each, one row behind the other, because what
// is written together is best kept together. It keeps the latest few, which the reader fetches in time.
class SampleRows {
 public:
  static constexpr std::size_t kept = 512;

  // `stride` in ticks, from 1; `first`, a multiple of it: of the first row there will be.
  SampleRows(std::int64_t stride, std::int64_t first, std::size_t columns)
      : stride_(stride), due_(first), columns_(columns), values_(kept * columns) {}

  std::int64_t stride() const { return stride_; }
  std::int64_t due() const { return due_; }  // tick of the next row
  // The value of a tick before `due`: a multiple of the stride, one of the `kept` latest.
  double at(std::int64_t tick, std::size_t column) const { return values_[place(tick) + column]; }

  // The row of tick `due`, to be written; it is the next one's turn then.
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

// A column of them, as those see it who want its values.
class Samples {
 public:
  // `rows` outlive it.
  explicit Samples(const SampleRows& rows, std::size_t column = 0) : rows_(&rows), column_(column) {}

  std::int64_t stride() const { return rows_->stride(); }
  std::int64_t due() const { return rows_->due(); }
  double at(std::int64_t tick) const { return rows_->at(tick, column_); }

 private:
  const SampleRows* rows_;
  std::size_t column_;
};

// The values of channels of one axis, from its making on. Nothing is allocated while it runs.
class Tap final {
 public:
  // At least one channel.
  Tap(std::vector<Channel> channels, std::int64_t stride);
  ~Tap();
  Tap(const Tap&) = delete;
  Tap& operator=(const Tap&) = delete;

  std::span<const Channel> channels() const { return channels_; }
  std::span<Samples> samples() { return samples_; }  // of each channel
  std::int64_t stride() const { return rows_.stride(); }
  std::int64_t due() const { return rows_.due(); }  // tick of the next values
  // By the axis, at tick `due`.
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
