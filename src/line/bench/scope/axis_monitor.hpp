#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "api/scope/recordings.hpp"
#include "line/bench/scope/line_source.hpp"

namespace servodrome::line::bench {

// Monitors one axis a thousand times a second: publishes its events, and records the time around a fault.
class AxisMonitor {
 public:
  static constexpr std::int64_t stride = 16;  // ticks: 1 kHz
  static constexpr std::int64_t moment_samples = 600;
  static constexpr std::int64_t samples_before = 500;

  using Publish = std::function<void(Json event)>;

  AxisMonitor(Axis& axis, LineSource& source, Publish publish);

  // Processes all samples before tick `end`.
  void take(std::int64_t end, api::Recordings& recordings);

 private:
  void look(std::int64_t tick, api::Recordings& recordings);
  void keep_moment(std::int64_t tick, unsigned code, api::Recordings& recordings);
  void tell(const char* kind, std::int64_t tick, Json details);

  Axis& axis_;
  Publish publish_;
  std::shared_ptr<api::Samples> state_;
  std::shared_ptr<api::Samples> fault_code_;
  std::vector<api::NamedChannel> channels_;          // of a recording of a fault
  std::vector<std::shared_ptr<api::Samples>> taps_;  // of a recording of a fault
  std::int64_t first_;
  std::int64_t next_;
  std::optional<int> known_state_;  // none: no power
  bool known_power_;
  unsigned known_fault_ = 0;
};

}  // namespace servodrome::line::bench
