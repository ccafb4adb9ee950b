#pragma once

#include "api/error.hpp"
#include "tools/tuning/own_tuning.hpp"
#include "tools/tuning/session.hpp"

// The results of tuning as JSON, for `servodrome tune --json` and for the bench API.
namespace servodrome::studio {

api::Json json_of(const std::vector<master::tuning::GainValue>& before,
                  const std::vector<master::tuning::GainValue>& after);
api::Json json_of(const master::tuning::Measurement& measured, const master::tuning::TuningUnits& units);
api::Json json_of(const master::tuning::StepResponse& step);
// The result of a whole session: "result" is "proposed" or "applied".
api::Json json_of(const master::tuning::SessionResult& result, const master::tuning::TuningUnits& units);
api::Json json_of(const master::tuning::OwnTuningResult& result);

}  // namespace servodrome::studio
