#include "line/bench/scope/line_scope.hpp"

namespace servodrome::line::bench {

LineScope::LineScope(Line& line, std::function<Time()> epoch)
    : line_(line), source_(line, std::move(epoch)), scope_(source_), next_look_(line.now() + period) {
  for (const auto& axis : line_.axes()) {
    monitors_.push_back(
        std::make_unique<AxisMonitor>(*axis, source_, [this](const Json& event) { scope_.publish(event); }));
  }
  line_.add_follower(*this);
}

LineScope::~LineScope() { line_.remove_follower(*this); }

void LineScope::reached(Time now) {
  next_look_ = now + period;
  const std::int64_t end = now / tick_length + 1;
  for (const auto& monitor : monitors_) monitor->take(end, scope_.recordings());
  scope_.advance(end);
}

}  // namespace servodrome::line::bench
