#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "line/bench/scope/trigger.hpp"

namespace servodrome::line::bench {

enum class RecordingState : std::uint8_t { armed, running, done, stopped };

// The values of some channels around a trigger. While it is armed it keeps as much of the past as it is long.
class Recording {
 public:
  struct Fault {
    std::string axis;
    unsigned code = 0;
  };
  struct Plan {
    std::uint32_t id = 0;
    std::string name;
    std::vector<NamedChannel> channels;
    std::int64_t stride = 1;    // ticks
    std::int64_t samples = 0;   // in all, for each channel
    std::int64_t before = 0;    // of those, before the trigger; less than `samples`
    bool fault_moment = false;  // made by the line itself
  };

  // Takes samples from now on. Throws ApiError when that is more than the line may be looked at.
  Recording(Plan plan, Trigger trigger);
  // Is triggered at a tick of the past, with `taps` that are open since before.
  Recording(Plan plan, std::vector<std::shared_ptr<Samples>> taps, std::int64_t first, std::int64_t trigger,
            Fault fault);

  // Takes all there is before tick `end`. True: its state is another now.
  bool take(std::int64_t end);
  // Ends it with what there is.
  void stop();

  const Plan& plan() const { return plan_; }
  RecordingState state() const { return state_; }
  bool ended() const { return state_ == RecordingState::done || state_ == RecordingState::stopped; }
  std::size_t bytes() const { return values_.size() * sizeof(double); }
  const std::optional<Fault>& fault() const { return fault_; }
  Json view() const;

  std::int64_t samples() const;  // that it shows
  std::int64_t tick(std::int64_t sample) const { return first_shown() + sample * plan_.stride; }
  double value(std::size_t channel, std::int64_t sample) const;

 private:
  std::int64_t first_shown() const;
  std::size_t slot(std::int64_t tick) const { return static_cast<std::size_t>(tick / plan_.stride % plan_.samples); }
  void trigger_at(std::int64_t tick);

  Plan plan_;
  std::optional<Trigger> trigger_;
  std::vector<std::shared_ptr<Samples>> taps_;
  std::vector<double> values_;  // ring after ring
  RecordingState state_ = RecordingState::armed;
  std::optional<std::int64_t> trigger_tick_;
  std::optional<Fault> fault_;
  std::int64_t first_;  // tick of the first sample there ever was
  std::int64_t next_;   // tick of the next sample
  std::int64_t begin_;  // once triggered, tick of the first sample to show, and
  std::int64_t end_;    // tick before which it ends
};

}  // namespace servodrome::line::bench
