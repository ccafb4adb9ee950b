#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dictionary/entry.hpp"

// What can be seen of an axis tick by tick, without a part of the drive knowing that somebody looks.
namespace servodrome::line {

class Axis;

// A number of an axis. Its value is that after a tick; not a number while it has none (an object of an axis without
// power).
struct Channel {
  using Read = double (*)(Axis& axis, const Channel& channel);

  Axis* axis = nullptr;
  Read read = nullptr;
  const dictionary::Entry* object = nullptr;  // of a channel that is an object
  unsigned wire = 0;                          // of a channel that is an input

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

// The channel of a signal, of an input ("DI0") or of an object that is a number. Without `read` if there is none of the
// name or the object is no number that can be read.
Channel signal_channel(Axis& axis, std::string_view name);
Channel object_channel(Axis& axis, const dictionary::Entry& object);

// Values at all ticks that are multiples of a stride. It keeps the latest few, which whoever wants them fetches in
// time.
class Samples {
 public:
  static constexpr std::size_t kept = 512;  // values

  // `stride` in ticks, from 1; `first`, a multiple of it: of the first value there will be.
  Samples(std::int64_t stride, std::int64_t first)
      : stride_(stride),
        first_(first),
        due_(first),
        slot_(static_cast<std::size_t>(first / stride) % kept),
        ring_(kept) {}
  virtual ~Samples() = default;
  Samples(const Samples&) = delete;
  Samples& operator=(const Samples&) = delete;

  std::int64_t stride() const { return stride_; }
  std::int64_t first() const { return first_; }  // tick of the first value there ever was
  std::int64_t due() const { return due_; }      // tick of the next value
  // The value of a tick before `due`: a multiple of the stride, one of the `kept` latest.
  double at(std::int64_t tick) const { return ring_[static_cast<std::size_t>(tick / stride_) % kept]; }

  // The value of tick `due`.
  void put(double value) {
    ring_[slot_] = value;
    slot_ = (slot_ + 1) % kept;
    due_ += stride_;
  }

 private:
  std::int64_t stride_;
  std::int64_t first_;
  std::int64_t due_;
  std::size_t slot_;
  std::vector<double> ring_;
};

// The values of a channel of a line's axis, from its making on. Nothing is allocated while it runs.
class Tap final : public Samples {
 public:
  Tap(const Channel& channel, std::int64_t stride);
  ~Tap() override;

  const Channel& channel() const { return channel_; }
  // By the axis, at tick `due`.
  void take() { put(channel_.value()); }

 private:
  Channel channel_;
};

}  // namespace servodrome::line
