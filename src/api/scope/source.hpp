#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "api/error.hpp"
#include "api/scope/samples.hpp"
#include "links/time.hpp"

namespace servodrome::api {

// A number of an axis that can be sampled.
struct NamedChannel {
  std::string axis;
  Json view;  // {"axis", "signal" or "object", "name", "unit"}
  // Returns the values from now on, at a stride in ticks. Throws ApiError 409 if too many values are being sampled.
  std::function<std::shared_ptr<Samples>(std::int64_t stride)> open;
  std::function<double()> value;  // the present value
};

// The source of streams and recordings: the axes of a line, or drives that a master reads. A tick is 62.5 us.
class Source {
 public:
  virtual ~Source() = default;

  // The present tick. The values of all ticks up to it are available.
  virtual std::int64_t tick() const = 0;
  virtual links::Time wall_epoch() const = 0;  // wall-clock time of tick 0; 0: there is none
  virtual std::vector<std::string> axes() const = 0;
  // Both throw ApiError if the axis, or its signal or object, does not exist.
  virtual NamedChannel signal(const std::string& axis, std::string_view name) = 0;
  virtual NamedChannel object(const std::string& axis, std::uint16_t index, std::uint8_t sub) = 0;
  // Returns the stride nearest to a rate at which these channels can be sampled together.
  virtual std::int64_t stride_of(double rate_hz, const std::vector<NamedChannel>& channels) const = 0;
  // The same for a recording. It may wait, set up the source for the recording, and replace `channels` by those to
  // open.
  struct Prepared {
    std::int64_t stride = 1;
    std::shared_ptr<void> held{};  // what was set up is undone when this ends
  };
  virtual Prepared prepare(double rate_hz, std::vector<NamedChannel>& channels) {
    return {stride_of(rate_hz, channels), nullptr};
  }
  // Returns the stride at which a trigger is evaluated, for a recording with this stride.
  virtual std::int64_t trigger_stride(std::int64_t stride) const = 0;

  // views(): the response to GET /api/v1/axes/{axis} for each axis, in the order of axes(). clock(): the response to
  // GET /api/v1/clock.
  virtual std::vector<Json> views() = 0;
  virtual Json clock() = 0;
};

}  // namespace servodrome::api
