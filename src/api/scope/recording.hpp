#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "api/scope/trigger.hpp"

namespace servodrome::api {

enum class RecordingState : std::uint8_t { armed, running, done, stopped };

// The values of some channels around a trigger. While it is armed, a ring buffer keeps the latest samples, as many as
// the recording will have.
class Recording {
 public:
  struct Fault {
    std::string axis;
    unsigned code = 0;
  };
  struct Plan {
    std::uint32_t id = 0;
    std::string name;
    std::string note;
    std::vector<NamedChannel> channels;
    std::int64_t stride = 1;       // ticks
    std::int64_t samples = 0;      // in total, for each channel
    std::int64_t before = 0;       // part of `samples` before the trigger; less than `samples`
    bool fault_moment = false;     // the line made it because of a fault
    std::shared_ptr<void> held{};  // what the source has set up for it (Source::Prepared); released when it ends
  };

  // Samples from now on. Throws ApiError if the line would have to sample too many values per tick.
  Recording(Plan plan, ArmedTrigger trigger);
  // A recording with a trigger in the past. Its `taps` must have been open since before the trigger.
  Recording(Plan plan, std::vector<std::shared_ptr<Samples>> taps, std::int64_t first, std::int64_t trigger,
            Fault fault);

  // A recording of an earlier run, which has ended. `plan.samples` is the number of its samples.
  struct Kept {
    bool is_stopped = false;
    std::int64_t first_tick = 0;
    std::optional<std::int64_t> trigger_tick{};
    std::optional<Fault> fault{};
    std::vector<double> values{};  // of the first channel, then of the second, and so on
  };
  Recording(Plan plan, Kept kept);

  // Takes all samples before tick `end`. Returns true if the state has changed.
  bool take(std::int64_t end);
  // Ends the recording with the samples so far.
  void stop();
  void set_name(std::string name) { plan_.name = std::move(name); }
  void set_note(std::string note) { plan_.note = std::move(note); }

  const Plan& plan() const { return plan_; }
  RecordingState state() const { return state_; }
  bool ended() const { return state_ == RecordingState::done || state_ == RecordingState::stopped; }
  std::size_t bytes() const { return values_.size() * sizeof(double); }
  const std::optional<Fault>& fault() const { return fault_; }
  Json view() const;

  std::int64_t samples() const;  // number of samples that it shows
  std::int64_t tick(std::int64_t sample) const { return first_shown() + sample * plan_.stride; }
  double value(std::size_t channel, std::int64_t sample) const;

 private:
  std::int64_t first_shown() const;
  std::size_t slot(std::int64_t tick) const { return static_cast<std::size_t>(tick / plan_.stride % plan_.samples); }
  void trigger_at(std::int64_t tick);
  void finish(RecordingState state);
  Json count(std::size_t channel) const;

  Plan plan_;
  std::optional<ArmedTrigger> trigger_;
  std::vector<std::shared_ptr<Samples>> taps_;
  std::vector<double> values_;  // a ring buffer for each channel, one after the other
  std::vector<Taken> taken_{};  // how each of these values was taken; empty: all were sampled
  RecordingState state_ = RecordingState::armed;
  std::optional<std::int64_t> trigger_tick_;
  std::optional<Fault> fault_;
  std::int64_t first_;  // tick of the first sample that was taken
  std::int64_t next_;   // tick of the next sample
  std::int64_t begin_;  // after the trigger: tick of the first sample to show
  std::int64_t end_;    // after the trigger: tick before which it ends
};

}  // namespace servodrome::api
