#include "tools/tuning/session.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace servodrome::master::tuning {
namespace {

constexpr double first_bandwidth_hz = 50.0;  // for the first measurement if no bandwidth is requested
constexpr double most_bandwidth_hz = 400.0;
constexpr double share_of_possible = 0.6;
constexpr double close_enough = 0.05;  // relative difference between two measurements of the same loop
constexpr int most_corrections = 3;

Request request_of(double bandwidth_hz, const LoopDelay& delay, const catalogue::TuningDialect& dialect) {
  return {.bandwidth_hz = bandwidth_hz, .delay = delay, .notch = dialect.notch};
}

Proposal proposal_for(const Measurement& measured, const Request& request, const std::string& where) {
  const auto proposal = propose(measured.mechanics, request);
  if (proposal) return *proposal;
  const double possible = greatest_bandwidth(measured.mechanics, request);
  std::string why = fmt::format("the loop delay of {:.2f} ms", 1e3 * request.delay.total_s());
  if (measured.mechanics.resonance) {
    why += fmt::format(" and the resonance at {:.0f} Hz", measured.mechanics.resonance->resonance_hz);
  }
  if (possible < 1.0)
    throw MasterError(fmt::format("no bandwidth is possible with {}", why), where, "check the coupling");
  throw MasterError(
      fmt::format("{:g} Hz are not possible with 45 degrees of phase margin, because of {}", request.bandwidth_hz, why),
      where, fmt::format("choose --bandwidth {:.0f} or less", std::floor(possible)));
}

bool is_slower(double bandwidth_hz, double than_hz) { return bandwidth_hz < (1.0 - close_enough) * than_hz; }

}  // namespace

std::string put_back_gains(ObjectClient& objects, std::span<const GainValue> gains) {
  std::string left;
  for (const GainValue& gain : gains) {
    try {
      write_gains(objects, std::span(&gain, 1));
    } catch (const MasterError&) {
      left += fmt::format("{}{} {} was {}", left.empty() ? "" : ", ", master::text_of(gain.gain->object),
                          gain.gain->name, gain.number);
    }
  }
  if (left.empty()) return "the old gains are restored";
  return fmt::format("the old gains could not be restored, and the new ones may be active until the drive restarts: {}",
                     left);
}

std::string text_of(const GainValue& before, const GainValue& after) {
  return fmt::format("{} {}: {} -> {} {}", master::text_of(after.gain->object), after.gain->name, before.number,
                     after.number, after.gain->unit_text);
}

std::string note_of(const SessionResult& result) {
  if (result.after) return {};
  std::string note;
  if (!result.before.bandwidth_hz) {
    note = "the measurement shows no bandwidth of the present loop, so the proposed loop may be slower";
  } else if (is_slower(result.bandwidth_hz, *result.before.bandwidth_hz)) {
    note = fmt::format("the proposed loop is slower than the present one: bandwidth {:.1f} Hz instead of {:.1f} Hz",
                       result.bandwidth_hz, *result.before.bandwidth_hz);
  }
  const auto& [before, after] = result.position_gain;
  if (before && after && is_slower(*after, *before)) {
    note += fmt::format("{}the proposed position gain is lower than the present one: {:.1f} 1/s instead of {:.1f} 1/s",
                        note.empty() ? "" : "; ", *after, *before);
  }
  return note;
}

std::string text_of_changes(const SessionResult& result) {
  struct Figure {
    const char* name;
    const char* unit;
    std::optional<double> before;
    std::optional<double> after;
    bool more_is_better;
    double negligible;  // difference
  };
  if (!result.after) return {};
  const auto of = [](const std::optional<StepResponse>& step, double StepResponse::*part, double scale) {
    return step ? std::optional(scale * (*step).*part) : std::nullopt;
  };
  const Measurement& before = result.before;
  const Measurement& after = *result.after;
  const std::array figures{
      Figure{"bandwidth", "Hz", before.bandwidth_hz, after.bandwidth_hz, true,
             close_enough * before.bandwidth_hz.value_or(0.0)},
      Figure{"phase margin", "deg", before.margins.phase_margin_deg, after.margins.phase_margin_deg, true, 3.0},
      Figure{"rise time", "ms", of(result.step_before, &StepResponse::rise_s, 1e3),
             of(result.step_after, &StepResponse::rise_s, 1e3), false, 0.5},
      Figure{"overshoot", "%", of(result.step_before, &StepResponse::overshoot, 100.0),
             of(result.step_after, &StepResponse::overshoot, 100.0), false, 2.0},
      Figure{"settling time", "ms", of(result.step_before, &StepResponse::settling_s, 1e3),
             of(result.step_after, &StepResponse::settling_s, 1e3), false, 2.0},
      Figure{"position gain", "1/s", result.position_gain.before, result.position_gain.after, true,
             close_enough * result.position_gain.before.value_or(0.0)}};
  std::array<std::string, 3> lists;  // better, worse, unchanged
  for (const Figure& figure : figures) {
    if (!figure.before || !figure.after) continue;
    const double change = *figure.after - *figure.before;
    const std::size_t which = std::abs(change) <= figure.negligible     ? 2
                              : (change > 0.0) == figure.more_is_better ? 0
                                                                        : 1;
    lists[which] += fmt::format("{}{} {:.1f} -> {:.1f} {}", lists[which].empty() ? "" : ", ", figure.name,
                                *figure.before, *figure.after, figure.unit);
  }
  constexpr std::array words{"better: ", "worse: ", "about the same: "};
  std::string text;
  for (std::size_t i = 0; i < lists.size(); ++i) {
    if (!lists[i].empty()) text += fmt::format("{}{}{}", text.empty() ? "" : "; ", words[i], lists[i]);
  }
  const auto& [gain_before, gain_after] = result.position_gain;
  if (!gain_before && gain_after) text += fmt::format("; position gain: the drive's own -> {:.1f} 1/s", *gain_after);
  return text;
}

SessionResult tune(Tuner& tuner, ObjectClient& objects, const catalogue::TuningDialect& dialect,
                   const TuningUnits& units, const SessionRequest& request) {
  SessionResult result;
  result.gains_before = read_gains(objects, dialect);
  const auto notch = controller_of(result.gains_before, dialect, units, {}).notch;
  result.before = tuner.measure(request.bandwidth_hz.value_or(first_bandwidth_hz), notch);
  const LoopDelay& delay = result.before.controller.delay;
  const double possible = greatest_bandwidth(result.before.mechanics, request_of(most_bandwidth_hz, delay, dialect));
  if (request.apply && !request.bandwidth_hz && !result.before.bandwidth_hz) {
    throw MasterError(
        "the measurement shows no bandwidth of the present loop, so the new one might be slower: nothing is written",
        objects.where(),
        "choose a --bandwidth, or measure with longer --seconds" + text_of_losses(result.before.lost_cycles));
  }
  const double present = result.before.bandwidth_hz.value_or(0.0);
  result.bandwidth_hz =
      request.bandwidth_hz.value_or(std::max(share_of_possible * possible, std::min(present, possible)));
  if (request.apply && !request.bandwidth_hz && present > possible) {
    throw MasterError(fmt::format("the loop is not made slower: it has a bandwidth of {:.1f} Hz, and {:.1f} Hz are "
                                  "possible with 45 degrees of phase margin",
                                  present, possible),
                      objects.where(), fmt::format("choose --bandwidth {:.0f} or less", std::floor(possible)));
  }
  result.proposal = proposal_for(result.before, request_of(result.bandwidth_hz, delay, dialect), objects.where());
  result.position_gain.before = position_gain(result.gains_before, dialect, units);
  // The velocity loop does not become slower, so the present position gain stays if it is greater than the proposed
  // one.
  if (!request.bandwidth_hz) {
    result.proposal.position_kp = std::max(result.proposal.position_kp, result.position_gain.before.value_or(0.0));
  }
  result.predicted = result.proposal;
  if (dialect.gains.empty()) {
    if (request.apply) {
      throw MasterError("its gain objects are not known", objects.where(),
                        "set them by hand as --propose gives them, in SI units");
    }
    return result;
  }
  const auto round = [&](const Proposal& proposal) {
    result.gains = numbers_of(proposal, dialect, units, objects.where());
    result.position_gain.after = position_gain(result.gains, dialect, units);
    result.predicted = predict(controller_of(result.gains, dialect, units, delay), result.before.mechanics);
  };
  round(result.proposal);
  if (!request.apply) return result;
  if (request.steps) result.step_before = tuner.step();

  std::string back;  // result of restoring the old gains
  // Restores the old gains on every exit, unless the result was as promised.
  struct PuttingBack {
    ObjectClient& objects;
    std::span<const GainValue> gains;
    std::string& outcome;
    bool kept = false;
    ~PuttingBack() {
      try {
        if (!kept) outcome = put_back_gains(objects, gains);
      } catch (...) {
        // The caller ends the operation and does not wait for the drive.
      }
    }
  };
  try {
    PuttingBack putting_back{objects, result.gains_before, back};
    Proposal aimed = result.proposal;
    for (int correction = 0;; ++correction) {
      write_gains(objects, result.gains);
      result.after = tuner.measure(result.bandwidth_hz, aimed.velocity.notch);
      const Measurement& after = *result.after;
      const double ratio = after.bandwidth_hz.value_or(0.0) / result.bandwidth_hz;
      if (std::abs(ratio - 1.0) < close_enough || correction == most_corrections) break;
      if (ratio <= 0.0) break;
      // The bandwidth is about proportional to the gain.
      const auto before = result.gains;
      const double factor = std::clamp(1.0 / ratio, 0.5, 2.0);
      aimed.velocity.kp *= factor;
      aimed.velocity.ki *= factor;
      round(aimed);
      const bool same = std::equal(before.begin(), before.end(), result.gains.begin(),
                                   [](const GainValue& a, const GainValue& b) { return a.number == b.number; });
      if (same) break;
    }
    if (!result.after->bandwidth_hz) {
      const auto& heard = result.after->frequencies_hz;
      throw MasterError(
          fmt::format("the measurement with the new gains shows no bandwidth: the axis responds at {} frequencies{}",
                      heard.size(), heard.empty() ? "" : fmt::format(" up to {:.0f} Hz", heard.back())),
          objects.where(), "measure with longer --seconds" + text_of_losses(result.after->lost_cycles));
    }
    const double measured = *result.after->bandwidth_hz;
    const double margin = result.after->margins.phase_margin_deg.value_or(0.0);
    if (std::abs(measured / result.bandwidth_hz - 1.0) > promised_tolerance || margin < promised_phase_margin) {
      throw MasterError(
          fmt::format(
              "measured with the new gains: bandwidth {:.1f} Hz instead of {:.1f} Hz, phase margin {:.0f} degrees",
              measured, result.bandwidth_hz, margin),
          objects.where(), "choose a lower --bandwidth" + text_of_losses(result.after->lost_cycles));
    }
    if (!request.bandwidth_hz && is_slower(measured, present)) {
      throw MasterError(fmt::format("measured with the new gains: bandwidth {:.1f} Hz, less than the {:.1f} Hz before",
                                    measured, present),
                        objects.where(),
                        "give --bandwidth to make the loop slower" + text_of_losses(result.after->lost_cycles));
    }
    if (request.steps) result.step_after = tuner.step();
    // If the operation was cancelled while the tuner disabled the axis, one of these calls throws.
    objects.read<std::uint16_t>(0x6041);
    tuner.leave_if_cancelled();
    putting_back.kept = true;
  } catch (const Cancelled&) {
    throw Cancelled("interrupted", objects.where(), back);
  } catch (const MasterError& error) {
    throw MasterError(error.happened(), error.where(), fmt::format("{}; {}", error.remedy(), back));
  }
  return result;
}

}  // namespace servodrome::master::tuning
