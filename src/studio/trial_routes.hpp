#pragma once

#include <memory>

#include "scenario/routes.hpp"
#include "studio/trial_record.hpp"

namespace servodrome::studio {

// The routes of the API for a trial on a running line: a scenario with the standard expectations, whose traffic and
// motion are recorded for a report. PUT and DELETE /api/v1/trial, POST .../master and .../report.
class TrialRoutes {
 public:
  // Both must outlive this object. The trial is the scenario of `scenarios`.
  TrialRoutes(line::Line& line, scenario::Routes& scenarios) : line_(line), scenarios_(scenarios) {}

  static std::span<const api::Route> table();
  // The group refers to this object.
  api::RouteGroup group() { return {table(), this}; }

  // Begins: {"text", "file"}; {"after_s"} is the time for which the line will run on after the end of the master.
  api::Json begin(const std::string& body);
  // The master has ended: {"exit_status", "was_ended", "uses_buses", "output"}.
  api::Json master_ended(const std::string& body);
  // Ends the trial: {"trial": its outcome, "section": its part of the page}.
  api::Json end();

 private:
  scenario::Director& director() const;

  line::Line& line_;
  scenario::Routes& scenarios_;
  std::unique_ptr<TrialRecord> record_;
  scenario::TrialResult result_;
};

}  // namespace servodrome::studio
