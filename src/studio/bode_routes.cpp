#include "studio/bode_routes.hpp"

#include <array>
#include <cmath>
#include <fmt/format.h>

#include "api/query.hpp"
#include "drive/drive.hpp"
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
constexpr double lowest_shown_hz = 0.01;
constexpr double highest_shown_hz = 8000.0;
constexpr double believed = 0.7;  // least coherence of the points used for bandwidth and margins

std::size_t channel_in_query(const Call& call, std::string_view key, std::size_t channels, std::size_t usual) {
  return api::query_integer(call, key, 0, channels - 1).value_or(std::min(usual, channels - 1));
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
  const std::size_t input = channel_in_query(call, "input", plan.channels.size(), 0);
  const std::size_t output = channel_in_query(call, "output", plan.channels.size(), 1);
  const double sample_s = static_cast<double>(plan.stride) * drive::tick_seconds;
  const tuning::SpectrumRequest request{
      .lowest_hz = api::query_number(call, "from_hz", lowest_shown_hz, highest_shown_hz).value_or(1.0),
      .highest_hz = api::query_number(call, "to_hz", lowest_shown_hz, highest_shown_hz).value_or(1000.0)};
  if (request.lowest_hz >= request.highest_hz) {
    throw ApiError{422, fmt::format("from_hz is {}, and to_hz is {}", request.lowest_hz, request.highest_hz), "from_hz",
                   "write a from_hz below to_hz"};
  }
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

constexpr std::array bode_table{Route{Method::get, "/api/v1/recordings/{}/bode?input&output&from_hz&to_hz", show_bode}};

}  // namespace

std::span<const api::Route> BodePlots::table() { return bode_table; }

}  // namespace servodrome::studio
