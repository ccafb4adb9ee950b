#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "drive/homing/homing.hpp"

// An ideal axis for tests of homing: exact ramps, switches and index at exact positions, hard stops.
namespace servodrome::drive::test {

// Positions are boundaries between counts: a region [from, to) contains the counts from .. to - 1.
struct World {
  Counts negative_limit = -100000;  // active below
  Counts positive_limit = 100000;   // active from here on
  Counts home_from = 0;
  Counts home_to = 0;
  Counts index = 0;
  Counts index_width = 1;  // 0: no index
  Counts revolution = 1000;
  Counts low_stop = -200000;  // the lowest count that the axis can reach
  Counts high_stop = 200000;

  bool lies_between_limits(Counts count) const { return count >= negative_limit && count < positive_limit; }
  bool has_index_at(Counts count) const {
    const Counts phase = (count - index) % revolution;
    return (phase < 0 ? phase + revolution : phase) < index_width;
  }
  std::uint32_t signals_at(Counts count) const {
    return (count < negative_limit ? bit(Signal::negative_limit) : 0) |
           (count >= positive_limit ? bit(Signal::positive_limit) : 0) |
           (count >= home_from && count < home_to ? bit(Signal::home) : 0) |
           (has_index_at(count) ? bit(Signal::index) : 0);
  }
  // The same axis with an encoder that counts in the opposite direction.
  World mirrored() const {
    World world = *this;
    world.negative_limit = -positive_limit;
    world.positive_limit = -negative_limit;
    world.home_from = -home_to;
    world.home_to = -home_from;
    world.index = -(index + index_width);
    world.low_stop = -1 - high_stop;
    world.high_stop = -1 - low_stop;
    return world;
  }
};

// The method with index that looks for the same edge: 1 for method 17, 2 for method 18, and so on.
constexpr int pattern(int number) { return number >= 17 && number <= 30 ? number - 16 : number; }

inline HomingConfig plain_config() {
  return {.fast = 20000.0, .slow = 2000.0, .acceleration = 1.0e6, .stall_torque = 1.5F, .stall_cycles = 5};
}

// Limit switches only.
inline constexpr World bare{
    .negative_limit = -5000, .positive_limit = 5000, .index_width = 0, .low_stop = -9000, .high_stop = 9000};

struct Outcome {
  bool finished = false;
  HomingError error = HomingError::none;
  Counts latch = 0;
  Counts rest = 0;                 // final position
  double velocity_at_latch = 0.0;  // signed, at the end of the cycle in which the latch was taken
  std::uint32_t cycles = 0;
  std::uint32_t latch_cycle = 0;
  std::vector<HomingCommand> commands;  // other than `keep`
};

class HomingAxis {
 public:
  static constexpr double cycle_s = 0.5e-3;

  HomingAxis(const World& world, Counts start, double acceleration)
      : world_(world), acceleration_(acceleration), position_(static_cast<double>(start) + 0.5) {
    inputs_.position = start;
    inputs_.signals = world_.signals_at(start);
  }

  const HomingInputs& inputs() const { return inputs_; }
  double velocity() const { return velocity_; }

  // Advances one cycle under `command`, then returns the inputs that the drive sees.
  void step(const HomingCommand& command) {
    switch (command.kind) {
      case HomingCommand::Kind::keep: break;
      case HomingCommand::Kind::velocity: goal_ = command.velocity, target_.reset(); break;
      case HomingCommand::Kind::stop: goal_ = 0.0, target_.reset(); break;
      case HomingCommand::Kind::position:
        goal_ = std::abs(command.velocity);
        target_ = static_cast<double>(command.position) + 0.5;
        break;
      case HomingCommand::Kind::hold:
        goal_ = velocity_ = 0.0;
        target_.reset();
        position_ = static_cast<double>(command.position) + 0.5;
        break;
    }
    if (target_) {
      move_to_target();
    } else {
      ramp();
    }
    sense();
  }

 private:
  // Exact motion: constant acceleration up to the target speed, then constant speed.
  void ramp() {
    const double change = goal_ - velocity_;
    const double ramp_s = std::min(cycle_s, std::abs(change) / acceleration_);
    const double end = ramp_s < cycle_s ? goal_ : velocity_ + std::copysign(acceleration_ * cycle_s, change);
    position_ += (velocity_ + end) / 2.0 * ramp_s + end * (cycle_s - ramp_s);
    velocity_ = end;
  }
  void move_to_target() {
    const double distance = *target_ - position_;
    const double allowed = std::min(
        {goal_, std::abs(velocity_) + acceleration_ * cycle_s, std::sqrt(2.0 * acceleration_ * std::abs(distance))});
    if (std::abs(distance) <= std::max(allowed * cycle_s, 0.5)) {
      position_ = *target_;
      velocity_ = goal_ = 0.0;
      target_.reset();
      return;
    }
    velocity_ = std::copysign(allowed, distance);
    position_ += velocity_ * cycle_s;
  }

  void sense() {
    const Counts demand = static_cast<Counts>(std::floor(position_));
    const Counts actual = std::clamp(demand, world_.low_stop, world_.high_stop);
    inputs_.ahead = demand < actual ? -1 : demand > actual ? 1 : 0;
    inputs_.torque = 2.0F * static_cast<float>(inputs_.ahead);
    edges_.clear();
    const Counts direction = actual >= inputs_.position ? 1 : -1;
    std::uint32_t before = world_.signals_at(inputs_.position);
    for (Counts count = inputs_.position; count != actual;) {
      count += direction;
      const std::uint32_t now = world_.signals_at(count);
      if (now != before) {
        for (const Signal signal : {Signal::negative_limit, Signal::positive_limit, Signal::home, Signal::index}) {
          if (((now ^ before) & bit(signal)) != 0) edges_.push_back({signal, (now & bit(signal)) != 0, count});
        }
        before = now;
      }
    }
    inputs_.position = actual;
    inputs_.signals = before;
    inputs_.edges = edges_;
    inputs_.standing = velocity_ == 0.0 && goal_ == 0.0;
  }

  World world_;
  double acceleration_;
  double position_;  // of the demand
  double velocity_ = 0.0;
  double goal_ = 0.0;
  std::optional<double> target_;
  std::vector<SignalEdge> edges_;
  HomingInputs inputs_;
};

// Homes from `start` until homing ends, for at most `most_cycles`.
inline Outcome run(const Method& method, const HomingConfig& config, const World& world, Counts start,
                   std::uint32_t most_cycles = 400000) {
  HomingAxis axis{world, start, config.acceleration};
  Homing homing;
  Outcome outcome;
  homing.start(method, config, axis.inputs());
  while (homing.active() && outcome.cycles < most_cycles) {
    const bool latched_before = homing.latched();
    const HomingCommand command = homing.step(axis.inputs());
    if (command.kind != HomingCommand::Kind::keep) outcome.commands.push_back(command);
    if (homing.latched() && !latched_before) {
      outcome.velocity_at_latch = axis.velocity();
      outcome.latch_cycle = outcome.cycles;
    }
    axis.step(command);
    ++outcome.cycles;
  }
  outcome.finished = homing.finished();
  outcome.error = homing.error();
  outcome.latch = homing.latch();
  outcome.rest = axis.inputs().position;
  return outcome;
}

}  // namespace servodrome::drive::test
