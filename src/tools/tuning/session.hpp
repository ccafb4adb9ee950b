#pragma once

#include "catalogue/product.hpp"
#include "tools/tuning/tuner.hpp"

// Tuning session: measure, propose, write, measure again.
namespace servodrome::master::tuning {

struct SessionRequest {
  // nullopt: 0.6 of the greatest possible bandwidth, or the present bandwidth if it is greater and possible. The
  // present position gain is then not reduced.
  std::optional<double> bandwidth_hz{};
  bool apply = false;  // false: nothing is written
  bool steps = true;   // also measure step responses
};

struct SessionResult {
  double bandwidth_hz = 0.0;  // promised bandwidth
  Measurement before{};
  std::vector<GainValue> gains_before{};
  std::vector<GainValue> gains{};  // proposed, and written if requested; empty for a drive whose gains are unknown
  Proposal proposal{};             // in SI units
  Proposal predicted{};            // prediction for the rounded numbers
  struct {
    std::optional<double> before{};
    std::optional<double> after{};
  } position_gain{};  // 1/s, of `gains_before` and `gains`; nullopt: unknown
  std::optional<Measurement> after{};
  std::optional<StepResponse> step_before{};
  std::optional<StepResponse> step_after{};
};

inline constexpr double promised_tolerance = 0.15;     // relative tolerance of the bandwidth
inline constexpr double promised_phase_margin = 40.0;  // degrees

// With `apply`, the measurement after writing must show the promised bandwidth within promised_tolerance, and at least
// promised_phase_margin. Without a requested bandwidth the loop must also be at least as fast as before, within 5 %; so
// nothing is written if the first measurement shows no bandwidth. If the bandwidth differs, tune() corrects the gains
// from the measurement, up to three times. On failure or cancellation it restores the old gains. Throws MasterError or
// Cancelled, whose text says that the gains are restored, or lists those that are not.
SessionResult tune(Tuner& tuner, ObjectClient& objects, const catalogue::TuningDialect& dialect,
                   const TuningUnits& units, const SessionRequest& request);

// The figures that became better and those that became worse, with the values before and after. Empty without `after`.
std::string text_of_changes(const SessionResult& result);

// Returns a warning if the proposed loops would be slower than the present ones, or if that is unknown. Empty if they
// would not, and for a result with `after`.
std::string note_of(const SessionResult& result);

// Writes the old gains as far as the drive accepts them. Returns the result as text for the end of a message.
std::string put_back_gains(ObjectClient& objects, std::span<const GainValue> gains);

// For example "60F9:01 Kvp[0]: 4 -> 11 DEC".
std::string text_of(const GainValue& before, const GainValue& after);

}  // namespace servodrome::master::tuning
