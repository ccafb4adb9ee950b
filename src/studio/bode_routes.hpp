#pragma once

#include "api/scope/ended_recording.hpp"

namespace servodrome::studio {

// Frequency responses calculated from recordings: docs/bench-api.md, "Bode plots".
class BodePlots {
 public:
  explicit BodePlots(api::FindRecording find) : find_(std::move(find)) {}

  static std::span<const api::Route> table();
  // The returned group refers to this object.
  api::RouteGroup routes() { return {table(), this}; }
  const api::FindRecording& find() const { return find_; }

 private:
  api::FindRecording find_;
};

}  // namespace servodrome::studio
