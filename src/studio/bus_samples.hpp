#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "api/scope/samples.hpp"
#include "master/object_address.hpp"
#include "master/process_image.hpp"

namespace servodrome::studio {

// How the thread of a bus gets the values of an object.
struct Sampling {
  enum class By : std::uint8_t {
    reading,  // it reads the object: SDO, registers
    cycle,    // the inputs of each cycle of the bus
    pdo,      // the drive sends them: TPDOs on CAN
  };
  By by = By::reading;
  std::int64_t period = 0;  // ticks between two values; 0: the drive sends them when it likes
  // Of a TPDO
  std::uint32_t can_id = 0;
  master::MappedBits bits{};
  bool on_sync = false;  // the values are those of the last SYNC
};

// Values of an object that the thread of a bus samples by the wall clock. Each value belongs to the nearest row, a
// multiple of the stride. If the values come less often than rows, the rows between hold the last value. A row is NaN
// if its value was due and has not arrived, or if the drive does not answer.
class BusSamples final : public api::Samples {
 public:
  // Decodes the bytes of the object to a number.
  using Decode = std::function<double(std::span<const std::byte> bytes)>;

  // `first`: tick of the first row.
  BusSamples(std::size_t drive, master::ObjectAddress object, Decode decode, Sampling sampling, std::int64_t stride,
             std::int64_t first);

  // Sets the value that the rows hold until the first sample arrives; empty: not known. Call it before other threads
  // use this object.
  void begin_with(std::span<const std::byte> initial) {
    if (!initial.empty()) held_.value = decode_(initial);
  }

  std::size_t drive() const { return drive_; }
  master::ObjectAddress object() const { return object_; }
  const Sampling& sampling() const { return sampling_; }

  // --- Called by the thread of the bus. They allocate no memory.
  std::int64_t wanted() const { return next_; }  // tick at which the next reading is due
  void note(std::int64_t tick, std::span<const std::byte> bytes);
  void skip(std::int64_t tick);  // reading failed at this tick

  // --- Called by the thread of the server
  // Fetches the values of rows before `end`. Short, because the thread of the bus may wait for it.
  void fetch(std::int64_t end);
  // Fills the rows of all ticks before `end`, which have passed, with the values that fetch() has fetched. `answers`:
  // the drive communicates.
  void fill(std::int64_t end, bool answers);
  bool counts() const override { return true; }
  api::Taken taken(std::int64_t tick) const override;

 private:
  struct Value {
    std::int64_t row = 0;
    double value = 0;
  };

  std::int64_t row_of(std::int64_t tick) const;
  void put(std::int64_t row, bool answers);

  api::SampleRows rows_;  // columns: value, api::Taken
  std::size_t drive_;
  master::ObjectAddress object_;
  Decode decode_;
  Sampling sampling_;

  // Used only by the thread of the bus
  std::int64_t next_;
  std::optional<std::int64_t> last_tick_{};  // of the newest value
  std::int64_t last_row_ = 0;

  // A ring buffer of the values that the server has not fetched
  std::mutex mutex_;
  std::vector<Value> values_;
  std::size_t begin_ = 0;
  std::size_t count_ = 0;

  // Used only by the thread of the server
  std::deque<Value> fetched_;
  Value held_;
};

}  // namespace servodrome::studio
