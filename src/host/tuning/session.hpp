#pragma once

#include "host/tuning/tuner.hpp"

// Measure, propose, write, measure again.
namespace servodrome::host::tuning {

struct SessionRequest {
  std::optional<double> bandwidth_hz{};  // nothing: six tenths of what is possible
  bool apply = false;                    // else nothing is written
  bool steps = true;                     // step responses as well
};

struct SessionResult {
  double bandwidth_hz = 0.0;  // promised
  Measurement before{};
  std::vector<GainValue> gains_before{};
  std::vector<GainValue> gains{};  // proposed, and written if asked to; empty for a drive whose gains are not known
  Proposal proposal{};             // in SI units
  Proposal predicted{};            // what the rounded numbers make
  std::optional<Measurement> after{};
  std::optional<StepResponse> step_before{};
  std::optional<StepResponse> step_after{};
};

inline constexpr double promised_tolerance = 0.15;     // of the bandwidth
inline constexpr double promised_phase_margin = 40.0;  // degrees

// What was measured after writing is promised_tolerance of the promise at most, with promised_phase_margin at least;
// gains are corrected once or twice by what was measured on the way there. If it does not come about, for whatever
// reason, the old gains are put back. Throws HostError, which says so, or which gains could not be put back; Cancelled
// likewise.
SessionResult tune(Tuner& tuner, ObjectClient& objects, const TuningDialect& dialect, const TuningUnits& units,
                   const SessionRequest& request);

// As far as the drive takes them; the text says how that went, for the end of a message.
std::string put_back_gains(ObjectClient& objects, std::span<const GainValue> gains);

// "60F9:01 Kvp[0]: 4 -> 11 DEC"
std::string text_of(const GainValue& before, const GainValue& after);

}  // namespace servodrome::host::tuning
