#pragma once

#include <memory>
#include <vector>

#include "api/scope/scope.hpp"
#include "line/bench/scope/axis_monitor.hpp"
#include "line/bench/scope/line_source.hpp"

namespace servodrome::line::bench {

// Samples a line while it runs: a scope, and the monitors that publish the events of the axes. It follows the line's
// time and fetches the samples that the taps of the axes have collected.
class LineScope final : private Follower {
 public:
  static constexpr Time period = std::chrono::milliseconds(10);  // of line time, between two fetches

  // The line must outlive it. `epoch`: see LineSource.
  explicit LineScope(Line& line, std::function<Time()> epoch = {});
  ~LineScope();
  LineScope(const LineScope&) = delete;
  LineScope& operator=(const LineScope&) = delete;

  api::Scope& scope() { return scope_; }
  LineSource& source() { return source_; }

 private:
  // Follower
  Time next_deadline() const override { return next_look_; }
  void reached(Time now) override;

  Line& line_;
  LineSource source_;
  api::Scope scope_;
  std::vector<std::unique_ptr<AxisMonitor>> monitors_;
  Time next_look_;
};

}  // namespace servodrome::line::bench
