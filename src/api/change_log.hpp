#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/entry.hpp"

namespace servodrome::api {

// A value of an object as its bytes, in a fixed amount of memory.
class KeptValue {
 public:
  static constexpr std::size_t most_bytes = 32;

  KeptValue() = default;
  // An empty or too long value is not kept.
  explicit KeptValue(std::span<const std::byte> value);

  bool known() const { return length_ != 0; }
  std::span<const std::byte> bytes() const { return std::span(bytes_).first(length_); }
  friend bool operator==(const KeptValue& a, const KeptValue& b);

 private:
  std::array<std::byte, most_bytes> bytes_{};
  std::uint8_t length_ = 0;
};

// A write that changed the value of an object.
struct Change {
  using Time = std::chrono::nanoseconds;

  std::uint64_t number = 0;  // counts all changes, from 1 on
  Time at{};                 // time of the line, or since the start of the server
  Time wall{};               // since 1970, UTC
  std::uint32_t axis = 0;    // index in ChangeLog::axes
  // Must outlive the log. `object_name` is the name of the whole object, that of sub-index 0.
  const dictionary::Entry* entry = nullptr;
  const char* object_name = "";
  KeptValue before{};
  KeptValue after{};
  std::array<char, 48> who{};  // ends with 0

  std::uint32_t key() const { return entry->key(); }
  std::string_view author() const { return who.data(); }
  std::string name() const;  // "Homing speeds.Speed during search for switch"
};

// The last changes of all axes: a ring buffer in a fixed amount of memory. Not thread-safe: the thread of the server
// writes and reads it.
class ChangeLog {
 public:
  static constexpr std::size_t usual_capacity = 10'000;

  // `axes` are the names of the axes.
  explicit ChangeLog(std::vector<std::string> axes, std::size_t capacity = usual_capacity);

  // Adds a change; sets its number and the author. Adds nothing for an object that moves the axis (is_motion), or for a
  // write that leaves the value as it was.
  void add(Change change, std::string_view who);
  // Controlword, targets and their offsets: a master writes them all the time to move the axis.
  static bool is_motion(std::uint16_t index);
  // Continues the numbers of an earlier run, whose last change has `number`. Must be called before the first add().
  void begin_after(std::uint64_t number) { before_ = last_ = number; }

  const std::vector<std::string>& axes() const { return axes_; }
  std::size_t capacity() const { return capacity_; }
  // Changes that are no longer in the log.
  std::uint64_t dropped() const { return last_ - before_ - ring_.size(); }
  // Numbers of the oldest and of the newest change in the log; oldest() > newest(): it is empty.
  std::uint64_t oldest() const { return before_ + dropped() + 1; }
  std::uint64_t newest() const { return last_; }
  // `number` is one of oldest() .. newest().
  const Change& at(std::uint64_t number) const { return ring_[place_of(number)]; }

 private:
  std::size_t place_of(std::uint64_t number) const { return (number - before_ - 1) % capacity_; }

  std::vector<std::string> axes_;
  std::size_t capacity_;
  std::vector<Change> ring_;
  std::uint64_t before_ = 0;  // number of the last change of earlier runs
  std::uint64_t last_ = 0;
};

}  // namespace servodrome::api
