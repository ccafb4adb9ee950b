#pragma once

#include "host/tuning/own_tuning.hpp"
#include "host/tuning/session.hpp"
#include "line/bench/error.hpp"

// The results of tuning as JSON, for `servodrome tune --json` and for the bench API.
namespace servodrome::studio {

line::bench::Json json_of(const std::vector<host::tuning::GainValue>& before,
                          const std::vector<host::tuning::GainValue>& after);
line::bench::Json json_of(const host::tuning::Measurement& measured, const host::tuning::TuningUnits& units);
line::bench::Json json_of(const host::tuning::StepResponse& step);
// The result of a whole session: "result" is "proposed" or "applied".
line::bench::Json json_of(const host::tuning::SessionResult& result, const host::tuning::TuningUnits& units);
line::bench::Json json_of(const host::tuning::OwnTuningResult& result);

}  // namespace servodrome::studio
