#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "line/bench/error.hpp"
#include "line/tap.hpp"

namespace servodrome::line::bench {

// A number of an axis that can be sampled.
struct NamedChannel {
  std::string axis;
  Json view;  // {"axis", "signal" or "object", "name", "unit"}
  // Its values from now on, at a stride in ticks. Throws ApiError 409 when that is more than may be looked at.
  std::function<std::shared_ptr<Samples>(std::int64_t stride)> open;
  std::function<double()> value;  // the present one
};

// What streams and recordings look at: the axes of a line, or drives that a master reads. Ticks are of 62.5 us.
class Source {
 public:
  virtual ~Source() = default;

  // The present: values of ticks up to it are there.
  virtual std::int64_t tick() const = 0;
  virtual std::vector<std::string> axes() const = 0;
  // Both throw ApiError if there is no such axis, or not that of it.
  virtual NamedChannel signal(const std::string& axis, std::string_view name) = 0;
  virtual NamedChannel object(const std::string& axis, std::uint16_t index, std::uint8_t sub) = 0;
  // The stride nearest to a rate at which channels can be looked at together.
  virtual std::int64_t stride_of(double rate_hz, const std::vector<NamedChannel>& channels) const = 0;
  // That at which a trigger is looked for, of a recording with this one.
  virtual std::int64_t trigger_stride(std::int64_t stride) const = 0;

  // What GET /api/v1/axes/{axis} says of each, in the order of axes(), and GET /api/v1/clock.
  virtual std::vector<Json> views() = 0;
  virtual Json clock() = 0;
};

}  // namespace servodrome::line::bench
