#include "studio/bode_routes.hpp"

#include <array>
#include <cmath>
#include <fmt/format.h>

#include "drive/drive.hpp"
#include "links/number_text.hpp"
#include "tools/tuning/loop.hpp"
#include "tools/tuning/spectrum.hpp"

namespace servodrome::studio {
namespace {

namespace tuning = master::tuning;
using api::ApiError;
using api::Call;
using api::Json;
using api::Method;
using api::Recording;
using api::Route;

// A transform of this many samples blocks the line for about 20 ms.
constexpr std::int64_t most_samples = 131'072;
constexpr double believed = 0.7;  // least coherence of the points used for bandwidth and margins

double number_in_query(const Call& call, std::string_view key, double otherwise, double least, double most) {
  const auto text = query_value(call, key);
  if (!text) return otherwise;
  const auto number = links::number_of_text<double>(*text);
  if (number && *number >= least && *number <= most) return *number;
  throw ApiError{422, fmt::format("{} is \"{}\"", key, text->substr(0, 40)), std::string(key),
                 fmt::format("write a number of {:g} .. {:g}", least, most)};
}

std::vector<double> samples_of(const Recording& recording, std::size_t channel) {
  std::vector<double> values(static_cast<std::size_t>(recording.samples()));
  for (std::size_t n = 0; n < values.size(); ++n) {
    values[n] = recording.value(channel, static_cast<std::int64_t>(n));
    if (std::isfinite(values[n])) continue;
    throw ApiError{409, "the recording has gaps", fmt::format("channel {}, sample {}", channel, n),
                   "record it while the axis has power"};
  }
  return values;
}

template <typename T>
Json number_or_null(const std::optional<T>& number) {
  return number ? Json(*number) : Json(nullptr);
}

Json points_of(std::span<const double> hz, std::span<const tuning::Complex> response) {
  Json points = Json::array();
  for (const tuning::BodePoint& one : tuning::bode(hz, response)) {
    points.push_back({{"hz", one.frequency_hz}, {"gain_db", one.gain_db}, {"phase_deg", one.phase_deg}});
  }
  return points;
}

struct Curve {
  std::vector<double> hz;
  std::vector<tuning::Complex> response;
};

// Computes the open loop T / (1 - T) of a closed loop T.
Json open_loop_of(const Curve& closed) {
  Curve open;
  for (std::size_t i = 0; i < closed.hz.size(); ++i) {
    const tuning::Complex rest = 1.0 - closed.response[i];
    if (std::abs(rest) < 1e-6) continue;
    open.hz.push_back(closed.hz[i]);
    open.response.push_back(closed.response[i] / rest);
  }
  const tuning::Margins margins = tuning::margins_of(open.hz, open.response);
  return {{"points", points_of(open.hz, open.response)},
          {"crossover_hz", number_or_null(margins.crossover_hz)},
          {"phase_margin_deg", number_or_null(margins.phase_margin_deg)},
          {"gain_margin_hz", number_or_null(margins.gain_margin_hz)},
          {"gain_margin_db", number_or_null(margins.gain_margin_db)}};
}

Json show_bode(Call& call) {
  const auto recording = api::ended_recording(call, static_cast<BodePlots*>(call.context)->find());
  const Recording::Plan& plan = recording->plan();
  const auto highest = static_cast<double>(plan.channels.size() - 1);
  const auto input = static_cast<std::size_t>(number_in_query(call, "input", 0.0, 0.0, highest));
  const auto output = static_cast<std::size_t>(number_in_query(call, "output", std::min(1.0, highest), 0.0, highest));
  const double sample_s = static_cast<double>(plan.stride) * drive::tick_seconds;
  const tuning::SpectrumRequest request{.lowest_hz = number_in_query(call, "from_hz", 1.0, 0.01, 8000.0),
                                        .highest_hz = number_in_query(call, "to_hz", 1000.0, 0.01, 8000.0)};
  if (recording->samples() > most_samples) {
    throw ApiError{409, fmt::format("{} samples are too many to transform", recording->samples()),
                   std::string(call.arguments.front()),
                   fmt::format("record at most {}: at a lower rate, or for a shorter time", most_samples)};
  }
  const auto points =
      tuning::response_of_signals(samples_of(*recording, input), samples_of(*recording, output), sample_s, request);
  Curve all;
  Curve sure;
  for (const tuning::ResponsePoint& one : points) {
    all.hz.push_back(one.frequency_hz);
    all.response.push_back(one.response);
    if (one.coherence < believed) continue;
    sure.hz.push_back(one.frequency_hz);
    sure.response.push_back(one.response);
  }
  Json shown = points_of(all.hz, all.response);
  for (std::size_t i = 0; i < points.size(); ++i) shown[i]["coherence"] = points[i].coherence;
  const Json& from = plan.channels[input].view;
  const Json& to = plan.channels[output].view;
  Json answer{{"recording", plan.id}, {"input", from}, {"output", to}, {"points", std::move(shown)}};
  // Input and output are the same quantity: the response is that of a closed loop.
  if (input != output && from.value("unit", std::string()) == to.value("unit", std::string("?"))) {
    answer["bandwidth_hz"] = number_or_null(tuning::bandwidth_of(sure.hz, sure.response));
    answer["open_loop"] = open_loop_of(sure);
  }
  return answer;
}

constexpr std::array bode_table{Route{Method::get, "/api/v1/recordings/{}/bode", show_bode}};

}  // namespace

api::RouteGroup BodePlots::routes() { return {bode_table, this}; }

}  // namespace servodrome::studio
