#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace servodrome::api {

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

// How a row got its value.
enum class Taken : std::uint8_t {
  sampled,  // a sample of this row
  held,     // the last value; none was due
  missed,   // a value was due and has not arrived
};

// One column of SampleRows, for a reader of its values.
class Samples {
 public:
  // `rows` must outlive it.
  explicit Samples(const SampleRows& rows, std::size_t column = 0) : rows_(&rows), column_(column) {}
  virtual ~Samples() = default;

  std::int64_t stride() const { return rows_->stride(); }
  std::int64_t due() const { return rows_->due(); }
  double at(std::int64_t tick) const { return rows_->at(tick, column_); }

  // False: every row is a sample.
  virtual bool counts() const { return false; }
  // How the row of a tick got its value; for the same range of ticks as at().
  virtual Taken taken(std::int64_t) const { return Taken::sampled; }

 private:
  const SampleRows* rows_;
  std::size_t column_;
};

}  // namespace servodrome::api
