#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "line/bench/routes.hpp"
#include "studio/traffic_view.hpp"

namespace servodrome::studio {

// The traffic of the line's buses over the bench API: recorded, in words, and as captures.
class Traffic {
 public:
  // `epoch` says the wall-clock time of the line's time 0, for captures.
  Traffic(line::Line& line, std::function<line::Time()> epoch) : line_(line), epoch_(std::move(epoch)) {}
  Traffic(const Traffic&) = delete;
  Traffic& operator=(const Traffic&) = delete;

  line::bench::RouteGroup routes();
  // That of a bus, made when it is first asked for.
  const std::shared_ptr<TrafficView>& view_of(line::bench::AnyBus bus);
  line::Time epoch() const { return epoch_(); }

 private:
  line::Line& line_;
  std::function<line::Time()> epoch_;
  std::map<std::string, std::shared_ptr<TrafficView>> views_;
};

}  // namespace servodrome::studio
