#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "api/scope/channel_list.hpp"

namespace servodrome::api {

// The event that starts a recording. On a line it is evaluated in every tick, whatever the recording's rate.
class Trigger {
 public:
  struct Hit {
    std::int64_t tick;
    std::string axis;  // whose value caused it
    double value;
  };

  // `json` is {"kind": "now"}; {"kind": "edge" | "level", "channel": 0, "level": 10, "slope": "rising" | "falling"};
  // {"kind": "state", "axis", "state"?}; {"kind": "fault", "axis"?}. `stride` is the distance of the evaluated ticks.
  // Throws ApiError.
  Trigger(Source& source, const Json& json, const std::vector<NamedChannel>& channels, std::int64_t stride);

  // Returns the first tick before `end` at which the event happens, among the ticks not evaluated yet.
  std::optional<Hit> find(std::int64_t end);
  bool is_fault() const { return kind_ == Kind::fault; }

 private:
  enum class Kind : std::uint8_t { now, edge, level, state, fault };
  struct Watched {
    std::string axis;
    std::shared_ptr<Samples> samples;
    std::int64_t next;  // next tick to evaluate
    double previous;    // the value before it; at first the value when it was armed
  };

  void watch(const NamedChannel& channel, std::int64_t stride);
  bool happens(double previous, double value) const;
  std::optional<Hit> find(Watched& watched, std::int64_t end) const;

  Kind kind_ = Kind::now;
  double level_ = 0;
  bool rising_ = true;
  std::optional<double> state_;  // none: any change
  std::vector<Watched> watched_;
};

}  // namespace servodrome::api
