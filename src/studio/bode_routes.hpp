#pragma once

#include <functional>
#include <memory>

#include "line/bench/routes.hpp"
#include "line/bench/scope/recording.hpp"

namespace servodrome::studio {

// Frequency responses of recordings: docs/bench-api.md, "Bode plots".
class BodePlots {
 public:
  // nullptr: there is no such recording.
  using Find = std::function<std::shared_ptr<const line::bench::Recording>(std::uint32_t id)>;
  explicit BodePlots(Find find) : find_(std::move(find)) {}

  // The group refers to this.
  line::bench::RouteGroup routes();
  const Find& find() const { return find_; }

 private:
  Find find_;
};

}  // namespace servodrome::studio
