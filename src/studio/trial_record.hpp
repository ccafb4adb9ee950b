#pragma once

#include <memory>
#include <vector>

#include "scenario/director.hpp"
#include "scenario/shaft_log.hpp"
#include "scenario/trial_result.hpp"
#include "studio/traffic_view.hpp"

namespace servodrome::studio {

// Records the shafts and the traffic of all buses of a line during a trial, for its report.
class TrialRecord {
 public:
  // `line` must outlive this object. The shafts are recorded for `most`.
  TrialRecord(line::Line& line, line::Time most);

  // Fills in what the director found, judges it, and adds the picture and the traffic around each moment that matters:
  // a failure, and the first act of each rule. The exit status of the master must be in `result`.
  void complete(scenario::TrialResult& result, const scenario::Director& director);

 private:
  // Frames that a ring does not hold any more are not shown.
  static constexpr std::size_t ring_bytes = std::size_t{16} << 20U;

  std::string picture() const;
  bool was_silent(const scenario::TrialResult& result);

  line::Line& line_;
  scenario::ShaftLog shafts_;
  std::vector<std::unique_ptr<TrafficView>> buses_;
};

}  // namespace servodrome::studio
