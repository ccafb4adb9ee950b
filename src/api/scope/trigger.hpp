#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "api/scope/channel_list.hpp"
#include "scope/trigger.hpp"

namespace servodrome::api {

// The trigger of a recording, armed on the samples of its channels. On a line it is evaluated in every tick, whatever
// the recording's rate.
class ArmedTrigger {
 public:
  struct Hit {
    std::int64_t tick;
    std::string axis;  // whose value caused it
    double value;
  };

  // `json`: docs/bench-api.md, "Recordings". `stride` is the distance of the evaluated ticks. Throws ApiError.
  ArmedTrigger(Source& source, const Json& json, const std::vector<NamedChannel>& channels, std::int64_t stride);

  // Returns the first tick before `end` at which the event happens, among the ticks not evaluated yet.
  std::optional<Hit> find(std::int64_t end);
  bool is_fault() const { return is_fault_; }

 private:
  struct Watched {
    std::string axis;
    std::shared_ptr<Samples> samples;
    std::int64_t next;             // next tick to evaluate
    std::optional<double> before;  // at first the value when it was armed
  };

  void watch(const NamedChannel& channel, std::int64_t stride);
  std::optional<Hit> find(Watched& watched, std::int64_t end) const;

  scope::Trigger trigger_;
  bool is_fault_ = false;
  std::vector<Watched> watched_;
};

}  // namespace servodrome::api
