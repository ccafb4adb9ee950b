#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "api/scope/samples.hpp"
#include "dictionary/entry.hpp"

// Samples values of an axis at the ticks that are multiples of a stride. The simulated drive takes no part in it.
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

// Samples channels of one axis from construction on. Nothing is allocated while it runs.
class Tap final {
 public:
  // `channels` has at least one element, all of the same axis; `stride` is in ticks.
  Tap(std::vector<Channel> channels, std::int64_t stride);
  ~Tap();
  Tap(const Tap&) = delete;
  Tap& operator=(const Tap&) = delete;

  std::span<const Channel> channels() const { return channels_; }
  std::span<api::Samples> samples() { return samples_; }  // one for each channel
  std::int64_t stride() const { return rows_.stride(); }
  std::int64_t due() const { return rows_.due(); }  // tick of the next values
  // Called by the axis at tick `due`.
  void take() {
    double* value = rows_.put().data();
    for (const Channel& channel : channels_) *value++ = channel.value();
  }

 private:
  std::vector<Channel> channels_;
  api::SampleRows rows_;
  std::vector<api::Samples> samples_;
};

}  // namespace servodrome::line
