// Recordings for the tests of this folder.
#pragma once

#include <chrono>
#include <vector>

#include "scope/recorder.hpp"

namespace servodrome::scope::test {

using namespace std::chrono_literals;

inline std::vector<Channel> two_channels() { return {{"position", "pos"}, {"statusword", ""}}; }

// Rows at 1 ms; the first channel is the row number, the second ten times that.
inline Recording recorded(RecorderOptions options, int rows, Time start = 5s) {
  Recorder recorder(two_channels(), {0, 0}, 1, options);
  for (int i = 0; i < rows && !recorder.done(); ++i) {
    const Time time = start + i * 1ms;
    const double values[] = {static_cast<double>(i), 10.0 * i};
    recorder.take({std::span(&time, 1), values});
  }
  return recorder.recording();
}

inline Recording made_of(const std::vector<double>& values, Time period) {
  Recording recording{.channels = {two_channels()[0]}, .groups = {0}, .period = period};
  for (std::size_t i = 0; i < values.size(); ++i) {
    recording.times.push_back(period * static_cast<std::int64_t>(i));
    recording.values.push_back(values[i]);
  }
  return recording;
}

}  // namespace servodrome::scope::test
