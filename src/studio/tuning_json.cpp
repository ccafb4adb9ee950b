#include "studio/tuning_json.hpp"

#include "catalogue/gains.hpp"
#include "tools/tuning/loop.hpp"

namespace servodrome::studio {
namespace {

namespace tuning = master::tuning;
using api::Json;

Json number_or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json points_of(const std::vector<double>& hz, const std::vector<tuning::Complex>& response) {
  Json points = Json::array();
  for (const tuning::BodePoint& point : tuning::bode(hz, response)) {
    points.push_back({{"hz", point.frequency_hz}, {"gain_db", point.gain_db}, {"phase_deg", point.phase_deg}});
  }
  return points;
}

}  // namespace

Json json_of(const std::vector<tuning::GainValue>& before, const std::vector<tuning::GainValue>& after) {
  Json list = Json::array();
  for (std::size_t i = 0; i < after.size(); ++i) {
    const catalogue::GainObject& gain = *after[i].gain;
    list.push_back({{"object", text_of(gain.object)},
                    {"name", gain.name},
                    {"unit", gain.unit_text},
                    {"before", before[i].number},
                    {"after", after[i].number}});
  }
  return list;
}

Json json_of(const tuning::Measurement& measured, const tuning::TuningUnits& units) {
  Json json{{"bandwidth_hz", number_or_null(measured.bandwidth_hz)},
            {"crossover_hz", number_or_null(measured.margins.crossover_hz)},
            {"phase_margin_deg", number_or_null(measured.margins.phase_margin_deg)},
            {"gain_margin_db", number_or_null(measured.margins.gain_margin_db)},
            {"inertia", measured.mechanics.inertia},
            {"inertia_unit", units.inertia_name},
            {"friction", measured.friction},
            {"constant_load", measured.constant_load},
            {"torque_unit", units.torque_name},
            {"loop_delay_ms", 1e3 * measured.controller.delay.total_s()},
            {"lost_cycles", measured.lost_cycles}};
  if (const auto& resonance = measured.mechanics.resonance) {
    json["antiresonance_hz"] = resonance->antiresonance_hz;
    json["resonance_hz"] = resonance->resonance_hz;
  }
  json["open_loop"] = points_of(measured.frequencies_hz, measured.open_loop);
  json["closed_loop"] = points_of(measured.frequencies_hz, measured.closed_loop);
  return json;
}

Json json_of(const tuning::StepResponse& step) {
  return {{"rise_ms", 1e3 * step.rise_s},
          {"overshoot_percent", 100.0 * step.overshoot},
          {"settling_ms", 1e3 * step.settling_s},
          {"sample_ms", 1e3 * step.sample_s},
          {"velocity", step.velocity}};
}

Json json_of(const tuning::SessionResult& result, const tuning::TuningUnits& units) {
  Json json{{"result", result.after ? "applied" : "proposed"},
            {"promised_bandwidth_hz", result.bandwidth_hz},
            {"before", json_of(result.before, units)},
            {"gains", json_of(result.gains_before, result.gains)},
            {"si",
             {{"velocity_kp", result.proposal.velocity.kp},
              {"velocity_ki", result.proposal.velocity.ki},
              {"position_kp", result.proposal.position_kp}}},
            {"predicted",
             {{"bandwidth_hz", result.predicted.bandwidth_hz},
              {"phase_margin_deg", number_or_null(result.predicted.margins.phase_margin_deg)}}}};
  if (result.position_gain.after) {
    json["position_gain"] = {{"before", number_or_null(result.position_gain.before)},
                             {"after", *result.position_gain.after},
                             {"unit", "1/s"}};
  }
  if (const std::string note = note_of(result); !note.empty()) json["note"] = note;
  if (result.after) {
    json["after"] = json_of(*result.after, units);
    json["changes"] = tuning::text_of_changes(result);
  }
  if (result.step_before) json["step_before"] = json_of(*result.step_before);
  if (result.step_after) json["step_after"] = json_of(*result.step_after);
  return json;
}

Json json_of(const tuning::OwnTuningResult& result) {
  return {{"result", "tuned by the drive itself"},
          {"gains", json_of(result.before, result.after)},
          {"note", note_of(result)}};
}

}  // namespace servodrome::studio
