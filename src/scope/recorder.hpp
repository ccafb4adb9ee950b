#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>

#include "scope/recording.hpp"
#include "scope/trigger.hpp"

namespace servodrome::scope {

// One sample of all channels.
struct Sample {
  std::span<const Time> times;     // one for each group of channels
  std::span<const double> values;  // one for each channel
  std::uint64_t missed = 0;        // samples that were due and not received, since the source began
};

struct RecorderOptions {
  std::optional<Time> duration{};  // from the trigger or the first sample; nullopt: no limit
  Time pre{};                      // time to keep from before the trigger
  Trigger trigger{};
  std::size_t trigger_channel = 0;
  std::size_t most_values = 20'000'000;  // 160 MB; then the recording ends
};

// Stores samples whose times come from their source: from the first one, or from `pre` before the trigger fires.
class Recorder {
 public:
  Recorder(std::vector<Channel> channels, std::vector<std::size_t> groups, std::size_t group_count,
           const RecorderOptions& options);

  void take(const Sample& sample);
  bool waits_for_trigger() const { return options_.trigger.condition != Condition::now && !triggered_; }
  bool done() const { return done_; }
  bool is_full() const { return full_; }

  // The recording so far. If the trigger has not fired: the rows kept for the time before it.
  Recording recording() const;

 private:
  void forget_before(Time time);

  RecorderOptions options_;
  std::vector<Channel> channels_;
  std::vector<std::size_t> groups_;
  std::size_t group_count_;
  std::deque<Time> times_;
  std::deque<double> values_;
  std::deque<std::uint64_t> missed_;  // of each row
  std::optional<double> before_{};    // of the trigger's channel
  std::optional<Time> zero_{};
  bool triggered_ = false;
  bool done_ = false;
  bool full_ = false;
};

}  // namespace servodrome::scope
