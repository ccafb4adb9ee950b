#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "scope/channel.hpp"

namespace servodrome::scope {

// Recorded samples. A row has a value for each channel and a time for each group of channels.
struct Recording {
  std::vector<Channel> channels{};
  std::vector<std::size_t> groups{};  // group of each channel
  std::size_t group_count = 1;
  std::vector<Time> times{};     // row after row
  std::vector<double> values{};  // row after row
  Time zero{};                   // time of the trigger or the first sample
  bool triggered = false;
  std::uint64_t missed = 0;  // samples that were due and not received
  Time period{};             // requested period; 0: as fast as the source delivers
  std::string source{};      // link and address
  std::string way{};         // sampling method
  std::int64_t zero_unix_ns = 0;

  std::size_t rows() const { return channels.empty() ? 0 : values.size() / channels.size(); }
  double value(std::size_t row, std::size_t channel) const { return values[row * channels.size() + channel]; }
  Time time_of_group(std::size_t row, std::size_t group) const { return times[row * group_count + group] - zero; }
  Time time(std::size_t row, std::size_t channel) const { return time_of_group(row, groups[channel]); }
  double seconds(std::size_t row, std::size_t channel) const {
    return std::chrono::duration<double>(time(row, channel)).count();
  }
  // Samples per second that were received; 0 for fewer than two.
  double rate_hz() const {
    if (rows() < 2) return 0;
    const double span = seconds(rows() - 1, 0) - seconds(0, 0);
    return span > 0 ? static_cast<double>(rows() - 1) / span : 0;
  }
};

// The rows of a recording, read on demand by the writers of files.
struct Table {
  std::vector<Channel> channels{};
  std::vector<std::size_t> groups{};  // group of each channel
  std::vector<std::string> topics{};  // topic of each group, which MCAP needs
  std::size_t rows = 0;
  std::string source{};
  std::string way{};
  std::function<double(std::size_t row, std::size_t channel)> value{};
  std::function<Time(std::size_t row, std::size_t group)> time{};
  std::int64_t zero_unix_ns = 0;  // wall-clock time at which `time` is 0
};

// The table of a recording. `recording` must outlive the table. The topics are "/scope/NAME" for a channel alone in its
// group, else "/scope".
Table table_of(const Recording& recording);

}  // namespace servodrome::scope
