#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "api/routes.hpp"
#include "studio/traffic_view.hpp"

namespace servodrome::studio {

// The traffic of buses over the bench API: recorded, decoded to text, and as captures.
class Traffic {
 public:
  // Finds the bus that the first argument of a call names. Throws ApiError 404.
  using Find = std::function<std::unique_ptr<TrafficSource>(const api::Call& call)>;

  // `epoch` returns the wall-clock time of the frames' time 0, for captures.
  Traffic(Find find, std::function<line::Time()> epoch) : find_(std::move(find)), epoch_(std::move(epoch)) {}
  Traffic(const Traffic&) = delete;
  Traffic& operator=(const Traffic&) = delete;

  api::RouteGroup routes();
  // The view of the bus that a call names. It is created lazily.
  const std::shared_ptr<TrafficView>& view_of(api::Call& call);
  // Makes all frames up to now readable.
  void flush();
  line::Time epoch() const { return epoch_(); }

 private:
  Find find_;
  std::function<line::Time()> epoch_;
  std::map<std::string, std::shared_ptr<TrafficView>> views_;
};

// Finds the bus of a line that the first argument of a call names. Throws ApiError 404.
std::unique_ptr<TrafficSource> find_line_traffic(line::Line& line, const api::Call& call);

}  // namespace servodrome::studio
