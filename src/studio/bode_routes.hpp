#pragma once

#include "studio/ended_recording.hpp"

namespace servodrome::studio {

// Frequency responses of recordings: docs/bench-api.md, "Bode plots".
class BodePlots {
 public:
  explicit BodePlots(FindRecording find) : find_(std::move(find)) {}

  // The group refers to this.
  line::bench::RouteGroup routes();
  const FindRecording& find() const { return find_; }

 private:
  FindRecording find_;
};

}  // namespace servodrome::studio
