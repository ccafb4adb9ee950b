#pragma once

#include <deque>
#include <map>
#include <memory>
#include <vector>

#include "line/line.hpp"

namespace servodrome::scenario {

using links::Time;

// Counts the events of the last second.
class LastSecond {
 public:
  void add(Time now) { times_.push_back(now); }
  // Call this before count(), and often enough to keep the list short.
  void forget(Time now) {
    while (!times_.empty() && times_.front() + std::chrono::seconds(1) <= now) times_.pop_front();
  }
  unsigned count() const { return static_cast<unsigned>(times_.size()); }

 private:
  std::deque<Time> times_;
};

// The actions of a master on an axis, observed in the true drive and on the wire.
struct MasterDeeds {
  LastSecond fault_resets;  // rising edges of bit 7 of the drive's controlword
  LastSecond repeats;       // SDO requests equal to the previous request, which had no answer
  // The first set-point in cyclic synchronous position was further away than the axis can go in a cycle.
  bool jumped = false;
  double jump_revolutions = 0;  // the distance of that set-point from the shaft, motor revolutions
};

// Watches what a master does, in every tick and on every CAN bus.
class MasterWatch {
 public:
  explicit MasterWatch(line::Line& line);
  ~MasterWatch();
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;

  // Call this in every tick.
  void look(Time now);
  const MasterDeeds& of(const line::Axis* axis) const { return axes_.at(axis).deeds; }

 private:
  class BusWatch;
  struct AxisWatch {
    MasterDeeds deeds;
    bool reset = false;       // bit 7 at the last tick
    bool following = false;   // had a set-point in cyclic synchronous position at the last tick
    bool has_looked = false;  // at least once: what the master did before the scenario is not judged
  };

  static void look_at_set_point(line::Axis& axis, AxisWatch& watch);

  line::Line& line_;
  std::map<const line::Axis*, AxisWatch> axes_;
  std::vector<std::unique_ptr<BusWatch>> buses_;
};

}  // namespace servodrome::scenario
