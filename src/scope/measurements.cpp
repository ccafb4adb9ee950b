#include "scope/measurements.hpp"

#include <algorithm>
#include <cmath>

namespace servodrome::scope {

namespace {

struct Rest {
  double mean = 0;
  double spread = 0;  // greatest minus least value
};

Rest rest_of(const std::vector<double>& values, std::size_t first, std::size_t count) {
  double sum = 0;
  const auto begin = values.begin() + static_cast<std::ptrdiff_t>(first);
  const auto end = begin + static_cast<std::ptrdiff_t>(count);
  for (auto value = begin; value != end; ++value) sum += *value;
  const auto [least, greatest] = std::minmax_element(begin, end);
  return {.mean = sum / static_cast<double>(count), .spread = *greatest - *least};
}

constexpr std::size_t least_resting = 3;

// Detects a step. `part` scales the values: 0 at the start of the step, 1 at its end.
std::optional<StepResponse> find_step(const Recording& recording, std::size_t channel,
                                      const std::vector<double>& values) {
  const std::size_t resting = std::max(least_resting, values.size() / 20);
  if (values.size() < 4 * resting) return std::nullopt;
  const Rest before = rest_of(values, 0, resting);
  const Rest after = rest_of(values, values.size() - resting, resting);
  const double height = after.mean - before.mean;
  if (std::abs(height) <= 20 * std::max(before.spread, after.spread) || height == 0) return std::nullopt;
  // A step overshoots by less than its height. A curve with a wider range moves away and comes back, so it is not a
  // step.
  if (2 * std::abs(height) < rest_of(values, 0, values.size()).spread) return std::nullopt;
  const auto part = [&](std::size_t row) { return (values[row] - before.mean) / height; };
  // `begin`: the last row at the initial value; `tenth` and `nine_tenths`: the first rows at or beyond 10 % and 90 %.
  const double noise = std::max(before.spread / std::abs(height), 1e-3);
  std::size_t tenth = 0;
  while (part(tenth) < 0.1) ++tenth;
  std::size_t begin = tenth;
  while (begin > 0 && part(begin) > noise) --begin;
  std::size_t nine_tenths = tenth;
  while (part(nine_tenths) < 0.9) ++nine_tenths;
  std::size_t settled = values.size() - 1;
  while (settled > begin && std::abs(part(settled - 1) - 1) <= settling_band) --settled;
  double highest = 0;
  for (std::size_t row = 0; row < values.size(); ++row) highest = std::max(highest, part(row));
  const auto at = [&](std::size_t row) { return recording.seconds(row, channel); };
  return StepResponse{.from = before.mean,
                      .to = after.mean,
                      .begin_s = at(begin),
                      .rise_s = at(nine_tenths) - at(tenth),
                      .overshoot_percent = std::max(0.0, (highest - 1) * 100),
                      .settling_s = at(settled) - at(begin)};
}

}  // namespace

Measurement measure(const Recording& recording, std::size_t channel) {
  std::vector<double> values;
  values.reserve(recording.rows());
  double sum = 0;
  double squares = 0;
  for (std::size_t row = 0; row < recording.rows(); ++row) {
    const double value = recording.value(row, channel);
    values.push_back(value);
    sum += value;
    squares += value * value;
  }
  const auto count = static_cast<double>(values.size());
  const auto [least, greatest] = std::minmax_element(values.begin(), values.end());
  return {.least = *least,
          .greatest = *greatest,
          .mean = sum / count,
          .rms = std::sqrt(squares / count),
          .step = find_step(recording, channel, values)};
}

}  // namespace servodrome::scope
