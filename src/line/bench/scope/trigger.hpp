#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "line/bench/scope/channel_list.hpp"

namespace servodrome::line::bench {

// What starts a recording: of a line watched at every tick, whatever the recording's rate.
class Trigger {
 public:
  struct Hit {
    std::int64_t tick;
    std::string axis;  // whose value it was
    double value;
  };

  // {"kind": "now"}; {"kind": "edge" | "level", "channel": 0, "level": 10, "slope": "rising" | "falling"};
  // {"kind": "state", "axis", "state"?}; {"kind": "fault", "axis"?}. Throws ApiError.
  // `stride`: of the ticks to be watched.
  Trigger(Source& source, const Json& json, const std::vector<NamedChannel>& channels, std::int64_t stride);

  // The first tick before `end` at which it happens, of those that were not looked at yet.
  std::optional<Hit> find(std::int64_t end);
  bool is_fault() const { return kind_ == Kind::fault; }

 private:
  enum class Kind : std::uint8_t { now, edge, level, state, fault };
  struct Watched {
    std::string axis;
    std::shared_ptr<Samples> samples;
    std::int64_t next;  // tick to be looked at
    double previous;    // the value before it; at first that when it was armed
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

}  // namespace servodrome::line::bench
