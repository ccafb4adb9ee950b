#pragma once

#include <deque>

#include "tools/scope/recording.hpp"
#include "tools/scope/sampler.hpp"
#include "tools/scope/trigger.hpp"

namespace servodrome::master::scope {

struct RecorderOptions {
  std::optional<Time> duration{};  // from the trigger or the first sample; nullopt: no limit
  Time pre{};                      // time to keep from before the trigger
  std::optional<Trigger> trigger{};
  std::size_t most_values = 20'000'000;  // 160 MB; then the recording ends
};

// Stores a sampler's samples: from the first one, or, with a trigger, from `pre` before it fires.
class Recorder {
 public:
  // Receives samples for as long as it exists. `sampler` must outlive this.
  Recorder(Sampler& sampler, const RecorderOptions& options);
  // Without a sampler: the caller passes samples to take().
  Recorder(std::vector<Channel> channels, std::vector<std::size_t> groups, std::size_t group_count,
           const RecorderOptions& options);
  ~Recorder();
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  void take(const Sample& sample);
  bool waits_for_trigger() const { return options_.trigger && !triggered_; }
  bool done() const { return done_; }
  bool is_full() const { return full_; }
  std::size_t rows() const { return values_.size() / channels_.size(); }

  // The recording so far. If the trigger has not fired: the rows kept for the time before it.
  Recording recording() const;

 private:
  void forget_before(Time time);

  Sampler* sampler_ = nullptr;
  RecorderOptions options_;
  std::vector<Channel> channels_;
  std::vector<std::size_t> groups_;
  std::size_t group_count_;
  std::deque<Time> times_;
  std::deque<double> values_;
  std::optional<double> before_{};  // previous value of the trigger's channel
  std::optional<Time> zero_{};
  bool triggered_ = false;
  bool done_ = false;
  bool full_ = false;
  std::deque<std::uint64_t> missed_;  // sampler's count of missed samples at each row
};

}  // namespace servodrome::master::scope
