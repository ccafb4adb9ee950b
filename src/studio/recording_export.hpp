#pragma once

#include "links/time.hpp"
#include "studio/ended_recording.hpp"

namespace servodrome::studio {

// Recordings as files for other programs: docs/bench-api.md, "Recordings".
class RecordingExport {
 public:
  // `epoch` returns the wall-clock time of tick 0 at the time of the export.
  RecordingExport(FindRecording find, std::function<links::Time()> epoch)
      : find_(std::move(find)), epoch_(std::move(epoch)) {}

  // The returned group refers to this object.
  api::RouteGroup routes();

 private:
  static api::Json show_mcap(api::Call& call);

  FindRecording find_;
  std::function<links::Time()> epoch_;
};

}  // namespace servodrome::studio
